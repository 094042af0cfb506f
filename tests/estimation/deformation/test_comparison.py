"""Two adjusted epochs are compared under the right model: carried datum or free, planted movements, false alarms."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from catseye.errors import EstimationError
from catseye.estimation.deformation import comparison, epoch_model
from catseye.estimation.deformation.comparison import ComparisonOptions, compare
from catseye.estimation.least_squares.adjustment import SolverSettings
from catseye.estimation.least_squares.status import AdjustmentOutcome, Status
from catseye.estimation.network.adjustment import NetworkSettings, adjust_network
from draws import draws
from repository import TESTS

METRO = TESTS / "vectors" / "networks" / "monitoring"
MONITORED = ("31", "32", "33", "34", "35", "41", "42", "43", "44", "45")
NEVER = 1e-250  # level: nothing is called moved
CARRIED = ("201", "202", "203", "204", "211", "212", "213", "214")


def adjusted(network, **options):
    return adjust_network(network, engine="dense", **options)


@pytest.fixture(scope="module")
def metro():
    """Both epochs as published: free, and with 201 to 214 held at the first's result rounded to 10 um."""
    from catseye.records.network.any_file import read_network

    return tuple(adjusted(read_network(METRO / f"phase-{i}-1TK.gkf")) for i in (0, 1))


def expected(phase):
    with (METRO / f"expected-phase-{phase}-1TK.csv").open() as file:
        return {row["id"]: np.array([float(row[axis]) for axis in "xyz"]) for row in csv.DictReader(file)}


def rows_of(found, names):
    """Rows of points in a comparison."""
    return [found.deformation.names.index(name) for name in names]


def measured(network, x, rng):
    """The network with observations drawn about the parameter vector x."""
    groups = []
    for group in network.groups:
        assert group.covariance.ndim == 1
        noise = rng.standard_normal(len(group.observed)) * np.sqrt(group.covariance)
        groups.append(replace(group, observed=group.predict(x)[0] + noise))
    return replace(network, groups=tuple(groups))


def vector(solution):
    return np.concatenate([solution.x.ravel(), solution.parameters])


def test_metro_displacements_match_two_other_programs(metro):
    """Differences of the published answers of GNU Gama and another; axes are the file's south and west."""
    found = compare(*metro)
    assert set(found.deformation.names) == {*MONITORED, *CARRIED, "4901", "4902"}
    theirs = [expected(1)[name] - expected(0)[name] for name in MONITORED]
    ours = found.difference[rows_of(found, MONITORED)] @ metro[0].network.axes
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=2e-6)  # the programs agree to 1 um each
    np.testing.assert_allclose(ours[[1, 4, 8], 0], [-1.05e-3, 0.70e-3, 0.56e-3], rtol=0, atol=1e-5)
    assert not found.difference[rows_of(found, CARRIED)].any()
    assert found.carried == CARRIED
    assert set(found.apart) == {"4901", "4902"}  # set up anew under old names
    assert found.apart["4901"] > 2.0
    for name in ("4901", "4902"):  # in the answer, with a displacement of metres that is known to a millimetre
        i = found.deformation.names.index(name)
        shift = metro[1].x[metro[1].index[name]] - metro[0].x[metro[0].index[name]]
        np.testing.assert_allclose(found.difference[i], shift, rtol=0, atol=1e-9)
        assert found.deformation.moved[i]
        assert (found.u[i] < 2e-3).all()
    assert found.doubts == ["moved so far that it may be another point of the same name: 4901 (2.54 m), 4902 (9.43 m)"]
    text = "\n".join(found.words)
    assert "possibly another point: 4901 (2.54 m), 4902 (9.43 m)" in text
    assert "treated as rounding to 10 um, u = 2.9 um each" in text
    assert "fixes 201, 202, 203, 204, 211, 212 and 2 more at the first's result" in text
    assert 1e-6 < found.rounding[0] <= 5.01e-6
    assert found.rounding[1] == pytest.approx(2.887e-6, abs=1e-9)


