"""Stop order from outside the lease, latched until a person clears it.

If a ranger has a folder, the order is a file in it, and survives a restart of the server.
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

    light, moves   True for what is forbidden
    order          the command and its sender, in words
    """

    light: bool
    moves: bool
    order: str

    def joined(self, standing_order: "Latch | None") -> "Latch":
        """This order added to an existing one, whose text stays."""
        if standing_order is None:
            return self
        return Latch(self.light or standing_order.light, self.moves or standing_order.moves, standing_order.order)

    def refuses(self, command: str) -> bool:
        """True for a command that it forbids."""
        return (self.light and command in LIGHTING) or (self.moves and command in MOVING)

    @property
    def extent(self) -> str:
        """Extent of the order, in words."""
        return " and ".join(word for word, off in (("light", self.light), ("moves", self.moves)) if off)


def read_latch(folder: Path | None) -> Latch | None:
    """Order stored in a folder; an unreadable one forbids light and moves."""
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
    """Write the order to a folder or remove it; errors are logged."""
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
        LOG.warning("%s: not stored, the order is lost when this program ends: %s", path, problem)
