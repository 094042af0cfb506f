"""Parameters set, prepared, started, and active between two rounds."""

import pytest

from catseye.coordinator.control.parameters import ClientParameter, Parameters
from catseye.coordinator.control.registry import ROWS
from catseye.errors import InputError


class Scene:
    """Two parameters between rounds and one at once; a set is refused where a round holds no reference."""

    def __init__(self):
        self.values = {"round_s": "10", "reference_every_s": "60", "mode": "active"}
        self.told, self.active, self.obstacle = [], [], None
        between = [ClientParameter(ROWS[n], self.now(n), str) for n in ("round_s", "reference_every_s")]
        mode = ClientParameter(ROWS["mode"], self.now("mode"), str, lambda text: self.values.update(mode=text))
        self.parameters = Parameters(
            (mode, *between),
            refuse=self.refuse,
            adopt=self.values.update,
            tell=self.tell,
            activated=lambda values: self.active.append(dict(values)),
        )

    def now(self, name):
        return lambda: self.values[name]

    def refuse(self, values):
        if self.obstacle is not None:
            raise InputError(self.obstacle)
        if float(values["reference_every_s"]) < float(values["round_s"]):
            raise InputError(f"reference_every_s = {values['reference_every_s']} is short")

    def tell(self, text, values, active):
        self.told.append((text, dict(values), active))


@pytest.fixture
def scene():
    return Scene()


def test_set_is_active_at_the_border_only(scene):
    p = scene.parameters
    assert p.set("ROUND_S", "20.0") == "20"
    p.set("mode", "hold")
    assert (p.prepare(), p.start()) == (2, 2)
    assert scene.values == {"round_s": "10", "reference_every_s": "60", "mode": "hold"}
    assert [row[:3] for row in p.rows()][1] == ("round_s", "10", "20")
    assert scene.active == []
    p.border()
    assert scene.active == [{"round_s": "20"}]
    assert scene.values["round_s"] == "20"
    assert [row[:3] for row in p.rows()][1] == ("round_s", "20", "none")
    expected = "started: round_s from 10 to 20; mode from active to hold"
    assert scene.told == [(expected, {"round_s": "20", "mode": "hold"}, True)]


def test_stage_of_a_waiting_value_is_told(scene):
    p = scene.parameters

    def stage():
        return p.rows()[1][7]

    assert stage() == "none"
    p.set("round_s", "20")
    assert stage() == "set"
    p.prepare()
    assert stage() == "prepared"
    p.set("reference_every_s", "50")  # a further value: the set is to be prepared again
    assert (stage(), p.expected()) == ("set", {"round_s": "20", "reference_every_s": "50", "mode": "active"})
    p.prepare()
    p.start()
    assert (stage(), p.expected()["round_s"]) == ("started", "20")
    p.border()
    assert stage() == "none"


def test_values_are_checked_together(scene):
    p = scene.parameters
    p.set("round_s", "100")
    with pytest.raises(InputError, match="reference_every_s = 60 is short"):
        p.prepare()
    with pytest.raises(InputError, match="nothing is prepared"):
        p.start()
    p.set("reference_every_s", "100")
    assert (p.prepare(), p.start()) == (2, 2)
    p.border()
    assert (scene.values["round_s"], scene.values["reference_every_s"]) == ("100", "100")


def test_second_set_is_checked_with_the_first_that_is_started(scene):
    p = scene.parameters
    p.set("reference_every_s", "20")
    p.prepare()
    p.start()
    p.set("round_s", "30")
    with pytest.raises(InputError, match="reference_every_s = 20 is short"):
        p.prepare()


def test_discarded_values_are_forgotten(scene):
    p = scene.parameters
    p.set("round_s", "20")
    p.prepare()
    assert p.discard() == 1
    with pytest.raises(InputError, match="nothing is prepared"):
        p.start()
    assert [row[2] for row in p.rows()] == ["none"] * 3


def test_set_that_no_longer_fits_changes_nothing_and_says_so(scene):
    p = scene.parameters
    p.set("round_s", "20")
    p.prepare()
    p.start()
    scene.obstacle = "journal away"
    p.border()
    p.border()
    assert scene.values["round_s"] == "10"
    assert scene.told[1:] == [("not active, nothing is changed: journal away", {"round_s": "20"}, False)]


def test_start_that_changes_nothing_is_no_event(scene):
    p = scene.parameters
    p.set("round_s", "10")
    p.prepare()
    assert p.start() == 1
    assert scene.told == []
