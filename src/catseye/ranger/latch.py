"""A dark order from outside the lease, which holds until a person clears it, also over a new start of the server.

Where a ranger has a folder of its own, the order is a file in it: a program that is started again reads it.
"""

import logging
from dataclasses import dataclass
from pathlib import Path

LOG = logging.getLogger(__name__)
FILE = "LATCH"
LIGHTING = frozenset(["PS", "CMEAS", "TRG", "SCN", "STM"])
MOVING = frozenset(["AXIS", "STT", "FHM", "CIL", "CMEAS", "TRK", "SCN"])


@dataclass(frozen=True)
class Latch:
    """An order that holds until it is cleared.

    light, moves   which of both
    order          the command and who gave it, in words
    """

    light: bool
    moves: bool
    order: str

    def joined(self, other: "Latch | None") -> "Latch":
        """This order on top of one that holds already, whose words stay."""
        if other is None:
            return self
        return Latch(self.light or other.light, self.moves or other.moves, other.order)

    def refuses(self, command: str) -> bool:
        """True for a command that it forbids, of those that switch on, fire or move."""
        return (self.light and command in LIGHTING) or (self.moves and command in MOVING)

    @property
    def extent(self) -> str:
        """Extent of the order, in words."""
        return " and ".join(word for word, off in (("light", self.light), ("moves", self.moves)) if off)


def stored_latch(folder: Path | None) -> Latch | None:
    """The order that a ranger's folder holds; a file that cannot be read counts as one for light and moves."""
    if folder is None:
        return None
    try:
        lines = (folder / FILE).read_text("ascii").splitlines()
        extent, order = lines[0].split(" and "), lines[1]
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError, IndexError):
        return Latch(True, True, f"an order in {FILE} that cannot be read")
    return Latch("light" in extent, "moves" in extent, order)


def store_latch(folder: Path | None, latch: Latch | None) -> None:
    """Write the order to a ranger's folder, or take it away; a folder that cannot be written keeps none."""
    if folder is None:
        return
    path, new = folder / FILE, folder / f".{FILE}.new"
    try:
        if latch is None:
            path.unlink(missing_ok=True)
            return
        new.write_text(f"{latch.extent}\n{latch.order}\n", "ascii")
        new.replace(path)
    except OSError as problem:
        LOG.warning("%s: the order holds until this program ends only: %s", path, problem)
