"""Tables of points of any maker: units, names, covariances, and what is refused."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.files.point_table import read_point_table, refuse_far, require_uncertainty

PLAIN = "point,x_m,y_m,z_m,u_mm\nA,1,2,3,0.1\nB,4,5,6,0.2\n"


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        "Name;X;Y;Z;U_mm\r\nA;1;2;3;0,1\r\nB;4;5;6;0,2\r\n",
        '\ufeff"ID","Z_mm","Y_mm","X_mm","U_um"\n"A",3000,2000,1000,100\n"B",6000,5000,4000,200\n',
        "id,x_cm,y_cm,z_cm,u_x_mm,u_y_um,u_z_m,code\nA,100,200,300,0.1,100,0.0001,7\nB,400,500,600,0.2,200,0.0002,8\n",
    ],
)
def test_units_names_and_order_of_the_columns_are_free(text):
    table = read_point_table(text, "p.csv")
    assert table.names == ("A", "B")
    np.testing.assert_allclose(table.x, [[1, 2, 3], [4, 5, 6]], rtol=1e-15)
    np.testing.assert_allclose(table.covariance, [1e-8 * np.eye(3), 4e-8 * np.eye(3)], rtol=1e-12)


def test_covariances_are_read_with_their_unit():
    text = "x,y,z,u_x_mm,u_y_mm,u_z_mm,cov_xy_mm2,cov_yz_mm2\n0,0,0,1,2,3,0.5,-1\n"
    table = read_point_table(text, "p.csv")
    expected = 1e-6 * np.array([[1.0, 0.5, 0.0], [0.5, 4.0, -1.0], [0.0, -1.0, 9.0]])
    np.testing.assert_allclose(table.covariance[0], expected, rtol=1e-12)
    assert table.names == ("P1",)


def test_a_table_without_u_is_exact_unless_one_is_given():
    text = "point,x,y,z\nA,1,2,3\n"
    assert read_point_table(text, "p.csv").covariance is None
    given = read_point_table(text, "p.csv", u=2e-4)
    np.testing.assert_array_equal(given.covariance[0], 4e-8 * np.eye(3))
    own = read_point_table(PLAIN, "p.csv", u=2e-4)
    assert own.covariance[0, 0, 0] == pytest.approx(1e-8)
    with pytest.raises(InputError, match=r"p.csv: has no uncertainty \(expected a column u_mm.* u_mm \(--u-mm\)\)"):
        require_uncertainty(read_point_table(text, "p.csv"))


def test_rows_of_a_kind_alone_are_taken_where_the_table_has_kinds():
    text = "point,kind,x,y,z\nA,dish prism,1,2,3\nB,monument,4,5,6\n"
    assert read_point_table(text, "p.csv", kind="dish prism").names == ("A",)
    assert read_point_table(PLAIN, "p.csv", kind="dish prism").names == ("A", "B")
    with pytest.raises(InputError, match="no row of kind 'mirror'"):
        read_point_table(text, "p.csv", kind="mirror")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("B,", "A,"), r"p.csv: line 3, point = 'A' is also in line 2 \(expected a unique name\)"),
        (("B,", ","), "line 3, point is empty"),
        (("z_m", "height"), "line 1, no column of z among point, x_m, y_m, height, u_mm"),
        (("point,x_m", "x_mm,x_m"), "columns 'x_mm' and 'x_m' are both x"),
        (("u_mm", "sigma_mm"), "'sigma_mm' looks like an uncertainty"),
        (("u_mm", "u_x_mm"), "'u_x_mm' without u_y"),
        (("u_mm", "cov_xy_mm2"), "'cov_xy_mm2' without u_x, u_y and u_z"),
        (("0.1", "0"), r"line 2, u_mm = '0' \(expected above 0 to 100 mm\)"),
        (("0.1", "300"), "expected above 0 to 100 mm"),
        (("1,2,3", "1,two,3"), r"line 2, y_m = 'two' \(expected a finite number\)"),
        (("1,2,3", "1,2,3,4"), "line 2, 6 fields"),
        (("4,5,6", "4000,5000,6000"), "line 3, B is 8774.96 m away: a coordinate looks like mm"),
    ],
)
def test_spoiled_tables_are_refused_with_place_value_and_remedy(change, said):
    with pytest.raises(InputError, match=said):
        refuse_far(read_point_table(PLAIN.replace(*change), "p.csv"), np.zeros(3), 1000.0)


def test_a_covariance_beyond_both_u_is_refused():
    text = "x,y,z,u_x_mm,u_y_mm,u_z_mm,cov_xy_mm2\n0,0,0,1,2,3,2.5\n"
    with pytest.raises(InputError, match="smaller than the product of both u"):
        read_point_table(text, "p.csv")
