"""certificate as programs call it: statuses, streams, the page whole or not at all."""

import hashlib
import json
import subprocess
import sys

import pytest

from repository import ROOT

EXAMPLES = ROOT / "examples"
ZY3, ZP3 = EXAMPLES / "monuments" / "ZY3.toml", EXAMPLES / "mirrors" / "ZP3.toml"


@pytest.mark.parametrize(("kind", "record", "missing"), [("monument", ZY3, 11), ("mirror", ZP3, 27)])
def test_a_record_gives_one_object_and_a_page(catseye, tmp_path, kind, record, missing):
    page = tmp_path / "page.html"
    status, out, err = catseye("certificate", kind, record, "--out", page, "--json")
    assert (status, err) == (0, "")
    found = json.loads(out, parse_constant=pytest.fail)
    assert set(found) == {"kind", "record", "sha256", "fields", "notes", "missing", "written"}
    assert (found["kind"], found["record"], found["written"]) == (kind, record.name, str(page))
    assert found["sha256"] == hashlib.sha256(record.read_bytes()).hexdigest()
    assert all(set(field) == {"name", "key", "value", "u", "unit"} for field in found["fields"])
    assert found["missing"] == [field["key"] for field in found["fields"] if field["value"] is None]
    assert len(found["missing"]) == missing
    text = page.read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>")
    assert found["sha256"] in text
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


@pytest.mark.parametrize("kind", ["monument", "mirror"])
def test_a_blank_form_comes_with_the_word_or_without_a_record(catseye, tmp_path, kind):
    one, two = tmp_path / "1.html", tmp_path / "2.html"
    status, out, err = catseye("certificate", kind, "--blank", "--out", one)
    assert (status, err) == (0, "")
    assert "blank" in out
    assert "Left blank" not in out
    assert catseye("certificate", kind, "--out", two, "--quiet") == (0, "", "")
    assert one.read_text(encoding="utf-8") == two.read_text(encoding="utf-8")  # a blank form has no date
    found = json.loads(catseye("certificate", kind, "--json")[1])
    assert (found["record"], found["missing"], found["written"]) == (None, [], None)
    assert {field["value"] for field in found["fields"]} == {None}


def test_people_are_told_what_stayed_blank_and_our_page_may_be_replaced(catseye, tmp_path):
    page = tmp_path / "zy3.html"
    for _ in range(2):
        status, out, err = catseye("certificate", "monument", ZY3, "--out", page)
        assert (status, err) == (0, "")
    assert "Laser Monument Calibration Report, ZY3" in out
    assert "11 of 29, not in ZY3.toml: measured_on, by, control_panel" in " ".join(out.split())
    page.write_text("somebody's", encoding="utf-8")
    status, out, err = catseye("certificate", "monument", ZY3, "--out", page)
    assert (status, out) == (1, "")
    assert "exists and is not a catseye file" in err
    assert page.read_text(encoding="utf-8") == "somebody's"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("monument", "no.toml", "--out", "x.html"), "no.toml: missing"),
        (("monument", ZP3, "--out", "x.html"), "ZP3.toml: "),
        (("mirror", ZY3, "--json"), "ZY3.toml: "),
        (("monument", ZY3, "--out", "no/x.html"), "page no/x.html: its directory does not exist"),
        (("monument", ZY3, "--out", ZY3), "is an input (expected another name)"),
        (("monument", ZY3, "--out", "."), "is a directory"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_status_1(catseye, tmp_path, monkeypatch, arguments, said):
    before = ZY3.read_bytes()
    monkeypatch.chdir(tmp_path)
    status, out, err = catseye("certificate", *arguments)
    assert (status, out) == (1, "")
    assert said in err
    assert len(err.splitlines()) == 1
    assert not list(tmp_path.iterdir())
    assert ZY3.read_bytes() == before


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("alpha3_rad = 0.000145", "alpha3_rad = 30", "alpha3_rad = 30 "),
        ("alpha1_rad = 1.008848", "alpha1_rad = -1.008848", "does not belong to azimuth_deg"),
        ("x_mm = 5586.2 ", 'x_mm = "5586.2" ', "x_mm = '5586.2' (expected a number)"),
        ('monument = "ZY3"', "", "monument is missing"),
    ],
)
def test_a_bad_record_is_refused_with_key_value_and_limit(catseye, tmp_path, old, new, said):
    text = ZY3.read_text(encoding="utf-8")
    assert old in text
    bad, page = tmp_path / "bad.toml", tmp_path / "page.html"
    bad.write_text(text.replace(old, new), encoding="utf-8")
    status, out, err = catseye("certificate", "monument", bad, "--out", page)
    assert (status, out) == (1, "")
    assert f"bad.toml: {said}" in err or said in err
    assert not page.exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("bogus", "--out", "x"), "'bogus' is not one of monument, mirror"),
        (("monument", ZY3), "is needed unless --certificate or --json is given"),
        (("monument", ZY3, "--blank", "--out", "x"), "--blank takes no record"),
        ((), "KIND"),
    ],
)
def test_wrong_usage_is_2(catseye, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    status, out, err = catseye("certificate", *arguments)
    assert status == 2
    assert said in " ".join((out + err).split())
    assert not list(tmp_path.iterdir())


def test_help_has_examples_and_spares_the_heavy_imports(catseye):
    status, out, _ = catseye("certificate", "--help")
    assert status == 0
    assert "catseye certificate monument examples/monuments/ZY3.toml --out zy3.html" in out
    code = "import sys, catseye.cli.certificate; print({'scipy', 'matplotlib', 'catseye.records'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "set()"
