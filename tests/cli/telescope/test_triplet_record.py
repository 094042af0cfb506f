"""`catseye triplet --write`: a site reads back what the sheet gave; nothing foreign is touched."""

import shutil
import tomllib

import pytest

import catseye as package
from catseye.errors import InputError
from catseye.records.files.reading import read_record
from catseye.records.site.triplet import TripletRecord
from repository import ROOT

EXAMPLES, SITE = ROOT / "examples" / "triplets", ROOT / "examples" / "night-01"
SHEET, BAD = EXAMPLES / "TR01.toml", EXAMPLES / "TR04.toml"
OLD = SITE / "triplets" / "TR01.toml"
HEIGHTS = ("h_corr", "u_h_corr", "l_mpbc", "u_l_mpbc")


@pytest.fixture
def catseye(catseye):
    """The command `triplet`."""
    return lambda *arguments: catseye("triplet", *arguments)


def test_the_site_reads_back_the_numbers_of_the_sheet(catseye, tmp_path):
    site = shutil.copytree(SITE, tmp_path / "night")
    status, said, complaint = catseye(SHEET, "--write", site / "triplets", "--replaces", OLD)
    assert (status, complaint) == (0, "")
    assert "Record        " in said
    found = package.triplet(SHEET)
    record = package.load(site).triplets["TR01"]
    for key in HEIGHTS:
        assert getattr(record, f"{key}_mm") == pytest.approx(1e3 * getattr(found, key)[0], abs=1e-9)
    assert (record.by, str(record.measured_on), record.triplet) == ("made up", "2003-05-14", "TR01")
    sheet, old = tomllib.loads(SHEET.read_text()), tomllib.loads(OLD.read_text())
    for side in ("left_prism", "right_prism"):
        assert getattr(record, side).pc_mm == sheet[side]["pc_mm"]
    assert list(record.nominal_position_mm) == old["nominal_position_mm"]
    assert list(record.axis) == old["axis"]


def test_an_earlier_record_keeps_its_other_keys_and_comments(catseye, tmp_path):
    record = tmp_path / "TR01.toml"
    package.triplet(SHEET, replaces=OLD).save_records(record)
    changed = record.read_text().replace("u_lateral_mm = 0.05", "u_lateral_mm = 0.0123").replace(
        "h_corr_mm = -0.1", "h_corr_mm = -9.1", 1
    )  # fmt: skip
    record.write_text(changed + "# the end\n")
    assert catseye(SHEET, "--write", tmp_path, "--json")[0] == 0
    found = read_record(record, TripletRecord)
    assert found.u_lateral_mm == 0.0123
    assert found.h_corr_mm == pytest.approx(1e3 * package.triplet(SHEET).h_corr[0], abs=1e-9)
    assert record.read_text().endswith("# the end\n")


def test_a_new_unit_gives_its_name_to_its_targets(tmp_path):
    (where,) = package.triplet(EXAMPLES / "TR02.toml", replaces=OLD).save_records(tmp_path)
    assert where == tmp_path / "TR02.toml"
    assert read_record(where, TripletRecord).targets == ("TR02-L", "TR02-R", "TR02-B")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((BAD, "--write", "{}", "--replaces", OLD), "not accepted"),
        ((SHEET, "--write", "{}"), "does not exist"),
        ((EXAMPLES / "TR02.toml", "--write", "{}/old.toml"), "is the record of TR01, the sheet is of TR02"),
        ((SHEET, "--write", "{}/old.toml"), "left_prism.hrp_mm = 25.181 is not the sheet's 25.0517"),
        ((SHEET, EXAMPLES / "TR02.toml", "--write", "{}", "--replaces", OLD), "expected a single sheet"),
        ((SHEET, "--write", "{}/TR01.txt", "--replaces", OLD), "neither a directory nor a .toml file"),
        ((SHEET, "--write", "{}/site.toml", "--replaces", OLD), "exists and is not a catseye file"),
    ],
)
def test_what_is_refused_leaves_every_file_as_it_was(catseye, arguments, said, tmp_path):
    shutil.copy(OLD, tmp_path / "old.toml")
    (tmp_path / "site.toml").write_text("name = 1\n")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    status, out, complaint = catseye(*(str(each).replace("{}", str(tmp_path)) for each in arguments))
    assert (status, out) == (1, "")
    assert said in complaint
    assert complaint.count("\n") == 1
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_of_two_records_none_is_written_if_one_cannot_be(tmp_path):
    for name in ("TR01", "TR02"):
        package.triplet(EXAMPLES / f"{name}.toml", replaces=OLD).save_records(tmp_path)
    before = (tmp_path / "TR01.toml").read_bytes()
    (tmp_path / "TR02.toml").unlink()
    sheet = tmp_path / "new.toml"
    sheet.write_text(SHEET.read_text().replace("l_bt_mm = 38.654461", "l_bt_mm = 38.655461"))
    with pytest.raises(InputError, match=r"TR02\.toml: does not exist"):
        package.triplet(sheet, EXAMPLES / "TR02.toml").save_records(tmp_path)
    assert (tmp_path / "TR01.toml").read_bytes() == before


def test_replaces_without_write_is_wrong_usage(catseye):
    assert catseye(SHEET, "--replaces", OLD)[0] == 2


def test_refused_record_leaves_no_output(catseye, tmp_path):
    """The record is checked first: neither pages nor a certificate beside a refusal."""
    out, page = tmp_path / "pages", tmp_path / "page.html"
    status, said, complaint = catseye(SHEET, "--write", tmp_path, "--out", out)
    assert (status, said) == (1, "")
    assert "does not exist" in complaint
    assert "--replaces" in complaint
    assert catseye(BAD, "--write", tmp_path, "--replaces", OLD, "--certificate", page)[0] == 1
    assert list(tmp_path.iterdir()) == []