def test_the_large_metro_shifts_are_not_the_significant_ones(metro):
    """Checked only against ourselves, but for the scatter: along the tunnel u is 0.75 mm, across it 0.1 to 0.2."""
    found = compare(*metro, points=MONITORED)
    d = found.deformation
    assert d.before.degrees_of_freedom == 30
    assert d.before.pvv == pytest.approx(86.80, abs=0.1)
    assert d.before.p == pytest.approx(2.0e-7, rel=0.05)
    assert d.status.startswith("moved: 31, 33, 34; ")
    assert d.p[1] == pytest.approx(0.085, abs=0.005)  # 32, shifted by -1.05 mm
    assert d.p[0] == pytest.approx(8.8e-5, rel=0.05)
    along = np.abs(metro[0].network.axes[:, 0]).astype(bool)
    assert (found.u_difference[:10, along] > 0.7e-3).all()
    assert not found.apart
    again = compare(*metro)  # two stations set up anew change nothing for the others
    at = rows_of(again, d.names)
    np.testing.assert_allclose(again.deformation.p[at], d.p, rtol=1e-6)
    assert set(np.array(again.deformation.names)[again.deformation.moved]) == {"31", "33", "34", "4901", "4902"}
    scaled = compare(*metro, points=MONITORED, options=ComparisonOptions(scale_by_variance_factor=True))
    value = (1.02670 * 47 + 1.52458 * 70) / 117
    assert scaled.variance_factor.value == pytest.approx(value, abs=1e-4)
    assert scaled.homogeneity == pytest.approx(2 * stats.f.sf(1.52458 / 1.02670, 70, 47), rel=1e-3)
    np.testing.assert_allclose(scaled.deformation.before.p, stats.f.sf(d.before.pvv / value / 30, 30, 117), rtol=1e-3)
    np.testing.assert_allclose(scaled.difference_covariance, value * found.difference_covariance, rtol=1e-3, atol=1e-15)


def test_the_second_epoch_follows_its_held_points_as_readjusting_it_does(metro):
    """The covariance against the formula with a Jacobian by differences of whole adjustments."""
    first, second = metro
    rows = [second.index[name] for name in MONITORED]
    held = np.argwhere(second.network.points.fixed)
    assert len(held) == 24
    slope, h, quick = np.zeros((30, 24)), 1e-3, NetworkSettings(SolverSettings(tests=False))
    for k, (i, axis) in enumerate(held):
        ends = []
        for sign in (1, -1):
            xyz = second.network.points.xyz.copy()
            xyz[i, axis] += sign * h
            network = replace(second.network, points=replace(second.network.points, xyz=xyz))
            ends.append(adjusted(network, start=second, settings=quick).x[rows].ravel())
        slope[:, k] = (ends[0] - ends[1]) / (2 * h)
    own = first.block(MONITORED)
    datum = [second.network.points.names[i] for i in dict.fromkeys(held[:, 0])]
    joint = first.block([*MONITORED, *datum])
    q_dd, q_d0 = joint[30:, 30:], joint[30:, :30]
    q = second.block(MONITORED) + slope @ q_dd @ slope.T + own - slope @ q_d0 - q_d0.T @ slope.T
    q += found_rounding(metro) ** 2 * slope @ slope.T
    claimed = compare(*metro, points=MONITORED).difference_covariance
    for i in range(10):
        part = slice(3 * i, 3 * i + 3)
        np.testing.assert_allclose(claimed[i], q[part, part], rtol=0, atol=1e-4 * np.abs(q[part, part]).max())
    difference = (second.x[rows] - [first.x[first.index[name]] for name in MONITORED]).ravel()
    statistic = compare(*metro, points=MONITORED).deformation.before.pvv
    np.testing.assert_allclose(statistic, difference @ np.linalg.solve(q, difference), rtol=1e-3)


def found_rounding(metro):
    return compare(*metro).rounding[1]


def metro_scatter(metro, runs, seed):
    """Both epochs measured and adjusted anew, the second held at the first's result rounded to 10 um."""
    rng = np.random.default_rng(seed)
    truth = vector(metro[0])
    x = metro[1].x.copy()
    for name in (*MONITORED, *CARRIED):
        x[metro[1].index[name]] = metro[0].x[metro[0].index[name]]
    truth_second = np.concatenate([x.ravel(), metro[1].parameters])
    whites, ps, alarms, moved_whites = [], [], 0, []
    for _ in range(runs):
        first = adjusted(measured(metro[0].network, truth, rng), start=metro[0])
        network = measured(metro[1].network, truth_second, rng)
        xyz = network.points.xyz.copy()
        for name in CARRIED:
            xyz[metro[1].index[name]] = np.round(first.x[first.index[name]], 5)
        second = adjusted(replace(network, points=replace(network.points, xyz=xyz)), start=metro[1])
        found = compare(first, second, points=MONITORED)
        for value, q, sink in (
            (found.difference, found.difference_covariance, whites),
            (found.deformation.displacement, found.deformation.covariance, moved_whites),
        ):
            sink.append([np.linalg.solve(np.linalg.cholesky(q[i]), value[i]) for i in range(10)])
        ps.append(found.deformation.before.p)
        alarms += bool(found.deformation.moved.any())
    return np.array(whites), np.array(moved_whites), np.array(ps), alarms


