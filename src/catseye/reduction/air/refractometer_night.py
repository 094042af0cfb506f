"""Readings of a refractometer path, and its unwrapped phase.

Phases with their weather, over a night.

Phase and weather belong together: the phase minus the weather's prediction hardly changes, so that it separates a
jump of the path from a change of the air, and bridges the whole cycles over a gap when it is accurate enough.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, ValidationError

from catseye.atmosphere.index.air import MODELS, air
from catseye.constants import MILLIMETRE, PPM, SECONDS_PER_DAY, TWO_PI
from catseye.errors import InputError
from catseye.names import AIR_MODEL
from catseye.records.files.columns import TextColumns, columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.record import EARLIEST_MJD, LATEST_MJD, Certificate, Version, Within
from catseye.records.files.refusal import explained, refusal, shown
from catseye.reduction.air.group_index import phase_slope
from catseye.reduction.air.path_instruments import COLUMNS, path_humidity, path_pressure, refuse_columns

THERMOMETERS = ("temperature_c", *(f"temperature_{k}_c" for k in range(1, 10)))
WEATHER = ("pressure_hpa", "humidity_percent")
REQUIRED = ("mjd_utc", "phase_rad")
OPTIONAL = (*COLUMNS, *THERMOMETERS, "u_phase_rad", "amplitude_v", "left_out")

SIGMAS = 5.0  # standard uncertainties allowed between step and prediction, or within a quarter cycle
FEWEST_AFTER_JUMP = 5  # consistent readings that make a step a jump of the path, not an outlier
RECENT = 5  # readings whose median is the reference of the next one
DEPARTURE_PPM = 0.5  # in an hour, growing with the root of time: path from the thermometers' place
AIR_WALK_PPM = 3.0  # in an hour, likewise: of the air, without weather readings
WINDOW = 15  # readings on either side of a step too small for single readings
STEP = 6.0  # usual differences of two such windows, beyond which there is a step
LONG_GAP = 10.0  # usual intervals: a longer one is reported when bridged

Spread = Annotated[float, Within(0, 100)]


class PathSheet(Certificate):
    """Data sheet of a refractometer path; `FILE.toml` beside `FILE.csv`.

    path                                 name of the path
    path_length_m                        D - D0, less the glass of the target
    u_path_length_mm                     of the length; 25 mm suffice for changes, the absolute index needs
                                         micrometres
    modulation_hz                        frequency of the modulation
    wavelength_um                        wavelength of the light in vacuum
    air_model                            formula for the index of air
    co2_ppm                              carbon dioxide in the air
    u_temperature_c                      of each thermometer's offset, common to all its readings; a list has one
                                         per thermometer
    u_pressure_hpa, u_humidity_percent   of the sensor's offset, likewise
    u_wet_bulb_c, u_dew_point_c          of such an instrument's offset, in place of u_humidity_percent
    gravity_m_per_s2                     at a mercury barometer
    noise_temperature_c, noise_pressure_hpa, noise_humidity_percent  scatter of a reading about the path's mean
    u_phase_rad                          of a phase, if the table has no column of that name
    drift_mrad_per_root_hour             random walk of the electronics or the path; 0: none
    """

    format: Annotated[int | str, Version("refractometer")] = 1
    path: Annotated[str, Field(min_length=1, max_length=200)] = "path"
    path_length_m: Annotated[float, Within(1, 1e5)]
    u_path_length_mm: Annotated[float, Within(0, 1000)] = 25.0
    modulation_hz: Annotated[float, Within(1e7, 1e11)] = 1500e6
    wavelength_um: Annotated[float, Within(0.3, 1.7)] = 0.780
    air_model: str = AIR_MODEL
    co2_ppm: Annotated[float, Within(0, 2000)] = 450.0
    u_temperature_c: Spread | Annotated[tuple[Spread, ...], Field(strict=False, min_length=1)] = 0.3
    u_pressure_hpa: Spread = 0.3
    u_humidity_percent: Spread = 3.0
    u_wet_bulb_c: Spread = 0.2
    u_dew_point_c: Spread = 0.4
    gravity_m_per_s2: Annotated[float, Within(9.7, 9.9)] | None = None
    noise_temperature_c: Spread = 0.1
    noise_pressure_hpa: Spread = 0.05
    noise_humidity_percent: Spread = 0.5
    u_phase_rad: Annotated[float, Within(0, 1, above=True)] = 0.001
    drift_mrad_per_root_hour: Spread = 0.0


@dataclass(frozen=True, eq=False)
class PathReadings:
    """Night of one path, m readings by k thermometers.

    Missing weather is nan.

    sheet          of the path
    mjd_utc        (m,) in order
    phase, u_phase (m,) rad, any turn
    temperature_c  (m, k)
    pressure_hpa, humidity_percent   (m,)
    thermometers   (k) names of their columns; u_temperature_c (k,) °C
    left_out       (m) reason that the table leaves a reading out, "" for none
    where          (m) place in the file
    """

    file: str
    sheet: PathSheet
    mjd_utc: np.ndarray
    phase: np.ndarray
    u_phase: np.ndarray
    temperature_c: np.ndarray
    pressure_hpa: np.ndarray
    humidity_percent: np.ndarray
    thermometers: tuple[str, ...]
    u_temperature_c: np.ndarray
    left_out: tuple[str, ...]
    where: tuple[str, ...]
    hashes: dict[str, str]

    def __len__(self) -> int:
        return len(self.mjd_utc)

    @property
    def hours(self) -> np.ndarray:
        """Time since the first reading, (m,) h."""
        return (self.mjd_utc - self.mjd_utc[0]) * SECONDS_PER_DAY / 3600.0

    @property
    def has_weather(self) -> np.ndarray:
        """True (m,) for pressure, humidity and at least one thermometer."""
        read = np.isfinite(self.pressure_hpa) & np.isfinite(self.humidity_percent)
        return read & np.isfinite(self.temperature_c).any(axis=1)


def read_path_sheet(
    path: Path, changes: Mapping[str, object], *, needed: bool = False
) -> tuple[PathSheet | None, dict[str, str]]:
    """Sheet FILE.toml with changes, or a sheet of these keys alone.

    The latter without a file.

    path      of the sheet; it may be missing
    changes   key -> value, of the command line
    needed    True if the file must exist

    None where neither has the length of the path. Raises InputError for a bad sheet.
    """
    folder, entries = Folder(path.parent), dict[str, object]()
    if needed or path.exists():
        entries = folder.record(path.name, PathSheet).model_dump(exclude_unset=True)
    elif "path_length_m" not in changes:
        return None, {}
    values = {**entries, **changes}
    try:
        return PathSheet.model_validate(values), dict(folder.hashes)
    except ValidationError as problem:
        raise refusal("options", explained(problem, values, PathSheet)) from problem


def read_path_readings(path: Path, sheet: PathSheet | None = None, sheet_hashes: dict | None = None) -> PathReadings:
    """Night of one path from FILE.csv.

    Columns as in docs/formats/refractometer.md.

    path           of the table
    sheet          of the path, from `read_path_sheet`
    sheet_hashes   SHA-256 of its files

    Raises InputError in one line: file, line, value, expectation.
    """
    folder, file = Folder(path.parent), path.name
    table = columns_of(folder.text(file), str(path), REQUIRED, optional=OPTIONAL)
    if sheet is None:
        text = f"has no sheet {path.with_suffix('.toml').name} beside it and there is no path length"
        raise refusal(str(path), f"{text} (expected the sheet, or path_length_m, in the command --path-length-m)")
    refuse_columns(table)
    if sheet.air_model not in MODELS:
        raise InputError(f"air_model = {shown(sheet.air_model)} is unknown (expected one of {', '.join(MODELS)})")
    named = tuple(name for name in THERMOMETERS if name in table.cells)
    if not named:
        raise refusal(str(path), "line 1, column 'temperature_c' is missing (or temperature_1_c, temperature_2_c ...)")
    u_columns = sheet.u_temperature_c if isinstance(sheet.u_temperature_c, tuple) else (sheet.u_temperature_c,)
    if len(u_columns) not in (1, len(named)):
        raise InputError(
            f"u_temperature_c has {len(u_columns)} values for {len(named)} thermometers (expected one each)"
        )
    mjd = table.numbers("mjd_utc")
    table.check("mjd_utc", (mjd >= EARLIEST_MJD) & (mjd <= LATEST_MJD), f"{EARLIEST_MJD:g} to {LATEST_MJD:g}")
    table.check("mjd_utc", np.diff(mjd, prepend=0.0) > 0.0, "later than the line before")
    phase = table.numbers("phase_rad")
    table.check("phase_rad", np.abs(phase) <= 1e6, "radians, -1e6 to 1e6")
    limits = MODELS[sheet.air_model].limits
    temperature = np.stack([_limited(table, name, limits["temperature_c"]) for name in named], axis=1)
    for name in WEATHER:
        if name in table.cells:
            _limited(table, name, limits[name])
    sheet_file = next(iter(sheet_hashes or ()), path.with_suffix(".toml").name)
    pressure = path_pressure(table, sheet.gravity_m_per_s2, sheet_file)
    moist = path_humidity(table, _mean_of_read(temperature), pressure, sheet.air_model)
    sheet = _with_hygrometer(sheet, table, moist.per_unit)
    if "u_phase_rad" in table.cells:
        u_phase = table.numbers("u_phase_rad")
        table.check("u_phase_rad", (u_phase > 0.0) & (u_phase <= 1.0), "above 0 to 1 rad")
    else:
        u_phase = np.full(len(table), sheet.u_phase_rad)
    if "amplitude_v" in table.cells:
        table.numbers("amplitude_v", blank=0.0)
    readings = PathReadings(
        file=str(path),
        sheet=sheet,
        mjd_utc=mjd,
        phase=phase,
        u_phase=u_phase,
        temperature_c=temperature,
        pressure_hpa=pressure,
        humidity_percent=moist.percent,
        thermometers=named,
        u_temperature_c=np.broadcast_to(np.array(u_columns), len(named)).astype(float),
        left_out=tuple(table.cells.get("left_out", [""] * len(table))),
        where=table.where(),
        hashes={**folder.hashes, **(sheet_hashes or {})},
    )
    serving = readings.has_weather & np.array([not why for why in readings.left_out])
    if serving.sum() < FEWEST_AFTER_JUMP:
        raise refusal(str(path), f"holds {serving.sum()} readings with weather (expected at least {FEWEST_AFTER_JUMP})")
    return readings


def _mean_of_read(temperature: np.ndarray) -> np.ndarray:
    """Mean (m,) of the thermometers that were read; nan where none was."""
    measured = np.isfinite(temperature)
    count = measured.sum(axis=1)
    total = np.where(measured, temperature, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _with_hygrometer(sheet: PathSheet, table: TextColumns, per_unit: np.ndarray) -> PathSheet:
    """Sheet whose u_humidity_percent is that of the table's psychrometer or mirror, at the median reading."""
    for kind in ("wet_bulb_c", "dew_point_c"):
        if kind in table.cells and np.isfinite(per_unit).any():
            u = min(100.0, float(getattr(sheet, f"u_{kind}") * np.nanmedian(np.abs(per_unit))))
            return sheet.model_copy(update={"u_humidity_percent": u})
    return sheet


