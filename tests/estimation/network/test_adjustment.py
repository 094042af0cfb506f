"""Networks adjusted: the datum against a bordered inverse, sparse against dense, and what is wrong said in one line."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.errors import EstimationError
from catseye.estimation.network import adjustment as network_adjustment
from catseye.estimation.network.adjustment import adjust_network
from catseye.estimation.network.model import NetworkParameter, NetworkPoints, ObservationNetwork
from catseye.estimation.observations.kinds import (
    Azimuths,
    Directions,
    Distances,
    ObservedCoordinates,
    Vectors,
    ZenithAngles,
)
from catseye.estimation.shapes.motions import motions

ENGINES = ("dense", "sparse")


def with_ranges(network, keep=None, **changes):
    """The network with other, or fewer, ranges."""
    ranges = network.groups[0]
    if keep is not None:
        changes = {name: getattr(ranges, name)[keep] for name in ("observed", "covariance", "origin", "target")}
    return replace(network, groups=(replace(ranges, **changes), *network.groups[1:]))


def bordered(network, x):
    """Coordinates' covariance by inverting the whole bordered normal matrix at once: no code of the solver."""
    ranges, n = network.groups[0], x.size
    values, jacobian = ranges.predict(x.ravel())
    a = np.zeros((len(values), n))
    for row, (columns, slopes) in enumerate(zip(ranges.columns, jacobian, strict=True)):
        np.add.at(a[row], columns, slopes)
    sigma = np.sqrt(ranges.covariance)[:, None]
    g = (motions(network.points.xyz)[:, :6] * network.points.datum.ravel()[:, None]).T
    scale = 1e4  # so that both kinds of row weigh alike
    full = np.block([[(a / sigma).T @ (a / sigma), scale * g.T], [scale * g, np.zeros((6, 6))]])
    return np.linalg.inv(full)[:n, :n]


@pytest.mark.parametrize("engine", ENGINES)
def test_inner_constraints_are_those_of_the_bordered_inverse(ranging_network, engine):
    network, _ = ranging_network(3)
    solution = adjust_network(network, engine=engine)
    assert solution.status == "converged"
    expected = bordered(network, solution.x)
    found = solution.block(network.points.names)
    # the bordered inverse has a condition of 1e9: six digits are left
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * expected.max())
    conditions = motions(network.points.xyz)[:, :6].T * network.points.datum.ravel()
    assert np.abs(conditions @ (solution.x - network.points.xyz).ravel()).max() < 1e-9
    assert solution.degrees_of_freedom == pytest.approx(6 * 12 - 3 * 18 + 6, abs=1e-6)


def test_no_rigid_motion_brings_the_datum_points_nearer_to_their_given_places(ranging_network):
    network, _ = ranging_network(4, off=0.5)
    solution = adjust_network(network)
    datum = network.points.datum[:, 0]

    def distance(x):
        return np.sum((x - network.points.xyz)[datum] ** 2)

    best = distance(solution.x)
    rng = np.random.default_rng(0)
    for _ in range(50):
        small = 1e-3 * rng.standard_normal(6)
        moved = solution.x + small[:3] + np.cross(small[3:] / 100.0, solution.x - solution.x.mean(axis=0))
        assert distance(moved) > best - 1e-4 * np.sum(small**2)  # a turn by straight lines: second order


