"""`catseye baseline` as programs call it: keys, statuses, streams, files whole or not at all."""

import csv
import json

import numpy as np
import pytest

from gateways.report_scene import column, read, words_of
from repository import ROOT

DATA = ROOT / "examples" / "baselines" / "busselton"
TS30, TS16 = DATA / "ts30-baseline-observations.csv", DATA / "ts16-calibration-observations.csv"
HEIGHTS = DATA / "pillar-heights.csv"
KEYS = {"zero", "u_zero", "scale_ppm", "u_scale_ppm", "cyclic", "s", "degrees_of_freedom", "tests", "covariance"}


@pytest.fixture
def catseye(catseye):
    """The command `baseline`."""
    return lambda *arguments: catseye("baseline", *arguments)


def test_the_pillars_then_an_instrument_against_them(catseye, tmp_path):
    toml, out = tmp_path / "BASELINE.toml", tmp_path / "out"
    status, said, complaint = catseye(TS30, "--heights", HEIGHTS, "--write", toml, "--json", "--by", "Landgate")
    assert (status, complaint) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    assert set(found) >= KEYS
    assert found["scale_ppm"] is None
    assert found["cyclic"] is None
    assert found["zero_correction"] == -found["zero"]
    assert np.shape(found["covariance"]) == (9, 9)
    assert len(found["distances"]) == 15
    assert {"name", "statistic", "limit", "passed", "text"} == set(found["tests"][0])
    status, said, complaint = catseye(TS16, "--heights", HEIGHTS, "--against", toml, "--json", "--out", out,
                                      "--unit-length-m", "1.5")  # fmt: skip
    assert (status, complaint) == (0, "")
    other = json.loads(said, parse_constant=pytest.fail)
    assert other["scale_ppm"] == pytest.approx(-4.5, abs=1.0)  # -3.1 without cyclic terms
    assert 0.5 < other["u_scale_ppm"] < 3.0
    assert {"order", "cosine", "u_cosine", "sine", "u_sine", "amplitude"} == set(other["cyclic"]["terms"][0])
    files = "baseline.json distances.csv observations.csv pillars.csv provenance.json report.html"
    assert sorted(p.name for p in out.iterdir()) == files.split()
    saved = json.loads((out / "baseline.json").read_text())
    assert saved == other
    provenance = json.loads((out / "provenance.json").read_text())
    assert set(provenance["inputs_sha256"]) == {TS16.name, HEIGHTS.name, "BASELINE.toml"}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["BASELINE.toml", "out"]


