"""`locate`: both solutions, the notes' iteration, agreement of the ranges, uncertain stations."""

import numpy as np
import pytest

import catseye
from catseye.errors import ArgumentError, InputError
from catseye.estimation.network.positions.trilateration import trilaterate

STATIONS = np.array(  # a ring, not quite level
    [[30.0, 115.0, -0.1], [115.0, 31.0, -0.3], [85.0, -85.0, 0.1], [-31.0, -116.0, -0.4], [-116.0, -31.0, 0.5]]
)
TARGETS = np.array([[-29.6, 35.9, 35.1], [51.7, -8.0, 18.2], [0.0, 0.0, 48.3]])
THREE = [0, 2, 4]
EXACT = 1e-8  # m: rounding of ranges of 100 m, magnified by the shallow geometry


def ranges(targets, stations):
    return np.linalg.norm(np.asarray(targets)[:, None] - stations, axis=2)


def test_both_solutions_are_those_of_the_closed_form_and_fit_their_ranges():
    d = ranges(TARGETS, STATIONS[THREE])
    found = catseye.locate(STATIONS[THREE], d, 1e-4, both=True)
    np.testing.assert_allclose(found.x, TARGETS, rtol=0, atol=EXACT)
    for k, distances in enumerate(d):
        both = trilaterate(STATIONS[THREE], distances).x
        both = both[np.argsort(both[:, 2])]
        np.testing.assert_allclose([found.other_x[k], found.x[k]], both, rtol=0, atol=EXACT)
    np.testing.assert_allclose(ranges(found.other_x, STATIONS[THREE]), d, rtol=0, atol=1e-9)
    a, b, c = STATIONS[THREE]
    n = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))
    turn = np.eye(3) - 2.0 * np.outer(n, n)  # the reflection carries the covariance, too
    np.testing.assert_allclose(found.other_covariance, turn @ found.covariance @ turn.T, rtol=1e-6, atol=1e-15)
    assert "T" not in found.verdict.why
    assert found.verdict.word == "doubtful"


def test_ranges_that_do_not_meet_say_how_much_they_lack():
    """The circle through these stations has a radius of 50 m about a point in their plane."""
    stations = np.array([[0.0, 0.0, 0.0], [60.0, 0.0, 0.0], [0.0, 80.0, 0.0]])
    lost = catseye.locate(stations, [[49.99, 49.99, 49.99], [60.0, 60.0, 60.0]], 1e-4, near=[0.0, 0.0, 9.0])
    assert lost.found.tolist() == [False, True]
    np.testing.assert_allclose(lost.too_short[0], 0.01, rtol=1e-9)
    assert np.isnan(lost.too_short[1]).all()
    assert lost.status[0].endswith("its ranges are too short by, mm: 0 10.000, 1 10.000, 2 10.000")


def test_the_report_has_the_numbers_of_the_answer():
    found = catseye.locate("positions/stations.csv", "positions/ranges.csv")
    report = found.to_report()
    columns = {c["key"]: c["values"] for c in report["tables"]["positions"]["columns"]}
    assert columns["target"] == list(found.located.target_names)
    np.testing.assert_allclose(columns["z"], found.x[:, 2], atol=1e-7)
    np.testing.assert_allclose(columns["u_z"], 1e3 * np.sqrt(found.covariance[:, 2, 2]), rtol=1e-3)
    assert {"positions", "ranges", "inputs"} <= set(report["tables"])
    assert set(report["drawings"]) == {"plan", "elevation"}


def test_the_first_solution_is_on_the_side_of_near():
    d = ranges(TARGETS, STATIONS[THREE])
    below = catseye.locate(STATIONS[THREE], d, 1e-4, both=True, near=[0.0, 0.0, -20.0])
    above = catseye.locate(STATIONS[THREE], d, 1e-4, both=True)
    np.testing.assert_allclose(below.x, above.other_x, rtol=0, atol=EXACT)
    np.testing.assert_allclose(below.other_x, above.x, rtol=0, atol=EXACT)


def test_stations_off_one_plane_leave_no_second_solution():
    stations = np.vstack([STATIONS, [0.0, 40.0, 60.0]])
    found = catseye.locate(stations, ranges(TARGETS, stations), 1e-4, both=True)
    np.testing.assert_allclose(found.x, TARGETS, rtol=0, atol=EXACT)
    assert np.isnan(found.other_x).all()
    assert "exclude every mirror image" in {p.title: p.text for p in found.passages()}["Mirror images"]


def test_the_iteration_ends_where_least_squares_does_and_its_steps_obey_herons_rule():
    d = ranges(TARGETS, STATIONS[THREE])
    start = np.array([0.0, 0.0, 30.0])
    found = catseye.locate(STATIONS[THREE], d, 1e-4, method="averaging", near=start, both=True)
    plain = catseye.locate(STATIONS[THREE], d, 1e-4, both=True)
    np.testing.assert_allclose(found.x, plain.x, rtol=0, atol=EXACT)
    np.testing.assert_allclose(found.other_x, plain.other_x, rtol=0, atol=EXACT)
    np.testing.assert_allclose(found.covariance, plain.covariance, rtol=1e-6)
    steps = found.to_table("steps")
    one = steps[steps["target"] == "1"]
    a, b, c = STATIONS[THREE]
    n = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))
    heights = np.abs([(np.array([row["x"].value, row["y"].value, row["z"].value]) - a) @ n for row in one])
    true = abs((TARGETS[1] - a) @ n)
    np.testing.assert_allclose(heights[1:], (heights[:-1] + true**2 / heights[:-1]) / 2.0, rtol=1e-9)
    assert one["difference"][-1].value < 1e-9