def test_sparse_and_dense_agree(ranging_network):
    network, _ = ranging_network(5, stations=8, targets=40, seen=0.7)
    dense, sparse = (adjust_network(network, engine=e) for e in ENGINES)
    np.testing.assert_allclose(sparse.x, dense.x, rtol=0, atol=1e-10)
    np.testing.assert_allclose(sparse.covariance, dense.covariance, rtol=0, atol=1e-8 * dense.covariance.max())
    for name in ("residual", "redundancy", "standardised", "detectable_error"):
        found, expected = getattr(sparse.fits[0], name), getattr(dense.fits[0], name)
        # what nothing checks has rounding over rounding for a test statistic
        checked = (dense.fits[0].redundancy > 1e-6) | (name in ("residual", "redundancy"))
        np.testing.assert_allclose(found[checked], expected[checked], rtol=1e-5, atol=1e-7 * np.abs(expected).max())
    names = ["S03", "T010", "T031"]
    np.testing.assert_allclose(sparse.block(names), dense.block(names), atol=1e-8 * dense.covariance.max())


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("sigma", "size"), [(1e-9, 100.0), (5e-5, 100.0), (1e-6, 1e5), (1e-3, 0.01)])
def test_rank_does_not_depend_on_units_or_sigmas(ranging_network, engine, sigma, size):
    good, _ = ranging_network(6, sigma=sigma, size=size, off=1e-6)
    solution = adjust_network(good, engine=engine)
    assert solution.status == "converged"
    conditions = motions(good.points.xyz)[:, :6].T * good.points.datum.ravel()  # in its datum, covariance too
    joint = conditions @ solution.block(good.points.names) @ conditions.T
    assert np.abs(joint).max() < 1e-6 * np.trace(solution.covariance.sum(axis=0))
    last = 3 * (len(good.points.names) - 1)
    lost = (good.groups[0].target != last) | (good.groups[0].origin < 6)
    bad = adjust_network(with_ranges(good, keep=lost), engine=engine)
    assert bad.status.startswith("rank deficient: T012 (2 observations) floats")
    assert np.isnan(bad.covariance).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_point_with_two_ranges_is_named_with_a_remedy(ranging_network, engine):
    network, _ = ranging_network(7)
    keep = (network.groups[0].target != 3 * 10) | (network.groups[0].origin < 6)
    status = adjust_network(with_ranges(network, keep=keep), engine=engine).status
    assert status.startswith("rank deficient: T005 (2 observations) floats; it can move along")
    assert "a range to" in status


def test_without_a_datum_the_six_motions_are_named(ranging_network):
    network, _ = ranging_network(8)
    loose = replace(network, points=replace(network.points, datum=np.zeros_like(network.points.datum)))
    status = adjust_network(loose, engine="dense").status
    assert status.startswith("rank deficient: the network floats (shift along x, shift along y, shift along z, turn")
    assert "--datum free" in status
    assert adjust_network(loose, engine="dense", datum="free").status == "converged"


def test_a_datum_of_two_points_does_not_hold_the_turn_about_their_line(ranging_network):
    network, _ = ranging_network(9)
    datum = np.zeros_like(network.points.datum)
    datum[:2] = True
    weak = replace(network, points=replace(network.points, datum=datum))
    status = adjust_network(weak, engine="dense").status
    assert "do not hold the network against turn about" in status
    datum[2, 2] = True
    assert adjust_network(replace(network, points=replace(network.points, datum=datum))).status == "converged"


@pytest.mark.parametrize("engine", ENGINES)
def test_a_network_in_two_pieces_names_both(ranging_network, engine):
    a, _ = ranging_network(10, stations=5, targets=8)
    b, _ = ranging_network(11, stations=5, targets=9)
    n = len(a.points.names)
    points = NetworkPoints(
        (*a.points.names, *(f"B{name}" for name in b.points.names)),
        *(np.concatenate([getattr(a.points, k), getattr(b.points, k)]) for k in ("xyz", "fixed", "datum")),
    )
    other = replace(b.groups[0], origin=b.groups[0].origin + 3 * n, target=b.groups[0].target + 3 * n)
    status = adjust_network(ObservationNetwork(points, (), (a.groups[0], other)), engine=engine).status
    assert status.startswith("rank deficient: the network is in 2 pieces")
    assert "S01" in status
    assert "BS01" in status


@pytest.mark.parametrize("engine", ENGINES)
def test_a_flat_network_floats_out_of_its_plane(ranging_network, engine):
    network, _ = ranging_network(12, flat=True, off=0.0)
    solution = adjust_network(network, engine=engine)
    assert solution.status.startswith("rank deficient")
    assert "z" in solution.status
    assert np.isnan(solution.covariance).all()


