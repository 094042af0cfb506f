"""Several runs and several journals on the command line."""

import json
import shutil

from cli.living_scene import recorded, smallest_site


def test_several_runs_need_virtual_time(catseye):
    status, out, err = catseye("simulate", smallest_site(), "--runs", "2")
    assert (status, out) == (2, "")
    assert "add --fast" in err


def test_options_for_several_are_refused_for_one(catseye, tmp_path):
    for words in (["--out", tmp_path / "x"], ["--processes", "2"], ["--resume"]):
        status, _, err = catseye("simulate", smallest_site(), "--fast", *words)
        assert (status, "is for several runs" in err) == (2, True)
        status, _, err = catseye("replay", recorded(), *words)
        assert (status, "is for several journals" in err) == (2, True)


def test_several_runs_are_a_list_for_programs(catseye):
    words = ("--fast", "--minutes", "0.12", "--round-s", "5", "--seed", "3", "--processes", "1", "--json")
    status, out, err = catseye("simulate", smallest_site(), "--runs", "2", *words)
    runs = json.loads(out)
    assert (status, err) == (0, "")
    assert [(run["name"], run["seed"], run["state"]) for run in runs] == [("seed-3", 3, "done"), ("seed-4", 4, "done")]


def test_several_journals_are_a_list_and_a_failed_one_is_status_1(catseye, tmp_path):
    good = shutil.copy(recorded(), tmp_path / "good.db")
    words = ("--processes", "1", "--json", "--quiet")
    status, out, err = catseye("replay", good, tmp_path / "none.db", *words)
    assert status == 1
    assert [each["state"] for each in json.loads(out)] == ["done", "failed"]
    assert "1 of 2 journals failed: none: " in err
    status, out, err = catseye("replay", good, shutil.copy(good, tmp_path / "other.db"), "--quiet", "--processes", "1")
    assert (status, out, err) == (0, "", "")
