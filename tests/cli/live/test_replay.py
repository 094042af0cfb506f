"""A journal again: the same to the last bit, and with other calibrations."""

import json
import shutil
import sqlite3

import pytest

from cli.living_scene import recorded, small_site
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
    assert (status, err, told["same"]) == (0, "", False)
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
    assert "the first that differs is epoch 1" in " ".join(out.split())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.db"], "none.db"),
        ([__file__], "no journal"),
        (["JOURNAL", "--run", "7"], "run 7 names 0 runs"),
        (["JOURNAL", "--calibrations", "nowhere"], "nowhere"),
    ],
)
def test_what_is_not_there_is_one_line_and_status_1(catseye, words, said):
    status, out, err = catseye("replay", *(recorded() if word == "JOURNAL" else word for word in words))
    assert (status, out) == (1, "")
    assert said in err
    assert err.count("\n") == 1
