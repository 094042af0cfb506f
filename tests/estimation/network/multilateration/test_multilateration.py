"""The ranging network: against an independent program, dense algebra written here, and the solver of `adjustment`."""

import csv
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catseye.errors import EstimationError, InputError
from catseye.estimation.least_squares.adjustment import SolverSettings, adjust
from catseye.estimation.least_squares.status import CONVERGED
from catseye.estimation.network.multilateration import gauss_newton
from catseye.estimation.network.multilateration.gauss_newton import adjust_ranges
from catseye.estimation.network.multilateration.network import RangingNetwork
from catseye.estimation.network.multilateration.terms import PointPriors, StationRanges
from catseye.estimation.observations.kinds import Linear
from repository import TESTS

FOLDER = TESTS / "vectors" / "networks" / "ranging-18x500"
ENGINES = ("numpy", "numba")


def room(seed=1, s=7, t=14, *, seen=1.0, noise=1.0, offset=0.003, zeros=0.0, scales=0.0, sigma=2e-5, repeats=0, **more):
    """A network in a hall of 40 m, observed with noise, started `offset` away from the truth."""
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * np.arange(s) / s
    stations = np.stack([25 * np.cos(angle), 20 * np.sin(angle), rng.uniform(0, 9, s)], axis=1)
    targets = rng.uniform([-14, -12, 1], [14, 12, 14], (t, 3))
    station, target = (i.ravel() for i in np.meshgrid(np.arange(s), np.arange(t), indexing="ij"))
    kept = (rng.random(s * t) < seen) | (station < 4)  # four stations see everything: each target has a place
    station, target = station[kept], target[kept]
    station, target = np.append(station, station[:repeats]), np.append(target, target[:repeats])
    zero, scale = zeros * rng.standard_normal(s), scales * rng.standard_normal(s)
    true = np.linalg.norm(targets[target] - stations[station], axis=1)
    claimed = sigma * rng.uniform(0.7, 1.5, len(true))
    observed = (1 + scale[station]) * true + zero[station] + noise * claimed * rng.standard_normal(len(true))
    starts = [x + offset * rng.standard_normal(x.shape) for x in (stations, targets)]
    marks = {} if "held_stations" in more else {"datum_stations": np.ones((s, 3), dtype=bool)}
    return RangingNetwork(*starts, station, target, observed, claimed, **{**marks, **more})


def marked(count, *where):
    """(count, 3) bool, true at the (point, axis) pairs given, or at whole points."""
    marks = np.zeros((count, 3), dtype=bool)
    for place in where:
        marks[place] = True
    return marks


def three_two_one():
    """Six coordinates that hold a network."""
    return marked(7, 0, (2, 1), (2, 2), (4, 2))


def spd(count, seed=5, size=1e-4):
    a = np.random.default_rng(seed).standard_normal((count, 3, 3))
    return size**2 * (a @ a.transpose(0, 2, 1) + np.eye(3))


def prior(points, index, size=1e-4):
    """Priors of some points at the starts given, correlated inside."""
    index = np.asarray(index)
    return PointPriors(index, np.asarray(points)[index] + size, spd(len(index), size=size))


def variants():
    """Networks of every kind, by name."""
    base = room()
    far = np.full(7, np.inf)
    some = np.array([np.inf, 0, 1e-5, np.inf, 0, 1e-4, 2e-5])
    held = marked(14, 3, (5, 2))
    between = StationRanges(
        np.array([0, 2, 1]),
        np.array([3, 5, 6]),
        np.linalg.norm(base.stations[[3, 5, 6]] - base.stations[[0, 2, 1]], axis=1),
        np.full(3, 1e-4),
    )
    everything = {"zero_sigma": some, "scale_sigma": some[::-1] * 0.1, "between": between}
    return {
        "free": base,
        "a third missing": room(2, s=9, seen=0.5),
        "repeated": room(3, repeats=11),
        "zeros": room(4, zero_sigma=far, zeros=1e-3),
        "zeros and scales, free size": room(5, t=25, zero_sigma=far, scale_sigma=far, zeros=1e-3, scales=1e-5),
        "part of zeros and scales": room(6, t=25, **everything, zeros=1e-5, scales=1e-6, repeats=5),
        "held": room(7, held_stations=three_two_one(), held_targets=held, offset=1e-5),
        "station priors": replace(base, station_priors=prior(base.stations, [0, 2, 5]), datum_stations=None),
        "target priors": replace(
            base, target_priors=prior(base.targets, [1, 4, 9]), zero_sigma=some, datum_stations=None
        ),
        "datum of targets": replace(base, datum_stations=None, datum_targets=marked(14, 0, 3, 7, 9)),
        "datum of all": room(8, datum_targets=np.ones((14, 3), dtype=bool), zero_sigma=far, zeros=1e-3, seen=0.8),
        "datum of some coordinates": replace(
            base,
            datum_stations=marked(7, (0, 0), (0, 1), (2, 2), (3, 0), (5, 2)),
            datum_targets=marked(14, (2, 2), (6, 0)),
        ),
        "one point held, turns by datum": replace(base, held_stations=marked(7, 0)),
    }


