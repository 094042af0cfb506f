"""Networks of every dimension and datum: adjusted, freed and planned as a plain least squares in numpy does."""

import numpy as np
import pytest

import catseye
from catseye.api.network import adjust
from catseye.api.planning import plan
from laws.network_scene import DATUMS, DIMENSIONS, least_squares, scene

SEEDS = range(2)
MICROMETRE = 1e-6  # where the last step of two Gauss-Newtons may differ, below a thousandth of u


def written(tmp_path, made, datum):
    file = tmp_path / "network.toml"
    file.write_text(made.toml("datum" if datum == "datum" else "fixed"), encoding="utf-8")
    return file


@pytest.mark.parametrize("datum", DATUMS)
@pytest.mark.parametrize("dimension", DIMENSIONS)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_network_of_any_dimension_and_datum_is_adjusted_as_by_hand(tmp_path, dimension, datum, seed):
    made = scene(seed, dimension, datum)
    right = least_squares(made, datum)
    ours = adjust(written(tmp_path, made, datum), datum="free" if datum == "free" else None)
    assert ours.status == "converged"
    assert ours.degrees_of_freedom == right.degrees
    assert ours.variance_factor == pytest.approx(right.pvv / right.degrees, rel=1e-5)
    np.testing.assert_allclose(ours.x, right.x, atol=MICROMETRE)  # nan where there is nothing, too
    size = float(np.nanmax(np.diag(right.covariance)))
    np.testing.assert_allclose(ours.covariance, right.covariance, rtol=1e-4, atol=1e-5 * size)
    for k, covariance in enumerate(ours.covariances):
        of_all = ours.covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        np.testing.assert_allclose(covariance, of_all, rtol=1e-9, atol=1e-9 * size)


@pytest.mark.parametrize("datum", DATUMS)
@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_a_plan_counts_the_coordinates_that_there_are(tmp_path, dimension, datum):
    made = scene(7, dimension, datum)
    made.given = np.where(made.there, made.truth, np.nan)
    right = least_squares(made, datum)
    ours = plan(written(tmp_path, made, datum), datum="free" if datum == "free" else None)
    variance = np.diag(right.covariance).reshape(-1, 3)
    known = made.there & ~(made.held & (datum == "held"))
    assert ours.mean_u == pytest.approx(float(np.sqrt(np.mean(variance[known]))), rel=1e-3)
    np.testing.assert_array_equal(np.isfinite(ours.u), made.there)


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_runs_of_a_plan_scatter_as_it_claims_over_the_coordinates_that_there_are(tmp_path, dimension):
    made = scene(5, dimension, "held")
    made.given = np.where(made.there, made.truth, np.nan)
    runs = 30
    told = plan(written(tmp_path, made, "held"), runs=runs, seed=2).to_object()
    known = made.there & ~made.held
    variance = np.diag(least_squares(made, "held").covariance).reshape(-1, 3)
    assert told["monte_carlo"]["predicted"] == pytest.approx(float(np.sqrt(np.mean(variance[known]))), rel=1e-3)
    spread = 4.0 / np.sqrt(2 * runs * 3)  # four sigmas of a mean square, at least three coordinates independent
    assert told["monte_carlo"]["ratio"] == pytest.approx(1.0, abs=spread)


@pytest.mark.parametrize("dimension", ["1", "2", "mixed"])
def test_missing_values_are_null_and_empty_cells_everywhere(tmp_path, dimension):
    made = scene(9, dimension, "held")
    ours = adjust(written(tmp_path, made, "held"))
    catseye.save(ours, tmp_path / "out")
    for name, point, there in zip(made.names, ours.to_object()["points"].values(), made.there, strict=True):
        assert [point[a] is not None for a in "xyz"] == there.tolist(), name
        assert [u is not None for u in point["u"]] == there.tolist()
        assert [[c is not None for c in row] for row in point["covariance"]] == np.outer(there, there).tolist()
        assert set(point["absent"]) == {a for a, t in zip("xyz", there, strict=True) if not t}
        assert not set(point["absent"]) & {*point["fixed"], *point["datum"]}
    lines = (tmp_path / "out" / "coordinates.csv").read_text(encoding="utf-8").splitlines()[1:]
    for line, there in zip(lines, made.there, strict=True):
        assert [cell != "" for cell in line.split(",")[1:4]] == there.tolist()
    text = (tmp_path / "out" / "adjustment.xml").read_text(encoding="utf-8")
    adjusted = text.partition("<adjusted>")[2].partition("</adjusted>")[0]
    assert adjusted.count("<z>") == int((made.there & ~made.held)[:, 2].sum())
    assert adjusted.count("<x>") == int((made.there & ~made.held)[:, 0].sum())
    assert "nan" not in text