def test_two_stations_exchanged_are_named(ranging_network):
    network, _ = ranging_network(13, targets=5, off=0.0)  # 55 pairs are tried
    held = network.points.fixed.copy()
    held[:6] = True
    exchanged = network.points.xyz.copy()
    exchanged[[1, 4]] = exchanged[[4, 1]]
    free = adjust_network(replace(network, points=replace(network.points, xyz=exchanged)))
    fixed = adjust_network(replace(network, points=replace(network.points, xyz=exchanged, fixed=held)))
    for solution in (free, fixed):
        assert solution.status != "converged"
        assert "S02" in solution.status
        assert "S05" in solution.status


def test_an_exchange_that_does_not_explain_all_is_not_named(ranging_network):
    network, _ = ranging_network(13, targets=5)  # what is held is 1 cm off: exchanged back, the factor is 6.7e4
    held = network.points.fixed.copy()
    held[:6] = True
    exchanged = network.points.xyz.copy()
    exchanged[[1, 4]] = exchanged[[4, 1]]
    status = adjust_network(replace(network, points=replace(network.points, xyz=exchanged, fixed=held))).status
    assert status.startswith("converged, but the observations contradict each other")
    assert "exchanged" not in status


def test_ranges_that_contradict_are_named_with_their_place(ranging_network):
    network, _ = ranging_network(14)
    observed = network.groups[0].observed.copy()
    observed[17] += 0.5
    places = (tuple(f"line {i + 2}" for i in range(len(observed))),)
    status = adjust_network(replace(with_ranges(network, observed=observed), places=places)).status
    assert status.startswith("converged, but the observations contradict each other")
    assert "S02 - T006, line 19" in status


def test_a_zero_sigma_is_refused(ranging_network):
    network, _ = ranging_network(15)
    covariance = network.groups[0].covariance.copy()
    covariance[3] = 0.0
    with pytest.raises(EstimationError, match="a sigma is zero"):
        adjust_network(with_ranges(network, covariance=covariance))


def test_a_levelled_theodolite_leaves_shift_turn_and_scale_open():
    rng = np.random.default_rng(16)
    true = rng.uniform(-50, 50, (8, 3))
    names = tuple(f"P{i}" for i in range(8))
    origin, target = np.repeat([0, 1, 2], 7), np.concatenate([np.delete(np.arange(8), i) for i in (0, 1, 2)])
    columns = 24 + np.repeat([0, 1, 2], 7)
    along = true[target] - true[origin]
    bearing = np.arctan2(along[:, 0], along[:, 1]) + 0.3
    zenith = np.arctan2(np.hypot(along[:, 0], along[:, 1]), along[:, 2])
    variance = np.full(21, 1e-10)
    nothing = np.zeros((8, 3), dtype=bool)
    network = ObservationNetwork(
        NetworkPoints(names, true, nothing, nothing),
        tuple(NetworkParameter(f"orientation {i}", -0.3, unit="rad") for i in range(3)),
        (
            Directions("directions", bearing, variance, 3 * origin, 3 * target, columns),
            ZenithAngles("zenith", zenith, variance, 3 * origin, 3 * target),
        ),
    )
    status = adjust_network(network, engine="dense").status
    assert "(shift along x, shift along y, shift along z, turn about z, scale)" in status
    azimuth = Azimuths("azimuth", bearing[:1] - 0.3, variance[:1], 3 * origin[:1], 3 * target[:1])
    turned = replace(network, groups=(*network.groups, azimuth))
    assert "(shift along x, shift along y, shift along z, scale)" in adjust_network(turned, engine="dense").status
    ranged = Distances("range", np.linalg.norm(along[:1], axis=1), variance[:1], 3 * origin[:1], 3 * target[:1])
    free = adjust_network(replace(turned, groups=(*turned.groups, ranged)), engine="dense", datum="free")
    assert free.status == "converged"
    assert "shift along x, shift along y, shift along z" in free.datum
    np.testing.assert_allclose(free.x, true, atol=1e-6)


