"""Recorded moves of a mirror's axis, a CSV: `time_s`, `drive_steps`, `position_counts`, and `move` if several."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catseye.records.files.columns import columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import refusal

FEWEST = 50  # samples of a move
UNEVEN = 1e-3  # of the sample time
MOST_STEPS = 128.0  # of the 8-bit converter
MOST_COUNTS = 1e9


@dataclass(frozen=True, eq=False)
class RecordedMove:
    """Samples of one move, evenly spaced.

    name       of the move
    time       (n,) s
    drive      (n,) steps of the 8-bit converter, computed at the sample
    position   (n,) counts, read at the sample
    """

    name: str
    time: np.ndarray
    drive: np.ndarray
    position: np.ndarray

    @property
    def sample(self) -> float:
        """Time between two samples, s."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))


def read_moves(path: Path) -> tuple[RecordedMove, ...]:
    """Moves of a table in its order; InputError names file, line, value.

    path   of the table
    """
    table = columns_of(
        Folder(path.parent).text(path.name),
        path.name,
        ["time_s", "drive_steps", "position_counts"],
        optional=["move"],
    )
    time, drive, position = (table.numbers(name) for name in ("time_s", "drive_steps", "position_counts"))
    table.check("time_s", np.isfinite(time), "a finite number")
    table.check("drive_steps", np.abs(drive) <= MOST_STEPS, f"-{MOST_STEPS:g} to {MOST_STEPS:g} steps")
    table.check("position_counts", np.abs(position) <= MOST_COUNTS, "-1e9 to 1e9 counts")
    names = np.array(table.cells["move"] if "move" in table.cells else ["1"] * len(table))
    moves = []
    for name in dict.fromkeys(names.tolist()):
        use = names == name
        if use.sum() < FEWEST:
            raise refusal(path.name, f"move {name} has {use.sum()} samples (expected {FEWEST} or more)")
        move = RecordedMove(str(name), time[use], drive[use], position[use])
        if not move.sample > 0.0 or np.abs(np.diff(move.time) - move.sample).max() > UNEVEN * move.sample:
            raise refusal(
                path.name, f"the samples of move {name} are not evenly spaced in time (expected a fixed sample time)"
            )
        moves.append(move)
    return tuple(moves)
