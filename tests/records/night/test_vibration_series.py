"""VIBRATION.csv: kinds by columns, lost samples, refusals with line and value."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.night.vibration_series import read_vibration_series


def written(tmp_path, header, row="{t:.2f},1,2", count=64):
    path = tmp_path / "arm.csv"
    path.write_text(header + "\n" + "\n".join(row.format(t=0.05 * k) for k in range(count)) + "\n")
    return path


@pytest.mark.parametrize(
    ("header", "row", "kind", "first"),
    [
        ("time_s,y_mm,x_mm", "{t:.2f},1,2", "displacement", [2e-3, 1e-3]),
        ("q1,q2,q3,q4,time_s", "1,2,3,4,{t:.2f}", "quadrant", [1.0, 2.0, 3.0, 4.0]),
        ("time_s,range_m", "{t:.2f},120.5", "range", [120.5]),
        ("time_s,x_m,y_m,z_m", "{t:.2f},1,2,3", "ground", [1.0, 2.0, 3.0]),
    ],
)
def test_the_columns_say_the_kind(tmp_path, header, row, kind, first):
    found = read_vibration_series(written(tmp_path, header, row))
    assert found.kind == kind
    np.testing.assert_allclose(found.values[0], first)
    assert found.seconds[1] == 0.05


def test_a_blank_cell_is_a_lost_sample(tmp_path):
    path = written(tmp_path, "time_s,x_mm,y_mm")
    path.write_text(path.read_text().replace("0.10,1,2", "0.10,,2"))
    assert np.isnan(read_vibration_series(path).values[2]).tolist() == [True, False]


@pytest.mark.parametrize(
    ("header", "row", "count", "said"),
    [
        ("time_s,x_mm", "{t:.2f},1", 64, "has the columns x_mm"),
        ("time_s,x_mm,y_mm,range_m", "{t:.2f},1,2,3", 64, "has the columns range_m, x_mm, y_mm"),
        ("x_mm,y_mm", "1,2", 64, "time_s"),
        ("time_s,x_mm,y_mm", "{t:.2f},1,2", 10, "has 10 rows"),
        ("time_s,x_mm,y_mm", "1.0,1,2", 64, "line 3, time_s = '1.0'"),
        ("time_s,x_mm,y_mm", "{t:.2f},1,many", 64, "line 2, y_mm = 'many'"),
        ("time_s,x_mm,y_mm,dx", "{t:.2f},1,2,3", 64, "dx"),
    ],
)
def test_a_spoilt_series_is_refused_with_its_place(tmp_path, header, row, count, said):
    with pytest.raises(InputError, match=said):
        read_vibration_series(written(tmp_path, header, row, count))