VARIANTS = variants()
named = pytest.mark.parametrize("name", VARIANTS)


# --- against the file


def read_ranging():
    points, ranges, expected = (
        list(csv.DictReader((FOLDER / f"{name}.csv").read_text().splitlines()))
        for name in ("points", "ranges", "expected")
    )
    stations = [p for p in points if p["role"] == "datum"]
    targets = [p for p in points if p["role"] != "datum"]
    order = [p["point"] for p in stations + targets]
    row = {name: i for i, name in enumerate(order)}

    def table(rows, prefix=""):
        return np.array([[float(r[prefix + axis]) for axis in "xyz"] for r in rows])

    network = RangingNetwork(
        table(stations),
        table(targets),
        np.array([row[r["from"]] for r in ranges]),
        np.array([row[r["to"]] for r in ranges]) - len(stations),
        np.array([float(r["distance"]) for r in ranges]),
        np.array([float(r["sigma"]) for r in ranges]),
        datum_stations=np.ones((len(stations), 3), dtype=bool),
    )
    expected.sort(key=lambda r: row[r["point"]])
    return network, table(expected), table(expected, "u_")


@pytest.mark.parametrize("engine", ENGINES)
def test_the_network_of_18_stations_and_500_targets_is_that_of_an_independent_program(engine):
    network, x, u = read_ranging()
    solution = adjust_ranges(network, engine=engine).require_converged()
    got = np.concatenate([solution.stations, solution.targets])
    covariance = np.concatenate([solution.covariance_stations, solution.covariance_targets])
    assert solution.degrees_of_freedom == 7452
    assert solution.pvv == pytest.approx(7362.7388, abs=5e-5)  # its printed digits
    assert np.abs(got - x).max() < 3.5e-9  # 3 nm between programs, 0.5 nm of the printed digits
    assert np.abs(np.sqrt(np.einsum("kii->ki", covariance)) - u).max() < 1e-9  # the last printed digit


# --- against dense algebra


def columns_of(network):
    """Columns of the stations' (S, 5) and targets' (T, 3) parameters in a dense vector, and its length."""
    s, t = len(network.stations), len(network.targets)
    stations = np.arange(s)[:, None] * 5 + np.arange(5)
    return stations, 5 * s + np.arange(3 * t).reshape(t, 3), 5 * s + 3 * t


def dense_start(network):
    stations, targets, n = columns_of(network)
    x = np.zeros(n)
    x[stations[:, :3]], x[targets] = network.stations, network.targets
    return x


def dense_free(network):
    stations, targets, n = columns_of(network)
    free = np.ones(n, dtype=bool)
    if network.held_stations is not None:
        free[stations[:, :3][network.held_stations]] = False
    if network.held_targets is not None:
        free[targets[network.held_targets]] = False
    for i, sigma in ((3, network.zero_sigma), (4, network.scale_sigma)):
        free[stations[:, i]] = False if sigma is None else np.asarray(sigma) > 0
    return free


class Stretched:
    """The ranges of a network as a group of `adjustment`, written independently of the elimination."""

    name = "ranges"

    def __init__(self, network):
        self.stations, self.targets, n = columns_of(network)
        self.network, self.columns = network, np.arange(n)
        self.observed, self.covariance = network.distance, network.sigma**2

    def predict(self, x):
        ends = x[self.targets[self.network.target]] - x[self.stations[self.network.station, :3]]
        length = np.sqrt((ends**2).sum(axis=1))
        zero, scale = x[self.stations[self.network.station, 3]], x[self.stations[self.network.station, 4]]
        jacobian, row = np.zeros((len(length), len(x))), np.arange(len(length))
        u = ((1 + scale) / length)[:, None] * ends
        jacobian[row[:, None], self.targets[self.network.target]] = u
        jacobian[row[:, None], self.stations[self.network.station, :3]] = -u
        jacobian[row, self.stations[self.network.station, 3]] = 1.0
        jacobian[row, self.stations[self.network.station, 4]] = length
        return (1 + scale) * length + zero, jacobian


class Between:
    """Ranges between stations, the same way."""

    name = "between stations"

    def __init__(self, network):
        self.stations, _, n = columns_of(network)
        self.between, self.columns = network.between, np.arange(n)
        self.observed, self.covariance = network.between.distance, network.between.sigma**2

    def predict(self, x):
        first, second = self.stations[self.between.first, :3], self.stations[self.between.second, :3]
        along = x[second] - x[first]
        length = np.sqrt((along**2).sum(axis=1))
        jacobian, row = np.zeros((len(length), len(x))), np.arange(len(length))[:, None]
        jacobian[row, second], jacobian[row, first] = along / length[:, None], -along / length[:, None]
        return length, jacobian


