"""Pose and beam against the twin's ray trace of the paraboloid, and claimed covariances against scatter."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.reduction.epoch.parameter import ParameterKind, point_parameters
from catseye.reduction.live.pose import beam_per_feed_shift, live_pose
from catseye.reduction.live.state import Carried, with_reference
from catseye.simulator.twin.beam import TracedDish
from draws import draws, same_sigmas
from live_scene import site
from parameter_scene import parameter

F = 60.0  # m
FOCUS = np.array([0.0, 0.0, F])
DISH = {f"D{k}": np.array(p) for k, p in enumerate([(0, 10, 0.4), (-40, 50, 17.1), (40, 52, 17.9), (3, 98, 40.0)])}
ARM = {f"A{k}": np.array(p) for k, p in enumerate([(-2, -4, 58), (2, -3, 59), (0, -1, 62), (1, -6, 50.0)])}
BODIES = dict.fromkeys(DISH, "dish") | dict.fromkeys(ARM, "arm") | {"X": "alidade"}
STAYS = np.zeros(3), np.zeros(3)
small = st.floats(-1.0, 1.0)


def on_the_sky(direction, azimuth, elevation):
    """Azimuth clockwise from north and elevation of a direction of the reflector frame, by its three axes on the sky.

    z looks at (azimuth, elevation), x is to the right of who looks along it, y makes them right-handed.
    """
    sa, ca, se, ce = np.sin(azimuth), np.cos(azimuth), np.sin(elevation), np.cos(elevation)
    z, x = np.array([sa * ce, ca * ce, se]), np.array([ca, -sa, 0.0])
    east, north, up = direction[0] * x + direction[1] * np.cross(z, x) + direction[2] * z
    return np.arctan2(east, north), np.arcsin(up)


def moved(dish=STAYS, feed=STAYS, *, covariance=None, only=None):
    """A state in which dish and arm have moved by a turn (about vertex or focus) and a shift since the reference."""
    names, then, now = [], [], []
    for places, (turn, shift), pivot in ((DISH, dish, np.zeros(3)), (ARM, feed, FOCUS)):
        for name, x in places.items():
            if only is None or name in only:
                names.append(name)
                then.append(x)
                now.append(pivot + shift + Rotation.from_rotvec(turn).apply(x - pivot))
    n = 3 * len(names)
    covariance = np.diag(np.repeat([1e-8, 1e-9], n)) if covariance is None else covariance
    columns = [*point_parameters(ParameterKind.POINT, names), *point_parameters(ParameterKind.REFERENCE_PLACE, names)]
    return Carried(tuple(columns), np.concatenate([*now, *then]), covariance, 0, 0.5)


@settings(max_examples=60)
@given(v=st.lists(small, min_size=12, max_size=12), azimuth=st.floats(0.0, 6.2), elevation=st.floats(0.1, 1.4))
def test_beam_follows_the_traced_rays(v, azimuth, elevation):
    v = np.array(v)
    turn, shift, feed_turn, feed_shift = 5e-6 * v[:3], 2e-4 * v[3:6], 1e-5 * v[6:9], 4e-4 * v[9:]
    pose = live_pose(moved((turn, shift), (feed_turn, feed_shift)), BODIES, site())
    direction = TracedDish.of(site().site.paraboloid).beam(turn, shift, FOCUS + feed_shift)
    a, e = on_the_sky(direction, azimuth, elevation)
    off = (a - azimuth + np.pi) % (2 * np.pi) - np.pi
    # second order: turns of 5e-6 and shifts of 5e-4 m in 60 m, and what an arc of azimuth is off its cosine at 80 deg
    np.testing.assert_allclose(pose.offset[:2], [off * np.cos(elevation), e - elevation], rtol=0, atol=2e-9)
    relative = feed_shift - shift - np.cross(turn, FOCUS)
    assert pose.offset[2] == pytest.approx(relative[2], abs=1e-7)
    np.testing.assert_array_equal(pose.correction, -pose.offset)
    assert pose.missing == ""


@pytest.mark.parametrize(
    ("dish", "feed", "azimuth_up", "elevation_up"),
    [
        ((1e-5, 0, 0), (1e-5, 0, 0), 0, 1),  # everything turns about x, right-handed: y goes to z, the beam to -y, up
        ((0, 1e-5, 0), (0, 1e-5, 0), 1, 0),  # about y, z goes to x, to the right, clockwise
    ],
)
def test_beam_turns_with_the_whole_telescope(dish, feed, azimuth_up, elevation_up):
    dish = np.array(dish, dtype=float)
    pose = live_pose(moved((dish, np.zeros(3)), (dish, np.cross(dish, FOCUS))), BODIES, site())
    np.testing.assert_allclose(
        pose.offset, [1e-5 * azimuth_up, 1e-5 * elevation_up, 0.0], rtol=0, atol=3e-9
    )  # 1e-10 * 60 m / 2


@pytest.mark.parametrize(
    ("shift", "signs"),
    [
        ((1e-3, 0, 0), (-1, 0, 0)),  # the feed to the right: the beam to the left
        ((0, 1e-3, 0), (0, 1, 0)),  # the feed to +y, which is down: the beam up
        ((0, 0, 1e-3), (0, 1, 1)),  # the feed away from the dish: an offset section's beam goes up, too
    ],
)
def test_feed_shift_turns_the_beam_the_other_way(shift, signs):
    still = np.zeros(3), np.zeros(3)
    pose = live_pose(moved(still, (np.zeros(3), np.array(shift))), BODIES, site())
    assert tuple(np.sign(np.round(pose.offset, 8)).tolist()) == signs


def test_the_beam_deviates_less_than_the_plate_scale():
    """A hundred metres of offset aperture on 60 m of focal length: 0.77 across the plane of symmetry, 0.55 in it."""
    factor = beam_per_feed_shift(site()) * F
    np.testing.assert_allclose(np.diag(factor), [-0.770, -0.547], atol=2e-3)
    assert abs(factor[0, 1:]).max() < 1e-3


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6))
def test_planted_rigid_motions_are_recovered(seed):
    rng = np.random.default_rng(seed)
    n = 6 * (len(DISH) + len(ARM))
    a = rng.normal(size=(n, 2 * n))
    turns, shifts = 1e-5 * rng.normal(size=(2, 3)), 1e-3 * rng.normal(size=(2, 3))
    covariance = 1e-8 * a @ a.T / n
    pose = live_pose(moved((turns[0], shifts[0]), (turns[1], shifts[1]), covariance=covariance), BODIES, site())
    for body, turn, shift in ((pose.dish, turns[0], shifts[0]), (pose.feed, turns[1], shifts[1])):
        np.testing.assert_allclose(body.rotation, turn, rtol=0, atol=1e-9)  # (1e-5)^2, fourfold for 3 sigma
        np.testing.assert_allclose(body.translation, shift, rtol=0, atol=1e-7)
        assert body.chi2 == pytest.approx(0.0, abs=1e-3)
        assert (body.points, body.degrees_of_freedom) == (4, 6)
    np.testing.assert_array_equal(pose.dish.pivot, np.zeros(3))
    np.testing.assert_allclose(pose.feed.pivot, FOCUS, rtol=0, atol=1e-12)


@draws(3000, name="count")
def test_claimed_covariances_agree_with_scatter(count):
    rng = np.random.default_rng(11)
    n = 6 * (len(DISH) + len(ARM))
    a = rng.normal(size=(n, n + 5))
    covariance = 1e-8 * a @ a.T / n
    calm = moved(covariance=covariance)
    claimed = live_pose(calm, BODIES, site())
    draws = calm.x + rng.multivariate_normal(np.zeros(n), covariance, count)
    poses = [live_pose(Carried(calm.parameters, x, covariance, 0, 0.5), BODIES, site()) for x in draws]
    bodies = {"dish": [p.dish for p in poses], "feed": [p.feed for p in poses]}
    samples = {k: np.array([np.concatenate([b.translation, b.rotation]) for b in v]) for k, v in bodies.items()}
    samples["offset"] = np.array([p.offset for p in poses])
    wanted = {"dish": claimed.dish.covariance, "feed": claimed.feed.covariance, "offset": claimed.covariance}
    for key, sample in samples.items():
        half = np.linalg.inv(np.linalg.cholesky(wanted[key]))
        normalised = half @ np.cov(sample.T) @ half.T
        # an element of 3000 draws' covariance has u = 0.018, on the diagonal 0.026: four of these
        np.testing.assert_allclose(normalised, np.eye(len(normalised)), rtol=0, atol=same_sigmas(0.11, 3000, count))
    for found in bodies.values():
        chi2 = np.array([b.chi2 for b in found])
        assert chi2.mean() == pytest.approx(6.0, abs=4 * np.sqrt(12 / count))


def test_points_that_no_longer_fit_a_rigid_body_show_in_chi2():
    bent = moved()
    x = bent.x.copy()
    x[bent.columns([parameter("D1 z")])] += 2e-3
    pose = live_pose(Carried(bent.parameters, x, bent.covariance, 0, 0.5), BODIES, site())
    assert pose.dish.chi2 > 100.0
    assert pose.feed.chi2 < 1e-3


@pytest.mark.parametrize("seed", range(8))
def test_reference_epoch_has_no_motion_and_no_negative_variance(seed):
    rng = np.random.default_rng(seed)
    names = point_parameters(ParameterKind.POINT, (*DISH, *ARM))
    a = rng.normal(size=(len(names), len(names) + 3))
    places = np.concatenate([*DISH.values(), *ARM.values()])
    state = with_reference(Carried(tuple(names), places, 1e-8 * a @ a.T, 0, 0.5), [*DISH, *ARM])
    # the journey of an epoch: the blocks are no longer the very same numbers, but rounded apart
    noise = rng.normal(size=state.covariance.shape)
    rounded = state.covariance * (1.0 + 2e-16 * (noise + noise.T))
    pose = live_pose(Carried(state.parameters, state.x, rounded, 0, 0.5), BODIES, site())
    np.testing.assert_allclose(pose.offset, 0.0, rtol=0, atol=1e-15)
    for covariance in (pose.covariance, pose.dish.covariance, pose.feed.covariance):
        assert np.diag(covariance).min() >= 0.0, "a display takes its root"
        assert np.diag(covariance).max() < 1e-16


def test_body_with_too_few_points_is_named():
    pose = live_pose(moved(only={*DISH, "A0", "A1"}), BODIES, site())
    assert pose.missing == "arm has 2 points with a reference position (expected 3 or more)"
    assert np.isnan(pose.offset).all()
    assert pose.dish is None
    assert pose.feed is None


def test_points_on_a_line_do_not_determine_a_rotation():
    state, x = moved(), moved().x.copy()
    for k in range(4):
        for kind in (ParameterKind.POINT, ParameterKind.REFERENCE_PLACE):
            x[state.columns(point_parameters(kind, [f"A{k}"]))] = [0.0, 0.0, 50.0 + 3 * k]
    pose = live_pose(Carried(state.parameters, x, state.covariance, 0, 0.5), BODIES, site())
    assert "arm" in pose.missing
    assert "line" in pose.missing


def test_points_without_a_reference_position_are_ignored():
    state = moved()
    bodies = {**BODIES, "NEW": "dish"}
    names = (*state.parameters, *point_parameters(ParameterKind.POINT, ["NEW"]))
    n = len(names)
    covariance = np.eye(n)
    covariance[: n - 3, : n - 3] = state.covariance
    more = Carried(names, np.concatenate([state.x, np.full(3, 1e3)]), covariance, 0, 0.5)
    assert live_pose(more, bodies, site()).dish.points == len(DISH)


def test_focal_length_comes_from_the_site():
    """And a small dish about the vertex has the plate scale of geometry, 1/f."""
    small_dish = SimpleNamespace(focal_length_mm=120_000.0, aperture_centre_mm=(0.0, 0.0), aperture_radius_mm=500.0)
    still = np.zeros(3), np.zeros(3)
    long = SimpleNamespace(site=SimpleNamespace(paraboloid=small_dish))
    pose = live_pose(moved(still, (np.zeros(3), np.array([1e-3, 0, 0]))), BODIES, long)
    assert pose.offset[0] == pytest.approx(-1e-3 / 120.0, rel=2e-5)  # (r/2f)^2 = 4e-6


def test_bending_body_has_a_covariance_that_covers_its_scatter():
    """Each point goes its own 0.3 mm beside a rigid motion, measured to 10 um: the motion scatters as claimed."""
    rng, found = np.random.default_rng(9), []
    places = {f"D{k}": rng.uniform([-50, 4, 0], [50, 104, 40]) for k in range(20)}
    names, bodies = [*places, *ARM], dict.fromkeys(places, "dish") | dict.fromkeys(ARM, "arm")
    then = np.concatenate([*places.values(), *ARM.values()])
    columns = [*point_parameters(ParameterKind.POINT, names), *point_parameters(ParameterKind.REFERENCE_PLACE, names)]
    for _ in range(60):
        now = then + rng.normal(0.0, 1e-5, len(then))
        now[:60] += rng.normal(0.0, 3e-4, 60)
        carried = Carried(
            tuple(columns), np.concatenate([now, then]), np.diag(np.repeat([1e-10, 1e-16], len(then))), 0, 0.5
        )
        pose = live_pose(carried, bodies, site())
        moved = np.concatenate([pose.dish.translation, pose.dish.rotation])
        found.append(moved @ np.linalg.solve(pose.dish.covariance, moved) / 6.0)
        assert pose.dish.bending == pytest.approx(3e-4, rel=0.35)
        assert pose.feed.bending < 2e-5
    # 60 x 6 degrees of freedom, and the bending itself known to 10 %
    assert np.mean(found) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 360) + 0.1)