def check_metro_scatter(metro, runs, seed):
    whites, moved_whites, p, alarms = metro_scatter(metro, runs, seed)
    for i in range(10):
        np.testing.assert_allclose(whites[:, i].T @ whites[:, i] / runs, np.eye(3), atol=5.0 * np.sqrt(2.0 / runs))
    assert np.abs(whites.mean(axis=0)).max() < 4.5 / np.sqrt(runs)
    quiet = p >= 0.05  # the search left the stable set alone
    spread = np.mean(moved_whites[quiet] ** 2)
    assert 0.8 < spread < 1.02  # cut off at the level: a little below 1
    assert stats.kstest(p, "uniform").pvalue > 1e-3
    for level in (0.05, 0.3):
        assert abs(np.mean(p < level) - level) < 3.5 * np.sqrt(level * (1 - level) / runs)
    assert abs(alarms / runs - 0.05) < 3.5 * np.sqrt(0.05 * 0.95 / runs)


@draws(100)
def test_the_claimed_covariance_of_metro_displacements_holds_in_a_few_runs(metro, runs):
    check_metro_scatter(metro, runs, 31)


@pytest.mark.slow
def test_the_claimed_covariance_of_metro_displacements_holds_in_2000_runs(metro):
    check_metro_scatter(metro, 2000, 32)


def test_taking_a_carried_datum_as_exact_or_independent_would_be_wrong(metro):
    """Why the model matters: with the second epoch's own covariance alone u along the tunnel is far too small."""
    right = compare(*metro, points=MONITORED).u_difference[:10]
    exact = np.sqrt([np.diag(metro[1].covariance[metro[1].index[name]]) for name in MONITORED])
    exact = np.sqrt(exact**2 + [np.diag(metro[0].covariance[metro[0].index[name]]) for name in MONITORED])
    assert (np.abs(exact / right - 1.0) > 0.05).any()


def twins(ranging_network, rng, *, moved=(), size=3e-4, sigma=2e-5, stations=8, targets=12, datums=(None, None)):
    """Two epochs of a free ranging network; the points named move by `size` in a random direction in between."""
    network, true = ranging_network(3, stations=stations, targets=targets, sigma=sigma)
    after = true.copy()
    for name in moved:
        step = rng.standard_normal(3)
        after[network.points.names.index(name)] += size * step / np.linalg.norm(step)
    epochs = []
    for x, datum in zip((true, after), datums, strict=True):
        drawn = measured(network, x.ravel(), rng)
        if datum is not None:
            fixed = np.zeros_like(network.points.fixed)
            xyz = network.points.xyz.copy()
            for i, axes in datum.items():
                fixed[i, axes] = True
                xyz[i, axes] = true[i, axes]
            drawn = replace(drawn, points=replace(drawn.points, fixed=fixed, datum=~fixed & False, xyz=xyz))
        epochs.append(adjusted(drawn))
    return epochs


PLANTED = ("S03", "T002", "T009")


@draws(30)
def test_two_targets_and_a_station_that_moved_are_found_and_no_other(ranging_network, runs):
    rng = np.random.default_rng(41)
    right = 0
    for _ in range(runs):
        found = compare(*twins(ranging_network, rng, moved=PLANTED))
        names = [found.deformation.names[i] for i in np.flatnonzero(found.deformation.moved)]
        assert set(PLANTED) <= set(names)
        right += len(names) == 3
        assert found.deformation.datum == "rigid"
    assert right >= 0.8 * runs  # the level itself costs 5 %


def check_false_alarms(ranging_network, runs, seed):
    rng = np.random.default_rng(seed)
    p, alarms = [], 0
    for _ in range(runs):
        found = compare(*twins(ranging_network, rng))
        p.append(found.deformation.before.p)
        alarms += bool(found.deformation.moved.any())
    limit = 3.5 * np.sqrt(0.05 * 0.95 / runs)
    assert abs(np.mean(np.array(p) < 0.05) - 0.05) < limit
    assert abs(alarms / runs - 0.05) < limit
    assert stats.kstest(p, "uniform").pvalue > 1e-3


