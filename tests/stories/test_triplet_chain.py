"""Ground rangers to balls, feed-arm rangers to prisms and each other: ground coordinates of the feed-arm scan points.

The site, the postures and who sees what are those of the example night; the truth is drawn about its sheets, and ranges
come from points and rays placed in three dimensions here, by nothing of the reduction: a prism's ray is bent with the
phase index and delayed with the group index.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.observations.kinds import Distances, Linear, ObservedCoordinates
from catseye.reduction.site.places import nominal_frame, places_of
from catseye.reduction.triplet.ties import (
    BALL,
    COUNT,
    TripletParameters,
    prism_ranges,
    triplet_observations,
    triplet_start,
)
from catseye.reduction.triplet.use import MountedTriplet, ball_ranges

U_RANGE, U_PER_METRE = 15e-6, 0.2e-6  # m, and of the distance: the usual night's
U_ZERO, U_GROUND, U_PLACE = 30e-6, 100e-6, 10e-3  # m: zeros of the rangers, ground points, typed positions
U_NORMAL = np.radians(0.3)
PHASE = 1.511186 / 1.527463  # of BK 7's phase index over its group index


@dataclass(frozen=True)
class Site:
    """What everybody knows: sheets, approximate places, ground points with u, who ranged to which ball."""

    units: list[MountedTriplet]
    scan: np.ndarray
    ground: np.ndarray
    seen: np.ndarray  # (p, 2) ground ranger, unit


@pytest.fixture(scope="module")
def site(night_01):
    places, frame = places_of(night_01), nominal_frame(night_01)
    ratio = night_01.site.ranging.bk7_to_air_group_index_ratio
    units = [MountedTriplet.of(t, frame, ratio=ratio, u_normal=U_NORMAL) for t in night_01.triplets.values()]
    ground, feed = list(night_01.monuments), [r.name for r in night_01.feedarm.ranger]
    balls = [t.ball.target for t in night_01.triplets.values()]
    fired = sorted(set(zip(night_01.shots.ranger, night_01.shots.target, strict=True)))
    seen = [(ground.index(r), balls.index(t)) for r, t in fired if r in ground and t in balls]
    return Site(
        units,
        np.stack([places[n].start for n in feed]),
        np.stack([places[n].start for n in ground]),
        np.array(seen),
    )


@dataclass(frozen=True)
class Night:
    """The truth of one night and its ranges, Pc added, dPc not: ground to balls (p,), feed arm to prisms (n, k, 2),
    feed arm to feed arm (k (k - 1),) in the order of `pairs`."""

    scan: np.ndarray
    to_balls: np.ndarray
    to_prisms: np.ndarray
    between: np.ndarray


def pairs(k):
    return np.array([(i, j) for i in range(k) for j in range(k) if i != j])


def measured_through(scan, corner, normal, height, ratio):
    """Group path over the air's index from scan points (k, 3) to a prism's corner, by bisection on Snell's law."""
    to_scan = scan - corner
    out = to_scan @ normal - height
    aside = np.sqrt(np.sum(to_scan**2, axis=1) - (out + height) ** 2)
    bend = ratio * PHASE
    low, high = np.zeros(len(scan)), aside.copy()
    for _ in range(60):
        crossing = 0.5 * (low + high)
        in_air, in_glass = aside - crossing, crossing
        far = in_air / np.hypot(in_air, out) > bend * in_glass / np.hypot(in_glass, height)
        low, high = np.where(far, crossing, low), np.where(far, high, crossing)
    return np.hypot(aside - crossing, out) + ratio * np.hypot(crossing, height)


def noisy(rng, d):
    return d + rng.normal(size=d.shape) * np.hypot(U_RANGE, U_PER_METRE * d)


