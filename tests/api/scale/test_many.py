"""Many nights reduced side by side: each as if alone."""

import json
import shutil

import numpy as np
import pytest

import catseye
from catseye.errors import ArgumentError, InputError
from catseye.reduction.night.digest import digest
from service.many.night_scene import nights_of, small_night

COUNT = 3


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Three nights that differ, and their digests as one process gives them, one by one."""
    place = tmp_path_factory.mktemp("nights")
    nights = nights_of(small_night(place / "simulated"), place, COUNT)
    return nights, [digest(catseye.reduce(night).reduction) for night in nights]


@pytest.fixture(scope="module")
def reduced(scene, tmp_path_factory):
    """The same by two processes, and where."""
    where = tmp_path_factory.mktemp("reduced") / "out"
    return catseye.reduce_nights(scene[0], where, processes=2), where


def test_digests_are_those_of_one_night_at_a_time(scene, reduced):
    assert [outcome.value["digest"] for outcome in reduced[0].outcomes] == scene[1]
    assert len(set(scene[1])) == COUNT


def test_a_cluster_gives_the_same(scene, tmp_path):
    pytest.importorskip("distributed")
    many = catseye.reduce_nights(scene[0], tmp_path / "out", cluster="local", processes=2)
    assert [outcome.value["digest"] for outcome in many.outcomes] == scene[1]


def test_each_night_has_the_files_of_reduce(scene, reduced, tmp_path):
    alone = catseye.save(catseye.reduce(scene[0][1]), tmp_path / "alone")
    folder = reduced[1] / "night-01"
    assert sorted(path.name for path in folder.iterdir()) == sorted(path.name for path in alone.iterdir())
    for name in ("coordinates.csv", "ranges.csv", "surface.csv", "pose.json", "coordinates.json", "results.fits"):
        assert (folder / name).read_bytes() == (alone / name).read_bytes()


def test_the_result_is_a_table_a_list_and_sentences(reduced):
    many, where = reduced
    assert many.verdict.word in ("good", "doubtful")
    assert list(many.table["name"]) == ["night-00", "night-01", "night-02"]
    assert many.table.colnames[:5] == ["name", "state", "why", "seconds", "verdict"]
    assert {"digest", "points", "shots", "variance_factor"} <= set(many.table.colnames)
    answer = json.loads(many.to_json())
    assert [each["name"] for each in answer] == ["night-00", "night-01", "night-02"]
    assert answer[0]["out"] == str(where / "night-00")
    assert "3 of 3 nights done" in repr(many)
    assert list(many.tables()) == ["nights"]


def test_a_result_of_many_is_saved_as_a_table(reduced, tmp_path):
    where = catseye.save(reduced[0], tmp_path / "saved")
    assert len((where / "nights.csv").read_text().splitlines()) == 1 + COUNT


def test_a_second_call_resumes_and_a_changed_night_is_done_again(scene, reduced, tmp_path):
    nights = nights_of(scene[0][0], tmp_path, 2)
    where = tmp_path / "out"
    first = catseye.reduce_nights(nights, where, processes=1)
    frames = np.load(nights[1] / "frames.npy")
    frames[5] = np.roll(frames[5], 1)
    np.save(nights[1] / "frames.npy", frames)
    again = catseye.reduce_nights(nights, where, processes=1, resume=True)
    assert [outcome.state for outcome in again.outcomes] == ["resumed", "done"]
    assert again.outcomes[0].value == first.outcomes[0].value
    assert again.outcomes[1].value["digest"] != first.outcomes[1].value["digest"]
    shutil.rmtree(where / "night-00")
    states = [outcome.state for outcome in catseye.reduce_nights(nights, where, processes=1, resume=True).outcomes]
    assert states == ["done", "resumed"]
    other = catseye.reduce_nights(nights[:1], where, processes=1, resume=True, air_model="ciddor_hill1999")
    assert [outcome.state for outcome in other.outcomes] == ["done"]  # other options, another answer


def test_a_bad_night_fails_with_its_reason_and_the_others_do_not(scene, tmp_path):
    bad = shutil.copytree(scene[0][0], tmp_path / "bad")
    (bad / "weather.csv").unlink()
    many = catseye.reduce_nights([bad, scene[0][0], tmp_path / "missing"], tmp_path / "out", processes=2)
    assert [outcome.state for outcome in many.outcomes] == ["failed", "done", "failed"]
    assert many.outcomes[0].why == f"weather.csv: missing in {bad}"
    assert many.verdict.text == "Failed: 2 of 3 nights have no result."
    assert [outcome.name for outcome in many.failures] == ["bad", "missing"]
    assert np.isnan(many.table["variance_factor"][0])
    assert many.table["digest"][0] == ""
    assert not (tmp_path / "out" / "bad").exists()
    assert ("Failed", f"bad: weather.csv: missing in {bad}.") in many.passages()


def test_two_nights_of_one_name_are_refused(scene, tmp_path):
    shutil.copytree(scene[0][0], tmp_path / "deep" / "night-00")
    with pytest.raises(ArgumentError, match="two nights are named night-00: "):
        catseye.reduce_nights([scene[0][0], tmp_path / "deep" / "night-00"], tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["ledger", ".hidden"])
def test_a_name_that_the_output_needs_is_refused(tmp_path, name):
    with pytest.raises(ArgumentError, match="cannot name a night's folder"):
        catseye.reduce_nights([tmp_path / name], tmp_path / "out")


def test_no_night_is_refused(tmp_path):
    with pytest.raises(ArgumentError, match="expected at least one"):
        catseye.reduce_nights([], tmp_path / "out")


def test_an_output_that_is_anothers_or_an_input_is_refused(scene, tmp_path):
    (tmp_path / "foreign").mkdir()
    (tmp_path / "foreign" / "thesis.txt").touch()
    with pytest.raises(InputError, match="which catseye did not write"):
        catseye.reduce_nights(scene[0], tmp_path / "foreign")
    with pytest.raises(InputError, match="is, holds or lies in the input"):
        catseye.reduce_nights(scene[0], scene[0][0] / "out")


def test_a_foreign_folder_of_a_nights_name_is_refused_before_any_work(scene, tmp_path):
    where = tmp_path / "out"
    catseye.reduce_nights(scene[0][:1], where, processes=1)
    (where / "night-01").mkdir()
    (where / "night-01" / "thesis.txt").touch()
    with pytest.raises(InputError, match=r"thesis\.txt"):
        catseye.reduce_nights(scene[0], where, processes=1)