@draws(200)
def test_where_nothing_moved_alarms_come_at_the_level_in_a_few_runs(ranging_network, runs):
    check_false_alarms(ranging_network, runs, 42)


@pytest.mark.slow
def test_where_nothing_moved_alarms_come_at_the_level_in_2000_runs(ranging_network):
    check_false_alarms(ranging_network, 2000, 43)


def test_holding_the_fewest_coordinates_anywhere_changes_no_decision(ranging_network):
    """Held 3-2-1 in both epochs, in the same or in other points, even in one that moved: a convention, no knowledge."""
    ways = ((None, None), ({0: [0, 1, 2], 1: [0, 2], 2: [2]},) * 2, ({2: [0, 1, 2], 4: [1, 2], 7: [2]}, None))
    results = [compare(*twins(ranging_network, np.random.default_rng(44), moved=PLANTED, datums=w)) for w in ways]
    plain = results[0].deformation
    assert plain.moved.sum() == 3
    for other in results[1:]:
        d = other.deformation
        np.testing.assert_array_equal(d.moved, plain.moved)
        assert not d.held.any()
        assert not other.carried
        # the given coordinates are 1 cm off: with the datum the axes turn by 0.1 mrad, and 0.3 mm by 30 nm
        np.testing.assert_allclose(d.displacement, plain.displacement, rtol=0, atol=1e-7)
        np.testing.assert_allclose(d.p[plain.moved], plain.p[plain.moved], rtol=0.05)
        np.testing.assert_allclose(other.difference, results[0].difference, rtol=0, atol=1e-7)
        scale = results[0].difference_covariance.max()
        np.testing.assert_allclose(
            other.difference_covariance, results[0].difference_covariance, rtol=0, atol=1e-3 * scale
        )


def test_points_fixed_in_both_epochs_define_the_datum(ranging_network):
    held = {0: [0, 1, 2], 1: [0, 1, 2], 2: [0, 1, 2]}
    found = compare(*twins(ranging_network, np.random.default_rng(45), moved=["T005"], datums=(held, held)))
    d = found.deformation
    assert [d.names[i] for i in np.flatnonzero(d.held)] == ["S01", "S02", "S03"]
    assert [d.names[i] for i in np.flatnonzero(d.moved)] == ["T005"]
    assert d.before.degrees_of_freedom == 3 * 17
    assert found.words[0].startswith("S01, S02, S03 are fixed in both epochs: ")
    i = d.names.index("T001")
    q = found.first.covariance[i] + found.second.covariance[i]
    np.testing.assert_allclose(found.difference_covariance[i], q, rtol=1e-6, atol=1e-6 * q.max())


def test_one_by_one_beside_a_frame_a_point_has_the_displacement_of_a_joint_adjustment(ranging_network):
    """Frame of stations: each target beside it as the joint test of stations and that target alone gives it."""
    rng = np.random.default_rng(46)
    first, second = twins(ranging_network, rng, moved=("T002", "T009"))
    turn = Rotation.from_rotvec([0.2, -0.4, 0.9]).as_matrix()
    stations = [f"S{i:02d}" for i in range(1, 9)]
    found = compare(first, second, frame=stations, options=ComparisonOptions(level=1e-3))
    d = found.deformation
    assert [d.names[i] for i in np.flatnonzero(d.moved)] == ["T002", "T009"]
    for name in ("T001", "T002", "T012"):
        alone = compare(first, second, points=[*stations, name], options=ComparisonOptions(level=NEVER))
        i, j = d.names.index(name), alone.deformation.names.index(name)
        np.testing.assert_allclose(d.displacement[i], alone.deformation.displacement[j], rtol=0, atol=3e-9)
        scale = d.covariance[i].max()
        np.testing.assert_allclose(d.covariance[i], alone.deformation.covariance[j], rtol=0, atol=1e-4 * scale)
        np.testing.assert_allclose(d.statistic[i], alone.deformation.statistic[j], rtol=1e-3)
    plain = compare(first, second, points=stations, options=ComparisonOptions(level=NEVER))
    np.testing.assert_allclose(found.difference[:8], plain.difference, rtol=0, atol=1e-9)
    assert turned_alike(first, second, turn, found, stations)
    with pytest.raises(EstimationError, match="S77 of the frame: not among the points compared"):
        compare(first, second, frame=["S01", "S77"])
    with pytest.raises(EstimationError, match=r"nothing to test|do not determine the datum"):
        compare(first, second, frame=["S01", "S02"])


