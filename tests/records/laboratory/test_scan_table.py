"""Tables of scans: read whole, or refused in one line with file, line and value."""

import pytest

from catseye.errors import InputError
from catseye.records.laboratory.scan_table import read_scan

HEAD = "azimuth_counts,elevation_counts,amplitude_volt\n"


def test_rows_keep_their_order_and_their_place(tmp_path):
    (tmp_path / "s.csv").write_text("amplitude_volt,azimuth_counts,elevation_counts\n0.5,10,20\n0.6,11,20\n")
    scan = read_scan(tmp_path / "s.csv")
    assert scan.counts.tolist() == [[10.0, 20.0], [11.0, 20.0]]
    assert scan.amplitude.tolist() == [0.5, 0.6]
    assert (scan.name, scan.where[1], len(scan)) == ("s.csv", "line 3", 2)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEAD + "10,20,-0.1\n", r"s.csv: line 2, amplitude_volt = '-0.1' \(expected 0 to 1000 V\)"),
        (HEAD + "10,2e6,0.1\n", "line 2, elevation_counts = '2e6'"),
        (HEAD + "10,20,\n", "line 2, amplitude_volt"),
        (HEAD, "holds a header and no rows"),
        ("azimuth_counts,amplitude_volt\n1,2\n", "column 'elevation_counts' is missing"),
        ("azimuth_counts,elevation_counts,amplitude_mv\n1,2,3\n", "column 'amplitude_mv' is unknown"),
    ],
)
def test_a_spoilt_table_is_refused(tmp_path, text, said):
    (tmp_path / "s.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        read_scan(tmp_path / "s.csv")
