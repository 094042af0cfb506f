"""What one ranger was told, as far as it decides where its mirror goes: cubes, geometry, targets of axes, the laser.

A guard keeps it from the requests that it let pass, and from the replies that it hears.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

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

Array = NDArray[np.float64]
GEOMETRY = ("BP", "ALPHA", "BETA", "MO", "EZ")


@dataclass
class Stand:
    """Where a mirror may be: counts (2,) from low to high; NaN of an axis of which nothing is known.

    arrives   ticks from which on it is taken to rest at `goal` (low, high), unless a failure was heard
    by        the command that moves it
    way       what `low` and `high` were on the last way
    """

    low: Array = field(default_factory=lambda: np.full(2, np.nan))
    high: Array = field(default_factory=lambda: np.full(2, np.nan))
    goal: tuple[Array, Array] | None = None
    arrives: int | None = None
    by: str = ""
    way: tuple[Array, Array] | None = None

    @property
    def known(self) -> bool:
        """Whether both axes' counts are known."""
        return bool(np.isfinite(self.low).all())

    def settle(self, now_ticks: int) -> None:
        """Note that the mirror stands at its goal, if it is time."""
        if self.goal is not None and self.arrives is not None and now_ticks >= self.arrives:
            self.arrive()

    def arrive(self) -> None:
        """Note that the mirror stands at its goal."""
        if self.goal is not None:
            self.low, self.high = self.goal
            self.goal = self.arrives = None

    def go(self, low: Array, high: Array, arrives: int, by: str) -> None:
        """Under way from wherever it is to a rectangle of counts."""
        self.goal, self.arrives, self.by = (low, high), arrives, by
        self.low, self.high = np.minimum(self.low, low), np.maximum(self.high, high)
        self.way = self.low, self.high

    def rest(self, axis: int, counts: float) -> None:
        """One axis is known to stand at counts."""
        self.low, self.high = self.low.copy(), self.high.copy()
        self.low[axis] = self.high[axis] = counts
        self.goal = self.arrives = self.way = None

    def failed(self) -> None:
        """The last move may have stopped anywhere on its way: it is there until counts are heard, or another ends."""
        self.goal = self.arrives = None
        if self.way is not None:
            self.low, self.high = self.way

    def lose(self, axis: int) -> None:
        """Nothing is known of an axis: it looks for its index."""
        self.low, self.high = self.low.copy(), self.high.copy()
        self.low[axis] = self.high[axis] = np.nan
        self.goal = self.arrives = self.way = None


class Memory:
    """The memory of one ranger.

    vantage   by the records, for its stops
    """

    def __init__(self, vantage: Vantage):
        self.vantage, self.stand = vantage, Stand()
        self.laser_off = False
        self.shining = False
        self.forget()

    def forget(self) -> None:
        """As when its power comes on."""
        self._table = Cubes(self.vantage.stops)
        self._places: dict[int, tuple[float, ...]] = {}
        self._numbers: dict[str, int] = {REFERENCE: 0}
        self._counts: dict[int, list[float | None]] = {}
        self.axes = (AxisSettings(), AxisSettings())
        self.order: list[int] = []

    @property
    def believed(self) -> MirrorStation:
        """The mirror as the ranger was told that it stands."""
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
        """The number of a cube, by number or name. Raises InputError: it was not told."""
        number = cube if isinstance(cube, int) else self._numbers.get(str(cube).upper())
        if number is None or (number != 0 and number not in self._places):
            raise InputError(f"cube {cube} was not told to {self.vantage.name} (expected COO first)")
        return number

    def counts(self, cube: Value) -> Array:
        """Counts (2,) to which CIL or CMEAS of a cube leads. Raises InputError: unknown, out of reach, ZRG not set."""
        number = self.number(cube)
        kept = self._counts.get(number, [None, None])
        looked = self.look(self._places[number]) if None in kept and number else np.full(2, np.nan)
        counts = np.array([v if k is None else k for k, v in zip(kept, looked, strict=True)], dtype=float)
        if not np.isfinite(counts).all():
            raise InputError(f"counts of ZRG were not told to {self.vantage.name} (expected AZM 0, c and ELV 0, c)")
        return counts

    def look(self, place_mm: tuple[float, ...]) -> Array:
        """Counts (2,) to which a point (mm, the ranger's own frame) leads. Raises InputError: beyond the stops."""
        return self._table.look(place_mm)

    def take(self, request: Request, values: tuple[Value, ...]) -> None:
        """A request that was let pass, and its values where they were read."""
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
        """What a reply says of where the mirror stands and of the laser; what cannot be read says nothing."""
        try:
            if command == "STW" and ok:
                self._status(StatusWord(int(values[0], 16)))
            elif command in (self.stand.by, "WAI") and ok is False:
                self.stand.failed()
            elif command in ("ACP", "WAI") and ok:
                if self.stand.goal is None:  # else it is under way to there
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
        """COO n, x, y, z[, name]; thousands of them are told, so they are read here."""
        key, place = parameters[0], tuple(float(p) for p in parameters[1:4])
        number = int(key) if key.isdecimal() else self.number(key)
        self._places[number] = place
        self._counts.pop(number, None)
        if len(parameters) == 5:
            self._numbers[parameters[4].upper()] = number