def turned_alike(first, second, turn, found, stations):
    """The second epoch readjusted from given coordinates in other axes: nothing changes."""
    points = second.network.points
    network = replace(second.network, points=replace(points, xyz=points.xyz @ turn.T + [3e3, 0.0, 5.0]))
    other = compare(first, adjusted(network), frame=stations, options=ComparisonOptions(level=1e-3))
    np.testing.assert_allclose(other.deformation.displacement, found.deformation.displacement, rtol=0, atol=1e-8)
    np.testing.assert_allclose(other.deformation.statistic, found.deformation.statistic, rtol=2e-3, atol=1e-3)
    scale = found.difference_covariance.max()
    np.testing.assert_allclose(other.difference_covariance, found.difference_covariance, rtol=0, atol=1e-4 * scale)
    return not np.allclose(other.second.x, second.x, atol=1.0)


def test_a_carried_metro_point_beside_its_frame_is_as_in_the_joint_model(metro):
    joint = compare(*metro, points=["33"], options=ComparisonOptions(level=NEVER))
    found = compare(*metro, frame=[*CARRIED, "41", "42"], options=ComparisonOptions(level=NEVER))
    beside = compare(*metro, points=["33", "41", "42"], options=ComparisonOptions(level=NEVER))
    i, j = found.deformation.names.index("33"), beside.deformation.names.index("33")
    np.testing.assert_allclose(found.deformation.displacement[i], beside.deformation.displacement[j], atol=1e-10)
    np.testing.assert_allclose(found.deformation.covariance[i], beside.deformation.covariance[j], rtol=1e-6, atol=1e-14)
    np.testing.assert_allclose(found.difference[i], joint.difference[0], atol=1e-12)
    np.testing.assert_allclose(found.difference_covariance[i], joint.difference_covariance[0], rtol=1e-6, atol=1e-14)


def test_many_points_are_compared_beside_the_points_that_define_the_datum(ranging_network, monkeypatch):
    monkeypatch.setattr(comparison, "LARGEST", 10)
    rng = np.random.default_rng(47)
    first, second = twins(ranging_network, rng, moved=PLANTED)
    found = compare(first, second)
    assert found.frame == tuple(f"S{i:02d}" for i in range(1, 9))  # marked as the datum in both
    d = found.deformation
    assert [d.names[i] for i in np.flatnonzero(d.moved)] == list(PLANTED)
    assert d.status.startswith("frame moved: S03; ")
    assert d.status.endswith("of the 12 other points moved: T002, T009")
    everywhere = np.ones_like(first.network.points.datum)
    floating = [replace(s, network=replace(s.network, points=replace(s.network.points, datum=everywhere)))
                for s in (first, second)]  # fmt: skip
    spread = compare(*floating)  # where all define it: as many of them as one test takes, evenly chosen
    assert spread.frame == tuple(first.network.points.names[i] for i in (0, 2, 4, 6, 8, 10, 12, 14, 16, 19))
    assert [d.names[i] for i in np.flatnonzero(spread.deformation.moved)] == list(PLANTED)
    with pytest.raises(EstimationError, match=r"20 frame points are too many .* \(limit 10\); name fewer"):
        compare(first, second, frame=first.network.points.names)


@draws(100)
def test_alarms_beside_a_frame_stay_below_the_level(ranging_network, runs):
    rng = np.random.default_rng(48)
    stations = [f"S{i:02d}" for i in range(1, 9)]
    alarms = sum(compare(*twins(ranging_network, rng), frame=stations).deformation.moved.any() for _ in range(runs))
    assert 0 < alarms / runs < 0.05 + 3.5 * np.sqrt(0.05 * 0.95 / runs)


def test_a_point_that_kept_its_name_only_is_compared_and_doubted_unless_asked_for(ranging_network):
    rng = np.random.default_rng(49)
    first, second = twins(ranging_network, rng, moved=["T004"], size=0.5)
    found = compare(first, second)
    assert set(found.apart) == {"T004"}
    d = found.deformation
    assert [d.names[i] for i in np.flatnonzero(d.moved)] == ["T004"]
    assert np.linalg.norm(d.displacement[d.moved]) == pytest.approx(0.5, abs=2e-4)
    assert found.doubts
    asked = compare(first, second, points=first.network.points.names)
    d = asked.deformation
    assert [d.names[i] for i in np.flatnonzero(d.moved)] == ["T004"]
    assert np.linalg.norm(d.displacement[d.moved]) == pytest.approx(0.5, abs=2e-4)
    assert not asked.apart
    assert not asked.doubts
    narrow = compare(first, second, options=ComparisonOptions(same_point=1e-9))  # what did not move is not doubted
    assert set(narrow.apart) == {"T004"}


