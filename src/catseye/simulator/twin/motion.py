"""Motion of the telescope's axes: true angles and rates from a text.

    fixed AZ EL                        stands, degrees
    track AZ EL                        follows the object of the sky that is there at the start
    slew AZ0 EL0 AZ1 EL1               at 35.2 and 17.6 degrees a minute, 0.2 degrees a second a second, then stands
    scan AZ EL WIDTH RATE              azimuth back and forth about AZ over WIDTH degrees at RATE degrees a minute
    table FILE                         CSV with the header mjd,azimuth_deg,elevation_deg; smooth between, constant
                                       outside

Azimuths are clockwise from north and count on past a turn, -540 to 540 degrees;
elevations are 5 to 95 degrees (a track: to 89).
"""

import csv
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catseye.aliases import Array
from catseye.constants import DEGREE, SECONDS_PER_DAY, TWO_PI
from catseye.errors import InputError

LOWEST_DEG, HIGHEST_DEG = 5.0, 95.0
FARTHEST_DEG = 540.0  # azimuth: a turn and a half either way, more than any telescope's cable wrap
TRACK_CLEARANCE_DEG = 1.0  # of the zenith: azimuth then turns at 11 degrees a minute at most
SIDEREAL_DAY = 86_164.098_903_69  # s of UT1: a turn of the Earth against the stars, IAU 2000
FASTEST = np.array([35.2, 17.6]) * DEGREE / 60.0  # rad/s, azimuth, elevation
ACCELERATION = 0.2 * DEGREE  # rad/s^2
EAST = np.array([1.0, 0.0, 0.0])
COLUMNS = ["mjd", "azimuth_deg", "elevation_deg"]


class AxisAngles(NamedTuple):
    """Azimuth and elevation (k,), rad, and rates (k,), rad/s."""

    azimuth: Array
    elevation: Array
    azimuth_rate: Array
    elevation_rate: Array


class AxisMotion(ABC):
    """Motion of the axes as a function of time."""

    @abstractmethod
    def angles(self, seconds: Array, *, latitude: float, start_mjd: float) -> AxisAngles:
        """Angles at times (k,), s since `start_mjd`, UTC, at a latitude, rad."""

    @staticmethod
    def parse(text: str) -> "AxisMotion":
        """Motion from text, as above. Raises InputError with the expectation.

        >>> AxisMotion.parse("slew 10 30 40 50")
        TelescopeSlew(start_deg=(10.0, 30.0), end_deg=(40.0, 50.0))
        """
        kind, *words = (text.split(maxsplit=1) if text.startswith("table ") else text.split()) or [""]
        if kind == "table" and words:
            return read_table(Path(words[0].strip()))
        arguments = {"fixed": 2, "track": 2, "slew": 4, "scan": 4}
        try:
            n = [float(word) for word in words]
        except ValueError:
            n = []
        if kind not in arguments or len(n) != arguments[kind] or not np.all(np.isfinite(n)):
            raise InputError(
                f"motion {text!r}: expected fixed AZ EL, track AZ EL, slew AZ0 EL0 AZ1 EL1, scan AZ EL WIDTH RATE "
                "(degrees, degrees a minute) or table FILE"
            )
        if kind == "fixed":
            return TelescopeSlew((n[0], n[1]), (n[0], n[1]))
        if kind == "track":
            return SkyTrack((n[0], n[1]))
        if kind == "slew":
            return TelescopeSlew((n[0], n[1]), (n[2], n[3]))
        return Scan((n[0], n[1]), n[2], n[3])


def _refuse_posture(posture_deg: tuple[float, float], where: str, highest: float = HIGHEST_DEG) -> None:
    azimuth_deg, elevation_deg = posture_deg
    if not abs(azimuth_deg) <= FARTHEST_DEG:
        raise InputError(
            f"{where}: azimuth {azimuth_deg:g} is outside {-FARTHEST_DEG:g} to {FARTHEST_DEG:g} (degrees): name another"
        )
    if not LOWEST_DEG <= elevation_deg <= highest:
        raise InputError(
            f"{where}: elevation {elevation_deg:g} is outside {LOWEST_DEG:g} to {highest:g} (degrees): name another"
        )