def dense_groups(network):
    stations, targets, _ = columns_of(network)
    groups = [Stretched(network)]
    if network.between is not None:
        groups.append(Between(network))
    for name, known, at in (
        ("station priors", network.station_priors, stations[:, :3]),
        ("target priors", network.target_priors, targets),
    ):
        if known is not None:
            k = len(known.index)
            c = np.zeros((3 * k, 3 * k))
            for i in range(k):
                c[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = known.covariance[i]
            groups.append(Linear(name, known.observed.ravel(), c, at[known.index].ravel(), np.eye(3 * k)))
    for i, name, sigma in ((3, "zero priors", network.zero_sigma), (4, "scale priors", network.scale_sigma)):
        index = np.flatnonzero((np.asarray(sigma) > 0) & np.isfinite(sigma)) if sigma is not None else []
        if len(index):
            variance = np.asarray(sigma)[index] ** 2
            groups.append(Linear(name, np.zeros(len(index)), variance, stations[index, i], np.eye(len(index))))
    return groups


def dense_answer(solution):
    """The solution's parameters as a dense vector."""
    stations, targets, n = columns_of(solution.network)
    x = np.zeros(n)
    x[stations[:, :3]], x[targets] = solution.stations, solution.targets
    x[stations[:, 3]], x[stations[:, 4]] = solution.zero, solution.scale
    return x


@named
def test_residual_statistics_equal_those_of_the_dense_solver(name):
    """The dense solver gets what floats as observations without redundancy: residuals do not feel them."""
    network = VARIANTS[name]
    solution = adjust_ranges(network, engine="numpy").require_converged()
    x, groups = dense_answer(solution), dense_groups(network)
    held = dense_free(network)
    motions = null_space(network, groups, x, held)
    pin = [Linear("datum", motions.T @ x, 1e-4 * np.ones(motions.shape[1]), np.arange(len(x)), motions.T)]
    dense = adjust(x, groups + (pin if motions.shape[1] else []), free=held).require_converged()
    assert dense.x == pytest.approx(x, abs=3e-10)  # a step of 1e-3 sigma from there, at most
    fits = [f for f in dense.fits if f.name != "datum"]
    assert [f.name for f in fits] == [f.name for f in solution.fits]
    for ours, theirs in zip(solution.fits, fits, strict=True):
        assert ours.redundancy == pytest.approx(theirs.redundancy, abs=1e-6)
        checked = theirs.redundancy > 1e-3
        for quantity in ("residual", "sigma", "standardised", "estimated_error", "detectable_error"):
            got, expected = getattr(ours, quantity)[checked], getattr(theirs, quantity)[checked]
            assert got == pytest.approx(expected, rel=1e-5, abs=1e-5 * np.abs(expected).max())
    total = sum(f.redundancy.sum() for f in solution.fits)
    assert total == pytest.approx(solution.degrees_of_freedom, abs=1e-7)
    assert sum(f.pvv for f in solution.fits) == pytest.approx(solution.pvv, rel=1e-9)


def whitened(groups, x):
    rows, off = [], []
    for group in groups:
        values, jacobian = group.predict(x)
        full = np.zeros((len(values), len(x)))
        full[:, group.columns] = jacobian
        c = group.covariance if group.covariance.ndim == 2 else np.diag(group.covariance)
        factor = np.linalg.cholesky(c)
        rows.append(np.linalg.solve(factor, full))
        off.append(np.linalg.solve(factor, group.observed - values))
    return np.concatenate(rows), np.concatenate(off)


def null_space(network, groups, x, free):
    """Orthonormal motions that no observation sees, zero where held: from singular vectors alone, no geometry."""
    a = whitened(groups, x)[0][:, free]
    scale = 1.0 / np.sqrt((a**2).sum(axis=0))
    _, values, vectors = np.linalg.svd(np.linalg.qr(a * scale, mode="r"))
    rank = int((values > 1e-9 * values[0]).sum())
    out = np.zeros((len(x), free.sum() - rank))
    out[free] = np.linalg.qr(scale[:, None] * vectors[rank:].T)[0]
    return out


def datum_marks(network):
    stations, targets, n = columns_of(network)
    marks = np.zeros(n)
    for at, part in ((stations[:, :3], network.datum_stations), (targets, network.datum_targets)):
        if part is not None:
            marks[at[part]] = 1.0
    return marks


@cache
def nearest_covariance(name):
    """d answer / d observations of "least squares, nearest to the given datum coordinates", from numerical motions."""
    network = VARIANTS[name]
    solution = adjust_ranges(network, engine="numpy").require_converged()
    x, groups, free = dense_answer(solution), dense_groups(network), dense_free(network)
    a, v = whitened(groups, x)
    motions = null_space(network, groups, x, free)
    off = datum_marks(network) * (x - dense_start(network))
    assert np.abs(motions.T @ off).max(initial=0.0) < 1e-9  # no free motion brings the datum nearer
    assert np.abs(a[:, free].T @ v).max() * 1e-5 < 1e-2  # and no step lowers the residuals: 10 um times the gradient
    k = motions.shape[1]
    slope = np.zeros((len(x), k))  # of motions' (x - x0) by x, numerically: the motions change with x
    for i in np.flatnonzero(free) if k else ():
        for sign in (1.0, -1.0):
            moved = x.copy()
            moved[i] += sign * 1e-3
            near = null_space_near(network, groups, moved, free, motions)
            slope[i] += sign * near.T @ (datum_marks(network) * (moved - dense_start(network))) / 2e-3
    normal, n = a.T @ a, int(free.sum())
    border = np.zeros((n + k, n + k))
    scale = 1.0 / np.sqrt(np.diag(normal)[free])
    border[:n, :n] = normal[np.ix_(free, free)] * scale[:, None] * scale
    border[:n, n:] = motions[free] / scale[:, None] * 1e-5
    border[n:, :n] = (slope[free] * scale[:, None]).T * 1e5
    expected = np.zeros((len(x), len(x)))
    inverse = np.linalg.inv(border)[:n, :n] * scale[:, None] * scale
    expected[np.ix_(free, free)] = inverse @ normal[np.ix_(free, free)] @ inverse.T
    return expected


@named
@pytest.mark.parametrize("engine", ENGINES)
def test_covariances_are_those_of_the_nearest_network_derived_by_a_bordered_inverse(name, engine):
    """Tested on plain numpy, which agrees with the compiled form to a picometre (below)."""
    network, expected = VARIANTS[name], nearest_covariance(name)
    solution = adjust_ranges(network, engine=engine).require_converged()
    stations, targets, _ = columns_of(network)
    chosen = np.concatenate([stations[:, :3].ravel(), targets.ravel()])
    joint = solution.joint(range(len(stations)), range(len(targets)))
    wanted = expected[np.ix_(chosen, chosen)]
    assert joint == pytest.approx(wanted, abs=2e-6 * np.abs(wanted).max())  # the numerical slope's share
    s = np.arange(len(stations))
    own = expected[np.ix_(stations.ravel(), stations.ravel())].reshape(len(s), 5, len(s), 5)
    got = solution.covariance.reshape(len(s), solution.width, len(s), solution.width)
    for i in range(solution.width):
        limit = 2e-6 * np.abs(own[:, i, :, i]).max(initial=0.0)
        assert got[:, i, :, i] == pytest.approx(own[:, i, :, i], abs=limit + 1e-30)
    assert solution.covariance_targets == pytest.approx(
        np.array([expected[np.ix_(at, at)] for at in targets]), abs=2e-6 * np.abs(wanted).max()
    )


def null_space_near(network, groups, x, free, like):
    """The null space at x in the basis that follows `like`."""
    here = null_space(network, groups, x, free)
    left, _, right = np.linalg.svd(here.T @ like)
    return here @ left @ right


@named
def test_the_compiled_form_gives_what_plain_numpy_gives(name):
    plain, compiled = (adjust_ranges(VARIANTS[name], engine=engine) for engine in ENGINES)
    assert compiled.iterations == plain.iterations
    for quantity in ("stations", "targets", "zero", "scale", "residual"):
        assert getattr(compiled, quantity) == pytest.approx(getattr(plain, quantity), abs=1e-12)
    for quantity in ("redundancy", "covariance", "covariance_targets"):
        a, b = getattr(plain, quantity), getattr(compiled, quantity)
        assert b == pytest.approx(a, abs=1e-11 * np.abs(a).max())
    assert compiled.detectable == pytest.approx(plain.detectable, rel=1e-8)
    assert compiled.standardised == pytest.approx(plain.standardised, abs=1e-12 / 1e-5 / 0.05)  # residuals over u


@pytest.mark.parametrize("engine", ENGINES)
def test_several_blocks_of_targets_and_a_last_one_that_is_not_full(engine):
    """131 targets: two blocks of 64 lanes and 3 more; seen by stations in groups, so that blocks differ."""
    network = room(11, s=9, t=131, seen=0.6)
    cut = network.station // 3 != network.target % 5
    network = replace(
        network,
        station=network.station[cut],
        target=network.target[cut],
        distance=network.distance[cut],
        sigma=network.sigma[cut],
        held_targets=marked(131, *np.flatnonzero(np.bincount(network.target[cut], minlength=131) < 4)),
    )
    solution = adjust_ranges(network, engine=engine).require_converged()
    x, groups, free = dense_answer(solution), dense_groups(network), dense_free(network)
    a, v = whitened(groups, x)
    assert np.abs(a[:, free].T @ v).max() * 1e-5 < 1e-3
    assert solution.redundancy.sum() == pytest.approx(solution.degrees_of_freedom, abs=1e-6)
    other = adjust_ranges(network, engine=ENGINES[1 - ENGINES.index(engine)])
    assert solution.covariance_targets == pytest.approx(
        other.covariance_targets, abs=1e-10 * np.abs(other.covariance_targets).max()
    )


# --- laws


@pytest.mark.parametrize("engine", ENGINES)
@settings(max_examples=10)
@given(seed=st.integers(0, 10**6))
def test_the_order_of_the_ranges_does_not_matter(engine, seed):
    network = room(3, seen=0.9, repeats=6)
    order = np.random.default_rng(seed).permutation(len(network.distance))
    mixed = replace(network, **{k: getattr(network, k)[order] for k in ("station", "target", "distance", "sigma")})
    a, b = adjust_ranges(network, engine=engine), adjust_ranges(mixed, engine=engine)
    assert b.targets == pytest.approx(a.targets, abs=1e-11)
    assert b.standardised == pytest.approx(a.standardised[order], abs=1e-6)


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6), far=st.floats(-1e4, 1e4))
def test_moving_and_turning_everything_moves_and_turns_the_answer(seed, far):
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    network = room(seed % 17, seen=0.7)
    moved = replace(network, stations=network.stations @ turn.T + far, targets=network.targets @ turn.T + far)
    a, b = adjust_ranges(network), adjust_ranges(moved)
    assert a.status == b.status == CONVERGED
    assert b.targets == pytest.approx(a.targets @ turn.T + far, abs=1e-10)
    turned = turn @ a.covariance_targets @ turn.T
    assert b.covariance_targets == pytest.approx(turned, abs=1e-6 * np.abs(turned).max())  # 10 km away: roundoff of D


