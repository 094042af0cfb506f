"""Layout, data sheet, readings, survey and maps of the panel setting instrument: what loads and what is refused."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.files.reading import read_record
from catseye.records.files.toml_text import record_toml
from catseye.records.panels.instrument import PanelInstrument
from catseye.records.panels.layout import COLUMNS, read_layout
from catseye.records.panels.readings import read_maps, read_panel_readings, read_survey
from panel_scene import EXAMPLE, dish, patch, tool


def test_the_prisms_of_the_bundled_site_are_the_corners_of_2004_panels():
    layout = dish()
    assert len(layout.panels) == len(set(layout.panels)) == 2004
    assert len(layout.corners) == 2209
    meet = np.bincount(layout.quad.ravel(), minlength=2209)
    assert meet.sum() == 8016  # the "over 8000" screws
    assert np.bincount(meet).tolist() == [0, 78, 262, 62, 1807]
    four = layout.xy[layout.quad]
    after = np.roll(four, -1, axis=1)
    area = 0.5 * np.sum(four[..., 0] * after[..., 1] - four[..., 1] * after[..., 0])  # m^2, by the corners
    assert area == pytest.approx(np.pi * 50.0**2, rel=0.01)  # panels tile the aperture, none twice
    assert sum(n[3] == "N" for n in layout.panels) == 1002


def test_panels_neither_overlap_nor_leave_gaps():
    layout = dish()
    rng = np.random.default_rng(1)
    angle, r = rng.uniform(0.0, 2 * np.pi, 500), 48.0 * np.sqrt(rng.uniform(0.0, 1.0, 500))
    from catseye.geometry.antenna.panel_surface import shares

    quads = layout.xy[layout.quad]
    for place in np.column_stack([r * np.cos(angle), 54.0 + r * np.sin(angle)])[:100]:
        assert np.sum(shares(np.broadcast_to(place, (2004, 2)), quads)[1]) == 1


def test_a_layout_survives_its_table(tmp_path):
    layout = patch()
    path = tmp_path / "layout.csv"
    path.write_text(layout.csv())
    again = read_layout(path, 60.0)
    assert again.panels == layout.panels
    assert [again.corners[c] for c in again.quad.ravel()] == [layout.corners[c] for c in layout.quad.ravel()]
    assert again.xy[again.quad] == pytest.approx(layout.xy[layout.quad], abs=1e-6)


@pytest.mark.parametrize(
    ("line", "changed", "told"),
    [
        (2, lambda c: [c[0], "1", *c[2:]], "place = 1 of panel 'T20P01' is a duplicate"),
        (2, lambda c: [*c[:3], "1.5", *c[4:]], "corner"),
        (1, lambda c: [*c[:5], "9000"], "design_offset_um = 9000 "),
        (1, lambda c: ["T99", *c[1:]], "panel 'T99' has places [1]"),
    ],
)
def test_a_bad_layout_is_refused_with_its_place(tmp_path, line, changed, told):
    layout = patch(("T20",), 1)
    rows = layout.csv().splitlines()
    row = next(k for k, text in enumerate(rows) if text.startswith("T20P01")) - 1 + line
    rows[row] = ",".join(changed(rows[row].split(",")))
    path = tmp_path / "layout.csv"
    path.write_text("\n".join(rows) + "\n")
    with pytest.raises(InputError) as refused:
        read_layout(path, 60.0)
    assert told in str(refused.value)
    assert str(refused.value).startswith("layout.csv: ")


def test_corners_in_another_order_are_refused(tmp_path):
    layout = patch(("T20",), 1)
    rows = [dict(zip(COLUMNS, r, strict=True)) for r in layout.rows()]
    for row in rows:
        row["place"] = {1: 1, 2: 3, 3: 2, 4: 4}[row["place"]]
    path = tmp_path / "layout.csv"
    path.write_text("\n".join([",".join(COLUMNS), *(",".join(map(str, r.values())) for r in rows)]) + "\n")
    with pytest.raises(InputError, match="lacks four corners in order around it"):
        read_layout(path, 60.0)


def test_the_sheet_survives_the_round_trip_and_needs_a_gauge_in_each_quarter(tmp_path):
    sheet = tool()
    path = tmp_path / "tool.toml"
    path.write_text(record_toml(sheet))
    assert read_record(path, PanelInstrument) == sheet
    path.write_text((EXAMPLE / "tool.toml").read_text().replace("x_mm = -75.0", "x_mm = 75.0"))
    with pytest.raises(InputError, match="not in four quarters"):
        read_record(path, PanelInstrument)


ROW = "DP21P01,0,day1,Ada,0.1,0.2,0.3,0.4,1.0,2.0,20.0,77.6"
HEADER = "corner,turn,session,member,a_mm,b_mm,c_mm,d_mm,lean_x_arcsec,lean_y_arcsec,temperature_c,elevation_deg"


@pytest.mark.parametrize(
    ("row", "told"),
    [
        (ROW.replace("DP21P01", "DP99X"), "line 2, corner = 'DP99X' (expected a corner of the layout, or FLAT)"),
        (ROW.replace("DP21P01,0", "DP21P01,4"), "line 2, turn = '4' (expected 0, 1, 2 or 3 quarter turns)"),
        (ROW.replace("0.1,", "100.,"), "line 2, a_mm = '100.' (expected within ± 6.35 mm, half the travel)"),
        (ROW.replace("0.1,0.2,0.3,0.4", ",,,"), "expected at least one reading in its row"),
        (ROW.replace("1.0,2.0", "1.0,"), "has one lean of two"),
        (ROW.replace("0.3", "nan"), "c_mm = 'nan' (expected a finite number)"),
        (ROW.replace("day1", ""), "session = ''"),
    ],
)
def test_a_bad_reading_is_refused_with_line_and_value(tmp_path, row, told):
    path = tmp_path / "r.csv"
    path.write_text(f"{HEADER}\n{row}\n")
    with pytest.raises(InputError) as refused:
        read_panel_readings(path, patch(), tool())
    assert told in str(refused.value)


def test_bad_surveys_and_maps_are_refused(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text("corner,height_um,u_um\nDP21P01,3,80\nDP21P01,4,80\n")
    with pytest.raises(InputError, match=r"line 3, corner = 'DP21P01' \(expected each corner once\)"):
        read_survey(path, patch())
    path.write_text("corner,height_um,u_um\nDP21P01,3,0\n")
    with pytest.raises(InputError, match="u_um = '0'"):
        read_survey(path, patch())
    maps = tmp_path / "maps"
    maps.mkdir()
    with pytest.raises(InputError, match="has no map"):
        read_maps(maps, patch())
    (maps / "X.csv").write_text("x_mm,y_mm,deviation_um\n")
    with pytest.raises(InputError, match=r"X.csv: is not a map of a panel"):
        read_maps(maps, patch())
    (maps / "X.csv").rename(maps / "T20P01.csv")
    (maps / "T20P01.csv").write_text("x_mm,y_mm,deviation_um\n" + "".join(f"{k},{2 * k},0\n" for k in range(9)))
    with pytest.raises(InputError, match="lie on one line"):
        read_maps(maps, patch())
