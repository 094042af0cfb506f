"""Movements from changes of range: against full epochs, generalised least squares, simulation, and their own claims."""

import csv

import numpy as np
import pytest

import catseye
from catseye.errors import ArgumentError, InputError
from catseye.records.files.examples import example
from catseye.records.files.reading import read_record
from catseye.records.network.movement_constraints import MovementConstraints, PlaneConstraint, StillConstraint
from catseye.records.network.range_changes import RangeChanges
from catseye.reduction.deformation.movements import measured_movements

SIGMA = 5e-5
S = np.array(
    [[31.0, 115.9, -0.1], [115.9, 31.0, -0.3], [84.8, -84.9, 0.1], [-31.0, -115.9, -0.4], [-115.9, -31.0, 0.5],
     [-84.9, 84.9, 0.5]]
)  # fmt: skip
P = np.array([[0.0, -20, 58], [3, -22, 62], [-3, -22, 62], [0, -26, 66], [19.5, 0, 48.3], [-19.5, 0, 48.3]])
MOVED = np.array([[1.2, -2.0, -3.5]] * 4 + [[0.4, 0.9, 0.0], [0.5, -0.6, 0.0]]) * 1e-3
BODY = {"name": "arm", "points": ("P0", "P1", "P2", "P3")}
PLANE = {"name": "bearings", "points": ("P4", "P5"), "normal": (0.0, 0.0, 2.0)}
BOTH = MovementConstraints(body=({**BODY},), plane=({**PLANE},))


def distances(points, stations=S):
    return np.linalg.norm(np.asarray(points)[:, None] - stations, axis=2)


def changes(change, *, points=P, stations=S, u=0.0, sigma=2**0.5 * SIGMA):
    n, s = change.shape
    return RangeChanges(
        stations=tuple(f"S{k}" for k in range(s)),
        points=tuple(f"P{k}" for k in range(n)),
        x_stations=stations,
        x=points,
        u_stations=np.full((s, 3), u),
        u=np.full((n, 3), u),
        change=change,
        u_change=np.where(np.isfinite(change), sigma, np.nan),
        distance=distances(points, stations),
        alone=(),
    )


TRUE = distances(P + MOVED) - distances(P)


def test_it_agrees_with_two_adjusted_epochs_and_needs_no_zeros():
    rng = np.random.default_rng(1)
    ranges = [distances(P + k * MOVED) + rng.normal(0.0, SIGMA, TRUE.shape) for k in (0, 1)]
    names = [f"S{k}" for k in range(6)]

    def network(d):
        points = {"point": names, "role": ["fixed"] * 6, **{axis: S[:, k] for k, axis in enumerate("xyz")}}
        start, end = np.meshgrid(range(6), range(6))
        rows = {"from": [f"S{k}" for k in start.ravel()], "to": [f"P{k}" for k in end.ravel()]}
        return {"points": points, "ranges": {**rows, "distance": d.ravel(), "sigma": np.full(36, SIGMA)}}

    full = catseye.compare(*(catseye.adjust(network(d)) for d in ranges))
    order = [full.names.index(f"P{k}") for k in range(6)]
    plain = np.array(full.compared.difference[0])[order]
    rough = P + rng.normal(0.0, 0.02, P.shape)
    found = measured_movements(changes(ranges[1] - ranges[0], points=rough, u=0.02))
    # 20 mm over 100 m turn a line by 0.2 mrad: of 4 mm below 1 um, in height, which is five times weaker, below 5
    np.testing.assert_allclose(found.displacement, plain, rtol=0, atol=5e-6)
    np.testing.assert_allclose(found.covariances, full.covariances[order], rtol=0.01, atol=1e-12)
    zeros = rng.normal(0.0, 5e-3, 6)
    scale = 1.0 + 3e-6
    again = [scale * d + zeros for d in ranges]
    cancelled = measured_movements(changes(again[1] - again[0], points=rough, u=0.02))
    np.testing.assert_allclose(cancelled.displacement, found.displacement, rtol=0, atol=3e-6 * 0.02)
    assert catseye.adjust(network(again[0])).verdict.word != "good"  # where full epochs need the zeros