@settings(max_examples=15)
@given(unit=st.sampled_from([1e-3, 1.0, 1e3, 1e6]), claim=st.sampled_from([1e-3, 1.0, 1e3]), few=st.booleans())
def test_units_and_sigmas_do_not_change_what_is_decided(unit, claim, few):
    """Nanometres to kilometres, 20 nm to 20 mm at 40 m: same status, except for iterations."""
    network = room(5, seen=0.8, offset=1e-7 if claim < 1 else 1e-4, noise=claim)
    if few:
        kept = (network.target != 3) | (network.station < 2)
        network = replace(network, **{k: getattr(network, k)[kept] for k in ("station", "target", "distance", "sigma")})
    scaled = replace(
        network,
        stations=network.stations * unit,
        targets=network.targets * unit,
        distance=network.distance * unit,
        sigma=network.sigma * unit * claim,
    )
    solution = adjust_ranges(scaled)
    assert solution.status.startswith("rank deficient: target[3] is seen by") if few else solution.status == CONVERGED


@pytest.mark.parametrize("seed", range(6))
def test_further_range_never_increases_a_covariance(seed):
    network = room(seed, seen=0.5, noise=0.0)
    left_out = np.ones(len(network.distance))
    left_out[7 * seed] = np.inf
    before, after = adjust_ranges(network, inflation=left_out), adjust_ranges(network)
    s, t = range(7), range(14)
    growth = np.linalg.eigvalsh(before.joint(s, t) - after.joint(s, t))
    assert growth[-1] > 0.0
    assert growth[0] > -1e-9 * growth[-1]


