"""A journal again: the same to the last bit, under another version, and with other calibrations."""

import json
import shutil
import sqlite3

import pytest

from cli.living_scene import recorded, small_site
from service.replay_scene import in_epoch, reworded, rewritten
from simulator.living_scene import site


def test_a_run_is_the_same_bit_for_bit(catseye):
    status, out, err = catseye("replay", recorded())
    assert (status, err) == (0, "")
    assert "the same bit for bit, and all" in " ".join(out.split())
    status, out, err = catseye("replay", recorded(), "--run", "1", "--json")
    told = json.loads(out)
    assert (status, err, told["same"], told["first_difference"]) == (0, "", True, None)
    assert told["epochs"] == told["epochs_same"] >= 2
    assert told["shots"] == told["shots_same"] > 100
    assert all(point["largest_mm"] == 0.0 for point in told["points"].values())
    assert (told["identical"], told["cause"], told["parts_differing"]) == (True, None, {})
    assert told["epochs_identical"] == told["epochs"]
    assert told["shots_identical"] == told["shots"]
    assert told["versions"]["stored"] == told["versions"]["here"]


def test_texts_of_another_version_are_no_difference(catseye, tmp_path):
    journal = rewritten(tmp_path / "j.db", reworded)
    status, out, err = catseye("replay", journal)
    assert (status, err) == (0, "")
    assert "texts are another version's" in " ".join(out.split())
    told = json.loads(catseye("replay", journal, "--json")[1])
    assert (told["same"], told["identical"], told["first_difference"]) == (True, False, None)
    assert (told["epochs_same"], told["epochs_identical"]) == (2, 0)


def test_another_version_says_how_far_it_moves_the_answers(catseye, tmp_path):
    """All of epoch 1 stored 0.25 mm higher: that far, by the software, in mm and in u, for people and programs."""
    raised = in_epoch(1, lambda entry: {"x": [[x, y, z + 2.5e-4] for x, y, z in entry.answer["x"]]})
    journal = rewritten(tmp_path / "j.db", raised)
    status, out, _ = catseye("replay", journal)
    words = " ".join(out.split())
    assert status == 1
    assert "this version changes the run's answers: points by up to 0.250 mm" in words
    assert "so the software differs" in words
    assert "in stored u" in words
    status, out, _ = catseye("replay", journal, "--json")
    told = json.loads(out)
    assert (status, told["same"], told["identical"], told["cause"]) == (1, False, False, "software")
    assert told["parts_differing"] == {"x": 1}
    points = told["moved"]["points"]
    assert round(points["largest_mm"], 9) == 0.25
    assert points["largest"]["epoch"] == points["largest_in_u"]["epoch"] == 1
    assert 0.0 < points["rms_mm"] < 0.25
    assert 0.0 < points["rms_u"] < points["largest_u"]


def test_other_calibrations_move_the_ranger_whose_mirror_they_change(catseye, tmp_path):
    """ZY102's D0 by 0.2 mm: ranges, and so the points that it sees, move by some of that, and none by centimetres."""
    folder = tmp_path / "site"
    shutil.copytree(small_site(), folder)
    mirror = folder / "mirrors" / f"{site().mirror_of('ZY102').zp}.toml"
    text = mirror.read_text()
    before = next(line for line in text.splitlines() if line.startswith("d0_mm"))
    mirror.write_text(text.replace(before, f"d0_mm = {float(before.split('=')[1]) + 0.2}"))
    status, out, err = catseye("replay", recorded(), "--calibrations", folder, "--json")
    told = json.loads(out)
    assert (status, err, told["same"], told["cause"]) == (0, "", False, "records")
    largest = [point["largest_mm"] for point in told["points"].values()]
    assert 0.001 < max(largest) < 10.0
    assert told["epochs_same"] == 0


def test_a_journal_that_was_changed_is_found_out(catseye, tmp_path):
    """One sample's bit of one shot: status 1, and the place."""
    journal = tmp_path / "changed.db"
    shutil.copy(recorded(), journal)
    with sqlite3.connect(journal) as connection:
        seq, value = connection.execute("SELECT seq, range_m FROM shots WHERE status = 'used' LIMIT 1").fetchone()
        connection.execute("UPDATE shots SET range_m = ? WHERE seq = ?", (value + 1e-9, seq))
    connection.close()
    status, out, _ = catseye("replay", journal)
    assert status == 1
    assert "the first difference is epoch 1" in " ".join(out.split())
    assert json.loads(catseye("replay", journal, "--json")[1])["cause"] == "journal"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.db"], "none.db"),
        ([__file__], "is not a journal"),
        (["JOURNAL", "--run", "7"], "run 7 names 0 runs"),
        (["JOURNAL", "--calibrations", "nowhere"], "nowhere"),
    ],
)
def test_what_is_not_there_is_one_line_and_status_1(catseye, words, said):
    status, out, err = catseye("replay", *(recorded() if word == "JOURNAL" else word for word in words))
    assert (status, out) == (1, "")
    assert said in err
    assert err.count("\n") == 1
