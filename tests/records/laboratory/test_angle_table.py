"""Tables of returns by angle: amplitudes or powers, with or without a rotation, or refused in one line."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.laboratory.angle_table import read_angles


def test_tables_are_joined_and_a_missing_rotation_is_zero(tmp_path):
    (tmp_path / "a.csv").write_text("incidence_deg,amplitude_volt\n-10,1.5\n20,1.0\n")
    (tmp_path / "b.csv").write_text("rotation_deg,incidence_deg,amplitude_volt\n90,30,0.5\n")
    found, hashes = read_angles([tmp_path / "a.csv", tmp_path / "b.csv"])
    np.testing.assert_allclose(np.degrees(found.incidence), [-10.0, 20.0, 30.0])
    np.testing.assert_allclose(np.degrees(found.rotation), [0.0, 0.0, 90.0])
    assert (found.names, found.unit, found.table.tolist()) == (("a.csv", "b.csv"), "V", [0, 0, 1])
    assert len(hashes) == 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("incidence_deg\n10\n", "line 1 has neither"),
        ("incidence_deg,power_mw,amplitude_volt\n10,1,1\n", "line 1 has amplitude_volt and power_mw"),
        ("incidence_deg,power_mw\n90,1\n", r"line 2, incidence_deg = '90' \(expected above -90"),
        ("incidence_deg,power_mw\n10,-1\n", r"power_mw = '-1' \(expected 0 to 10000 mW\)"),
        ("incidence_deg,rotation_deg,power_mw\n10,800,1\n", "rotation_deg = '800'"),
    ],
)
def test_a_spoilt_table_is_refused(tmp_path, text, said):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        read_angles([tmp_path / "a.csv"])


def test_volts_and_milliwatts_do_not_mix(tmp_path):
    (tmp_path / "a.csv").write_text("incidence_deg,amplitude_volt\n-10,1.5\n")
    (tmp_path / "b.csv").write_text("incidence_deg,power_mw\n-10,1.5\n")
    with pytest.raises(InputError, match="different units"):
        read_angles([tmp_path / "a.csv", tmp_path / "b.csv"])