def test_tables_and_page_tell_the_same_as_the_object(catseye, tmp_path):
    out = tmp_path / "out"
    for _ in range(2):  # the second replaces the first
        status, said, _ = catseye(TS30, "--heights", HEIGHTS, "--out", out, "--json", "--unit-length-m", "1.5")
        assert status == 0
    found = json.loads(said)
    with (out / "observations.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 127
    way = sum(float(rows[30][k]) * u for k, u in (
        ("first_velocity_mm", 1e-3), ("second_velocity_um", 1e-6), ("arc_to_chord_um", 1e-6),
        ("slope_to_level_mm", 1e-3),
    ))  # fmt: skip
    assert float(rows[30]["slope_m"]) + way == pytest.approx(float(rows[30]["horizontal_m"]), abs=3e-7)
    adjusted = {(d["from"], d["to"]): d["distance"] for d in found["distances"]}
    row = rows[12]
    cyclic = found["cyclic"]["terms"][0]
    phase = 2 * np.pi * float(row["slope_m"]) / 1.5
    predicted = adjusted["1", "5"] + found["zero"] + cyclic["cosine"] * np.cos(phase) + cyclic["sine"] * np.sin(phase)
    assert float(row["residual_mm"]) == pytest.approx((float(row["horizontal_m"]) - predicted) * 1e3, abs=2e-3)
    with (out / "distances.csv").open() as stream:
        for line in csv.DictReader(stream):
            assert float(line["distance_m"]) == pytest.approx(
                adjusted[line["from_pillar"], line["to_pillar"]], abs=1e-6
            )
    page = (out / "report.html").read_text()
    report, words = read(page), " ".join(words_of(page))
    assert {"line", "residuals", "weather", "correction-1", "cyclic", "cyclic-term"} <= report["charts"].keys()
    assert f"{found['zero'] * 1e3:+.3f}" in words
    assert "the light follows the weather as read" in column(report, "tests", "test")
    assert column(report, "distances", "distance") == pytest.approx(
        [d["distance"] for d in found["distances"]], abs=0.51e-7
    )
    assert "nan" not in words.split()


def test_people_are_told_the_signs(catseye):
    status, said, complaint = catseye(TS30, "--heights", HEIGHTS)
    assert (status, complaint) == (0, "")
    for words in (
        "observed minus true",
        "not determined without certified distances",
        "ISO 17123-4 c",
        "FAILED",
        "1 - 6",
    ):
        assert words in " ".join(said.split())


def test_quiet_is_quiet(catseye):
    assert catseye(TS30, "--quiet") == (0, "", "")


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["missing.csv"], 1, "missing.csv"),
        ([HEIGHTS], 1, "are unknown"),
        ([TS30, "--heights", TS30], 1, "are unknown"),
        ([TS30, "--against", HEIGHTS], 1, "TOML"),
        ([TS30, "--wavelength-um", "10.6"], 1, "wavelength 10.6 um is outside"),
        ([TS30, "--reference-index", "286.338"], 1, "index of air 286.338"),
        ([TS30, "--model", "bogus"], 2, "bogus"),
        ([TS30, "--u-temperature-c", "-1"], 2, "-1"),
        ([TS30, "--specified-mm", "0"], 2, "above zero"),
        ([TS30, "--measured-on", "yesterday"], 2, "yesterday"),
        ([TS30, "--level", "5"], 2, "probability"),
        ([TS30, "--reference-height-m", "-8e6"], 2, "-9000 to 9000 m"),
        ([TS30, "--reference-height-m", "10"], 2, "needs --heights"),
        ([], 2, "OBSERVATIONS.csv"),
    ],
)
def test_what_cannot_be_done_is_said_once(catseye, tmp_path, monkeypatch, arguments, status, said):
    monkeypatch.chdir(tmp_path)
    done, out, complaint = catseye(*arguments, "--write", "b.toml", "--out", "o")
    assert (done, out) == (status, "")
    assert said in complaint
    assert status == 2 or complaint.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_another_programs_file_is_not_overwritten(catseye, tmp_path):
    mine = tmp_path / "thesis.toml"
    mine.write_text("precious = true\n")
    status, out, complaint = catseye(TS30, "--write", mine)
    assert (status, out, complaint.count("\n")) == (1, "", 1)
    assert mine.read_text() == "precious = true\n"
    out_dir = tmp_path / "out"
    assert catseye(TS30, "--write", mine, "--out", out_dir, "--quiet")[0] == 1
    assert list(tmp_path.iterdir()) == [mine]


def test_known_pillars_are_not_replaced_by_what_used_them(catseye, tmp_path):
    toml = tmp_path / "b.toml"
    assert catseye(TS30, "--heights", HEIGHTS, "--write", toml, "--quiet")[0] == 0
    before = toml.read_text()
    status, _, complaint = catseye(TS16, "--heights", HEIGHTS, "--against", toml, "--write", toml)
    assert (status, complaint.count("\n")) == (1, 1)
    assert "is an input" in complaint
    assert toml.read_text() == before


def test_a_pillar_named_like_a_parameter_is_named_in_the_message(catseye, tmp_path):
    rows = ["A,B,0,0,100,15,1000,50", "A,C,0,0,250,15,1000,50", "B,C,0,0,150,15,1000,50", "A,x 99,0,0,300,15,1000,50"]
    (tmp_path / "o.csv").write_text("\n".join([TS16.read_text().splitlines()[0], *rows]) + "\n")
    status, _, complaint = catseye(tmp_path / "o.csv")
    assert status == 1
    assert "pillar x 99 has 1 distances to the others" in complaint