def test_3_2_1_holds_six_coordinates_and_changes_no_residual(ranging_network):
    network, _ = ranging_network(17)
    free = adjust_network(network)
    fixed = np.zeros_like(network.points.fixed)
    fixed[0], fixed[2, 1:], fixed[4, 2] = True, True, True
    points = replace(network.points, xyz=free.x, fixed=fixed, datum=np.zeros_like(fixed))
    held = adjust_network(replace(network, points=points))
    assert held.status == "converged"
    np.testing.assert_allclose(held.fits[0].residual, free.fits[0].residual, atol=1e-9)
    np.testing.assert_allclose(held.fits[0].redundancy, free.fits[0].redundancy, atol=1e-7)
    assert np.all(held.covariance[0] == 0.0)
    assert held.degrees_of_freedom == pytest.approx(free.degrees_of_freedom, abs=1e-6)


def test_stochastic_points_hold_the_datum_with_their_own_uncertainty(ranging_network):
    network, true = ranging_network(18)
    nothing = np.zeros_like(network.points.datum)
    u = 2e-3
    survey = ObservedCoordinates.of_points("survey", true[:6], np.full(18, u**2), 3 * np.arange(6))
    solution = adjust_network(
        replace(network, points=replace(network.points, datum=nothing), groups=(*network.groups, survey))
    )
    assert solution.status == "converged"
    middle = solution.block(network.points.names[:6]).reshape(6, 3, 6, 3).mean(axis=(0, 2))
    # ranges say nothing about where the whole network is: its mean is as uncertain as the mean of six surveyed points
    np.testing.assert_allclose(np.diag(middle), u**2 / 6, rtol=1e-6)
    assert solution.degrees_of_freedom == pytest.approx(72 + 18 - 54, abs=1e-6)


def test_zeros_and_scales_are_found_with_their_uncertainty(ranging_network):
    network, true = ranging_network(19, stations=8, targets=30, sigma=1e-5)
    ranges = network.groups[0]
    station = ranges.origin // 3
    zero, scale = np.linspace(-2e-3, 2e-3, 8), 1e-5 * np.linspace(-1, 1, 8)
    length = np.linalg.norm(true.ravel()[ranges.target[:, None] + np.arange(3)] - true[station], axis=1)
    observed = ranges.observed + zero[station] + scale[station] * length
    n = true.size
    fixed = np.zeros_like(network.points.fixed)
    fixed[:8] = True
    parameters = [NetworkParameter(f"zero {i}", unit="m") for i in range(8)] + [
        NetworkParameter(f"scale {i}") for i in range(8)
    ]
    changed = replace(ranges, observed=observed, nuisance=(n + station)[:, None], scaling=(n + 8 + station)[:, None])
    points = replace(network.points, xyz=np.where(fixed, true, network.points.xyz), fixed=fixed)
    solution = adjust_network(replace(network, points=points, parameters=tuple(parameters), groups=(changed,)))
    assert solution.status == "converged"
    off = solution.parameters - np.concatenate([zero, scale])
    assert np.abs(off / solution.u_parameters).max() < 4.0
    assert solution.u_parameters.max() < 1e-4


@pytest.mark.parametrize("engine", ["dense", "ranging"])
def test_a_network_with_nothing_known_calibrates_itself(ranging_network, engine):
    """The National Physical Laboratory's way: stations and targets unknown, the network's shape from ranges alone."""
    network, true = ranging_network(20, stations=8, targets=25)
    unknown = replace(network, points=replace(network.points, xyz=np.full_like(true, np.nan), datum=true > np.inf))
    assert adjust_network(unknown, engine="dense").status.startswith("rank deficient: the network floats")
    solution = adjust_network(unknown, engine=engine, datum="free")
    assert solution.status == "converged"
    known = adjust_network(network, engine="dense")
    np.testing.assert_allclose(solution.fits[0].residual, known.fits[0].residual, atol=1e-7)
    apart = [np.linalg.norm(s.x[:, None] - s.x[None], axis=2) for s in (solution, known)]
    np.testing.assert_allclose(apart[0], apart[1], atol=1e-7)
    assert solution.degrees_of_freedom == known.degrees_of_freedom


