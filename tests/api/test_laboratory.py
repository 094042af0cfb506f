"""Laboratory, baseline and paths of air from Python: results, single files, refusals by parameter."""

import numpy as np
import pytest

import catseye
from catseye.errors import ArgumentError, InputError

TS30 = "baselines/busselton/ts30-baseline-observations.csv"
HEIGHTS = "baselines/busselton/pillar-heights.csv"


def test_single_files_are_written_together_or_not_at_all(tmp_path):
    found = catseye.calibrate("linearity", "calibrations/linearity.csv")
    found.save_pages(record=tmp_path / "r.toml", certificate=tmp_path / "c.html")
    assert catseye.load(tmp_path / "r.toml").verdict == found.verdict.text
    assert ">Results<" in (tmp_path / "c.html").read_text()
    (tmp_path / "mine.toml").write_text("mine")
    for paths, said in (
        ({"record": tmp_path / "new.toml", "certificate": tmp_path / "c.png"}, "certificate .*is PDF or HTML"),
        ({"record": tmp_path / "mine.toml", "certificate": tmp_path / "new.html"}, "record .*not a catseye file"),
        ({"record": tmp_path / "new.html", "certificate": tmp_path / "new.html"}, "is the record too"),
        ({"record": tmp_path / "no" / "r.toml"}, "record .*its directory does not exist"),
        ({"record": found.read[0]}, "is an input"),
        ({"picture": tmp_path / "p.svg"}, "page 'picture' is not in this result .expected one of record, certificate"),
    ):
        with pytest.raises(InputError, match=said):
            found.save_pages(**paths)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["c.html", "mine.toml", "r.toml"]


def test_a_directory_and_a_page_beside_it_are_one_output(tmp_path):
    found = catseye.acoustic("acoustic/night.csv")
    with pytest.raises(InputError, match="is or lies in"):
        catseye.save(found, tmp_path / "out", table=tmp_path / "out")
    (tmp_path / "mine.csv").write_text("mine")
    with pytest.raises(InputError, match=r"mine\.csv: exists and is not a catseye file"):
        catseye.save(found, tmp_path / "out", table=tmp_path / "mine.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["mine.csv"]
    catseye.save(found, tmp_path / "out", table=tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_text() == (tmp_path / "out" / "path_temperatures.csv").read_text()


def test_a_certificate_is_filled_or_blank(tmp_path):
    found = catseye.certificate("mirror", "mirrors/ZP3.toml")
    assert (found.verdict.word, len(found.missing)) == ("doubtful", 27)
    assert found.to_object()["written"] is None
    where = found.save_page(tmp_path / "zp3.html")
    assert where.to_object()["written"] == str(tmp_path / "zp3.html")
    assert len(found.to_table()) == len(found.keys)
    blank = catseye.certificate("monument", blank=True)
    assert (blank.verdict.word, blank.missing) == ("good", ())
    for call in ({"kind": "telescope"}, {"kind": "mirror", "record": "mirrors/ZP3.toml", "blank": True}):
        with pytest.raises(ArgumentError):
            catseye.certificate(**call)
    with pytest.raises(InputError, match=r"page .*is an input"):
        found.save_page(found.read)
    form = catseye.save_triplet_form(tmp_path / "form.html")
    assert "blank sheet" in form.read_text()


def test_acoustic_paths_are_in_the_result():
    found = catseye.acoustic("acoustic/night.csv")
    used = found.to_object()["paths"][0]
    assert found.temperature_c.tolist() == [used["temperature_c"]]
    assert found.u_group_refractivity.tolist() == [used["u_group_refractivity"]]
    shots = found.to_table("shots")
    assert len(shots) == len(used["measurements"])
    assert np.nanmean(shots["temperature"].value) == pytest.approx(found.temperature_c[0], abs=0.5)
    assert "temperature" in " ".join(catseye.show(found))
    with pytest.raises(InputError, match="needs a file"):
        catseye.acoustic()


def test_a_refractometer_takes_what_its_sheet_would_say():
    sheet = catseye.refractometer("refractometer/path-a.csv")
    longer = catseye.refractometer("refractometer/path-a.csv", path_length_m=sheet.calibration.path_length + 0.01)
    assert longer.to_object()["path_length"] == pytest.approx(sheet.calibration.path_length + 0.01)
    other = catseye.refractometer("refractometer/path-a.csv", model="rueger1990", u_pressure_hpa=1.0)
    assert other.to_object()["model"] == "rueger1990"
    assert other.u_group_index > sheet.u_group_index
    with pytest.raises(InputError, match=r"path_length_m = 0\.2"):
        catseye.refractometer("refractometer/path-a.csv", path_length_m=0.2)


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        ({"u_scale_ppm": -1.0}, "u_scale_ppm"),
        ({"u_temperature_c": float("nan")}, "u_temperature_c"),
        ({"u_direction_arcsec": 0.0}, "u_direction_arcsec"),
        ({"unit_length_m": 2e4}, "unit_length_m"),
        ({"refraction": float("inf")}, "refraction"),
        ({"reference_height_m": 1e5}, "reference_height_m"),
        ({"cyclic_orders": 5}, "cyclic_orders"),
        ({"level": 1.0}, "level"),
        ({"measured_on": "yesterday"}, "measured_on"),
    ],
)
def test_an_invalid_setting_of_a_baseline_is_refused_by_its_name(settings, name):
    with pytest.raises(ArgumentError, match=f"^{name} = ") as refused:
        catseye.baseline(TS30, **settings)
    assert refused.value.names == (name,)


def test_a_baseline_keeps_its_provenance_in_its_record(tmp_path):
    found = catseye.baseline(TS30, heights=HEIGHTS, serial="TS30-1", measured_on="2020-01-02", by="A", report="R 1")
    found.save_pages(record=tmp_path / "busselton.toml")
    record = catseye.load(tmp_path / "busselton.toml")
    assert (record.name, record.serial, str(record.measured_on), record.by) == (
        "busselton",
        "TS30-1",
        "2020-01-02",
        "A",
    )
    assert record.pillars == found.pillars
    assert [row.split()[0] for row in found.rows()][:2] == ["1", "1"]
    wider = catseye.baseline(TS30, heights=HEIGHTS, u_scale_ppm=3.0)
    assert wider.calibration.settings.u_scale_ppm == 3.0