@named
@pytest.mark.parametrize("engine", ENGINES)
def test_a_normal_matrix_that_is_kept_changes_no_standard_uncertainty_by_a_thousandth_of_a_percent(
    name, engine, monkeypatch
):
    anew = adjust_ranges(VARIANTS[name])
    monkeypatch.setattr(gauss_newton, "KEEP_FROM", 0)
    monkeypatch.setattr(gauss_newton, "KEEP_BELOW", 1e-2)  # more often than ever in use
    kept = adjust_ranges(VARIANTS[name], engine=engine).require_converged()
    assert kept.targets == pytest.approx(anew.targets, abs=1e-9)  # 1e-4 of a sigma
    assert kept.pvv == pytest.approx(anew.pvv, abs=1e-6)
    u, v = (np.sqrt(np.einsum("kii->ki", s.covariance_targets)) for s in (kept, anew))
    assert u == pytest.approx(v, abs=1e-5 * v.max())
    total = sum(f.redundancy.sum() for f in kept.fits)
    assert total == pytest.approx(kept.degrees_of_freedom, abs=1e-7)


# --- left out, inflated


@pytest.mark.parametrize("engine", ENGINES)
def test_a_range_left_out_is_tested_against_its_prediction(engine):
    network = room(9, repeats=3)
    bad = np.array([4, 40, len(network.distance) - 1])
    distance = network.distance.copy()
    distance[bad] += 0.02
    inflation = np.ones(len(distance))
    inflation[bad], inflation[7] = np.inf, 3.0
    solution = adjust_ranges(replace(network, distance=distance), inflation=inflation, engine=engine)
    kept = np.setdiff1d(np.arange(len(distance)), bad)
    sigma = network.sigma * np.where(np.isinf(inflation), 1.0, inflation)
    cut = replace(
        network,
        distance=distance[kept],
        sigma=sigma[kept],
        station=network.station[kept],
        target=network.target[kept],
    )
    without = adjust_ranges(cut, engine=engine).require_converged()
    assert solution.targets == pytest.approx(without.targets, abs=1e-12)
    for quantity in ("redundancy", "standardised", "detectable"):
        assert getattr(solution, quantity)[kept] == pytest.approx(getattr(without, quantity), rel=1e-9, abs=1e-9)
    assert solution.degrees_of_freedom == without.degrees_of_freedom
    for i in bad:
        s, t = int(network.station[i]), int(network.target[i])
        along = solution.targets[t] - solution.stations[s]
        u = along / np.linalg.norm(along)
        variance = np.concatenate([-u, u]) @ without.joint([s], [t]) @ np.concatenate([-u, u]) + network.sigma[i] ** 2
        assert solution.residual[i] == pytest.approx(distance[i] - np.linalg.norm(along), abs=1e-12)
        assert solution.standardised[i] == pytest.approx(solution.residual[i] / variance**0.5, rel=1e-8)
        assert solution.detectable[i] == pytest.approx(4.13 * variance**0.5, rel=1e-8)
        assert solution.estimated_error[i] == solution.residual[i]
        assert solution.redundancy[i] == 1.0


