"""`catseye beam` as a user meets it."""

import json

import pytest

from repository import ROOT

EXAMPLE = ROOT / "examples" / "beams" / "head.toml"


@pytest.fixture
def train(tmp_path):
    text = EXAMPLE.read_text()
    start, end = text.index("distances_m"), text.index("[laser]")
    file = tmp_path / "head.toml"
    file.write_text(text[:start] + "distances_m = [60, 100]\n" + text[end:])
    return file


def test_it_prints_a_table(catseye, train):
    status, said, complained = catseye("beam", train)
    assert (status, complained) == (0, "")
    assert "steering mirror, out" in said
    assert "smallest possible spot" in said


def test_json_is_one_object_and_the_distance_can_be_given(catseye, train):
    status, said, complained = catseye("beam", train, "--distance-m", 60, "--json")
    assert (status, complained) == (0, "")
    found = json.loads(said)
    assert found["distance"] == 60.0
    reflector = next(place for place in found["places"] if place["leg"] == "reflector")
    assert reflector["radius"] == found["returned"][0]["radius"]


def test_a_directory_appears_whole_or_not_at_all(catseye, train, tmp_path):
    status, said, _ = catseye("beam", train, "--out", tmp_path / "out")
    assert status == 0
    assert "beam.svg" in said
    assert (tmp_path / "out" / "provenance.json").is_file()
    train.write_text(train.read_text().replace('glass = "N-BK7"', 'glass = "ice"'))
    status, said, complained = catseye("beam", train, "--out", tmp_path / "other")
    assert (status, said) == (1, "")
    assert complained.count("\n") == 1
    assert "glass 'ice' is unknown" in complained
    assert not (tmp_path / "other").exists()


def test_a_missing_file_is_1_and_a_wrong_distance_2(catseye, tmp_path, train):
    status, _, complained = catseye("beam", tmp_path / "none.toml")
    assert status == 1
    assert "none.toml" in complained
    assert catseye("beam", train, "--distance-m", "nan")[0] == 2
    assert catseye("beam", train, "--distance-m", "-5")[0] == 2


def test_help_has_an_example(catseye):
    status, said, _ = catseye("beam", "--help")
    assert status == 0
    assert "Example: catseye beam examples/beams/head.toml" in said
