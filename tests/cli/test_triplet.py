"""`catseye triplet` as programs call it: keys, statuses, streams, files whole or not at all."""

import json

import pytest

import catseye.cli.triplet
from repository import ROOT

EXAMPLES = ROOT / "examples" / "triplets"
ONE, BAD, ODD = EXAMPLES / "TR99.toml", EXAMPLES / "TR04.toml", EXAMPLES / "TR05.toml"
KEYS = {"h_corr", "l_mpbc", "difference", "accepted", "u_h_corr", "conformity_probability", "cycles", "memo_cycles"}


@pytest.fixture
def catseye(catseye):
    """The command `triplet`."""
    return lambda *arguments: catseye("triplet", *arguments)


def told(said):
    return json.loads(said, parse_constant=pytest.fail)


def test_one_file_gives_one_object(catseye):
    status, said, complaint = catseye(ONE, "--json")
    assert (status, complaint) == (0, "")
    found = told(said)
    assert set(found) >= KEYS
    assert found["h_corr"] == pytest.approx(-23e-6, abs=2e-9)  # metres
    assert found["difference"] == pytest.approx(found["h_corr"] - found["l_mpbc"], abs=1e-15)
    assert found["accepted"] is True
    assert found["cycles"][0] == {"N_1": 182, "N_2": 182, "N_BC": 183, "margin": pytest.approx(0.04993, abs=1e-5)}
    assert found["memo_cycles"][0] == {"N_1": 182, "N_2": 182, "N_BC": 183}


def test_several_files_give_a_list_in_their_order(catseye):
    status, said, complaint = catseye(BAD, ONE, "--json")
    assert (status, complaint) == (0, "")
    assert [each["triplet"] for each in told(said)] == ["TR04", "TR99"]
    assert [each["accepted"] for each in told(said)] == [False, True]


def test_one_file_twice_is_told_twice(catseye):
    status, said, complaint = catseye(ONE, ONE, "--json")
    assert (status, complaint) == (0, "")
    assert [each["triplet"] for each in told(said)] == ["TR99", "TR99"]


def test_a_sheet_with_the_name_of_the_provenance_is_refused(catseye, tmp_path):
    sheet = tmp_path / "provenance.toml"
    sheet.write_bytes(ONE.read_bytes())
    status, _, complaint = catseye(sheet, "--out", tmp_path / "sheets")
    assert status == 1
    assert "provenance.json" in complaint
    assert not (tmp_path / "sheets").exists()


def test_a_unit_out_of_tolerance_is_an_answer_not_a_failure(catseye):
    status, said, complaint = catseye(BAD)
    assert (status, complaint) == (0, "")
    assert "NOT ACCEPTED" in said


def test_people_get_the_whole_sheet_of_one_and_the_words_of_many(catseye):
    _, one, _ = catseye(ONE)
    assert "δ_range" in one
    _, many, _ = catseye(ONE, ODD)
    assert "δ_range" not in many
    assert "placement 5: contradicts the others" in " ".join(many.split())
    assert catseye(ONE, "--quiet") == (0, "", "")


def test_files_are_written_whole_and_tell_the_same(catseye, tmp_path):
    out = tmp_path / "sheets"
    for _ in range(2):  # the second replaces the first
        status, said, complaint = catseye(ONE, ODD, "--out", out, "--json")
        assert (status, complaint) == (0, "")
    names = [
        "TR05.html",
        "TR05.json",
        "TR05.txt",
        "TR99.html",
        "TR99.json",
        "TR99.txt",
        "provenance.json",
        "triplets.csv",
    ]
    assert sorted(p.name for p in out.iterdir()) == names
    assert told((out / "TR05.json").read_text(encoding="utf-8")) == told(said)[1]
    provenance = told((out / "provenance.json").read_text(encoding="utf-8"))
    assert set(provenance["inputs_sha256"]) == {"TR99.toml", "TR05.toml"}
    assert sorted(provenance["outputs"]) == sorted(set(names) - {"provenance.json"})
    assert [p.name for p in tmp_path.iterdir()] == ["sheets"]


def test_a_bad_file_among_good_ones_leaves_nothing(catseye, tmp_path):
    bad = tmp_path / "bad.toml"
    text = ONE.read_text(encoding="utf-8").replace("l_post_mm = 88.900000", "l_post_mm = 3.5")
    bad.write_text(text, encoding="utf-8")
    status, said, complaint = catseye(ONE, bad, "--out", tmp_path / "sheets", "--json")
    assert (status, said) == (1, "")
    assert complaint.startswith(
        "catseye: bad.toml: surface_plate.l_post_mm = 3.5 (expected 20 to 500 mm; it looks like inches"
    )
    assert complaint.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["bad.toml"]


def test_a_missing_file_is_named(catseye, tmp_path):
    status, said, complaint = catseye(tmp_path / "none.toml", "--json")
    assert (status, said) == (1, "")
    assert complaint.startswith("catseye: none.toml: missing in")


def test_sheets_of_one_name_are_not_written_over_each_other(catseye, tmp_path):
    twin = tmp_path / "a" / "TR99.toml"
    twin.parent.mkdir()
    twin.write_bytes(ONE.read_bytes())
    status, _, complaint = catseye(ONE, twin, "--out", tmp_path / "out")
    assert status == 1
    assert "expected sheets of different names in one output" in complaint
    assert not (tmp_path / "out").exists()
    assert catseye(ONE, twin, "--json")[0] == 0  # told apart by their order


def test_the_blank_form(catseye, tmp_path):
    form = tmp_path / "sheet.html"
    for _ in range(2):  # ours may be written again
        status, said, complaint = catseye("--blank", form)
        assert (status, complaint) == (0, "")
        assert "sheet.html" in said
    assert "phi_bcfp_rad" in form.read_text(encoding="utf-8")
    other = tmp_path / "mine.html"
    other.write_text("mine", encoding="utf-8")
    status, _, complaint = catseye("--blank", other)
    assert status == 1
    assert "exists and is not a catseye file" in complaint
    assert other.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("arguments", [(), ("--json",), ("--frobnicate",), ("--blank", "x.html", "--json")])
def test_wrong_usage_is_2(catseye, arguments, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, said, _ = catseye(*arguments)
    assert (status, said) == (2, "")
    assert list(tmp_path.iterdir()) == []


def test_help_has_an_example(catseye):
    status, said, _ = catseye("--help")
    assert status == 0
    assert "Example: catseye triplet" in said
