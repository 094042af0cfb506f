"""Budget of points as command and call: it adds up to the claim of `reduce`, and refuses what is no point."""

import json

import numpy as np
import pytest

import catseye as face
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"
POINTS = ("DP012", "ZY113")


@pytest.fixture(scope="module")
def budget():
    return face.budget(NIGHT, POINTS)


def test_parts_add_up_to_what_reduce_claims(budget):
    night = face.reduce(NIGHT)
    at = [night.names.index(name) for name in POINTS]
    np.testing.assert_allclose(budget.u, night.u[at], rtol=1e-9)
    np.testing.assert_allclose(budget.x, night.x[at], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(budget.contribution, axis=0), budget.u, rtol=5e-3)
    np.testing.assert_allclose(budget.share.sum(axis=0), 1.0, rtol=1e-2)


def test_up_of_a_feed_arm_ranger_rests_on_the_thermometers(budget):
    """Six rangers that look up from all around: what scales all ranges moves the arm up, not sideways."""
    share = budget.share[budget.kinds.index("thermometers"), 1]
    assert share[2] > 0.3
    assert share[:2].max() < 0.1


def test_the_command_says_and_writes_the_call_s_numbers(catseye, tmp_path, budget):
    status, out, err = catseye("budget", NIGHT, *POINTS, "--json", "--out", tmp_path / "out")
    assert (status, err) == (0, "")
    found = json.loads(out, parse_constant=pytest.fail)
    assert found["sources"] == list(budget.kinds)
    np.testing.assert_allclose(found["points"]["ZY113"]["u"], budget.u[1], rtol=1e-12)
    np.testing.assert_allclose(found["points"]["DP012"]["contribution"], budget.contribution[:, 0], rtol=1e-12)
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"budget.csv", "budget.json", "contributions.svg", "provenance.json"}


def test_people_read_a_table_whose_columns_add_up(catseye):
    status, out, err = catseye("budget", NIGHT, "ZY113")
    assert (status, err) == (0, "")
    rows = out[out.index("ZY113  ", out.index("\n\n")) :].splitlines()[1:]
    sizes = {row[:40].strip(): [float(part) for part in row[40:].split()][::2] for row in rows if row[40:].strip()}
    together = sizes.pop("together")
    np.testing.assert_allclose(np.linalg.norm(list(sizes.values()), axis=0), together, rtol=0.01)


def test_an_unknown_point_is_one_line_with_names_like_it(catseye):
    status, out, err = catseye("budget", NIGHT, "DP12")
    assert (status, out) == (1, "")
    assert err.count("\n") == 1
    assert "point 'DP12' is not among the 130 points of night-01" in err
    assert "DP012" in err


def test_no_point_is_an_argument_error():
    with pytest.raises(face.ArgumentError, match="points is empty"):
        face.budget(NIGHT, ())
