"""Finite element results by node: a punch file's columns, a table's units, and refusals in one line."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.files.reading import Folder
from catseye.records.site.nodal_result import read_nodal_result, read_node_places

PUNCH = """$TITLE   = BOOM                                                                1
$SUBTITLE=                                                                     2
$LABEL   =                                                                     3
$DISPLACEMENTS                                                                 4
$REAL OUTPUT                                                                   5
$SUBCASE ID =           7                                                      6
         5       G      1.000000E+00     -2.500000E-01      3.000000E+00       7
-CONT-                  1.000000E-03      0.000000E+00      0.000000E+00       8
        12       G      0.000000E+00      0.000000E+00     -1.000000E-05       9
-CONT-                  0.000000E+00      0.000000E+00      0.000000E+00      10
$TITLE   = BOOM                                                               11
$SUBTITLE=                                                                    12
$LABEL   =                                                                    13
$SPCF                                                                         14
$REAL OUTPUT                                                                  15
$SUBCASE ID =           7                                                     16
         5       G      9.000000E+09      0.000000E+00      0.000000E+00      17
-CONT-                  0.000000E+00      0.000000E+00      0.000000E+00      18
"""


def result(tmp_path, text, name="one.pch", **options):
    (tmp_path / name).write_text(text, encoding="utf-8")
    return read_nodal_result(Folder(tmp_path), name, **options)


def test_a_punch_files_displacements_are_read_and_its_forces_left(tmp_path):
    found = result(tmp_path, PUNCH, unit="mm")
    assert (found.cases, found.nodes) == (("7",), (5, 12))
    np.testing.assert_allclose(found.displacement[0], [[1e-3, -0.25e-3, 3e-3], [0.0, 0.0, -1e-8]], rtol=1e-12)
    inches = result(tmp_path, PUNCH, unit="in").displacement
    np.testing.assert_allclose(inches, 25.4 * found.displacement, rtol=1e-12)


def test_a_table_has_cases_or_elevations_and_says_its_unit(tmp_path):
    text = "elevation_deg,node,dx_in,dy_in,dz_in\n10,2,1,0,0\n10,1,0,0,0\n80,1,0,2,0\n80,2,0,0,3\n"
    found = result(tmp_path, text, "one.csv")
    assert found.cases == ("10", "80")
    np.testing.assert_allclose(found.elevation_deg, [10.0, 80.0])
    np.testing.assert_allclose(found.displacement[1], [[0.0, 0.0508, 0.0], [0.0, 0.0, 0.0762]])
    (tmp_path / "nodes.csv").write_text("node,target,x_mm,y_mm,z_mm\n4,A,1000,0,0\n9,,0,0,500\n", encoding="utf-8")
    places = read_node_places(Folder(tmp_path), "nodes.csv")
    assert (places.nodes, places.targets) == ((4, 9), ("A", ""))
    np.testing.assert_allclose(places.place, [[1.0, 0.0, 0.0], [0.0, 0.0, 0.5]])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("$DISPLACEMENTS", "$VELOCITY     ", "has no"),
        ("$REAL OUTPUT ", "$REAL-IMAGINARY OUTPUT ", r"line 5 is .* \(expected \$REAL OUTPUT\)"),
        ("-2.500000E-01", "  a lot      ", "line 7 is"),
        ("        12       G", "         5       G", "node 5 occurs twice"),
        (" 1.000000E+00", " 1.000000E+05", "another unit"),
    ],
)
def test_what_is_no_punch_file_is_refused(tmp_path, old, new, said):
    assert old in PUNCH
    with pytest.raises(InputError, match=said):
        result(tmp_path, PUNCH.replace(old, new, 1), unit="mm")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("node,dx_mm,dy_mm,dz_m\n1,0,0,0\n", "has no dx, dy, dz with one unit"),
        ("node,dx_mm,dy_mm,dz_mm\n1,0,0,0\n1,0,0,0\n", "node 1 occurs twice"),
        ("node,case,dx_mm,dy_mm,dz_mm\n1,a,0,0,0\n2,b,0,0,0\n", "node 1 is not in every case"),
        ("node,dx_mm,dy_mm,dz_mm\n1.5,0,0,0\n", "node = '1.5'"),
        ("node,case,elevation_deg,dx_mm,dy_mm,dz_mm\n1,a,3,0,0,0\n", "has case and elevation_deg"),
    ],
)
def test_what_is_no_table_of_displacements_is_refused(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        result(tmp_path, text, "one.csv")


def test_a_unit_is_needed_where_the_file_does_not_say_it_and_refused_where_it_does(tmp_path):
    with pytest.raises(InputError, match=r"unit = None \(expected m, mm, in"):
        result(tmp_path, PUNCH)
    with pytest.raises(InputError, match="is for a punch file"):
        result(tmp_path, "node,dx_mm,dy_mm,dz_mm\n1,0,0,0\n", "one.csv", unit="mm")
