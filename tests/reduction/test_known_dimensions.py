"""Plane and levelling networks, wrong units and wrong senses with answers found by other programs or by hand.

Variance factors of GNU Gama 2.33; heights of [Wolf and Ghilani] example 12.1, worked again in numpy here.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from catseye.api.network import adjust
from catseye.api.planning import plan
from catseye.errors import InputError
from command_scene import command_line

HERE = Path(__file__).parents[1] / "vectors" / "networks" / "dimensions"
LEVELS = (  # from, to, m of levels.toml; BMX 100.00 m and BMY 107.50 m
    ("BMX", "A", 5.10), ("A", "BMY", 2.34), ("BMY", "C", -1.25), ("C", "BMX", -6.13), ("A", "B", -0.68),
    ("BMY", "B", -3.00), ("B", "C", 1.70),
)  # fmt: skip
U_LEVEL = 0.05  # m, of each


def levels_by_hand():
    """Heights of A, B, C, their standard uncertainties, and the variance factor."""
    known, order = {"BMX": 100.0, "BMY": 107.5}, "ABC"
    a, b = np.zeros((7, 3)), np.zeros(7)
    for k, (start, end, rise) in enumerate(LEVELS):
        b[k] = rise
        for name, sign in ((start, -1.0), (end, 1.0)):
            if name in known:
                b[k] -= sign * known[name]
            else:
                a[k, order.index(name)] = sign
    x, squares, _, _ = np.linalg.lstsq(a, b, rcond=None)
    return x, U_LEVEL * np.sqrt(np.diag(np.linalg.inv(a.T @ a))), float(squares[0]) / U_LEVEL**2 / 4


@pytest.mark.parametrize(
    ("file", "datum", "factor", "degrees"),
    [
        ("plane-held.gkf", "free", 1.1956, 7),
        ("plane-datum.gkf", None, 1.1956, 7),
        ("levels.gkf", "free", 0.0833, 1),
        ("inner-blanks.gkf", None, 0.834, 16),
    ],
)
def test_variance_factors_are_those_of_gama(file, datum, factor, degrees):
    answer = adjust(HERE / file, datum=datum)
    assert answer.status == "converged"
    assert answer.variance_factor == pytest.approx(factor, abs=6e-4)
    assert answer.degrees_of_freedom == degrees


def test_a_freed_network_is_the_one_that_is_marked_free():
    freed, marked = adjust(HERE / "plane-held.gkf", datum="free"), adjust(HERE / "plane-datum.gkf")
    np.testing.assert_allclose(freed.x, marked.x, atol=1e-9)
    np.testing.assert_allclose(freed.covariance, marked.covariance, rtol=1e-6, atol=1e-12)


@pytest.fixture
def catseye(capsys):
    """A command run in this process: exit status, what it said, what it complained of."""
    return command_line(capsys)


def test_points_of_a_plane_network_have_no_height(tmp_path, catseye):
    status, said, _ = catseye("adjust", HERE / "plane-and-heights.gkf", "--out", tmp_path / "x")
    assert status == 0
    assert "nan" not in said
    rows = (tmp_path / "x" / "coordinates.csv").read_text(encoding="utf-8").splitlines()
    header, points = rows[0].split(","), {row.split(",")[0]: row.split(",") for row in rows[1:]}
    for name, cells in points.items():
        row = dict(zip(header, cells, strict=True))
        assert [row["z_m"] != "", row["u_z_mm"] != "", row["cov_zz_mm2"] != ""] == [name in "14"] * 3, name
        assert "z" not in row["fixed"].split() or name == "1"
    assert "Datum: 7 coordinates held" in " ".join(said.split())
    assert float(dict(zip(header, points["4"], strict=True))["z_m"]) == pytest.approx(110.001)


def test_levelling_needs_no_places():
    x, u, factor = levels_by_hand()
    answer = adjust(HERE / "levels.toml")
    at = [answer.names.index(name) for name in "ABC"]
    assert answer.x[at, 2] == pytest.approx(x, abs=1e-9)
    assert answer.u[at, 2] == pytest.approx(u, rel=1e-9)
    assert answer.variance_factor == pytest.approx(factor, rel=1e-9)
    assert np.isnan(answer.x[at, :2]).all()
    assert x == pytest.approx((105.141, 104.483, 106.188), abs=6e-4)  # as printed


def test_a_plan_counts_no_coordinate_that_is_held():
    _, u, _ = levels_by_hand()
    planned = plan(HERE / "levels-held-places.toml")
    assert planned.mean_u == pytest.approx(float(np.sqrt(np.mean(u**2))), rel=1e-9)
    assert planned.mean_u == pytest.approx(0.0315, abs=5e-5)


def test_sigmas_in_millimetres_are_doubtful_and_name_the_unit(catseye):
    answer = adjust(HERE / "sigma-in-mm")
    assert answer.verdict.word == "doubtful"
    assert "mm typed as m" in answer.verdict.why
    assert catseye("adjust", HERE / "sigma-in-mm", "--strict")[0] == 1


def test_reasons_of_known_mistakes():
    mirrored = adjust(HERE / "mirrored-sense.gkf").status
    assert "sense of the horizontal angles is mirrored: reversed, the variance factor is 0.628" in mirrored
    opposite = adjust(HERE / "half-turn.dat")
    assert "angle Q - C - P, line 16 is half a turn off" in opposite.status
    unmeasured = adjust(HERE / "height-unmeasured.dat").status
    assert "Q (2 observations) floats" in unmeasured
    with pytest.raises(InputError, match="packed 45-30-15"):
        adjust(HERE / "packed.dat")


@pytest.mark.slow
def test_the_angle_that_is_half_a_turn_off_is_left_out():
    assert adjust(HERE / "half-turn.dat", reject=True).variance_factor == pytest.approx(0.845, abs=5e-4)


@pytest.mark.parametrize(("file", "word"), [("plane-held.gkf", "doubtful"), ("plane-datum.gkf", "good")])
def test_an_assumed_side_is_a_doubt_where_points_are_held_and_a_convention_in_a_free_network(file, word):
    found = adjust(HERE / file).adjusted
    assumed = replace(found, solution=replace(found.solution, assumed=("4",)))
    assert found.verdict.word == "good"
    assert assumed.verdict.word == word
    assert ("side on which these points lie" in assumed.verdict.why) == (word == "doubtful")