def measure(site, rng):
    """A night: everything drawn about what is known by its standard uncertainty, then ranged."""
    n, k = len(site.units), len(site.scan)
    scan = site.scan + U_PLACE * rng.normal(size=site.scan.shape)
    ground = site.ground + U_GROUND * rng.normal(size=site.ground.shape)
    zeros, zeros_ground = U_ZERO * rng.normal(size=k), U_ZERO * rng.normal(size=len(ground))
    balls, to_prisms = np.empty((n, 3)), np.empty((n, k, 2))
    for i, u in enumerate(site.units):
        normal = u.normal + U_NORMAL * (rng.normal() * u.axis + rng.normal() * u.across)
        normal /= np.linalg.norm(normal)
        axis = u.axis + 0.01 * rng.normal() * u.across - (u.axis @ normal) * normal  # and turned about the normal
        axis -= (axis @ normal) * normal
        axis /= np.linalg.norm(axis)
        balls[i] = u.ball + U_PLACE * rng.normal(size=3)
        lateral = u.u_lateral * (rng.normal() * axis + rng.normal() * np.cross(normal, axis))
        middle = balls[i] - lateral - (u.h_corr + u.u_h_corr * rng.normal()) * normal
        half = 0.5 * (u.d_12 + u.u_d_12 * rng.normal())
        rise = u.u_square * rng.normal() * normal  # the prisms' line leans out of the plate
        line = (axis + rise) / np.linalg.norm(axis + rise)
        for side, sign in ((0, -1.0), (1, 1.0)):
            h = u.heights[side]
            corner = middle + sign * half * line - (h - h / u.ratio) * normal
            to_prisms[i, :, side] = measured_through(scan, corner, normal, h, u.ratio) - (u.ratio - 1 / u.ratio) * h
    to_balls = np.linalg.norm(ground[site.seen[:, 0]] - balls[site.seen[:, 1]], axis=1)
    ij = pairs(k)
    between = np.linalg.norm(scan[ij[:, 0]] - scan[ij[:, 1]], axis=1)
    return Night(
        scan,
        noisy(rng, to_balls) + zeros_ground[site.seen[:, 0]],
        noisy(rng, to_prisms) + zeros[:, None],
        noisy(rng, between) + zeros[ij[:, 0]],
    )


def variance(d):
    return U_RANGE**2 + (U_PER_METRE * d) ** 2


def ground_groups(site, night, first_ground, first_ball, stride):
    """Ground points and the zeros of their rangers (after them) as known; ranges to the balls."""
    g = len(site.ground)
    zero = first_ground + 3 * g
    at = site.seen[:, 0], site.seen[:, 1]
    return (
        ObservedCoordinates.of_points(
            "ground", site.ground, np.full(3 * g, U_GROUND**2), first_ground + 3 * np.arange(g)
        ),
        Linear("ground zeros", np.zeros(g), np.full(g, U_ZERO**2), zero + np.arange(g), np.eye(g)),
        Distances(
            "ground to balls",
            night.to_balls,
            variance(night.to_balls),
            first_ground + 3 * at[0],
            first_ball + stride * at[1],
            nuisance=(zero + at[0])[:, None],
        ),
    )


def in_one(site, night):
    """The whole chain in one adjustment: solution, scan points first."""
    k, n, g = len(site.scan), len(site.units), len(site.ground)
    first = 3 * k + COUNT * np.arange(n)
    zeros = 3 * k + COUNT * n + np.arange(k)
    ground = zeros[-1] + 1
    x = np.concatenate([site.scan.ravel(), triplet_start(site.units), np.zeros(k), site.ground.ravel(), np.zeros(g)])
    at = TripletParameters(first)
    ij = pairs(k)
    groups = [
        *triplet_observations(site.units, at),
        prism_ranges(
            "feed arm to prisms",
            site.units,
            at,
            scan_points=site.scan,
            scan_columns=3 * np.arange(k),
            ranges=night.to_prisms,
            covariance=variance(night.to_prisms).ravel(),
            zeros=zeros,
        ),
        Distances(
            "feed arm",
            night.between,
            variance(night.between),
            3 * ij[:, 0],
            3 * ij[:, 1],
            nuisance=zeros[ij[:, 0]][:, None],
        ),
        Linear("zeros", np.zeros(k), np.full(k, U_ZERO**2), zeros, np.eye(k)),
        *ground_groups(site, night, ground, first[0] + BALL, COUNT),
    ]
    return adjust(x, groups).require_converged()


def step_by_step(site, night):
    """The memo's three steps: balls from the ground, appendix C, scan points from balls."""
    k, n, g = len(site.scan), len(site.units), len(site.ground)
    balls = np.stack([u.ball for u in site.units])
    x = np.concatenate([balls.ravel(), site.ground.ravel(), np.zeros(g)])
    first = adjust(x, ground_groups(site, night, 3 * n, 0, 3)).require_converged()
    of_balls = first.covariance[: 3 * n, : 3 * n]
    ranger = np.tile(np.repeat(np.arange(k), 2), n)
    covariance = np.diag(variance(night.to_prisms).ravel()) + U_ZERO**2 * (ranger[:, None] == ranger)
    ranges = ball_ranges(site.units, site.scan, night.to_prisms, covariance=covariance)
    unit, ranger = np.divmod(np.arange(n * k), k)
    columns = 3 * k + 3 * np.arange(n)  # of the balls, behind the scan points
    balls = first.x[: 3 * n].reshape(n, 3)
    groups = (
        ObservedCoordinates.of_points("balls", balls, of_balls, columns),
        Distances("ball distances", ranges.d_bc.ravel(), ranges.covariance, 3 * ranger, columns[unit]),
    )
    return adjust(np.concatenate([site.scan.ravel(), balls.ravel()]), groups).require_converged()