# --- scatter


def scatter(runs, seed):
    """Mean of the normalised squares over runs: of targets and stations jointly, and of standardised residuals."""
    rng = np.random.default_rng(seed)
    quiet = room(12, s=6, t=10, noise=0.0, offset=0.0, zero_sigma=np.full(6, np.inf))
    s, t = range(6), range(10)
    exact = adjust_ranges(quiet)
    values, vectors = np.linalg.eigh(exact.joint(s, t))
    seen = values > 1e-9 * values[-1]  # the datum's seven conditions leave no scatter in as many directions
    total = tests = 0.0
    for _ in range(runs):
        noisy = quiet.distance + quiet.sigma * rng.standard_normal(len(quiet.distance))
        solution = adjust_ranges(replace(quiet, distance=noisy))
        off = np.concatenate([solution.stations - quiet.stations, solution.targets - quiet.targets]).ravel()
        total += np.sum((vectors[:, seen].T @ off) ** 2 / values[seen])
        tests += np.mean(solution.standardised**2)
        assert solution.status == CONVERGED
    return total / runs, int(seen.sum()), tests / runs


def test_the_claimed_covariance_is_the_scatter_of_60_seeded_runs():
    mean, rank, tests = scatter(60, 1)
    assert rank == 3 * 16 - 6
    assert mean == pytest.approx(rank, abs=4 * (2 * rank / 60) ** 0.5)  # chi-square: four of its standard deviations
    assert tests == pytest.approx(1.0, abs=0.15)


@pytest.mark.slow
def test_the_claimed_covariance_is_the_scatter_of_2000_seeded_runs():
    mean, rank, tests = scatter(2000, 2)
    assert mean == pytest.approx(rank, abs=4 * (2 * rank / 2000) ** 0.5)
    assert tests == pytest.approx(1.0, abs=0.03)


# --- starts


@pytest.mark.parametrize("seed", range(6))
def test_a_start_one_percent_of_the_size_off_finds_the_same_answer(seed):
    """40 cm in a hall of 40 m; the datum is the start, so only distances compare."""
    near, far = (room(20 + seed, noise=0.0, offset=o) for o in (0.0, 0.4))
    assert not np.allclose(near.stations, far.stations, atol=0.1)
    solution = adjust_ranges(far).require_converged()
    assert solution.pvv < 1e-6
    got, true = (np.linalg.norm(n.targets[:, None] - n.stations, axis=2) for n in (solution, near))
    assert got == pytest.approx(true, abs=1e-9)


def test_the_cost_never_rises():
    """Far from the answer whole steps overshoot: the cost at every accepted state falls."""
    network = room(3, noise=0.0, offset=4.0)
    costs = [adjust_ranges(network, solver=SolverSettings(iterations=k, tests=False)).pvv for k in range(1, 12)]
    assert all(b <= a * (1 + 1e-9) for a, b in pairwise(costs))
    assert adjust_ranges(network, solver=SolverSettings(iterations=1, tests=False)).status.startswith(
        "not converged: the last step was"
    )


@pytest.mark.parametrize("seed", [2, 14, 31])
def test_starts_a_tenth_of_the_size_off_that_need_halving_find_the_answer(seed):
    """Whole steps alone do not descend here."""
    assert adjust_ranges(room(seed, noise=0.0, offset=4.0)).require_converged().pvv < 1e-6


# --- what has no answer


def status(network, **more):
    both = [adjust_ranges(network, engine=engine, **more).status for engine in ENGINES]
    assert both[0] == both[1]
    return both[0]


def without(network, dropped):
    kept = ~dropped
    return replace(network, **{k: getattr(network, k)[kept] for k in ("station", "target", "distance", "sigma")})


NAMES = {"station_names": [f"S{i:02d}" for i in range(1, 8)], "target_names": [f"T{i:02d}" for i in range(1, 15)]}


def test_a_target_seen_by_two_ranges_is_named():
    network = room(**NAMES)
    told = status(without(network, (network.target == 6) & (network.station > 1)))
    assert told.startswith("rank deficient: T07 is seen by 2 ranges and has 3 free coordinates; add ranges")
    told = status(without(network, np.isin(network.target, [6, 7, 8]) & (network.station > 0)))
    assert told.startswith("rank deficient: T07 is seen by 1 range and has 3 free coordinates (so do T08, T09); ")


def test_a_target_left_with_two_ranges_by_inflation_is_named():
    network = room(**NAMES)
    inflation = np.where((network.target == 6) & (network.station > 1), np.inf, 1.0)
    assert "T07 is seen by 2 ranges" in status(network, inflation=inflation)