def test_the_airs_common_error_is_that_of_generalised_least_squares():
    rng = np.random.default_rng(2)
    change = TRUE + 0.4e-6 * distances(P) + rng.normal(0.0, 2**0.5 * SIGMA, TRUE.shape)
    found = measured_movements(changes(change), air_ppm=0.5)
    e = (P + found.displacement)[:, None] - S
    e /= np.linalg.norm(e, axis=2, keepdims=True)
    a = np.zeros((6, 6, 6, 3))
    for k in range(6):
        a[k, :, k] = e[k]
    a = a.reshape(36, 18)
    c = 0.5e-6 * distances(P).ravel()
    w = np.linalg.inv(2 * SIGMA**2 * np.eye(36) + np.outer(c, c))
    q = np.linalg.inv(a.T @ w @ a)
    x = q @ a.T @ w @ (change.ravel() - (distances(P + found.displacement) - distances(P)).ravel())
    np.testing.assert_allclose(x, 0.0, atol=1e-9)  # no step is left
    np.testing.assert_allclose(found.covariance, q, rtol=1e-6, atol=1e-15)
    value, u = found.air
    assert abs(value - 0.4) < 4.0 * u < 4.0 * 0.5


def test_movements_tests_and_air_scatter_as_claimed():
    rng = np.random.default_rng(3)
    runs, z, p = 200, [], []
    for _ in range(runs):
        change = TRUE + 0.5e-6 * rng.normal() * distances(P) + rng.normal(0.0, 2**0.5 * SIGMA, TRUE.shape)
        rough, stations = P + rng.normal(0.0, 0.05, P.shape), S + rng.normal(0.0, 0.05, S.shape)
        found = measured_movements(changes(change, points=rough, stations=stations, u=0.05), BOTH, air_ppm=0.5)
        moves = found.u > 1e-9
        z.append(((found.displacement - MOVED) / np.where(moves, found.u, np.inf)).ravel())
        p.append([*(test.p for test in found.tests), found.p_fit])
    rms = np.sqrt(np.mean(np.square(z), axis=0)).reshape(6, 3)
    assert (np.abs(rms[moves] - 1.0) < 4.0 / np.sqrt(2 * runs)).all()
    assert (np.abs(np.mean(np.array(p) < 0.2, axis=0) - 0.2) < 4.0 * np.sqrt(0.16 / runs)).all()


def test_a_broken_constraint_and_a_wrong_range_are_named():
    lifted = MOVED.copy()
    lifted[5, 2] = 1.0e-3
    found = measured_movements(changes(distances(P + lifted) - distances(P)), BOTH)
    assert found.verdict.why.startswith("the ranges contradict plane bearings")
    assert [test.rejected for test in found.tests] == [False, True]
    wrong = TRUE.copy()
    wrong[2, 4] += 1e-3
    found = measured_movements(changes(wrong), BOTH)
    assert found.suspects[0].tolist() == [2, 4]
    alone = measured_movements(changes(wrong))
    assert "S4 to P2 contradicts the others" in alone.verdict.why


def test_a_point_of_two_ranges_has_no_movement_unless_its_body_has_one():
    change = TRUE.copy()
    change[3, 2:] = np.nan
    free = measured_movements(changes(change))
    assert free.words[3] == "undetermined"
    assert "do not determine the movement of P3" in free.verdict.why
    assert np.isnan(free.displacement[3]).all()
    others = measured_movements(changes(np.delete(change, 3, axis=0), points=np.delete(P, 3, axis=0)))
    np.testing.assert_allclose(np.delete(free.displacement, 3, axis=0), others.displacement, rtol=0, atol=1e-12)
    tied = measured_movements(changes(change), BOTH)
    assert tied.verdict.word == "good"
    np.testing.assert_allclose(tied.displacement, MOVED, rtol=0, atol=1e-9)
    assert tied.tests[0].degrees_of_freedom == 3 * 3 + 2 - 6


