"""State of one ranger as known to the guard: cubes, geometry, axes, laser.

A guard updates it from the requests that it let pass, and from the replies.
"""

from dataclasses import dataclass, field

import numpy as np

from catseye.aliases import Array
from catseye.coordinator.visibility.vantage import Vantage
from catseye.errors import InputError
from catseye.geometry.mirror.pointing import MirrorStation
from catseye.geometry.mirror.slew import Pace
from catseye.ranger.cubes import Cubes
from catseye.ranger.line import Request
from catseye.ranger.motion_units import acceleration_counts, velocity_counts
from catseye.ranger.state import AxisSettings
from catseye.ranger.status import StatusWord
from catseye.ranger.values import Value
from catseye.records.site.folder import REFERENCE

GEOMETRY = ("BP", "ALPHA", "BETA", "MO", "EZ")


@dataclass
class Stand:
    """Possible position of a mirror: counts (2,) from low to high.

    NaN for an axis whose position is unknown.

    arrives   ticks from which it is assumed to be at `goal` (low, high), unless a failure was reported
    by        the command that moves it
    path      `low` and `high` during the last move
    """

    low: Array = field(default_factory=lambda: np.full(2, np.nan))
    high: Array = field(default_factory=lambda: np.full(2, np.nan))
    goal: tuple[Array, Array] | None = None
    arrives: int | None = None
    by: str = ""
    path: tuple[Array, Array] | None = None

    @property
    def known(self) -> bool:
        """True if both axes' counts are known."""
        return bool(np.isfinite(self.low).all())

    def settle(self, now_ticks: int) -> None:
        """Set the mirror at its goal, if it is time."""
        if self.goal is not None and self.arrives is not None and now_ticks >= self.arrives:
            self.arrive()

    def arrive(self) -> None:
        """Set the mirror at its goal."""
        if self.goal is not None:
            self.low, self.high = self.goal
            self.goal = self.arrives = None

    def go(self, low: Array, high: Array, arrives: int, by: str) -> None:
        """Start a move from anywhere to a rectangle of counts."""
        self.goal, self.arrives, self.by = (low, high), arrives, by
        self.low, self.high = np.minimum(self.low, low), np.maximum(self.high, high)
        self.path = self.low, self.high

    def rest(self, axis: int, counts: float) -> None:
        """Set the known position of one axis, counts."""
        self.low, self.high = self.low.copy(), self.high.copy()
        self.low[axis] = self.high[axis] = counts
        self.goal = self.arrives = self.path = None

    def failed(self) -> None:
        """Note that the last move may have stopped anywhere on its path.

        That holds until counts are reported, or another move ends.
        """
        self.goal = self.arrives = None
        if self.path is not None:
            self.low, self.high = self.path

    def lose(self, axis: int) -> None:
        """Forget an axis's position: it searches for its index."""
        self.low, self.high = self.low.copy(), self.high.copy()
        self.low[axis] = self.high[axis] = np.nan
        self.goal = self.arrives = self.path = None


