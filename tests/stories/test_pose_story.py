"""Where is the feed, where does the beam point: from the coordinates of two nights, as sure as the network makes them.

The covariance is that of the reduced example night, or propagated from it to the whole dish; coordinates are drawn from
it, a motion is planted, and the pose must find it. A difference of two nights is as sure as both together.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.estimation.shapes.pose import PlaceCovariances, fit_pose
from catseye.estimation.shapes.rigid_body import motion_columns
from catseye.records.network.solved_points import SolvedPoints
from catseye.records.site.folder import read_site
from catseye.reduction.pose.pointing_offsets import cross_covariance, pointing_offset
from catseye.reduction.pose.pose import pose_of_group
from catseye.reduction.site.bodies import bodies_of
from catseye.reduction.site.places import nominal_frame
from draws import draws
from repository import ROOT

ARM = [f"ZY11{k}" for k in range(3, 9)]
RANGE = 26e-6  # m, of one range of the example night to a prism, from its covariance given the rangers (checked below)


@pytest.fixture(scope="module")
def epoch(reduced_night_01):
    """The example night as its coordinates.json has it."""
    c = reduced_night_01.coordinates
    told = reduced_night_01.campaign.site.campaign
    posture = np.radians(told.azimuth_deg), np.radians(told.elevation_deg)
    return SolvedPoints("night-01", "night-01", tuple(c.points), c.x, c.covariance, posture, {})


def drawn(epoch, rng):
    noise = rng.multivariate_normal(np.zeros(len(epoch.covariance)), epoch.covariance, method="eigh")
    return replace(epoch, x=epoch.x + noise.reshape(-1, 3))


def planted(epoch, site, body, *, shift=(0, 0, 0), turn=(0, 0, 0)):
    """The epoch with all points of the bodies moved in the reflector frame, turned about the vertex."""
    frames = {n: t.frame for n, t in site.targets.items()}
    mine = [k for k, n in enumerate(epoch.names) if bodies_of(site, frames).get(n) in body]
    to = nominal_frame(site)
    x = epoch.x.copy()
    local = to.inverse().points(x[mine])
    x[mine] = to.points(Rotation.from_rotvec(turn).apply(local) + shift)
    return replace(epoch, x=x)


def offset(later, earlier, site):
    dish, arm = (pose_of_group(later, earlier, site, group=g, frame="reflector") for g in ("dish", "feed-arm"))
    cross = cross_covariance(arm, dish, site, earlier=earlier)
    return pointing_offset(dish.pose, arm.pose, site, cross=cross)


@draws(40)
def test_a_feed_shift_of_half_a_millimetre_is_found_to_fifty_micrometres(epoch, night_01, runs):
    rng, shift = np.random.default_rng(1), np.array([0.3, 0.0, -0.4]) * MILLIMETRE
    moved = planted(epoch, night_01, ("arm",), shift=shift)
    found = [offset(drawn(moved, rng), drawn(epoch, rng), night_01) for _ in range(runs)]
    relative = np.array([f.relative[:3] for f in found])
    u = np.sqrt(np.diag(found[0].relative_covariance))[:3]
    # 36, 70, 40 um claimed: the y of the arm is what the network sees worst, and the claim says so
    assert np.all(u[[0, 2]] < 50e-6)
    assert u[1] < 80e-6
    np.testing.assert_allclose(relative.std(axis=0, ddof=1), u, rtol=4 / (2 * runs - 2) ** 0.5)
    np.testing.assert_allclose(relative.mean(axis=0), shift, rtol=0, atol=4 * u.max() / runs**0.5)
    assert np.abs(relative - shift)[:, [0, 2]].std() < 50e-6


@draws(40)
def test_a_pointing_offset_of_two_arc_seconds_is_found_to_a_quarter_with_sixty_prisms(epoch, night_01, runs):
    rng, turn = np.random.default_rng(2), np.array([1.2, 1.6, 0.0]) * ARCSECOND
    moved = planted(epoch, night_01, ("dish", "arm"), turn=turn)  # all of it: beam follows the dish
    found = [offset(drawn(moved, rng), drawn(epoch, rng), night_01) for _ in range(runs)]
    values = np.array([f.offset[:2] for f in found])
    u = np.sqrt(np.diag(found[0].covariance))[:2]
    assert np.all(u < 0.3 * ARCSECOND)  # 0.17 and 0.27: sixty prisms, the rim's triplets and the arm
    np.testing.assert_allclose(values.std(axis=0, ddof=1), u, rtol=4 / (2 * runs - 2) ** 0.5)
    np.testing.assert_allclose(values.mean(axis=0), turn[[1, 0]], rtol=0, atol=4 * u.max() / runs**0.5)


def test_common_errors_make_the_beam_more_certain_than_its_parts(epoch, night_01):
    """Rangers of the arm see the dish: their own motion is common to both, and a covariance without that is larger."""
    dish, arm = (pose_of_group(epoch, epoch, night_01, group=g, frame="reflector") for g in ("dish", "feed-arm"))
    joint = pointing_offset(dish.pose, arm.pose, night_01, cross=cross_covariance(arm, dish, night_01, earlier=epoch))
    apart = pointing_offset(dish.pose, arm.pose, night_01)
    assert np.all(np.diag(joint.covariance) < 0.4 * np.diag(apart.covariance))


@dataclass(frozen=True)
class Whole:
    """The dish's prisms as the arm's rangers see them: own covariances (n, 3, 3) and what they share (3n, k)."""

    x: np.ndarray
    own: np.ndarray
    shared: np.ndarray

    def of(self, step):
        rows = np.arange(3 * len(self.x)).reshape(-1, 3)[::step].ravel()
        return Whole(self.x[::step], self.own[::step], self.shared[rows])

    def matrix(self):
        q = self.shared @ self.shared.T
        for k, block in enumerate(self.own):
            q[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] += block
        return q

    def information(self, design):
        """(6, 6) A' Q^-1 A without Q: Woodbury's identity, Q = D + S S'."""
        inverse = np.linalg.inv(self.own)
        da = np.einsum("kij,kjp->kip", inverse, design.reshape(-1, 3, 6)).reshape(-1, 6)
        ds = np.einsum("kij,kjp->kip", inverse, self.shared.reshape(len(self.x), 3, -1)).reshape(self.shared.shape)
        middle = np.eye(self.shared.shape[1]) + self.shared.T @ ds
        return design.T @ da - ds.T.dot(design).T @ np.linalg.solve(middle, ds.T @ design)