@dataclass(frozen=True)
class TelescopeSlew(AxisMotion):
    """Slew between postures, a trapezoid of speed on each axis.

    A fixed posture is a slew to itself.

    start_deg, end_deg   azimuth, elevation
    """

    start_deg: tuple[float, float]
    end_deg: tuple[float, float]

    def __post_init__(self) -> None:
        _refuse_posture(self.start_deg, "slew")
        _refuse_posture(self.end_deg, "slew")

    def angles(self, seconds: Array, *, latitude: float, start_mjd: float) -> AxisAngles:
        axes = []
        for axis in (0, 1):
            begin = self.start_deg[axis] * DEGREE
            travel = self.end_deg[axis] * DEGREE - begin
            if travel == 0.0:
                axes.append((np.full_like(seconds, begin), np.zeros_like(seconds)))
                continue
            speed = min(FASTEST[axis], np.sqrt(ACCELERATION * abs(travel)))
            rise = speed / ACCELERATION
            full = abs(travel) / speed + rise
            t = np.clip(seconds, 0.0, full)
            end = full - t
            passed = np.where(t < rise, 0.5 * ACCELERATION * t**2, speed * (t - 0.5 * rise))
            passed = np.where(end < rise, abs(travel) - 0.5 * ACCELERATION * end**2, passed)
            axes.append((begin + np.sign(travel) * passed, np.sign(travel) * ACCELERATION * _least(t, end, rise)))
        return AxisAngles(axes[0][0], axes[1][0], axes[0][1], axes[1][1])


def _least(since: Array, until: Array, rise: float) -> Array:
    """Effective acceleration time, limited to the full rise.

    Since the start, until the end.
    """
    return np.minimum(np.minimum(since, until), rise)


@dataclass(frozen=True)
class SkyTrack(AxisMotion):
    """Track of a sky object at sidereal rate, without refraction.

    start_deg   azimuth, elevation at the start; while the object is below 5 degrees the telescope waits there
    """

    start_deg: tuple[float, float]

    def __post_init__(self) -> None:
        _refuse_posture(self.start_deg, "track", 90.0 - TRACK_CLEARANCE_DEG)

    def angles(self, seconds: Array, *, latitude: float, start_mjd: float) -> AxisAngles:
        a, e = np.array(self.start_deg) * DEGREE
        direction = np.array([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), np.sin(e)])  # east, north, up
        pole = np.array([0.0, np.cos(latitude), np.sin(latitude)])
        meridian = np.array([0.0, -np.sin(latitude), np.cos(latitude)])
        declination = np.arcsin(direction @ pole)
        if abs(latitude - declination) < TRACK_CLEARANCE_DEG * DEGREE:
            raise InputError(
                f"track {self.start_deg[0]:g} {self.start_deg[1]:g}: the object passes "
                f"{abs(latitude - declination) / DEGREE:.2f} degrees from the zenith (expected {TRACK_CLEARANCE_DEG:g} "
                "or more, where azimuth can follow): name another"
            )
        south = (
            declination < latitude
        )  # passes the meridian south of the zenith, then azimuth goes round; else it oscillates
        round_trip = TWO_PI if south else 0.0
        lowest = (np.sin(LOWEST_DEG * DEGREE) - np.sin(latitude) * np.sin(declination)) / (
            np.cos(latitude) * np.cos(declination)
        )
        sets = np.arccos(np.clip(lowest, -1.0, 1.0))  # hour angle; pi where it never does

        def sky_angles(hour: Array) -> tuple[Array, Array, Array, Array]:
            """Azimuth off the meridian, elevation, and derivatives by hour angle."""
            cosine, sine = np.cos(hour)[:, None] * np.cos(declination), np.sin(hour)[:, None] * np.cos(declination)
            v = np.sin(declination) * pole + cosine * meridian - sine * EAST
            slope = -sine * meridian - cosine * EAST
            across = np.hypot(v[:, 0], v[:, 1])
            off = np.arctan2(-v[:, 0], -v[:, 1]) if south else np.arctan2(v[:, 0], v[:, 1])
            turn = (v[:, 1] * slope[:, 0] - v[:, 0] * slope[:, 1]) / across**2
            return off, np.arctan2(v[:, 2], across), turn, slope[:, 2] / across

        speed = TWO_PI / SIDEREAL_DAY
        first = np.arctan2(-direction[0], direction @ meridian)
        hours = first + speed * seconds
        transit = np.round(hours / TWO_PI)
        hour = hours - TWO_PI * transit
        off, elevation, turn, climb = sky_angles(hour)
        up = np.abs(hour) <= sets
        # below the limit it waits: low, and azimuth moves evenly to the rising point
        begin = float(sky_angles(np.array([sets]))[0][0])
        even = (round_trip - 2.0 * begin) / max(TWO_PI - 2.0 * sets, 1e-9)
        waits = begin + even * (np.where(hour > 0.0, hour, hour + TWO_PI) - sets)
        azimuth = round_trip * np.where(up | (hour > 0.0), transit, transit - 1.0)
        return AxisAngles(
            a - float(sky_angles(np.array([first]))[0][0]) + azimuth + np.where(up, off, waits),
            np.where(up, elevation, LOWEST_DEG * DEGREE),
            speed * np.where(up, turn, even),
            speed * np.where(up, climb, 0.0),
        )