def scattered(site, solve, nights, seed):
    """Whitened errors (nights, 3k) of the scan points, their rms (m), the mean claimed u (m), variance factors."""
    rng = np.random.default_rng(seed)
    size = 3 * len(site.scan)
    white, errors, claimed, factors = [], [], [], []
    for _ in range(nights):
        night = measure(site, rng)
        solution = solve(site, night)
        c = solution.covariance[:size, :size]
        errors.append(solution.x[:size] - night.scan.ravel())
        white.append(np.linalg.solve(np.linalg.cholesky(c), errors[-1]))
        claimed.append(np.sqrt(np.diag(c)))
        factors.append(solution.variance_factor()[0])
    return np.array(white), np.sqrt(np.mean(np.square(errors))), np.sqrt(np.mean(np.square(claimed))), np.array(factors)


def judged(found, nights, k):
    """Scatter as claimed: chi square of 18 coordinates a night to 4 sigma, no direction beyond it, no bias."""
    white, rms, claimed, _ = found
    count = white.size
    assert np.mean(white**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / count))
    assert np.abs(white.mean(axis=0)).max() < 4.5 / np.sqrt(nights)
    # coordinates of one night are correlated: an rms over nights is worth some three of them each
    assert rms == pytest.approx(claimed, rel=4.0 / np.sqrt(2.0 * 3.0 * nights))
    assert 3 * k == white.shape[1]


@pytest.mark.parametrize("solve", [in_one, step_by_step])
def test_the_feed_arm_is_found_in_ground_coordinates_as_claimed(site, solve):
    judged(scattered(site, solve, 24, 7), 24, 6)


@pytest.mark.slow
@pytest.mark.parametrize("solve", [in_one, step_by_step])
def test_the_feed_arm_is_found_over_four_hundred_nights(site, solve):
    found = scattered(site, solve, 400, 8)
    judged(found, 400, 6)
    assert np.mean(found[3]) == pytest.approx(1.0, abs=0.045)  # of 42 degrees of freedom or more: 0.011


def test_one_adjustment_is_never_worse_than_the_memos_steps_and_agrees_with_them(site):
    """Both are linear estimates of the same data, the first the best one: their difference has covariance
    C_steps - C_one, which therefore is none below zero, and the difference is as large as it says."""
    night = measure(site, np.random.default_rng(11))
    one, steps = in_one(site, night), step_by_step(site, night)
    size = 3 * len(site.scan)
    spare = steps.covariance[:size, :size] - one.covariance[:size, :size]
    values, vectors = np.linalg.eigh(spare)
    assert values.min() > -1e-3 * values.max()  # both are linearised, 10 mm apart in places
    large = values > 1e-2 * values.max()
    score = (vectors.T @ (steps.x[:size] - one.x[:size]))[large] / np.sqrt(values[large])
    assert np.abs(score).max() < 4.0
    assert np.sqrt(np.diag(one.covariance)[:size]).max() < 0.12e-3  # good to a tenth of a millimetre


def test_exchanged_prisms_turn_the_unit_round_and_leave_the_feed_arm(site):
    """Left and right swapped in one unit: H_corr does not care, and no range disagrees; but the prisms come to stand
    635 mm from where their sheet has them, thirty times what a typed place is good to."""
    night = measure(site, np.random.default_rng(12))
    swapped = night.to_prisms.copy()
    swapped[3] = swapped[3][:, ::-1]
    clean, turned = in_one(site, night), in_one(site, replace(night, to_prisms=swapped))
    assert np.abs(turned.x[:18] - clean.x[:18]).max() < 2e-6  # the lateral prior is round: only dPc is exchanged
    first = 18 + COUNT * 3
    places = turned.x[first : first + 6].reshape(2, 3)
    assert np.linalg.norm(places - site.units[3].prisms, axis=1).min() > 0.6
    assert np.linalg.norm(places - site.units[3].prisms[::-1], axis=1).max() < 5 * U_PLACE


def test_a_wrong_h_corr_moves_the_feed_arm_and_its_triplet_is_named(site):
    """0.5 mm on one of ten: the standardised residual of that height stands out."""
    night = measure(site, np.random.default_rng(13))
    wrong = [replace(u, h_corr=u.h_corr + 0.5e-3) if i == 6 else u for i, u in enumerate(site.units)]
    bad = in_one(replace(site, units=wrong), night)
    fit = next(f for f in bad.fits if f.name == "triplets")
    heights = np.abs(fit.standardised[2::5])
    assert int(np.argmax(heights)) == 6
    assert heights[6] > 4.13
    clean = in_one(site, night)
    moved = np.linalg.norm((bad.x - clean.x)[:18].reshape(6, 3), axis=1)
    assert moved.max() > 30e-6
