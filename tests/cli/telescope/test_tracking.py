"""`catseye track`: slews and stars from the ground and the feed arm, files, refusals."""

import json

import pytest

from repository import ROOT

SLEW = ["--site", "gbt", "--ranger", "ZY103", "--to=0,54,12.2", "--start", "145,30", "--end", "146,31"]


def test_the_answer_has_counts_at_every_node(catseye):
    status, said, complaint = catseye("track", *SLEW, "--to=20,60,18", "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    assert found["status"] == ["followed"] * 2
    assert len(found["seconds"]) == len(found["counts"])
    assert [len(row) for row in found["counts"][0]] == [2, 2]
    assert found["ranger"] == "ZY103"


def test_people_read_t0_and_t1_and_the_error_between(catseye, tmp_path):
    status, said, _ = catseye("track", *SLEW, "--out", tmp_path / "slew")
    assert status == 0
    for words in ("linear counts are off by", "N_a t0", "N_e t1", "more: nodes.csv"):
        assert words in said.replace("\n              ", " ")
    assert (tmp_path / "slew" / "errors.svg").is_file()


def test_people_read_what_the_mirror_s_offsets_take(catseye, tmp_path):
    records = ["--monument", "night-01/monuments/ZY103.toml", "--mirror", "mirrors/ZP103.toml"]
    status, said, _ = catseye("track", *records, *SLEW[4:], "--out", tmp_path / "slew")
    assert status == 0
    said = " ".join(said.split())
    assert "the beam would pass its targets by 0.6" in said
    assert "ideal mm" in said
    assert "mirror.svg, misses.svg" in said
    assert (tmp_path / "slew" / "mirror.svg").is_file()


def test_a_feed_arm_ranger_and_a_star(catseye):
    status, said, _ = catseye("track", "--site", "gbt", "--ranger", "ZY115", "--to=0,0,10", "--frame", "ground",
                              "--star", "83.63,22.01", "--duration-s", "1", "--start-at",
                              "2003-09-07T09:00:00Z")  # fmt: skip
    assert status == 0
    assert "1 of 1 points followed" in said


@pytest.mark.parametrize(
    ("arguments", "status", "complaint"),
    [
        (SLEW[:5], 2, "--start is missing"),
        ([*SLEW, "--star", "1,2"], 2, "--start does not go with --star"),
        ([*SLEW, "--start-at", "yesterday"], 2, "--start-at"),
        ([*SLEW, "--file", "coord.dat"], 2, "--to"),
        ([*SLEW[:4], "--file", "none.dat", *SLEW[5:]], 1, "none.dat"),
        (["--site", "gbt", "--ranger", "ZY9", *SLEW[4:]], 1, "'ZY9' is not of the site"),
        ([*SLEW[:5], "--star", "83.63,22.01", "--duration-s", "1", "--start-at", "2003-09-07T21:00:00Z"], 1,
         "is at elevation"),
    ],
)  # fmt: skip
def test_what_cannot_be_done_is_one_line(catseye, arguments, status, complaint):
    found, _, complained = catseye("track", *arguments)
    assert found == status
    assert complaint in complained.replace("\n", " ")


def test_a_star_needs_a_place_on_earth_and_says_so(catseye, tmp_path):
    record = tmp_path / "ZY103.toml"
    text = (ROOT / "examples/night-01/monuments/ZY103.toml").read_text()
    record.write_text("".join(line for line in text.splitlines(keepends=True) if not line.startswith("longitude")))
    mirror = ROOT / "examples/night-01/mirrors/ZP103.toml"
    star = ["--star", "83.63,22.01", "--duration-s", "1", "--start-at", "2003-09-07T09:00:00Z"]
    status, _, complaint = catseye("track", "--monument", record, "--mirror", mirror, "--to=0,54,12.2", *star)
    assert status == 1
    assert "direction of the Sun or a star needs longitude_deg" in complaint
