"""Options of a twin: equal options make equal twins."""

import numpy as np
import pytest
import typer

from catseye.api.live.serving import twin_options, twin_world
from catseye.errors import InputError
from catseye.service.world import TwinWords
from simulator.living_scene import site


def test_options_recreate_the_same_twin_in_another_process(monkeypatch):
    from catseye.cli.commands import app, join_commands

    join_commands()
    world = TwinWords(
        60635.1234567891, seed=5, offset=-1.25e8 - 1e-7, motion="slew 10 30 40 50", faults=("dew * 5 9 0.1",)
    )
    made = []

    def noted(*given, **named):
        made.append(TwinWords(*given, **named))
        raise InputError("enough")

    monkeypatch.setattr("catseye.service.world.TwinWords", noted)
    monkeypatch.setattr("catseye.api.live.serving.read_site_of", lambda name: site())
    with pytest.raises(InputError, match="enough"):
        typer.main.get_command(app).main(["zy", "gbt", *world.options()])
    assert made == [world]


@pytest.mark.parametrize("offset", [None, 0.0, -864_000.0, 1e8])
def test_without_a_start_the_twin_begins_now_in_its_own_time(offset):
    world = twin_world(None, offset, twin_options(1, "track 145.3 45", "night", ()))
    assert world.twin(site()).seconds(world.clock().now_ns()) == pytest.approx(0.0, abs=30.0)
    assert world.offset == pytest.approx(offset or 0.0, abs=30.0)


def test_equal_options_give_equal_truth_and_time():
    one, two = (TwinWords(60635.125, seed=3, offset=12.5) for _ in "ab")
    a, b = one.twin(site()).point("ZEG41040L", 7.0), two.twin(site()).point("ZEG41040L", 7.0)
    assert np.array_equal(a, b)
    first, second = one.clock(), two.clock()
    low, middle, high = first.now_ns(), second.now_ns(), first.now_ns()
    assert low - 10**7 <= middle <= high + 10**7  # each read UTC once, between which its steps would show


def test_starting_now_reads_the_start_and_late_reads_earlier():
    world = TwinWords.starting_now(52889.25)
    assert world.twin(site()).seconds(world.clock().now_ns()) == pytest.approx(0.0, abs=30.0)
    late = world.late(100.0)
    assert (world.clock().now_ns() - late.clock().now_ns()) * 1e-9 == pytest.approx(100.0, abs=5.0)


@pytest.mark.parametrize("words", [{"motion": "dance"}, {"faults": ("sleepy ZY101",)}, {"conditions": "nice"}])
def test_unknown_options_are_refused(words):
    with pytest.raises(InputError, match="expected"):
        TwinWords(60635.125, **words)


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("dead-ranger ZY999", "unknown ranger ZY999"),
        ("lying-station ZY101", "unknown weather station ZY101"),
        ("silent-telescope ZY101", "unknown telescope"),
        ("dew ZY999", "unknown target"),
        ("stuck-axis ZY101:2", "2 is not an axis"),
        ("blocked-beam ZY101:NOWHERE", "unknown target NOWHERE"),
    ],
)
def test_fault_on_an_unknown_device_is_refused(fault, said):
    with pytest.raises(InputError, match=said):
        TwinWords(60635.125, faults=(fault,)).twin(site())


@pytest.mark.parametrize("fault", ["dead-ranger *", "blocked-beam ZY101:ZEG41040L", "lost-index ZY101:1", "dew *"])
def test_fault_on_a_known_device_is_accepted(fault):
    assert TwinWords(60635.125, faults=(fault,)).twin(site()).faults.faults[0].whom == fault.split()[1]