def _limited(table: TextColumns, name: str, limit) -> np.ndarray:
    """Column of numbers within the model's limits; a blank cell is nan."""
    values = table.numbers(name, blank=float("nan"))
    good = ~((values < limit.lower) | (values > limit.upper))
    table.check(name, good, f"{limit.lower:g} to {limit.upper:g} {limit.unit}, where {limit.source} holds")
    return values


@dataclass(frozen=True, eq=False)
class PathWeather:
    """Index by the weather at every reading.

    (m,) or (m, k); nan without weather.

    index         (m, k) group refractivity by each thermometer
    mean          (m,) by their mean
    slopes        (m, 3) per °C, hPa, %, at fixed relative humidity
    noise         (m,) of `mean`, by the sheet's noise of a reading
    """

    index: np.ndarray
    mean: np.ndarray
    slopes: np.ndarray
    noise: np.ndarray


def path_weather(readings: PathReadings) -> PathWeather:
    """Index by the weather: each thermometer's, their mean's, and slopes.

    Source: the model's own.
    """
    sheet, rows = readings.sheet, np.flatnonzero(readings.has_weather)
    light = {"wavelength_um": sheet.wavelength_um, "co2_ppm": sheet.co2_ppm, "model": sheet.air_model}
    measured = np.isfinite(readings.temperature_c[rows])
    count = measured.sum(axis=1)
    warm = np.where(measured, readings.temperature_c[rows], 0.0).sum(axis=1) / count
    p, h = readings.pressure_hpa[rows], readings.humidity_percent[rows]
    state = air(warm, p, h, **light)
    single = air(np.where(measured, readings.temperature_c[rows], warm[:, None]), p[:, None], h[:, None], **light)
    slopes = np.stack([np.broadcast_to(s, warm.shape) for s in state.sensitivity[:3]], axis=1)
    noises = (sheet.noise_temperature_c, sheet.noise_pressure_hpa, sheet.noise_humidity_percent)
    scatter = slopes * np.stack([noises[0] / np.sqrt(count), *(np.full(len(rows), n) for n in noises[1:])], axis=1)
    m, k = readings.temperature_c.shape
    index, mean, slope, noise = (np.full(shape, np.nan) for shape in ((m, k), m, (m, 3), m))
    index[rows] = np.where(measured, single.group_refractivity, np.nan)
    mean[rows], slope[rows], noise[rows] = state.group_refractivity, slopes, np.sqrt(np.sum(scatter**2, axis=1))
    return PathWeather(index, mean, slope, noise)