def test_the_iteration_refuses_four_ranges_and_a_start_it_does_not_have():
    d = ranges(TARGETS, STATIONS)
    with pytest.raises(InputError, match="target 0 has 5 ranges"):
        catseye.locate(STATIONS, d, 1e-4, method="averaging", near=[0.0, 0.0, 30.0])
    with pytest.raises(ArgumentError, match="near is missing"):
        catseye.locate(STATIONS[THREE], d[:, THREE], 1e-4, method="averaging")
    with pytest.raises(ArgumentError, match="expected one of least_squares, averaging"):
        catseye.locate(STATIONS, d, 1e-4, method="newton")
    in_plane = STATIONS[THREE].mean(axis=0)
    assert not catseye.locate(STATIONS[THREE], d[:, THREE], 1e-4, method="averaging", near=in_plane).found.any()


def test_a_closure_is_the_range_less_what_the_other_stations_predict():
    rng = np.random.default_rng(3)
    d = ranges(TARGETS, STATIONS) + rng.normal(0.0, 1e-4, (3, 5))
    found = catseye.locate(STATIONS, d, 1e-4, near=[0.0, 0.0, 30.0])
    for j in range(5):
        others = np.delete(np.arange(5), j)
        without = catseye.locate(STATIONS[others], d[:, others], 1e-4, near=[0.0, 0.0, 30.0])
        arm = without.x - STATIONS[j]
        length = np.linalg.norm(arm, axis=1)
        e = arm / length[:, None]
        np.testing.assert_allclose(found.closure[:, j], d[:, j] - length, rtol=0, atol=2e-6)  # first order of 1 mm
        u = np.sqrt(1e-8 + np.einsum("mi,mij,mj->m", e, without.covariance, e))
        np.testing.assert_allclose(found.u_closure[:, j], u, rtol=1e-3)


def test_ranges_that_agree_have_uniform_p_and_one_wrong_range_is_named():
    rng = np.random.default_rng(4)
    count = 4000
    targets = rng.uniform([-50, -50, 15], [50, 50, 50], (count, 3))
    d = ranges(targets, STATIONS) + rng.normal(0.0, 2e-4, (count, 5))
    found = catseye.locate(STATIONS, d, 2e-4, near=[0.0, 0.0, 30.0])
    share = np.mean(found.p < 0.1)
    assert abs(share - 0.1) < 4.0 * np.sqrt(0.09 / count)  # four sigma of a share
    one = d[:3].copy()
    one[1, 2] += 2e-3
    spoilt = catseye.locate(STATIONS, one, 2e-4, near=[0.0, 0.0, 30.0])
    assert spoilt.verdict.word == "doubtful"
    assert spoilt.contradicting.tolist() == [False, True, False]
    assert "1: p =" in spoilt.verdict.why
    assert abs(spoilt.closure[1, 2] - 2e-3) < 4.0 * spoilt.u_closure[1, 2]


def test_uncertain_stations_widen_the_covariance_as_a_simulation_does():
    rng = np.random.default_rng(5)
    u, runs, sigma = np.array([2e-4, 2e-4, 5e-4]), 3000, 1e-4
    truth = STATIONS + rng.normal(0.0, 1.0, (runs, 5, 3)) * u
    d = np.linalg.norm(TARGETS[0] - truth, axis=2) + rng.normal(0.0, sigma, (runs, 5))
    found = catseye.locate(STATIONS, d, sigma, near=[0.0, 0.0, 30.0], u_stations=np.tile(u, (5, 1)))
    claimed = found.covariance.mean(axis=0)
    scatter = np.cov((found.x - TARGETS[0]).T)
    whitened = np.linalg.solve(np.linalg.cholesky(claimed), np.linalg.solve(np.linalg.cholesky(claimed), scatter).T)
    np.testing.assert_allclose(np.linalg.eigvalsh(whitened), 1.0, atol=4.0 * np.sqrt(2.0 / runs) + 0.02)
    assert abs(np.mean(found.p < 0.1) - 0.1) < 4.0 * np.sqrt(0.09 / runs)
    exact = catseye.locate(STATIONS, d[:1], sigma, near=[0.0, 0.0, 30.0])
    assert np.trace(exact.covariance[0]) < 0.5 * np.trace(claimed)


def test_tables_and_arrays_give_the_same_and_mixtures_are_refused():
    found = catseye.locate("positions/stations.csv", "positions/ranges.csv")
    again = catseye.locate(found.located.stations, found.located.ranges, 2e-4, u_stations=2e-4, near=[0.0, 0.0, 30.0])
    np.testing.assert_allclose(found.x, again.x, rtol=0, atol=1e-7)
    assert found.located.target_names[0] == "T01"
    assert set(found.inputs()) == {"stations.csv", "ranges.csv"}
    with pytest.raises(ArgumentError, match="expected two tables, or two arrays"):
        catseye.locate("positions/stations.csv", found.located.ranges, 1e-4)
    with pytest.raises(ArgumentError, match="sigma stands in the tables"):
        catseye.locate("positions/stations.csv", "positions/ranges.csv", 1e-4)
    with pytest.raises(ArgumentError, match="sigma is missing"):
        catseye.locate(found.located.stations, found.located.ranges)
    with pytest.raises(InputError, match="u_stations has the shape"):
        catseye.locate(STATIONS, ranges(TARGETS, STATIONS), 1e-4, u_stations=[1.0, 2.0], near=[0.0, 0.0, 9.0])
