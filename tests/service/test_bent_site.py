"""A living site whose telescope bends by a structural model: aims of its coordinator beside the twin's truth."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.api.reading import place_of, with_structure
from catseye.constants import DEGREE
from catseye.coordinator.journal.entries import Run
from catseye.coordinator.parts import SiteState
from catseye.coordinator.plan.places import ChosenTarget, Places
from catseye.coordinator.visibility.vantage import retros_of, vantages_of
from catseye.records.night.live import TICKS_PER_DAY, LivePosture
from catseye.records.site.folder import STRUCTURAL_MODEL, read_site
from catseye.records.site.structural_model import read_structural_model
from catseye.reduction.live.live import Live
from catseye.simulator.twin.conditions import LivingPlanted
from catseye.simulator.twin.motion import AxisMotion
from catseye.simulator.twin.site import Twin
from catseye.simulator.twin.targets import CORNER_RADIUS

START = 60_635.125
TICKS = round(START * TICKS_PER_DAY)
SITE = with_structure(read_site(place_of("gbt")), "structural-model/telescope.toml")
STILL = frozenset({"typing", "posture", "feed_arm", "bearing_tilt", "encoder", "wind", "vibration", "surface"})


@pytest.fixture(scope="module")
def twin():
    """The bent telescope at elevation 12°, moved by its model alone."""
    return Twin(
        SITE, seed=1, start_mjd=START, motion=AxisMotion.parse("fixed 145.3 12"), planted=LivingPlanted(ignore=STILL)
    )


def live_of(site):
    """A live reduction that knows the posture and has solved nothing."""
    live = Live(site)
    for k in range(-20, 21):
        live.posture(LivePosture(TICKS + 10_000 * k, 145.3 * DEGREE, 12.0 * DEGREE))
    return live


def aimed(live, ranger, target):
    """Where a round aims the ranger, from its scan point in its own frame, m."""
    site = live.site
    vantages = vantages_of(site)
    state = SiteState(
        now_ticks=TICKS,
        posture=LivePosture(TICKS, 145.3 * DEGREE, 12.0 * DEGREE),
        ready=(ranger,),
        counts={},
        suspended=frozenset(),
        since_reference={},
        place=live.place,
        u={},
        bent_frame=None if live.bending is None else live.bent_frame,
    )
    places = Places(site, vantages, retros_of(site), state, TICKS + 2893 * np.arange(5))
    (shot,) = places.shots(vantages[ranger], [ChosenTarget(target, 1.0, "test")], 0.128)
    return shot.at_begin - vantages[ranger].station.scan_point


def truly(twin, ranger, target):
    """Where the target truly is, likewise; the arm's rangers ride and turn with it."""
    state = twin.standing(np.array([1.0]))
    sight = twin.point(target, np.array([1.0]))[0] - twin.point(ranger, np.array([1.0]))[0]
    return sight @ state.bodies["arm" if ranger in ARM else "ground"].turn[0]


ARM = {ranger.name for ranger in SITE.feedarm.ranger}


@pytest.mark.parametrize("ranger", ["ZY113", "ZY103"])
@pytest.mark.parametrize("target", ["ZEG41040L", "TR01-B", "DISH"])
def test_aims_by_the_model_meet_the_retroreflector(twin, ranger, target):
    names = [target] if target != "DISH" else [n for n, t in SITE.targets.items() if t.shapes_dish][:60:20]
    live = live_of(SITE)
    for name in names:
        miss = np.linalg.norm(aimed(live, ranger, name) - truly(twin, ranger, name))
        assert miss < 0.25 * CORNER_RADIUS, name  # expansion of the steel and settled monuments: millimetres


def test_aims_of_a_rigid_telescope_miss(twin):
    live = live_of(replace(SITE, structure=None))
    assert np.linalg.norm(aimed(live, "ZY103", "ZEG41040L") - truly(twin, "ZY103", "ZEG41040L")) > CORNER_RADIUS
    prisms = [n for n, t in SITE.targets.items() if t.shapes_dish][::250]
    misses = [np.linalg.norm(aimed(live, "ZY113", name) - truly(twin, "ZY113", name)) for name in prisms]
    assert max(misses) > CORNER_RADIUS  # the arm turns by 150 arc seconds: 7 cm at 100 m


def test_a_journal_keeps_the_model_with_the_site(tmp_path):
    path = tmp_path / STRUCTURAL_MODEL
    path.write_text(Run(SITE).files()[STRUCTURAL_MODEL], encoding="utf-8")
    kept = read_structural_model(path)
    assert kept.frame == SITE.structure.frame
    assert kept.group == SITE.structure.group
    assert STRUCTURAL_MODEL not in Run(replace(SITE, structure=None)).files()