def test_incompatible_epochs_are_refused_in_one_line(metro, ranging_network):
    first, second = metro
    with pytest.raises(EstimationError, match=r"the first epoch fixes 201, .* at the second's result; give the epochs"):
        compare(second, first)
    axes = replace(second, network=replace(second.network, axes=np.eye(3)))
    with pytest.raises(EstimationError, match="the epochs have different axes: x, y, z with"):
        compare(first, axes)
    with pytest.raises(EstimationError, match="the second epoch has no solution to compare: rank deficient"):
        compare(first, replace(second, status=Status(AdjustmentOutcome.RANK_DEFICIENT, "everything")))
    with pytest.raises(EstimationError, match="point '999' is not in both epochs"):
        compare(first, second, points=["31", "999"])
    with pytest.raises(EstimationError, match="unknown datum 'loose'"):
        compare(first, second, datum="loose")

    def held_off(by):
        xyz = second.network.points.xyz + by
        return adjusted(replace(second.network, points=replace(second.network.points, xyz=xyz)))

    one = np.zeros((len(second.x), 3))
    one[second.index["203"], 2] = 2e-3
    with pytest.raises(EstimationError, match=r"203 are fixed in the second epoch 0.002 m from the first's result"):
        compare(first, held_off(one))
    with pytest.raises(EstimationError, match=r"the second epoch fixes 201, .* that are not those of the other epoch"):
        compare(first, held_off(np.full((len(second.x), 3), 1e-3)))
    assert compare(first, held_off(np.full((len(second.x), 3), 1e-3)), datum="levelled").carried == ()
    assert "the second epoch: converged, but the" in "".join(compare(first, held_off(one), datum="levelled").words)
    inflated = [np.full(len(g.observed), 1.3) for g in second.network.groups]
    with pytest.raises(EstimationError, match="does not match its observations' sigmas"):
        compare(first, adjusted(second.network, inflation=inflated))
    other, _ = twins(ranging_network, np.random.default_rng(50))
    with pytest.raises(EstimationError, match="the epochs have"):
        compare(first, other)


def test_the_least_datum_has_every_motion_that_floats():
    for name, motions in (("absolute", []), ("translation", [0, 2]), ("levelled", [5]), ("levelled similarity", [6, 1]),
                          ("rigid", [3]), ("similarity", [3, 6])):  # fmt: skip
        assert epoch_model._least_datum(np.eye(7)[:, motions]) == name


@pytest.fixture(scope="module")
def large(ranging_network):
    """Two epochs of many targets between which two points moved, and both adjusted by whole normal equations."""
    rng = np.random.default_rng(51)
    network, true = ranging_network(5, stations=6, targets=199, sigma=2e-5)
    after = true.copy()
    after[[2, 30]] += [3e-4, -2e-4, 2e-4]
    drawn = [measured(network, x.ravel(), rng) for x in (true, after)]
    return drawn, [adjusted(epoch) for epoch in drawn]


@pytest.mark.parametrize("engine", ["sparse", "ranging"])
def test_every_engine_gives_the_comparison_that_the_dense_one_gives(large, engine):
    """Selected inverse and block elimination against whole normal equations."""
    drawn, dense = large
    own = [adjust_network(epoch, engine=engine) for epoch in drawn]
    for options in ({"frame": [f"S{i:02d}" for i in range(1, 7)]}, {"options": ComparisonOptions(rule="local")}):
        fast, plain = (compare(*epochs, **options) for epochs in (own, dense))
        d = plain.deformation
        assert [d.names[i] for i in np.flatnonzero(d.moved)] == ["S03", "T025"]
        np.testing.assert_array_equal(fast.deformation.moved, d.moved)
        np.testing.assert_allclose(fast.deformation.displacement, d.displacement, rtol=0, atol=1e-8)
        np.testing.assert_allclose(fast.deformation.p, d.p, rtol=1e-2, atol=1e-6)
        scale = plain.difference_covariance.max()
        np.testing.assert_allclose(fast.difference_covariance, plain.difference_covariance, rtol=0, atol=1e-4 * scale)