def seen_by_the_arm(x, epoch, zeros):
    """Prisms at x (n, 3) ranged by six rangers whose places are as sure as the night's, zeros included."""
    where, joint = epoch.places(ARM), epoch.block(ARM)
    way = x[:, None] - where
    unit = way / np.linalg.norm(way, axis=2)[..., None]
    normal = np.linalg.inv(np.einsum("kri,krj->kij", unit, unit))
    back = np.einsum("kij,krj->kir", normal, unit)  # from ranges to a prism
    by_place = np.einsum("kir,krj->kirj", back, unit).reshape(3 * len(x), -1)  # a ranger's step shows in full
    by_zero = -back.reshape(3 * len(x), -1) * zeros
    return Whole(x, normal * RANGE**2, np.hstack([by_place @ np.linalg.cholesky(joint), by_zero]))


@pytest.fixture(scope="module")
def whole(epoch, night_01, reduced_night_01):
    site = read_site(ROOT / "examples" / "sites" / "gbt")
    local = [t.position_mm for n, t in sorted(site.targets.items()) if n.startswith("DP")]
    assert len(local) == 2209
    x = nominal_frame(night_01).points(np.array(local) * MILLIMETRE)
    zeros = np.array([reduced_night_01.coordinates.zeros[n][1] for n in ARM])
    return seen_by_the_arm(x, epoch, zeros)