def test_what_no_range_can_check_is_told_and_excluded_movement_widens():
    change = TRUE[4:5, :2]
    line = MovementConstraints(line=({"name": "rail", "points": ("P0",), "along": (0.4, 0.9, 0.0)},))
    found = measured_movements(changes(change, points=P[4:5], stations=S[:2]), line)
    assert found.tests[0].degrees_of_freedom == 1
    single = measured_movements(changes(change[:, :1], points=P[4:5], stations=S[:1]), line)
    assert single.tests[0].degrees_of_freedom == 0
    assert single.verdict.word == "doubtful"
    wider = measured_movements(changes(TRUE), BOTH.model_copy(update={"u_excluded_mm": 0.2}))
    plain = measured_movements(changes(TRUE), BOTH)
    assert (wider.u[4] > plain.u[4]).any()
    np.testing.assert_array_equal(wider.displacement, plain.displacement)
    nothing = measured_movements(changes(TRUE[:1, :2], points=P[:1], stations=S[:2]))
    assert nothing.verdict.word == "failed"


def test_the_example_finds_what_was_simulated():
    place = example("movements/truth.csv").parent
    found = catseye.movements(
        *(place / f"{name}.csv" for name in ("before", "after", "points")),
        constraints=place / "constraints.toml",
        air_ppm=0.5,
    )
    with (place / "truth.csv").open(encoding="utf-8") as stream:
        rows = {row["point"]: [float(row[f"d{axis}_mm"]) * 1e-3 for axis in "xyz"] for row in csv.DictReader(stream)}
    error = found.displacement - np.array([rows[name] for name in found.names])
    assert (np.abs(error) <= 4.0 * found.u + 1e-12).all()
    moved = {name for name, word in zip(found.names, found.words, strict=True) if word == "moved"}
    assert moved == {"FA1", "FA2", "FA3", "FA4", "W1", "W2", "DP1"}
    assert set(found.constraints) == {"feed-arm", "weldments", "benchmark"}
    assert set(found.figures()) == {"plan", "elevation"}
    assert list(found.tables()) == ["movements", "changes", "constraints"]


def test_more_points_than_are_solved_together_are_refused():
    with pytest.raises(InputError, match="601 points"):
        measured_movements(changes(np.zeros((601, 6)), points=np.tile(P[0], (601, 1))))


def test_constraints_that_make_no_sense_are_refused(tmp_path):
    unknown = MovementConstraints(still=(StillConstraint(name="hall", points=("Q",)),))
    with pytest.raises(InputError, match="constraint 'hall': point 'Q' has no range in both epochs"):
        measured_movements(changes(TRUE), unknown)
    all_still = MovementConstraints(still=(StillConstraint(name="all", points=tuple(f"P{k}" for k in range(6))),))
    with pytest.raises(InputError, match="let no point move"):
        measured_movements(changes(TRUE), all_still)
    row = np.array([[0.0, 0.0, 40.0], [1.0, 0.0, 40.0], [2.0, 0.0, 40.0]])
    body = MovementConstraints(body=({"name": "rod", "points": ("P0", "P1", "P2")},))
    with pytest.raises(InputError, match="its points lie on one line"):
        measured_movements(changes(np.zeros((3, 6)), points=row), body)
    file = tmp_path / "c.toml"
    file.write_text(
        '[[still]]\nname = "a"\npoints = ["P0"]\n[[line]]\nname = "b"\npoints = ["P0"]\nalong = [1.0, 0, 0]\n'
    )
    with pytest.raises(InputError, match="point 'P0' occurs twice"):
        read_record(file, MovementConstraints)
    with pytest.raises(ValueError, match="normal"):
        PlaneConstraint(name="p", points=("A",), normal=(0.0, 0.0, 0.0))
    paths = [f"movements/{name}.csv" for name in ("before", "after", "points")]
    with pytest.raises(ArgumentError, match="level = 2"):
        catseye.movements(*paths, level=2)
    with pytest.raises(ArgumentError, match="air_ppm = -1"):
        catseye.movements(*paths, air_ppm=-1.0)
