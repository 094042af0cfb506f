"""Cubes of a ZY: coordinates, encoder values, last measurements.

Encoder values are computed on demand, cached, and dropped when the cube's coordinates or the ranger's geometry change.
Those of the internal cube, number 0, ZRG, are never computed: they are set.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catseye.constants import MILLIMETRE
from catseye.errors import InputError
from catseye.geometry.mirror.encoder import choice, prime_counts
from catseye.geometry.mirror.pointing import MirrorStation, aim
from catseye.ranger.values import Value

REFERENCE = "ZRG"
GEOMETRY = ("BP", "ALPHA", "BETA", "MO", "EZ")


@dataclass(frozen=True)
class RangerShot:
    """Result of one measurement.

    V, rad, mm (for a benchmark the group index; None without a reference), ticks.
    """

    amplitude: float
    phase: float
    distance: float | None
    ticks: int


@dataclass(frozen=True)
class Cube:
    """One target.

    number, name   0 is ZRG
    place_mm       ground frame
    kind           R internal, S standard, B benchmark
    value_mm       constant of a standard cube's prism, certified distance of a benchmark
    shot           the last, None before it
    """

    number: int
    name: str
    place_mm: tuple[float, float, float]
    kind: str = "S"
    value_mm: float = 0.0
    shot: RangerShot | None = None


class Cubes:
    """Table of cubes, and the ranger's geometry.

    limits   counts, lowest and highest azimuth
    """

    def __init__(self, limits: tuple[float, float]):
        self.limits = limits
        self.geometry: dict[str, tuple[float, ...]] = {
            "BP": (0.0, 0.0, 0.0),
            "ALPHA": (0.0, 0.0, 0.0),
            "BETA": (0.0, 0.0),
            "MO": (0.0, 0.0, 0.0),
            "EZ": (0.0, 0.0),
        }
        self.allocated = 0
        self.by_number: dict[int, Cube] = {0: Cube(0, REFERENCE, (0.0, 0.0, 0.0), "R")}
        self._numbers = {REFERENCE: 0}  # by name in capitals
        self._counts: dict[int, list[float | None]] = {0: [None, None]}
        self._station: MirrorStation | None = None
        self.computed = 0  # number of times that encoder values were computed

    @property
    def station(self) -> MirrorStation:
        """The mirror on its monument. Source: [PARKER04] section 2.2."""
        if self._station is None:
            g = self.geometry
            self._station = MirrorStation(
                np.array(g["BP"]) * MILLIMETRE,
                np.array(g["ALPHA"]),
                np.array(g["MO"]) * MILLIMETRE,
                np.array(g["BETA"]),
                np.array(g["EZ"]),
            )
        return self._station

    def allocate(self, count: int) -> None:
        """Allocate cubes 1 to count; existing ones but ZRG are dropped."""
        self.allocated = count
        self.by_number = {0: self.by_number[0]}
        self._numbers = {REFERENCE: 0}
        self._counts = {0: self._counts[0]}

    def set_geometry(self, name: str, values: tuple[float, ...]) -> None:
        """Set one of `GEOMETRY`; encoder values but ZRG's are dropped."""
        self.geometry[name] = values
        self._station = None
        self._counts = {0: self._counts[0]}

    def find(self, key: Value) -> Cube:
        """Cube by number or name, in any case.

        Raises InputError: no such cube.
        """
        number = key if isinstance(key, int) else self._numbers.get(str(key).upper(), -1)
        cube = self.by_number.get(number)
        if cube is None:
            raise InputError(f"unknown cube {key} (expected one of {len(self.by_number)} listed by COO)")
        return cube

    def place(self, key: Value, place_mm: tuple[float, float, float], name: str | None) -> Cube:
        """Move a cube, or with a name create or replace it.

        Raises InputError: ZRG, not allocated, unknown without a name, or the name of another cube.
        """
        if name is None or not isinstance(key, int):
            old = self.find(key)
            cube = replace(old, place_mm=place_mm, shot=None, name=old.name if name is None else name)
        else:
            cube = Cube(key, name, place_mm)
        if cube.number == 0:
            raise InputError("cube 0 is ZRG, inside the instrument (expected 1 or above; its distance is D0)")
        if not 1 <= cube.number <= self.allocated:
            raise InputError(f"cube {cube.number} is not allocated (expected 1 to {self.allocated}; INI allocates)")
        owner = self._numbers.get(cube.name.upper(), cube.number)
        if owner != cube.number:
            raise InputError(f"name {cube.name} belongs to cube {owner} (expected another)")
        self.put(cube)
        self._counts.pop(cube.number, None)
        return cube

    def put(self, cube: Cube) -> None:
        """Replace the cube of this number; its encoder values stay."""
        if cube.number in self.by_number:
            del self._numbers[self.by_number[cube.number].name.upper()]
        self.by_number[cube.number] = cube
        self._numbers[cube.name.upper()] = cube.number

    def counts(self, cube: Cube) -> tuple[float, float]:
        """Encoder values of a cube.

        Raises InputError: ZRG's were not set, or no setting within the stops points at the cube.
        """
        cached = self._counts.setdefault(cube.number, [None, None])
        if None in cached:
            if cube.number == 0:
                raise InputError("encoder values of ZRG are not set (expected AZM 0, e and ELV 0, e first)")
            computed = self.look(cube.place_mm)
            cached[:] = [old if old is not None else new for old, new in zip(cached, computed.tolist(), strict=True)]
        return float(cached[0] or 0.0), float(cached[1] or 0.0)

    def set_counts(self, cube: Cube, axis: int, value: float) -> None:
        """Set an encoder value by hand, until it would be dropped."""
        self._counts.setdefault(cube.number, [None, None])[axis] = value

    def one_count(self, cube: Cube, axis: int) -> float:
        """One encoder value; for ZRG the other may be unset."""
        cached = self._counts.get(cube.number, [None, None])[axis]
        return cached if cached is not None else self.counts(cube)[axis]

    def look(self, place_mm: tuple[float, ...], current: tuple[float, float] | None = None) -> NDArray[np.float64]:
        """Counts (2,) for a point, direct pointing if the stops allow it, else prime.

        place_mm   ground frame
        current    present counts of the mirror: then the nearer of the two pointings

        Raises InputError: neither is allowed. Source: [PARKER04] eq. 2.12 to 2.26, section 2.4.
        """
        self.computed += 1
        pointing = aim(self.station, np.array(place_mm) * MILLIMETRE)
        direct = np.array([pointing.azimuth_counts, pointing.elevation_counts])
        prime = np.array(prime_counts(direct[0], direct[1], self.station.zeros[1]))
        chosen = choice(direct, prime, low=self.limits[0], high=self.limits[1], current=current)
        if not chosen.allowed:
            raise InputError(
                f"no setting within the stops {self.limits[0]:g} to {self.limits[1]:g} counts looks at "
                f"{', '.join(f'{v:.3f}' for v in place_mm)} mm"
            )
        return np.asarray(chosen.counts)

    def coarse_mm(self, cube: Cube) -> float:
        """Distance from the scan point by coordinates, mm."""
        return float(np.linalg.norm(np.array(cube.place_mm) - self.station.scan_point / MILLIMETRE))
