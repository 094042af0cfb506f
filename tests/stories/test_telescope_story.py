"""What the telescope wants, from raw samples: two nights at one site, something moved between them, and what was found.

The second night has its own noise, electronics, air and weather. What moved is planted into the twin's truth.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.optics.zernike import Term, zernike
from catseye.records.network.solved_points import SolvedPoints
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.pose.pointing_offsets import cross_covariance, pointing_offset
from catseye.reduction.pose.pose import pose_of_group
from catseye.reduction.site.places import nominal_frame
from catseye.reduction.surface.change import change_between
from catseye.reduction.surface.shape import LitAperture, Prisms, ShapeSettings
from catseye.simulator.night.faults import Planted
from catseye.simulator.night.simulate import simulate_night

SEED = 4711
F = 60.0  # m
MIDDLE, RADIUS = np.array([0.0, 54.0]), 50.0  # m, of the aperture
ARM = (*(f"ZY{k}" for k in range(113, 119)), "ZEG41040L", "ZEG20440L")


@dataclass(frozen=True, eq=False)
class Reduced:
    """A night's answer."""

    campaign: object
    points: SolvedPoints
    surface: Prisms


def reduced(campaign):
    found = reduce_epoch(campaign)
    c, told = found.coordinates, campaign.site.campaign
    posture = np.radians(told.azimuth_deg), np.radians(told.elevation_deg)
    names = found.surface.names
    rows = [c.index(n) for n in names]
    at = np.concatenate([np.arange(3 * k, 3 * k + 3) for k in rows])
    prisms = Prisms(names, c.x[rows], c.covariance[np.ix_(at, at)], nominal_frame(campaign), "a night")
    return Reduced(campaign, SolvedPoints("night", "night", tuple(c.points), c.x, c.covariance, posture, {}), prisms)


@pytest.fixture(scope="module")
def before(whole):
    return reduced(whole.campaign)


@cache
def true_points():
    return simulate_night(SEED).truth.points


def planted(before, names, moved):
    """Shifts (ground frame) of named points that `moved` takes elsewhere in the reflector frame."""
    to, truth = nominal_frame(before.campaign), true_points()
    there = to.inverse().points([truth[n] for n in names])
    shift = to.directions(moved(there) - there)
    return Planted(shifts=dict(zip(names, shift, strict=True)))


def offset(later, before):
    dish, arm = (
        pose_of_group(later.points, before.points, before.campaign, group=g, frame="reflector")
        for g in ("dish", "feed-arm")
    )
    cross = cross_covariance(arm, dish, before.campaign, earlier=before.points)
    return pointing_offset(dish.pose, arm.pose, before.campaign, cross=cross)


def nights(written, before, moved, count):
    for k in range(1, count + 1):
        yield reduced(written(simulate_night(SEED, planted=moved, night=k)))


def on_the_dish(before):
    return [n for n in before.points.names if n.startswith(("DP", "TR"))]


@pytest.mark.parametrize("count", [pytest.param(1, id="one"), pytest.param(12, id="twelve", marks=pytest.mark.slow)])
def test_a_feed_that_moved_half_a_millimetre_is_found_from_samples(written, before, count):
    shift = np.array([0.3, 0.0, -0.4]) * MILLIMETRE
    moved = planted(before, ARM, lambda x: x + shift)
    found = [offset(later, before) for later in nights(written, before, moved, count)]
    relative = np.array([f.relative[:3] for f in found])
    u = np.sqrt(np.diag(found[0].relative_covariance))[:3]
    assert np.all(u[[0, 2]] < 50e-6)
    assert u[1] < 85e-6  # along y the network is weaker, and says so
    assert np.all(np.abs(relative - shift) < 4 * u)
    if count > 1:
        z = (relative[:, :3] - shift) / u
        assert 0.25 < np.mean(z**2) < 1.9


@pytest.mark.parametrize("count", [pytest.param(1, id="one"), pytest.param(12, id="twelve", marks=pytest.mark.slow)])
def test_a_beam_two_arc_seconds_off_is_found_from_samples(written, before, count):
    turn = np.array([1.2, 1.6, 0.0]) * ARCSECOND
    names = [*on_the_dish(before), *ARM]
    moved = planted(before, names, Rotation.from_rotvec(turn).apply)
    found = [offset(later, before) for later in nights(written, before, moved, count)]
    values = np.array([f.offset[:2] for f in found])
    u = np.sqrt(np.diag(found[0].covariance))[:2]
    expected = np.array([turn[1], turn[0]])
    assert np.all(u < 0.35 * ARCSECOND)
    assert np.all(np.abs(values - expected) < 4 * u)
    if count > 1:
        assert 0.2 < np.mean(((values - expected) / u) ** 2) < 2.0


@pytest.mark.parametrize("count", [pytest.param(1, id="one"), pytest.param(12, id="twelve", marks=pytest.mark.slow)])
def test_astigmatism_of_0_3_mm_is_found_from_samples(written, before, count):
    term = Term(2, 2)

    def bent(x):
        half = 0.3 * MILLIMETRE * zernike((term,), *((x[:, :2] - MIDDLE) / RADIUS).T)[:, 0]
        slope = x[:, :2] / (2 * F)
        cos = 1.0 / np.sqrt(1.0 + np.sum(slope**2, axis=1))
        normal = np.column_stack([-slope, np.ones(len(x))]) * cos[:, None]
        return x + (half / cos)[:, None] * normal

    names = [n for n in before.points.names if n.startswith("DP")]
    moved = planted(before, names, bent)
    aperture = LitAperture.of(before.campaign.site.paraboloid)
    settings = ShapeSettings(terms=10)
    values, u = [], 0.0
    for later in nights(written, before, moved, count):
        change = change_between(before.surface, later.surface, aperture, settings=settings)
        k = change.expansion.terms.index(term)
        values.append(change.expansion.value[k])
        u = float(np.sqrt(change.expansion.covariance[k, k]))
    assert u < 30e-6
    assert np.all(np.abs(np.array(values) - 0.3 * MILLIMETRE) < 30e-6)
    if count > 1:
        assert 0.2 < np.mean(((np.array(values) - 0.3 * MILLIMETRE) / u) ** 2) < 2.5