class Memory:
    """Guard's state of one ranger.

    vantage   by the records, for its stops
    """

    def __init__(self, vantage: Vantage):
        self.vantage, self.stand = vantage, Stand()
        self.laser_off = False
        self.shining = False
        self.forget()

    def forget(self) -> None:
        """Reset to the state at power-on."""
        self._table = Cubes(self.vantage.stops)
        self._places: dict[int, tuple[float, ...]] = {}
        self._numbers: dict[str, int] = {REFERENCE: 0}
        self._counts: dict[int, list[float | None]] = {}
        self.axes = (AxisSettings(), AxisSettings())
        self.order: list[int] = []

    @property
    def station(self) -> MirrorStation:
        """The mirror by the geometry sent to the ranger."""
        return self._table.station

    @property
    def pace(self) -> Pace:
        """Speed and acceleration of its next moves."""
        velocity, acceleration = (
            (convert(getattr(self.axes[0], name)), convert(getattr(self.axes[1], name)))
            for name, convert in (("velocity", velocity_counts), ("acceleration", acceleration_counts))
        )
        return Pace(velocity, acceleration)

    def number(self, cube: Value) -> int:
        """Number of a cube, by number or name.

        Raises InputError: not sent to the ranger.
        """
        number = cube if isinstance(cube, int) else self._numbers.get(str(cube).upper())
        if number is None or (number != 0 and number not in self._places):
            raise InputError(f"cube {cube} was not sent to {self.vantage.name} (expected COO first)")
        return number

    def counts(self, cube: Value) -> Array:
        """Destination of CIL or CMEAS of a cube, counts (2,).

        Raises InputError: unknown, out of reach, ZRG not set.
        """
        number = self.number(cube)
        cached = self._counts.get(number, [None, None])
        computed = self.look(self._places[number]) if None in cached and number else np.full(2, np.nan)
        counts = np.array([v if k is None else k for k, v in zip(cached, computed, strict=True)], dtype=float)
        if not np.isfinite(counts).all():
            raise InputError(f"counts of ZRG were not sent to {self.vantage.name} (expected AZM 0, c and ELV 0, c)")
        return counts

    def look(self, place_mm: tuple[float, ...]) -> Array:
        """Destination for a point (mm, the ranger's own frame), counts (2,).

        Raises InputError: beyond the stops.
        """
        return self._table.look(place_mm)

    def take(self, request: Request, values: tuple[Value, ...]) -> None:
        """Take in a request let pass, with its values if parsed."""
        name = request.command
        if name == "COO" and len(request.parameters) >= 4:
            self._place(request.parameters)
        elif name == "INI":
            self._places.clear()
            self._numbers = {REFERENCE: 0}
            self._counts = {0: self._counts.get(0, [None, None])}
            self.order = []
        elif name in GEOMETRY and values:
            self._table.set_geometry(name, tuple(float(v) for v in values))
            self._counts = {0: self._counts.get(0, [None, None])}
        elif name in ("AZM", "ELV") and len(values) == 2:
            self._counts.setdefault(self.number(values[0]), [None, None])[int(name == "ELV")] = float(values[1])
        elif name in ("ABP", "ABV", "ABA") and len(values) == 2:
            field_ = {"ABP": "position", "ABV": "velocity", "ABA": "acceleration"}[name]
            setattr(self.axes[int(values[0])], field_, int(values[1]))
        elif name == "NUM" and values:
            self.order = (self.order + [0] * int(values[0]))[: int(values[0])]
        elif name == "ORD" and len(values) == 2 and int(values[0]) <= len(self.order):
            self.order[int(values[0]) - 1] = self.number(values[1])
        elif name == "PS" and values:
            self.shining, self.laser_off = values[0] == 1, values[0] == 0
        elif name == "RST":
            self.forget()
            self.stand = Stand()

    def hear(self, command: str, ok: bool | None, values: tuple[str, ...]) -> None:
        """Update position and laser from a reply; ignore unreadable ones."""
        try:
            if command == "STW" and ok:
                self._status(StatusWord(int(values[0], 16)))
            elif command in (self.stand.by, "WAI") and ok is False:
                self.stand.failed()
            elif command in ("ACP", "WAI") and ok:
                if self.stand.goal is None:  # else it is still moving
                    self.stand.rest(int(values[0]), float(values[1]))
            elif command == self.stand.by and ok and (command == "CIL" or (command == "CMEAS" and values[0] == "1")):
                self.stand.arrive()
            elif command == "FHM" and ok:
                self.stand.rest(int(values[0]), 0.0)
        except (ValueError, IndexError):
            return

    def _status(self, word: StatusWord) -> None:
        self.laser_off = bool(word & StatusWord.LASER_OFF)
        if word & (StatusWord.AZIMUTH_OFF | StatusWord.ELEVATION_OFF):
            self.stand.failed()
        for axis, home in enumerate((StatusWord.AZIMUTH_HOMED, StatusWord.ELEVATION_HOMED)):
            if not word & home:
                self.stand.lose(axis)

    def _place(self, parameters: tuple[str, ...]) -> None:
        """Take in COO n, x, y, z[, name], fast since there are thousands."""
        key, place = parameters[0], tuple(float(p) for p in parameters[1:4])
        number = int(key) if key.isdecimal() else self.number(key)
        self._places[number] = place
        self._counts.pop(number, None)
        if len(parameters) == 5:
            self._numbers[parameters[4].upper()] = number