class ReadingStatus(IntEnum):
    """Status of a reading: FOLLOWED, STRAY or LEFT_OUT.

    A STRAY contradicts its neighbours, which agree; LEFT_OUT is by the table.

    A STRAY is also one whose own u is too large for its whole cycles: faint, or hours without weather.
    """

    FOLLOWED = 0
    STRAY = 1
    LEFT_OUT = 2


@dataclass(frozen=True)
class Section:
    """Readings between which the whole cycles are known.

    first, last   rows
    reason        of its begin: "start", "jump" of path or electronics, "ambiguous gap"
    text          the same as a text
    """

    first: int
    last: int
    reason: str
    text: str


@dataclass(frozen=True, eq=False)
class FollowedPhase:
    """Unwrapped phase of a night, in sections with known whole cycles.

    phase      (m,) rad, continuous within a section; for an outlier the turn nearest to its neighbours
    section    (m,) number of the section
    status     (m,) int8 of `ReadingStatus`
    sections   of the phase
    bridged    long gaps bridged by the weather, as texts
    """

    phase: np.ndarray
    section: np.ndarray
    status: np.ndarray
    sections: tuple[Section, ...]
    bridged: tuple[str, ...]


def follow_phase(readings: PathReadings, weather: PathWeather) -> FollowedPhase:
    """Unwrap the phase over the night, compared with the weather's prediction.

    A reading belongs to the section when its phase minus the weather's prediction lies within five standard
    uncertainties of the latest readings'. A gap over which that prediction is not good to a quarter cycle at five sigma
    ends the section: its whole cycles are not guessed. A step that persists for five readings is a jump of path or
    electronics and begins a section, too; a shorter one is an outlier. Steps below that are found by the medians of
    fifteen readings on either side, six times what such medians usually differ by, and at least half of it sudden: air
    that slowly departs from the thermometers' is no jump. A step of a whole number of turns is undetectable.

    Source: [PARKER04] section 1.6; the rule is that of `signal.cycles.whole`: the nearest integer with a margin.
    """
    sheet, hours = readings.sheet, readings.hours
    slope = float(phase_slope(sheet.path_length_m, modulation_hz=sheet.modulation_hz))
    rows, read = np.flatnonzero([not why for why in readings.left_out]), np.isfinite(weather.mean)
    smooth = _running_median(weather.mean[read])  # one wrong weather reading makes no phase an outlier
    expected = slope * (np.interp(hours, hours[read], smooth) - np.mean(smooth))
    unread = _to_nearest(hours, hours[read])
    remainder = readings.phase - expected
    noise = np.interp(hours, hours[read], weather.noise[read])
    sigma = np.sqrt(readings.u_phase**2 + (slope * noise) ** 2 + (slope * AIR_WALK_PPM * PPM) ** 2 * unread)
    steps = _wrapped(np.diff(remainder[rows]))
    scatter = float(1.4826 * np.median(np.abs(steps)) / np.sqrt(2.0)) if len(steps) else 0.0
    walk = np.hypot(sheet.drift_mrad_per_root_hour * 1e-3, slope * DEPARTURE_PPM * PPM)
    follower = _Follower(hours, remainder, np.maximum(sigma, scatter), walk, TWO_PI / slope * sheet.path_length_m)
    return follower.follow(rows, expected, np.array([bool(why) for why in readings.left_out]))