@pytest.mark.parametrize("engine", ENGINES)
def test_a_network_that_is_almost_flat_is_weak_not_floating(ranging_network, engine):
    network, flat = ranging_network(21, stations=8, flat=True, off=0.0)
    true = flat.copy()
    true[:, 2] = 2e-3 * np.random.default_rng(21).standard_normal(len(true))  # millimetres in a hundred metres
    ranges = network.groups[0]
    length = np.linalg.norm(true[ranges.target // 3] - true[ranges.origin // 3], axis=1)
    exact = replace(ranges, observed=length, covariance=np.full(len(length), 1e-20))
    solution = adjust_network(
        replace(network, points=replace(network.points, xyz=true), groups=(exact,)), engine=engine
    )
    assert solution.status == "converged"
    u = np.sqrt(np.einsum("nii->ni", solution.covariance))
    assert np.median(u[:, 2]) > 1e3 * np.median(u[:, :2])  # a slope of some 2e-5 carries height


@pytest.mark.parametrize("engine", ENGINES)
def test_a_target_seen_from_stations_a_millimetre_apart_is_weak_not_floating(engine):
    rng = np.random.default_rng(22)
    true = np.concatenate([1e-3 * rng.uniform(-1, 1, (8, 3)), [[50.0, 60.0, 40.0]]])
    length = np.linalg.norm(true[8] - true[:8], axis=1)
    ranges = Distances("ranges", length, np.full(8, 1e-20), 3 * np.arange(8), np.full(8, 24))
    fixed = np.arange(9)[:, None] < np.full(3, 8)
    names = tuple(f"P{i}" for i in range(9))
    network = ObservationNetwork(NetworkPoints(names, true, fixed, np.zeros_like(fixed)), (), (ranges,))
    solution = adjust_network(network, engine=engine)
    assert solution.status == "converged"
    along = true[8] / np.linalg.norm(true[8])
    u = np.sqrt(np.linalg.eigvalsh(solution.covariance[8]))
    assert np.sqrt(along @ solution.covariance[8] @ along) < 1e-9  # ranges of 0.1 nm, and directions within 1e-5
    assert 3e-6 < u[2] < 3e-4


@pytest.mark.parametrize("targets", [12, 220])
def test_given_coordinates_exchanged_in_the_datum_are_named_though_every_range_fits(ranging_network, targets):
    network, _ = ranging_network(23, stations=9, targets=targets)
    xyz = network.points.xyz.copy()
    xyz[[2, 6]] = xyz[[6, 2]]
    good = adjust_network(network)
    solution = adjust_network(replace(network, points=replace(network.points, xyz=xyz)), start=good)
    assert good.status == "converged"
    assert solution.variance_factor == pytest.approx(good.variance_factor, rel=1e-6)
    assert solution.status.startswith("converged, but S03 and S07 appear exchanged")


def test_points_on_a_line_do_not_turn_about_it():
    true, everywhere = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 3.0]]), np.ones((2, 3), dtype=bool)
    vector = Vectors("v", np.array([10.01, 0.0, 3.0]), np.full(3, 1e-6), np.array([0]), np.array([3]))
    solution = adjust_network(
        ObservationNetwork(NetworkPoints(("A", "B"), true, ~everywhere, everywhere), (), (vector,))
    )
    assert solution.status == "converged"
    assert solution.datum.endswith("against shift along x, shift along y, shift along z")
    np.testing.assert_allclose(solution.x, [[-0.005, 0, 0], [10.005, 0, 3]], atol=1e-12)
    np.testing.assert_allclose(solution.covariance, np.tile(np.eye(3) * 1e-6 / 4, (2, 1, 1)), atol=1e-15)


def test_unsettled_datum_is_reported(ranging_network, monkeypatch):
    network, _ = ranging_network(24, off=0.5)
    monkeypatch.setattr(
        network_adjustment, "ROUNDS", 1
    )  # the first pass holds the fewest coordinates, half a metre off
    solution = adjust_network(network, engine="dense")
    assert solution.status.startswith("not converged: the network did not settle in its datum")
