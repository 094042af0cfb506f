"""A telescope that tracks while it is measured: phases of night-01 as they would be, by rotations written here."""

import dataclasses

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from catseye.constants import SPEED_OF_LIGHT
from catseye.records.night.live import TICKS_PER_DAY, LivePosture
from catseye.reduction.epoch.coordinates import adjust_coordinates
from catseye.reduction.epoch.ranges import follow_electronics
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.telescope_track import at_middle_posture
from catseye.reduction.epoch.verdict import MOST_REJECTED

KAPPA = 4 * np.pi * 1.5e9 / SPEED_OF_LIGHT  # rad a metre of range, in vacuum
RATES = np.radians([2e-5, -1.2e-5])  # rad/s: 0.07 deg in the night, 60 mm at the rim; faces turn by nothing that counts


def turned(axis, angle):
    """[Rodrigues] by a right-handed turn about a unit axis."""
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def carried(campaign, point, seconds):
    """A point of the reflector: raised about the elevation axis, then swung clockwise as seen from above."""
    azimuth, height = np.radians(campaign.site.campaign.azimuth_deg), campaign.site.frames.reflector
    out, up = np.array([np.sin(azimuth), np.cos(azimuth), 0.0]), np.array([0.0, 0.0, 1.0])
    axis = np.array([0.0, 0.0, height.elevation_axis_height_mm * 1e-3])
    raised = axis + turned(np.cross(out, up), RATES[1] * seconds) @ (point - axis)
    return turned(-up, RATES[0] * seconds) @ raised


def on_reflector(campaign):
    """Names of the points that ride on it, as the records say."""
    names = {ranger.name for ranger in campaign.feedarm.ranger}
    names |= {target.name for target in campaign.targets.values() if target.frame == "reflector"}
    return names | {n for t in campaign.triplets.values() if t.frame == "reflector" for n in t.targets}


@pytest.fixture(scope="module")
def moved(few_01, reduced_few_01):
    """The campaign with its postures, and its phases."""
    c, phases, shots = reduced_few_01.coordinates, reduced_few_01.phases, few_01.shots
    middle = 0.5 * (shots.mjd_utc.min() + shots.mjd_utc.max())
    stood, ride = few_01.site.campaign, on_reflector(few_01)
    turn = np.zeros(len(shots.ranger))
    for k, (ranger, target) in enumerate(zip(shots.ranger, shots.target, strict=True)):
        if target in c.points:
            ends = [c.x[c.index(name)] for name in (ranger, target)]
            seconds = (shots.mjd_utc[k] - middle) * 86_400.0 + 0.5 * 0.128  # the buffer's middle
            there = [
                carried(few_01, x, seconds) if n in ride else x for n, x in zip((ranger, target), ends, strict=True)
            ]
            longer = np.linalg.norm(there[1] - there[0]) - np.linalg.norm(ends[1] - ends[0])
            turn[k] = -KAPPA * (1.0 + c.refractivity_ppm * 1e-6) * longer
    angles = np.radians([stood.azimuth_deg, stood.elevation_deg])
    ticks = np.arange(
        round(shots.mjd_utc.min() * TICKS_PER_DAY) - 1000, round(shots.mjd_utc.max() * TICKS_PER_DAY) + 1000, 600
    )
    reads = tuple(
        LivePosture(int(t), *(angles + RATES * (t / TICKS_PER_DAY - middle) * 86_400.0).tolist(), *RATES.tolist())
        for t in ticks
    )
    return dataclasses.replace(few_01, postures=reads), dataclasses.replace(
        phases, phasor=phases.phasor * np.exp(1j * turn)
    )


def solved(campaign, phases):
    electronics, _ = follow_electronics(campaign, phases)
    with threadpool_limits(limits=1, user_api="blas"):
        return adjust_coordinates(campaign, phases, electronics, settings=ReductionSettings())


def rejected(coordinates):
    return {int(k) for k, on in zip(coordinates.ranges.shot, coordinates.ranges.used, strict=True) if not on}


def test_a_night_of_tracking_has_the_coordinates_of_its_middle(few_01, reduced_few_01, moved):
    """Within its claim: the telescope's expansion is not followed while it moves."""
    still, (campaign, phases) = reduced_few_01.coordinates, moved
    found = solved(campaign, phases)
    assert len(rejected(found) ^ rejected(still)) <= 2
    free = found.u > 0.0  # fixed points may be held
    assert np.sqrt(np.mean(((found.x - still.x)[free] / found.u[free]) ** 2)) < 0.6
    untold = solved(few_01, phases)
    assert len(rejected(untold)) > MOST_REJECTED * len(few_01.shots.shot)  # no usual night: its verdict is doubtful
    both = [n for n in untold.points if n in still.points and still.u[still.index(n)].all()]
    moved_by = np.array([untold.x[untold.index(n)] - still.x[still.index(n)] for n in both])
    claimed = np.array([untold.u[untold.index(n)] for n in both])
    assert np.sqrt(np.mean((moved_by / claimed) ** 2)) > 10.0  # and nonsense


def test_it_stands_as_in_the_middle_of_its_shots(few_01, moved):
    before = few_01.site.campaign
    stands = at_middle_posture(moved[0]).site.campaign
    assert stands.azimuth_deg == pytest.approx(before.azimuth_deg, abs=1e-9)
    assert stands.elevation_deg == pytest.approx(before.elevation_deg, abs=1e-9)
    assert at_middle_posture(few_01) is few_01