def test_the_nights_prisms_are_as_uncertain_as_propagated(epoch, night_01, reduced_night_01):
    """What is taken to the whole dish below is first held against the reduction, for its own sixty prisms."""
    names = [n for n in epoch.names if n.startswith("DP")]
    zeros = np.array([reduced_night_01.coordinates.zeros[n][1] for n in ARM])
    model = seen_by_the_arm(epoch.places(names), epoch, zeros)
    rough = np.sqrt(np.diag(model.matrix()).reshape(-1, 3).mean(axis=0))
    real = np.sqrt(np.diag(epoch.block(names)).reshape(-1, 3).mean(axis=0))
    np.testing.assert_allclose(rough, real, rtol=0.35)  # ranges differ: strength, incidence, air


def test_the_rims_triplets_determine_the_dishs_turn_to_two_tenths(epoch, night_01):
    """The triplets tie the dish to the ground's rangers; a change of two independent nights."""
    found = pose_of_group(epoch, epoch, night_01, group="dish", frame="reflector")
    assert np.all(found.pose.u[3:5] < 0.2 * ARCSECOND)  # 0.18 and 0.11


def test_the_covariance_of_the_dishs_prisms_shows_their_limiting_errors(whole, night_01):
    """2209 prisms: 0.02 arc seconds for their own ranges, 0.31 for where the arm's rangers are, which all share."""
    frame = nominal_frame(night_01)
    pivot, turn = frame.translation, frame.rotation
    part = whole.of(8)  # 277 of them in full: the pose itself, and Woodbury held against it
    names = [f"P{k}" for k in range(len(part.x))]
    q = part.matrix()
    fitted = fit_pose(
        names, part.x, part.x, frame="ground", covariance=PlaceCovariances(first=q, second=q), pivot=pivot
    )
    claimed = 2.0 * np.linalg.inv(part.information(motion_columns(part.x, pivot)[:, :6]))
    np.testing.assert_allclose(np.sqrt(np.diag(claimed)), fitted.u, rtol=1e-6)

    def u_of(dish):  # about x and y of the reflector, arc seconds, of a change between two nights
        both = 2.0 * np.linalg.inv(dish.information(motion_columns(dish.x, pivot)[:, :6]))
        return np.sqrt(np.diag(turn.T @ both[3:, 3:] @ turn))[:2] / ARCSECOND

    assert np.all(u_of(replace(whole, shared=1e-6 * whole.shared)) < 0.02)
    assert np.all(u_of(whole) < 0.33)
    assert np.all(u_of(whole) > 0.9 * u_of(part))  # eight times as many prisms help little: it is not their noise


def test_two_arc_seconds_planted_in_many_prisms_are_found_within_the_claim(whole, night_01):
    frame = nominal_frame(night_01)
    pivot, part, rng = frame.translation, whole.of(24), np.random.default_rng(3)
    names, q = [f"P{k}" for k in range(len(part.x))], part.matrix()
    planted_turn = frame.rotation @ (np.array([1.2, 1.6, 0.0]) * ARCSECOND)
    second = pivot + Rotation.from_rotvec(planted_turn).apply(part.x - pivot)
    root, off = np.linalg.cholesky(q), []
    for _ in range(30):
        noise = root @ rng.normal(size=(len(q), 2))
        both = (x + n.reshape(-1, 3) for x, n in zip((part.x, second), noise.T, strict=True))
        found = fit_pose(names, *both, frame="ground", covariance=PlaceCovariances(first=q, second=q), pivot=pivot)
        half = np.linalg.cholesky(found.covariance[3:, 3:])
        off.append(np.linalg.solve(half, found.rotation - planted_turn))
    assert np.mean(np.square(off)) == pytest.approx(1.0, abs=4 * (2 / 90) ** 0.5)
