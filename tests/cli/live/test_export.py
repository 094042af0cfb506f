"""A journal in others' formats."""

import csv
import json

import numpy as np
import pytest

from catseye.coordinator.journal.reader import JournalReader
from catseye.records.night.campaign import read_campaign
from cli.living_scene import recorded


def rows(folder, name):
    with (folder / f"{name}.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_tables_hold_every_shot_and_point(catseye, tmp_path):
    out = tmp_path / "out"
    status, said, err = catseye("export", recorded(), "--to", "csv", "--out", out, "--json")
    told = json.loads(said)
    assert (status, err, told["run"], told["format"]) == (0, "", 1, "csv")
    with JournalReader(recorded()) as reader:
        shots = [shot for _, shot in reader.shots(1, buffers=False)]
        last = [solution for _, solution in reader.solutions(1)][-1]
    assert len(rows(out, "shots")) == told["rows"]["shots"] == len(shots)
    assert [float(row["range_m"] or "nan") for row in rows(out, "shots")] == pytest.approx(
        [shot.range_ for shot in shots], rel=0, abs=0, nan_ok=True
    )
    mine = {row["point"]: float(row["x_m"]) for row in rows(out, "coordinates")}
    assert mine["ZY101"] == last.answer["x"][last.answer["names"].index("ZY101")][0]


def test_a_span_takes_what_is_in_it(catseye, tmp_path):
    with JournalReader(recorded()) as reader:
        ticks = [shot.shot.ticks for _, shot in reader.shots(1, buffers=False)]
    middle = sorted(ticks)[len(ticks) // 2]
    words = ["--from", f"{middle / 1e8:.8f}", "--out", tmp_path / "out", "--to", "csv", "--quiet"]
    assert catseye("export", recorded(), *words) == (0, "", "")
    assert len(rows(tmp_path / "out", "shots")) == sum(t >= middle for t in ticks)


def test_fits_tables_open_in_astropy(catseye, tmp_path):
    from astropy.io import fits

    status, said, _ = catseye("export", recorded(), "--to", "fits", "--out", tmp_path / "out")
    assert (status, "run 1" in said) == (0, True)
    with fits.open(tmp_path / "out" / "shots.fits") as page:
        assert np.all(np.diff(page[1].data["SEQ"]) > 0)


def test_a_campaign_is_one_that_can_be_read(catseye, tmp_path):
    status, said, err = catseye("export", recorded(), "--to", "campaign", "--out", tmp_path / "out", "--json")
    told = json.loads(said)
    assert (status, err) == (0, "")
    assert len(read_campaign(tmp_path / "out").shots) == told["rows"]["shots"] > 100


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["--to", "xls", "--out", "OUT"], 2, "'xls' is not one of csv, fits, campaign"),
        (["--to", "csv", "--out", "OUT", "--from", "noon"], 2, "noon"),
        (
            ["--to", "csv", "--out", "OUT", "--from", "60636", "--until", "60635"],
            1,
            "at 60636 and ends at 60635",
        ),
        (["--to", "csv", "--out", "OUT/a/b"], 1, "is not a directory"),
        (["--to", "csv", "--out", "OUT", "--run", "9"], 1, "run 9 names 0 runs"),
        (["--to", "campaign", "--out", "OUT", "--until", "60000"], 1, "no complete weather reading"),
    ],
)
def test_what_cannot_be_exported_is_refused_and_nothing_is_written(catseye, tmp_path, words, status, said):
    words = [word.replace("OUT", str(tmp_path / "out")) for word in words]
    code, out, err = catseye("export", recorded(), *words)
    assert (code, out) == (status, "")
    assert said in " ".join(err.split())
    assert list(tmp_path.iterdir()) == []


def test_what_is_left_of_a_cut_journal_is_exported_when_asked(catseye, tmp_path):
    """Refused in one line, and with --damaged what is left, doubtful; beside --out nothing stays."""
    raw = recorded().read_bytes()
    cut = tmp_path / "cut.db"
    cut.write_bytes(raw[: len(raw) * 2 // 3])
    words = ["--to", "csv", "--out", tmp_path / "out", "--json"]
    status, out, err = catseye("export", cut, *words)
    assert (status, out, err.count("\n")) == (1, "", 1)
    status, said, err = catseye("export", cut, *words, "--damaged")
    told = json.loads(said)
    assert (status, err, told["verdict"]["word"]) == (0, "", "doubtful")
    assert "cut.db is damaged" in told["notes"][0]
    assert len(rows(tmp_path / "out", "shots")) == told["rows"]["shots"] > 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cut.db", "out"]


def test_an_empty_span_is_doubtful(catseye, tmp_path):
    """It was written with status 0 and without a verdict."""
    words = ["export", recorded(), "--from", "2090-01-01", "--to", "csv"]
    status, said, _ = catseye(*words, "--out", tmp_path / "out")
    assert (status, "Doubtful: no event of the run lies in the span" in " ".join(said.split())) == (0, True)
    status, said, _ = catseye(*words, "--out", tmp_path / "out", "--json")
    assert (status, json.loads(said)["verdict"]["word"]) == (0, "doubtful")