def test_three_ranges_from_two_stations_do_not_place_a_target():
    network = room(repeats=98, **NAMES)
    assert "T07 is seen from 2 stations only" in status(without(network, (network.target == 6) & (network.station > 1)))


def test_two_ranges_and_a_height_place_a_target():
    network = room(**NAMES)
    network = without(network, (network.target == 6) & (network.station > 1))
    held = replace(network, held_targets=marked(14, (6, 2)))
    assert adjust_ranges(replace(held, held_stations=three_two_one())).status == CONVERGED
    known = replace(network, target_priors=prior(network.targets, [6]), datum_stations=None)
    assert "the whole network floats" not in adjust_ranges(known).status


@pytest.mark.parametrize("tilt", [0.0, 0.7])
def test_a_target_in_the_plane_of_its_stations_is_named(tilt):
    network = room(**NAMES, noise=0.0, offset=0.0)
    stations, targets = network.stations.copy(), network.targets.copy()
    stations[:, 2] = 1.0
    targets[4, 2] = 1.0
    turn = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    network = replace(network, stations=stations @ turn.T, targets=targets @ turn.T)
    assert "T05 lies on one plane with all 7 stations that see it" in status(network)
    flat = targets.copy()
    flat[:, 2] = 1.0
    told = status(replace(network, targets=flat @ turn.T))
    assert "lies on one plane with all 7 stations" in told
    assert "and 9 more" in told


def test_stations_and_targets_on_one_line():
    line = np.arange(21.0)[:, None] * np.array([1.0, 2.0, -0.5])
    network = room(**NAMES)
    told = status(replace(network, stations=line[:7], targets=line[7:]))
    assert "lies on one line with all 7 stations" in told


def test_a_network_without_datum_floats_by_six_motions_or_seven():
    bare = room(datum_stations=None)
    assert "floats (3 shifts and 3 turns); hold 6 more coordinates" in status(bare)
    far = np.full(7, np.inf)
    self_scaled = room(5, t=25, datum_stations=None, scale_sigma=far)
    assert "floats (3 shifts, 3 turns and the scale); hold 7 more" in status(self_scaled)
    assert adjust_ranges(replace(self_scaled, datum_stations=np.ones((7, 3), dtype=bool))).status == CONVERGED


def test_datum_with_a_free_rotation_names_it():
    base = room(offset=0.0, noise=0.0)
    stations = base.stations.copy()
    stations[0], stations[3] = (-25, 0, 2), (25, 0, 2)
    length = np.linalg.norm(base.targets[base.target] - stations[base.station], axis=1)
    two = replace(base, stations=stations, distance=length, datum_stations=marked(7, 0, 3))
    assert "the datum does not hold a turn about (1.00, 0.00, 0.00)" in status(two).replace("-1.00", "1.00").replace(
        "-0.00", "0.00"
    )
    two_held = replace(two, held_stations=marked(7, 0, 3), datum_stations=None)
    assert "floats (a turn about (1.00, 0.00, 0.00)); hold 1 more" in status(two_held).replace("-", "")
    assert adjust_ranges(replace(two_held, held_stations=marked(7, 0, 3, (5, 2)))).status == CONVERGED


def test_a_network_in_two_pieces_names_their_members():
    names = {"station_names": [f"S{i}" for i in range(10)], "target_names": [f"T{i:02d}" for i in range(20)]}
    network = room(s=10, t=20, **names)
    apart = (network.station < 5) != (network.target < 8)
    told = status(without(network, apart))
    assert "in 2 pieces" in told
    assert "[S0, S1, S2, S3 and 9 more] and [S5, S6, S7, S8 and 13 more]" in told
    bridge = StationRanges(np.zeros(6, int), np.arange(5, 10).repeat(2)[:6], np.ones(6), np.full(6, 1e-3))
    assert "pieces" not in adjust_ranges(replace(without(network, apart), between=bridge)).status


def test_a_station_without_ranges_is_named():
    network = room(**NAMES)
    assert "[S03]" in status(without(network, network.station == 2))


def test_inseparable_zero_and_scale_are_named():
    """All targets of one station lie at one distance: its zero and scale do the same."""
    network = room(5, t=25, noise=0.0, offset=0.0, station_names=NAMES["station_names"])
    targets = network.targets.copy()
    around = targets - network.stations[0]
    targets = network.stations[0] + 20.0 * around / np.linalg.norm(around, axis=1)[:, None]
    length = np.linalg.norm(targets[network.target] - network.stations[network.station], axis=1)
    free = np.where(np.arange(7) == 0, np.inf, 0.0)
    network = replace(network, targets=targets, distance=length, zero_sigma=free, scale_sigma=free)
    told = status(network)
    assert told.startswith("rank deficient: ")
    assert "zero of S01" in told
    assert "scale of S01" in told


def test_a_range_between_coinciding_points_is_named():
    network = room(**NAMES)
    targets = network.targets.copy()
    targets[2] = network.stations[4]
    assert status(replace(network, targets=targets)).startswith(
        "undefined at the current values: the range S05 to T03 "
    )


