"""Recorded moves: names, sample time, and tables that are no moves."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.laboratory.move_table import FEWEST, read_moves


def written(folder, rows, header="move,time_s,drive_steps,position_counts"):
    path = folder / "moves.csv"
    path.write_text("\n".join([header, *rows]) + "\n", "utf-8")
    return path


def test_moves_come_in_their_order_each_with_its_samples(tmp_path):
    rows = [f"{name},{0.001 * k:.3f},{k % 7},{k}" for name in ("up", "down") for k in range(FEWEST)]
    first, second = read_moves(written(tmp_path, rows))
    assert (first.name, second.name) == ("up", "down")
    assert first.sample == pytest.approx(0.001)
    assert np.array_equal(second.position, np.arange(FEWEST))
    bare = [row.split(",", 1)[1] for row in rows[:FEWEST]]
    assert len(read_moves(written(tmp_path, bare, "time_s,drive_steps,position_counts"))) == 1


def test_a_short_move_is_refused(tmp_path):
    rows = [f"up,{0.001 * k:.3f},1,{k}" for k in range(FEWEST - 1)]
    with pytest.raises(InputError, match=f"move up has {FEWEST - 1} samples"):
        read_moves(written(tmp_path, rows))