@dataclass(frozen=True)
class Scan(AxisMotion):
    """Scan in azimuth at one elevation, turning outside the width.

    At the drives' acceleration.

    middle_deg      azimuth, elevation
    width_deg       of what is scanned at the full rate, above 0
    rate_deg_min    above 0, up to 35.2
    """

    middle_deg: tuple[float, float]
    width_deg: float
    rate_deg_min: float

    def __post_init__(self) -> None:
        _refuse_posture(self.middle_deg, "scan")
        if not (0.0 < self.width_deg <= 360.0 and 0.0 < self.rate_deg_min <= 35.2):
            raise InputError(
                f"scan: width {self.width_deg:g} degrees at {self.rate_deg_min:g} degrees a minute (expected 0 to 360 "
                "and 0 to 35.2, both above 0)"
            )

    def angles(self, seconds: Array, *, latitude: float, start_mjd: float) -> AxisAngles:
        speed, width = self.rate_deg_min * DEGREE / 60.0, self.width_deg * DEGREE
        sweep, turn = width / speed, 2.0 * speed / ACCELERATION
        half = sweep + turn
        phase = np.mod(seconds + 0.5 * sweep, 2.0 * half)  # from the lower end of the width, upwards
        back = phase >= half
        t = np.where(back, phase - half, phase)
        late = np.maximum(t - sweep, 0.0)
        up = speed * np.minimum(t, sweep) - 0.5 * width + speed * late - 0.5 * ACCELERATION * late**2
        rate = speed - ACCELERATION * late
        sign = np.where(back, -1.0, 1.0)
        elevation = np.full_like(up, self.middle_deg[1] * DEGREE)
        return AxisAngles(self.middle_deg[0] * DEGREE + sign * up, elevation, sign * rate, np.zeros_like(up))


@dataclass(frozen=True, eq=False)
class PostureTable(AxisMotion):
    """Posture table interpolated by cubics; constant before and after.

    The slopes are means of the neighbours.

    mjd, azimuth, elevation   (n,) UTC ascending, rad
    """

    mjd: Array
    azimuth: Array
    elevation: Array

    def angles(self, seconds: Array, *, latitude: float, start_mjd: float) -> AxisAngles:
        at = (self.mjd - start_mjd) * SECONDS_PER_DAY
        t = np.clip(seconds, at[0], at[-1])
        k = np.clip(np.searchsorted(at, t, side="right") - 1, 0, len(at) - 2)
        span = at[k + 1] - at[k]
        s = (t - at[k]) / span
        moving = (seconds >= at[0]) & (seconds <= at[-1])
        axes = []
        for y in (self.azimuth, self.elevation):
            slope = np.gradient(y, at)
            slope[0] = slope[-1] = 0.0
            slope_before, slope_after, rise = slope[k] * span, slope[k + 1] * span, y[k + 1] - y[k]
            c2, c3 = 3.0 * rise - 2.0 * slope_before - slope_after, slope_before + slope_after - 2.0 * rise
            axes.append(
                (
                    y[k] + s * (slope_before + s * (c2 + s * c3)),
                    (slope_before + s * (2.0 * c2 + 3.0 * s * c3)) / span * moving,
                )
            )
        return AxisAngles(axes[0][0], axes[1][0], axes[0][1], axes[1][1])


def read_table(path: Path) -> PostureTable:
    """Read a table of postures. Raises InputError with file and row."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError) as problem:
        raise InputError(f"motion table {path}: cannot be read: {problem}") from None
    if not rows or rows[0] != COLUMNS:
        raise InputError(f"motion table {path}: header is not {','.join(COLUMNS)}")
    values: list[tuple[float, float, float]] = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            mjd, azimuth, elevation = (float(word) for word in row)
        except ValueError:
            raise InputError(f"motion table {path}, line {number}: {','.join(row)!r} is not three numbers") from None
        if values and not mjd > values[-1][0]:
            raise InputError(f"motion table {path}, line {number}: mjd {mjd} is not after the line before")
        if not np.isfinite(mjd):
            raise InputError(f"motion table {path}, line {number}: mjd {mjd:g} (expected a number)")
        _refuse_posture((azimuth, elevation), f"motion table {path}, line {number}")
        values.append((mjd, azimuth, elevation))
    if len(values) < 2:
        raise InputError(f"motion table {path}: {len(values)} postures (expected at least 2)")
    table = np.array(values)
    return PostureTable(table[:, 0], table[:, 1] * DEGREE, table[:, 2] * DEGREE)
