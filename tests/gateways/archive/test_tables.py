"""Parquet files of an archive: sorted, typed, with checksums; unknown columns are refused."""

import numpy as np
import pyarrow.parquet as pq
import pytest

from catseye.errors import InputError
from catseye.gateways.archive.tables import GROUP, arrow_table, write_table


def test_rows_are_sorted_and_missing_columns_are_null(tmp_path):
    rows = {"ranger": ["ZY2", "ZY1", "ZY2"], "mjd": [2.0, 3.0, 1.0], "value": [1e-6, np.nan, -0.0]}
    assert write_table(tmp_path / "zeros.parquet", "zeros", rows) == 3
    table = pq.read_table(tmp_path / "zeros.parquet")
    assert table.column("ranger").to_pylist() == ["ZY1", "ZY2", "ZY2"]
    assert table.column("mjd").to_pylist() == [3.0, 1.0, 2.0]
    assert table.column("value").to_pylist() == [None, -0.0, 1e-6]
    assert table.column("u").to_pylist() == [None] * 3
    assert table.column("parameter").to_pylist() == [""] * 3


def test_doubles_keep_all_their_bits(tmp_path):
    x = np.random.default_rng(1).standard_normal(1000) * 10.0 ** np.random.default_rng(2).integers(-300, 300, 1000)
    rows = {"point": np.char.mod("P%04d", np.arange(1000)), "mjd": np.zeros(1000), "x": x}
    write_table(tmp_path / "points.parquet", "points", rows)
    back = pq.read_table(tmp_path / "points.parquet").column("x").to_numpy()
    assert back.tobytes() == x.tobytes()


def test_a_page_with_a_changed_byte_is_seen(tmp_path):
    path = tmp_path / "points.parquet"
    rows = {"point": ["A"] * 100, "mjd": np.arange(100.0), "x": np.random.default_rng(1).standard_normal(100)}
    write_table(path, "points", rows)
    column = pq.read_metadata(path).row_group(0).column(4)
    content = bytearray(path.read_bytes())
    content[column.data_page_offset + column.total_compressed_size - 5] ^= 1
    path.write_bytes(content)
    with pytest.raises(OSError, match=r"(?i)crc|corrupt"):
        pq.read_table(path, columns=["x"], page_checksum_verification=True)


def test_a_row_group_is_small_enough_for_one_series(tmp_path):
    rows = {"point": np.repeat(["A", "B", "C"], GROUP // 2), "mjd": np.tile(np.arange(GROUP / 2), 3)}
    write_table(tmp_path / "points.parquet", "points", rows)
    assert pq.read_metadata(tmp_path / "points.parquet").num_row_groups == 2


def test_an_unknown_column_is_refused():
    with pytest.raises(InputError, match=r"table points: column 'x_m' is unknown \(expected one of point, night"):
        arrow_table("points", {"x_m": [1.0]})
    with pytest.raises(InputError, match=r"table 'point' is unknown"):
        arrow_table("point", {"x": [1.0]})