def test_two_stations_exchanged_end_in_a_contradiction():
    network = room(**NAMES, held_stations=np.ones((7, 3), dtype=bool), offset=1e-6)
    exchanged = np.array([0, 1, 5, 3, 4, 2, 6])[network.station]
    solution = adjust_ranges(replace(network, station=exchanged))
    assert solution.status.startswith(("contradictory: half of the residuals exceed", "not converged"))
    assert solution.variance_factor > 1e6
    with pytest.raises(EstimationError, match=solution.status[:12]):
        solution.require_converged()


def test_one_error_of_a_metre_contradicts_and_is_named_with_its_size():
    network = room(**NAMES)
    network.distance[33] += 1.0
    solution = adjust_ranges(network)
    assert solution.status.startswith("contradictory: half of the residuals exceed ")
    assert "at the range S03 to T06 (about 1 m off)" in solution.status
    assert np.argmax(np.abs(solution.standardised)) == 33
    assert solution.estimated_error[33] == pytest.approx(1.0, abs=0.05)
    assert "at the range" not in adjust_ranges(network, solver=SolverSettings(tests=False)).status


def test_an_error_of_a_millimetre_shows_in_its_test_alone():
    network = room()
    network.distance[33] += 1e-3
    solution = adjust_ranges(network).require_converged()
    assert np.argmax(np.abs(solution.standardised)) == 33
    assert abs(solution.standardised[33]) > 4.13
    assert solution.estimated_error[33] == pytest.approx(1e-3, abs=1e-4)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"sigma": (3, 0.0)}, "range 3, S01 to T04: distance .* sigma 0.0 m; both must be finite and sigma positive"),
        ({"sigma": (3, np.inf)}, "range 3, S01 to T04"),
        ({"distance": (5, np.nan)}, "range 5, S01 to T06: distance nan m"),
        ({"station": (2, 7)}, "range 2 names station 7, but there are 7"),
        ({"target": (2, -1)}, "range 2 names target -1, but there are 14"),
        ({"stations": ((1, 2), np.nan)}, "S02 starts at .*nan.*; every point needs approximate coordinates"),
    ],
)
def test_bad_input_is_refused_with_its_place(change, told):
    network = room(**NAMES)
    ((name, (where, value)),) = change.items()
    getattr(network, name)[where] = value
    for engine in ENGINES:
        with pytest.raises(InputError, match=told):
            adjust_ranges(network, engine=engine)


def test_bad_extras_are_refused():
    network = room(**NAMES)
    with pytest.raises(InputError, match="prior of S01 needs finite values and a positive definite"):
        adjust_ranges(
            replace(network, station_priors=PointPriors(np.array([0]), np.zeros((1, 3)), np.zeros((1, 3, 3))))
        )
    with pytest.raises(InputError, match=r"priors name point 2 \(expected below 7"):
        adjust_ranges(replace(network, station_priors=prior(network.stations, [2, 2])))
    with pytest.raises(InputError, match="zero of S03: start"):
        adjust_ranges(replace(network, zero_sigma=np.where(np.arange(7) == 2, -1.0, 0.0)))
    between = StationRanges(np.array([1]), np.array([1]), np.ones(1), np.ones(1))
    with pytest.raises(InputError, match="range 0 between stations 1 and 1"):
        adjust_ranges(replace(network, between=between))
    with pytest.raises(InputError, match="inflation needs 98 positive factors"):
        adjust_ranges(network, inflation=np.zeros(98))
    with pytest.raises(InputError, match='"numpy", "numba" or None'):
        adjust_ranges(network, engine="fortran")
    with pytest.raises(InputError, match="held marks are bool"):
        adjust_ranges(replace(network, held_stations=np.ones(7)))


def test_without_tests_the_answer_is_the_same_and_claims_nothing():
    network = room()
    bare, full = adjust_ranges(network, solver=SolverSettings(tests=False)), adjust_ranges(network)
    assert np.array_equal(bare.targets, full.targets)
    assert np.isnan(bare.covariance).all()
    assert np.isnan(bare.redundancy).all()
    assert bare.pvv == pytest.approx(np.sum((full.residual / network.sigma) ** 2), rel=1e-9)
    with pytest.raises(EstimationError, match="tests was False"):
        bare.joint([0])


def test_all_stations_held_is_position_by_position():
    network = room(noise=1.0, held_stations=np.ones((7, 3), dtype=bool), offset=1e-6)
    solution = adjust_ranges(network).require_converged()
    assert solution.covariance == pytest.approx(np.zeros((21, 21)))
    for t in range(14):
        seen = network.target == t
        groups = [
            Stretched(
                replace(network, **{k: getattr(network, k)[seen] for k in ("station", "target", "distance", "sigma")})
            )
        ]
        free = np.zeros(columns_of(network)[2], dtype=bool)
        at = columns_of(network)[1][t]
        free[at] = True
        dense = adjust(dense_start(network), groups, free=free).require_converged()
        assert solution.targets[t] == pytest.approx(dense.x[at], abs=2e-8)  # a last step of 1e-3 sigma
        assert solution.covariance_targets[t] == pytest.approx(dense.covariance[np.ix_(at, at)], rel=1e-6)
