"""Table of a TOML file, read key by key; unused keys are refused. Units are in the keys."""

import difflib
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE, PPM
from catseye.errors import InputError
from catseye.records.files.refusal import refusal, shown

GON = 0.9 * DEGREE
LENGTH = {"m": 1.0, "mm": MILLIMETRE, "um": 1e-6}
ANGLE = {
    "rad": 1.0,
    "mrad": 1e-3,
    "urad": 1e-6,
    "deg": DEGREE,
    "arcsec": ARCSECOND,
    "gon": GON,
    "mgon": 1e-3 * GON,
    "cc": 1e-4 * GON,
}
RATIO = {"ppm": PPM, "ppb": 1e-9, "ratio": 1.0}
DIMENSIONS = {"m": LENGTH, "rad": ANGLE, "1": RATIO}
DMS = re.compile(r"([+-]?)([0-9]+)-([0-9]+)-([0-9]+(?:\.[0-9]*)?)")


@dataclass(eq=False)
class Fields:
    """One table of a file.

    file      file name, for messages
    place     place of the table
    values    keys and values
    used      keys that were read
    """

    file: str
    place: str
    values: dict[str, Any]
    used: set[str] = field(default_factory=set)
    requested: set[str] = field(default_factory=set)

    def refuse(self, problem: str) -> InputError:
        place = self.place.removeprefix(f"{self.file} ")  # rows of a table that a TOML file names
        return refusal(self.file, f"{place}, {problem}")

    def has(self, key: str) -> bool:
        self.requested.add(key)
        return key in self.values

    def take(self, key: str, kind: type | tuple[type, ...], expected: str, default: Any = None) -> Any:
        """Value of a type; the default if the key is absent, or an error if that is None."""
        self.requested.add(key)
        self.used.add(key)
        if key not in self.values:
            if default is None:
                raise self.refuse(f"{key} is missing (expected {expected})")
            return default
        value = self.values[key]
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise self.refuse(f"{key} = {shown(value)} (expected {expected})")
        return value

    def text(self, key: str, default: str | None = None) -> str:
        return str(self.take(key, str, "some text", default))

    def tables(self, key: str) -> list["Fields"]:
        """Tables within this one; empty if the key is absent."""
        tables = self.take(key, list, "tables", [])
        if not all(isinstance(table, dict) for table in tables):
            raise self.refuse(f"{key} = {shown(tables)} (expected tables)")
        return [Fields(self.file, f"{self.place}, {key} {i}", table) for i, table in enumerate(tables, start=1)]

    def keyed(self, stem: str, units: dict[str, float]) -> tuple[str, float] | None:
        """Present key of a stem and its unit's size in SI, or None; an error for two."""
        keys = [f"{stem}_{unit}" if stem else unit for unit in units]
        self.requested.update(keys)
        present = [key for key in keys if key in self.values]
        if len(present) > 1:
            raise self.refuse(f"{present[0]} and {present[1]} give the same quantity (expected one of them)")
        return (present[0], units[present[0].removeprefix(f"{stem}_")]) if present else None

    def quantity(self, stem: str, units: dict[str, float], default: float | None = None) -> float:
        """Number in SI, in the unit of its key; angles also as stem_dms = "ddd-mm-ss.s"."""
        if units is ANGLE and f"{stem}_dms" in self.values:
            return self._dms(f"{stem}_dms")
        key = self.keyed(stem, units)
        if key is None:
            if default is None:
                raise self.refuse(f"{stem} is missing (expected {', '.join(f'{stem}_{unit}' for unit in units)})")
            return default
        return self.number(key[0]) * key[1]

    def number(self, key: str, default: float | None = None) -> float:
        value = float(self.take(key, (int, float), "a finite number", default))
        if not math.isfinite(value):
            raise self.refuse(f"{key} = {value} (expected a finite number)")
        return value

    def array(self, key: str, shape: tuple[int, ...]) -> np.ndarray:
        """Numbers of a shape, with 0 for any size."""
        value = self.take(key, list, "numbers")
        try:
            array = np.array(value, dtype=float)
        except (TypeError, ValueError):
            array = np.full(1, np.nan)
        fits = array.ndim == len(shape) and all(s in (0, n) for s, n in zip(shape, array.shape, strict=True))
        if not fits or not np.isfinite(array).all():
            size_text = " x ".join(str(s) if s else "any number" for s in shape)
            raise self.refuse(f"{key} = {shown(value)} (expected {size_text} finite numbers)")
        return array

    def vector(self, stem: str, units: dict[str, float], default: Sequence[float] | None = None) -> np.ndarray:
        """Three numbers of a key in SI, (3,)."""
        key = self.keyed(stem, units)
        if key is None:
            if default is None:
                raise self.refuse(f"{stem} is missing (expected {', '.join(f'{stem}_{unit}' for unit in units)})")
            return np.array(default, dtype=float)
        return self.array(key[0], (3,)) * key[1]

    def uncertainties(self, size: int, *, or_zero: bool = False) -> np.ndarray | None:
        """Covariance (size, size) m^2 from covariance_mm2, or from u_mm etc., one or each; or None."""
        key = self.keyed("u", LENGTH)
        if self.has("covariance_mm2"):
            if key is not None:
                raise self.refuse(f"{key[0]} and covariance_mm2 give the same quantity (expected one of them)")
            return self.array("covariance_mm2", (size, size)) * MILLIMETRE**2
        if key is None:
            return None
        one = not isinstance(self.values[key[0]], list)
        u = np.full(size, self.number(key[0])) if one else self.array(key[0], (size,))
        if not np.all(u >= 0.0 if or_zero else u > 0.0):
            limit = "0 or above" if or_zero else "above 0: no measurement is exact"
            raise self.refuse(f"{key[0]} = {shown(self.values[key[0]])} (expected {limit})")
        return np.diag((u * key[1]) ** 2)

    def refuse_unused(self) -> None:
        """Raise InputError for all unused keys at once."""
        strange = [key for key in self.values if key not in self.used]
        if not strange:
            return
        hints = []
        for key in strange:
            close = difflib.get_close_matches(key, sorted(self.requested - set(self.values)), n=1)
            hints.append(f"perhaps {close[0]}" if close else "no such key")
        named, verb = ", ".join(map(shown, strange)), "is not a known key" if len(strange) == 1 else "are no known keys"
        expected = hints[0] if len(set(hints)) == 1 else ", ".join(hints)
        raise self.refuse(f"{named} {verb} here (expected {expected})")

    def _dms(self, key: str) -> float:
        text = self.text(key)
        parts = DMS.fullmatch(text)
        if parts is None or float(parts[3]) >= 60.0 or float(parts[4]) >= 60.0:
            raise self.refuse(f"{key} = {shown(text)} (expected degrees-minutes-seconds, ' and \" below 60)")
        size = (float(parts[2]) + float(parts[3]) / 60.0 + float(parts[4]) / 3600.0) * DEGREE
        return -size if parts[1] == "-" else size