def _running_median(values: np.ndarray) -> np.ndarray:
    """Median of each value and two on either side, the ends repeated."""
    padded = np.pad(values, 2, mode="edge")
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1)


def _to_nearest(when: np.ndarray, reference_times: np.ndarray) -> np.ndarray:
    """Time (m,) from each instant to the nearest reference time.

    Reference times ascend.
    """
    after = np.clip(np.searchsorted(reference_times, when), 1, len(reference_times) - 1)
    return np.minimum(np.abs(when - reference_times[after - 1]), np.abs(when - reference_times[after]))


def _wrapped(angle):
    """Angle reduced to the turn nearest to zero."""
    return angle - TWO_PI * np.rint(angle / TWO_PI)


class _Follower:
    """Sequential unwrapping; `level` is the median of the latest readings."""

    def __init__(self, hours: np.ndarray, rest: np.ndarray, sigma: np.ndarray, walk: float, per_turn: float) -> None:
        self.hours, self.rest, self.sigma, self.walk, self.per_turn = hours, rest, sigma, walk, per_turn
        self.recent: list[tuple[int, float]] = []
        self.turned = rest.copy()
        self.status = np.full(len(rest), ReadingStatus.STRAY, dtype=np.int8)
        self.starts: list[tuple[int, str, str]] = []
        self.bridged: list[str] = []

    def follow(self, rows: np.ndarray, expected: np.ndarray, left_out: np.ndarray) -> FollowedPhase:
        certain = SIGMAS * self.sigma[rows] < 0.25 * TWO_PI
        if certain.any():  # a reading too faint for its own cycle ends no section: it is skipped
            vague, rows = rows[~certain], rows[certain]
        else:
            vague = rows[:0]
        usual = float(np.median(np.diff(self.hours[rows]))) if len(rows) > 1 else 0.0
        self._begin(rows, "start", "the first readings")
        waiting: list[int] = []
        for place, row in enumerate(rows):
            u, off = self._against(row)
            gap = self.hours[row] - self.hours[self.recent[-1][0]]
            if gap > 0.0 and SIGMAS * u >= 0.25 * TWO_PI:
                if SIGMAS * np.sqrt(u**2 - self.sigma[row] ** 2) < 0.25 * TWO_PI:
                    self.turned[row] = self._level() + off
                    continue  # the reading is too uncertain, not the gap too long
                text = f"no reading for {gap:.2f} h, over which the prediction is good to {u / TWO_PI:.2f} cycles only"
                self._begin(rows[place:], "ambiguous gap", text)
                u, off = self._against(row)
                waiting = []
            if abs(off) <= SIGMAS * u:
                self._take(row, off, gap, usual)
                waiting = []
                continue
            self.turned[row] = self._level() + off
            waiting.append(int(row))
            if len(waiting) == FEWEST_AFTER_JUMP and self._agree(waiting):
                step = self._level()
                self._begin(np.array(waiting), "jump", "")
                step = float(_wrapped(self._level() - step))
                self.starts[-1] = (waiting[0], "jump", self._step_text(step))
                for old in waiting:
                    self._take(old, self._against(old)[1], 0.0, usual)
                waiting = []
            elif len(waiting) == FEWEST_AFTER_JUMP:
                waiting.pop(0)
        for row in vague:
            near = self.turned[rows[np.argmin(np.abs(self.hours[rows] - self.hours[row]))]]
            self.turned[row] = near + _wrapped(self.rest[row] - near)
        self.status[left_out] = ReadingStatus.LEFT_OUT
        self._small_steps()
        return self._followed(expected)

    def _small_steps(self) -> None:
        """Cut sections at small steps, largest first.

        Where the medians before and after differ by far more than elsewhere.
        """
        while True:
            edges = [0, *sorted(row for row, _, _ in self.starts[1:]), len(self.rest)]
            best, where = 0.0, -1
            for first, last in pairwise(edges):
                rows = first + np.flatnonzero(self.status[first:last] == ReadingStatus.FOLLOWED)
                if len(rows) < 4 * WINDOW:
                    continue
                medians = np.median(np.lib.stride_tricks.sliding_window_view(self.turned[rows], WINDOW), axis=1)
                apart = medians[WINDOW:] - medians[:-WINDOW]
                formal = 1.25 * np.median(self.sigma[rows]) * np.sqrt(2.0 / WINDOW)
                usual = max(1.4826 * float(np.median(np.abs(apart))), float(formal))
                apart = np.where(np.abs(self._sudden(self.turned[rows])) > 0.5 * np.abs(apart), apart, 0.0)
                at = int(np.argmax(np.abs(apart)))
                if abs(apart[at]) > max(STEP * usual, best):
                    best, step = float(abs(apart[at])), float(apart[at])
                    where = int(rows[at + self._cut(self.turned[rows[at : at + 2 * WINDOW]])])
            if where < 0:
                return
            self.starts.append((where, "jump", self._step_text(step)))
            self.starts[1:] = sorted(self.starts[1:])

    @staticmethod
    def _sudden(values: np.ndarray) -> np.ndarray:
        """Sudden part of each step between windows.

        A straight line runs on either side of it: a slope has none.
        """
        place = np.arange(WINDOW) - 0.5 * (WINDOW - 1)
        toward = 1.0 / WINDOW + 0.5 * WINDOW * place / np.sum(place**2)  # the line's value at the window's late end
        late = np.convolve(values, toward[::-1], mode="valid")
        early = np.convolve(values, toward, mode="valid")
        return early[WINDOW:] - late[:-WINDOW]

    def _cut(self, values: np.ndarray) -> int:
        """Row that splits the values into two levels.

        With the least sum of absolute departures.
        """
        places = range(2, len(values) - 2)
        return min(places, key=lambda k: float(sum(np.abs(v - np.median(v)).sum() for v in (values[:k], values[k:]))))

    def _step_text(self, step: float) -> str:
        return f"{step * 1e3:+.1f} mrad, as {step * self.per_turn / TWO_PI / MILLIMETRE:+.3f} mm of path"

    def _begin(self, rows: np.ndarray, reason: str, text: str) -> None:
        """Begin a new level at the most central of the next readings."""
        near = rows[: 2 * FEWEST_AFTER_JUMP - 1]
        apart = np.abs(_wrapped(self.rest[near][:, None] - self.rest[near]))
        centre = int(near[np.argmin(apart.sum(axis=1))])
        self.recent = [(int(near[0]), float(self.rest[centre]))]
        self.starts.append((int(near[0]), reason, text))

    def _level(self) -> float:
        return float(np.median([value for _, value in self.recent]))

    def _against(self, row: int) -> tuple[float, float]:
        """Standard uncertainty of a reading's prediction, and its error, rad."""
        last = self.recent[-1][0]
        level = 1.25 * self.sigma[last] / np.sqrt(len(self.recent))  # 1.25: of a median
        u = np.sqrt(self.sigma[row] ** 2 + level**2 + self.walk**2 * abs(self.hours[row] - self.hours[last]))
        return float(u), float(_wrapped(self.rest[row] - self._level()))

    def _take(self, row: int, off: float, gap: float, usual: float) -> None:
        value = self._level() + off
        if gap > LONG_GAP * usual > 0.0:
            self.bridged.append(f"a gap of {gap:.2f} h was bridged by the weather, {abs(off) * 1e3:.0f} mrad off")
        self.turned[row], self.status[row] = value, ReadingStatus.FOLLOWED
        fresh = len(self.recent) == 1 and self.status[self.recent[0][0]] != ReadingStatus.FOLLOWED
        self.recent = [*([] if fresh else self.recent), (int(row), value)][-RECENT:]

    def _agree(self, rows: list[int]) -> bool:
        """True if the readings agree on a level of their own."""
        apart = np.abs(_wrapped(self.rest[rows] - self.rest[rows[FEWEST_AFTER_JUMP // 2]]))
        return bool(np.all(apart <= SIGMAS * np.sqrt(2.0) * self.sigma[rows]))

    def _followed(self, expected: np.ndarray) -> FollowedPhase:
        firsts = [0, *(row for row, _, _ in self.starts[1:])]
        lasts = [*(row - 1 for row in firsts[1:]), len(expected) - 1]
        section = np.searchsorted(firsts, np.arange(len(expected)), side="right") - 1
        sections = tuple(
            Section(first, last, reason, text)
            for first, last, (_, reason, text) in zip(firsts, lasts, self.starts, strict=True)
        )
        return FollowedPhase(expected + self.turned, section, self.status, sections, tuple(self.bridged))
