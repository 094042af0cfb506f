"""Tables of actuators: read back without loss, refused in one line."""

import pytest

from catseye.errors import InputError
from catseye.gateways.surface.tables import actuators_csv
from catseye.records.files.reading import Folder
from catseye.records.panels.actuators import ActuatorCorrection, read_positions
from repository import TESTS

FORMATS = TESTS / "vectors" / "formats"


def test_a_table_of_corrections_is_read_back_to_the_bit():
    rows = Folder(FORMATS).table("actuators-1.csv", ActuatorCorrection)
    assert [row.actuator for row in rows] == ["DP01C", "DP01N01", "DP01N02", "DP01N03"]
    assert actuators_csv(rows) == (FORMATS / "actuators-1.csv").read_text()


def test_positions_are_read_by_name():
    assert read_positions(FORMATS / "actuator-positions-1.csv") == {"DP01C": 0.0, "DP01N01": -1.275, "DP45P03": 25.4}


def test_corrections_that_were_made_are_positions_of_the_next_night(tmp_path):
    rows = Folder(FORMATS).table("actuators-1.csv", ActuatorCorrection)
    (tmp_path / "a.csv").write_text(actuators_csv([row.model_copy(update={"within_limits": "yes"}) for row in rows]))
    found = read_positions(tmp_path / "a.csv")
    assert found == {row.actuator: pytest.approx(row.position_mm + 0.025 * row.steps, abs=1e-9) for row in rows}
    (tmp_path / "a.csv").write_text(actuators_csv([row.model_copy(update={"within_limits": "no"}) for row in rows]))
    with pytest.raises(InputError, match="row 1, actuator 'DP01C' cannot reach target_mm"):
        read_positions(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("actuator,position_mm\nA,1\nA,2\n", "row 2, actuator = 'A' is given twice"),
        ("actuator,position_mm\nA,far\n", "row 1, position_mm = 'far'"),
        ("actuator,position_mm\nA,1001\n", "row 1, position_mm"),
        ("actuator,position\nA,1\n", "column 'position' is unknown"),
    ],
)
def test_bad_positions_are_refused(tmp_path, text, said):
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        read_positions(tmp_path / "p.csv")
