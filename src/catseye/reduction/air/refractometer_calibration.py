"""Calibration of a refractometer path by a night with weather.

n_g(t0, h0, p0) with phase(t0, h0, p0) from a night of both, then n_g(t).

Every thermometer's index plus its change by the phase is one observation,
    n_weather + dphi / K = n0 + delta dphi / K + b(t) / K + (sensor offsets) + formula + noise,
K = 4 pi f L / c, dphi the phase since the reference phase, delta the relative error of the length L, b a drift of the
phase. Offsets of sensors, the formula, delta and b are parameters with priors: they do not average out. Readings whose
test statistic is beyond 3.5 are left out. The estimated scatter and its correlation in time determine the
uncertainty where it is larger than the sheet's claim.
"""

from dataclasses import dataclass

import numpy as np

from catseye.atmosphere.index.air import MODELS, group_refractivity
from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.constants import MILLIMETRE, PPM, SPEED_OF_LIGHT, TWO_PI
from catseye.records.site.validity import expired
from catseye.reduction.air.group_index import AbsoluteIndex, absolute_group_index, length_sensitivity, phase_slope
from catseye.reduction.air.refractometer_fit import PathFit, drift_name
from catseye.reduction.air.refractometer_night import (
    FEWEST_AFTER_JUMP,
    FollowedPhase,
    PathReadings,
    PathWeather,
    ReadingStatus,
    follow_phase,
    path_weather,
)
from catseye.signal.cycles.whole import CycleStatus
from catseye.verdict import Verdict

AGREES = 3.0  # standard uncertainties within which slopes agree
UNKNOWN_SLOPE = 1e3  # prior u of a free slope over the theoretical one
LEAST_SLOPE = 0.3  # u of the slope's ratio beyond which it is meaningless
LARGE_FACTOR = 3.0  # standard deviations of a variance factor above 1 beyond which the scatter is more than claimed
STATUS = ("good", "stray", "left out", "weather off", "no weather", "uncalibrated")


@dataclass(frozen=True)
class SlopeTest:
    """Ratio of the fitted weather index's changes to the theoretical ones.

    The theory is the phase and -(4 pi f/c) L.

    ratio       1 when the phase follows the weather; above 1 the path's air changes less than the sensors'
    u           of the ratio, by the scatter
    agrees      within three u, the length's own included; None where the index hardly changed
    """

    ratio: float
    u: float
    agrees: bool | None


@dataclass(frozen=True, eq=False)
class PathCalibration:
    """Calibrated path and the index of its air; rows as in the readings.

    index_0, u_index_0   group refractivity at phase_0 and its standard uncertainty, at the time mjd_0
    phase_0        rad, of the first calibrated section: the mean of its readings
    temperature_0_c, pressure_0_hpa, humidity_0_percent   mean weather of that section's readings
    names, x, covariance   of all parameters (ppm, °C, hPa, %, rad): see `names`
    drift_hours    (k) knots of the drift, h since the first reading
    budget         cause -> its part of u_index_0
    refractivity, u_refractivity   (m,) n_g - 1 by the phase; nan where the phase is not followed or not calibrated
    temperature_c, u_temperature_c (m,) path mean that gives this index at the measured pressure and humidity
    residual       (m,) weather minus path, of the mean of the thermometers
    standardised   (m,) test statistic of the reading
    status         (m) a word of STATUS
    slope          test of the theoretical slope
    thermometer_scatter   estimated over claimed, 1 at least
    places         factor on the thermometers' offsets' u by their differences, 1 at least
    air_noise      estimated scatter of the weather's index against the path's beyond the sheet's claim
    correlation    of readings in time: factor on the variance of means, 1 for white noise
    variance_factor, degrees_of_freedom   of the values used
    absolute       the index by phase and length alone at phase_0
    path_length, u_path_length   m, implied by the weather's index; nan where the whole cycles are uncertain
    notes          for the user
    """

    readings: PathReadings
    weather: PathWeather
    followed: FollowedPhase
    index_0: float
    u_index_0: float
    phase_0: float
    mjd_0: float
    temperature_0_c: float
    pressure_0_hpa: float
    humidity_0_percent: float
    names: tuple[str, ...]
    x: np.ndarray
    covariance: np.ndarray
    drift_hours: tuple[float, ...]
    budget: dict[str, float]
    refractivity: np.ndarray
    u_refractivity: np.ndarray
    temperature_c: np.ndarray
    u_temperature_c: np.ndarray
    residual: np.ndarray
    standardised: np.ndarray
    status: tuple[str, ...]
    slope: SlopeTest
    thermometer_scatter: float
    places: float
    air_noise: float
    correlation: float
    variance_factor: float
    degrees_of_freedom: float
    absolute: AbsoluteIndex
    path_length: float
    u_path_length: float
    notes: tuple[str, ...]

    @property
    def length_sensitivity(self) -> float:
        """Change of the index per metre of error in the path's length, 1/m, at the reading farthest from index_0.

        Source: [PARKER04] eqs. 1.37 to 1.39, with the path's own largest change of phase.
        """
        sheet, moved = self.readings.sheet, self.refractivity - self.index_0
        known = moved[np.isfinite(moved)]
        if not len(known):
            return float("nan")
        farthest = float(known[np.argmax(np.abs(known))])
        phase = farthest * float(phase_slope(sheet.path_length_m, modulation_hz=sheet.modulation_hz))
        return float(length_sensitivity(phase, path_length=sheet.path_length_m, modulation_hz=sheet.modulation_hz))

    @property
    def verdict(self) -> Verdict:
        """Verdict on scatter against the claim, slope of the phase, and validity of the sheet."""
        readings = self.readings
        validity = expired({"the path": readings.sheet}, readings.mjd_utc[-1])
        return self._agreement().hearing(validity + humidity_doubts(readings.humidity_percent))

    def _agreement(self) -> Verdict:
        """Verdict on phases and weather alone."""
        if not self.slope.agrees:
            ratio = self.slope.ratio
            why = f"the slope of phase against the weather's index is {ratio:.3f} of theory, not 1"
            return Verdict("doubtful", why)
        factor, degrees = self.variance_factor, self.degrees_of_freedom
        if not degrees >= 1.0:
            return Verdict("doubtful", "the calibration has no redundancy to check it")
        if factor > 1.0 + LARGE_FACTOR * (2.0 / degrees) ** 0.5:
            return Verdict("doubtful", f"phases and weather scatter more than claimed (variance factor {factor:.2f})")
        return Verdict("good", f"phases and weather agree as claimed (variance factor {factor:.2f})")

    @property
    def thermometers(self) -> dict[str, tuple[float, float]]:
        """Offset of each thermometer and its standard uncertainty, °C, by the name of its column."""
        return {name: self.of(name) for name in self.readings.thermometers}

    @property
    def drift(self) -> tuple[tuple[float, float, float], ...]:
        """Hours of each knot of the drift, the drift and its standard uncertainty, rad."""
        return tuple((hours, *self.of(drift_name(hours))) for hours in self.drift_hours)

    def of(self, name: str) -> tuple[float, float]:
        """Parameter and its standard uncertainty."""
        i = self.names.index(name)
        return float(self.x[i]), float(np.sqrt(self.covariance[i, i]))


def calibrate_path(readings: PathReadings) -> PathCalibration:
    """Calibrate a path, and get the index of every phase of the night.

    The index at a reference phase, with its uncertainty.

    readings   from `read_path_readings`

    Raises EstimationError where no section has five readings with weather.

    Source: [PARKER04] sections 1.6, 1.6.2, eqs. 1.35, 1.36 with the sign of 5.18; least squares with priors,
    [FOERSTNER16] chapter 4; tests, [BAARDA68]. Tested against scatter: u holds with outliers, drift and offsets.
    """
    weather = path_weather(readings)
    followed = follow_phase(readings, weather)
    fit = PathFit(readings, weather, followed)
    fit.run()
    return _calibration(fit)


def _calibration(fit: PathFit) -> PathCalibration:
    """Calibration in SI units, from the fit in ppm."""
    readings, followed = fit.readings, fit.followed
    mean, w_reading, _ = fit.tests()
    keep = fit.reading_in & fit.value_in.any(axis=1)
    first = followed.section[fit.rows] == fit.calibrated[0]  # the section of phase_0 and index_0
    keep = keep & first if (keep & first).any() else first
    when = float(readings.mjd_utc[fit.rows[keep]].mean())
    row = int(fit.rows[keep][np.argmin(np.abs(readings.mjd_utc[fit.rows[keep]] - when))])
    at = fit.at(np.array([row]))[0]
    at[: len(fit.calibrated)], at[fit.names.index("length")] = 0.0, 0.0
    at[0] = 1.0
    phase_0 = float(fit.phase_0[0])
    index_0 = fit.mean + float(at @ fit.x) * PPM
    u_0 = float(np.sqrt(at @ fit.covariance @ at)) * PPM
    all_rows = np.arange(len(readings))
    refractivity, u, gradient = _indices(fit, all_rows)
    temperature, u_temperature = _temperatures(fit, refractivity, gradient)
    residual, standardised = np.full(len(readings), np.nan), np.full(len(readings), np.nan)
    residual[fit.rows], standardised[fit.rows] = mean * PPM, w_reading
    absolute, length = _absolute(readings, phase_0, index_0, u_0)
    d, g = fit.weights()
    pvv = float(np.sum(d * fit.v**2) - np.sum(g * np.sum(d * fit.v, axis=1) ** 2))
    used = int(np.sum(fit.value_in & fit.reading_in[:, None]))
    freedom = used - float(np.trace(fit.covariance @ fit.data) * fit.correlation) if used else 0.0
    slope = _slope(fit)
    return PathCalibration(
        readings=readings,
        weather=fit.weather,
        followed=followed,
        index_0=index_0,
        u_index_0=u_0,
        phase_0=phase_0,
        mjd_0=when,
        temperature_0_c=float(np.nanmean(readings.temperature_c[fit.rows[keep]])),
        pressure_0_hpa=float(readings.pressure_hpa[fit.rows[keep]].mean()),
        humidity_0_percent=float(readings.humidity_percent[fit.rows[keep]].mean()),
        names=fit.names,
        x=fit.x,
        covariance=fit.covariance,
        drift_hours=tuple(round(float(h), 2) for h in fit.knots),
        budget=_budget(fit, at),
        refractivity=refractivity,
        u_refractivity=u,
        temperature_c=temperature,
        u_temperature_c=u_temperature,
        residual=residual,
        standardised=standardised,
        status=_statuses(fit),
        slope=slope,
        thermometer_scatter=fit.scatter,
        places=fit.places,
        air_noise=fit.air * PPM,
        correlation=fit.correlation,
        variance_factor=pvv / freedom if freedom > 0.0 else float("nan"),
        degrees_of_freedom=freedom,
        absolute=absolute,
        path_length=length,
        u_path_length=length * u_0,
        notes=_notes(fit, slope, absolute, index_0, u_0),
    )


def _absolute(readings: PathReadings, phase_0: float, index_0: float, u_0: float) -> tuple[AbsoluteIndex, float]:
    """Index at the reference phase by the sheet's length, and the length by the index.

    Length in m.

    The length is nan where its whole cycles are uncertain; its standard uncertainty is u_0 of it.
    """
    sheet = readings.sheet
    absolute = absolute_group_index(
        phase_0,
        path_length=sheet.path_length_m,
        u_path_length=sheet.u_path_length_mm * MILLIMETRE,
        expected_index=1.0 + index_0,
        u_expected_index=u_0,
        u_phase=float(np.median(readings.u_phase)),
        modulation_hz=sheet.modulation_hz,
    )
    if absolute.status != CycleStatus.SURE:
        return absolute, np.nan
    half = 0.5 * SPEED_OF_LIGHT / sheet.modulation_hz
    return absolute, float((absolute.cycles - np.mod(phase_0, TWO_PI) / TWO_PI) * half / (1.0 + index_0))


def _indices(fit: PathFit, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Group refractivity (m,) by the phase, its u, and derivatives.

    Derivatives (m, q), ppm, by the parameters.
    """
    at = fit.at(rows)
    change = at[:, fit.names.index("length")]
    value = fit.mean + (at @ fit.x - change) * PPM
    noise = fit.readings.u_phase[rows] * fit.per_radian
    u = np.sqrt(np.einsum("mq,qr,mr->m", at, fit.covariance, at) + noise**2) * PPM
    good = fit.good[rows]
    return np.where(good, value, np.nan), np.where(good, u, np.nan), at


def _temperatures(fit: PathFit, refractivity: np.ndarray, gradient: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean temperature (m,) for the index, and its u; °C.

    At the pressure and humidity as read.

    n_model(t, p, h as read) = n_path - formula + dn/dp offset + dn/dh offset. A barometer that reads too high moved the
    calibration by as much as it moves this inversion: the two cancel, through the covariance of the parameters.
    """
    r, sheet = fit.readings, fit.readings.sheet
    rows = np.flatnonzero(np.isfinite(refractivity) & r.has_weather)
    limits = MODELS[sheet.air_model].limits["temperature_c"]
    light = {"wavelength_um": sheet.wavelength_um, "co2_ppm": sheet.co2_ppm, "model": sheet.air_model}
    weather = r.pressure_hpa[rows], r.humidity_percent[rows]
    slopes = fit.weather.slopes[rows]
    warm = np.nanmean(r.temperature_c[rows], axis=1)
    first = len(fit.calibrated) + len(r.thermometers)
    sensors = np.stack([slopes[:, 1] / PPM, slopes[:, 2] / PPM, -np.ones(len(rows))], axis=1)
    target = refractivity[rows] + sensors @ fit.x[first : first + 3] * PPM
    inside = np.ones(len(rows), dtype=bool)
    for _ in range(4):  # Newton: errors of 10 °C, 0.4, 5e-4, then 0
        warm = warm + (target - group_refractivity(warm, *weather, **light)) / slopes[:, 0]
        inside &= (warm >= limits.lower) & (warm <= limits.upper)
        warm = np.clip(warm, limits.lower, limits.upper)  # where the model ends: no number, see `inside`
    by = gradient[rows].copy()
    by[:, first : first + 3] += sensors
    noise = (r.u_phase[rows] * fit.per_radian) ** 2
    noise = noise + (slopes[:, 1] / PPM * sheet.noise_pressure_hpa) ** 2
    noise = noise + (slopes[:, 2] / PPM * sheet.noise_humidity_percent) ** 2
    u = np.sqrt(np.einsum("mq,qr,mr->m", by, fit.covariance, by) + noise) * PPM / np.abs(slopes[:, 0])
    temperature_and_u = np.full((2, len(r)), np.nan)
    temperature_and_u[:, rows] = np.where(inside, [warm, u], np.nan)
    return temperature_and_u[0], temperature_and_u[1]


def _statuses(fit: PathFit) -> tuple[str, ...]:
    words = np.full(len(fit.readings), "uncalibrated", dtype=object)
    words[fit.good] = "no weather"
    words[fit.rows] = np.where(fit.reading_in & fit.value_in.any(axis=1), "good", "weather off")
    words[fit.followed.status == ReadingStatus.STRAY] = "stray"
    words[fit.followed.status == ReadingStatus.LEFT_OUT] = "left out"
    return tuple(str(word) for word in words)


def _budget(fit: PathFit, at: np.ndarray) -> dict[str, float]:
    """Contribution of each independent cause to the uncertainty of at'x.

    Index; scatter, and each prior.
    """
    by = fit.covariance @ at
    k = len(fit.readings.thermometers)
    first = len(fit.calibrated)
    causes = {
        "scatter of the readings": np.zeros(0, dtype=int),
        "thermometers": np.arange(first, first + k),
        "barometer": np.array([first + k]),
        "hygrometer": np.array([first + k + 1]),
        "formula": np.array([first + k + 2]),
        "path length": np.array([first + k + 3]),
        "drift": np.arange(first + k + 4, len(fit.names)),
    }
    parts = {"scatter of the readings": float(np.sqrt(by @ fit.data @ by)) * PPM}
    for cause, columns in causes.items():
        if len(columns):
            parts[cause] = float(np.sqrt(by[columns] @ fit.prior[np.ix_(columns, columns)] @ by[columns])) * PPM
    return parts


def _slope(free_fit: PathFit) -> SlopeTest:
    """Slope test from a fit without prior of the length.

    Noise of the phase flattens the slope, which is corrected.
    """
    fit = PathFit(free_fit.readings, free_fit.weather, free_fit.followed)
    at = fit.names.index("length")
    fit.prior[at, at] = (fit.prior[at, at] ** -0.5 + UNKNOWN_SLOPE) ** -2
    fit.run()
    d, g = fit.weights()
    alone = d.sum(axis=1) - g * d.sum(axis=1) ** 2
    variance = fit.covariance[at, at]
    share = float(np.sum(alone * fit.u_phase**2) / fit.correlation * variance)
    u = float(np.sqrt(variance))
    if u >= LEAST_SLOPE or share > 0.5:
        return SlopeTest(float("nan"), u, None)
    ratio, u = float((1.0 - fit.x[at]) / (1.0 - share)), u / (1.0 - share)
    u_length = fit.readings.sheet.u_path_length_mm * MILLIMETRE / fit.readings.sheet.path_length_m
    return SlopeTest(ratio, u, bool(abs(ratio - 1.0) <= AGREES * np.hypot(u, u_length)))


def _notes(fit: PathFit, slope: SlopeTest, absolute: AbsoluteIndex, index_0: float, u_0: float) -> tuple[str, ...]:
    followed, readings, notes = fit.followed, fit.readings, list(fit.followed.bridged)
    for number, s in enumerate(followed.sections[1:], start=2):
        where = f"section {number} from {readings.where[s.first]}"
        if s.reason == "jump":
            notes.append(f"{where}: a jump of {s.text}")
        else:
            notes.append(f"{where}: {s.text}; its whole cycles are not connected to those before")
    for number in range(len(followed.sections)):
        if number not in fit.calibrated:
            notes.append(
                f"section {number + 1} has fewer than {FEWEST_AFTER_JUMP} readings with weather: not calibrated"
            )
    if slope.agrees is False:
        notes.append(
            f"phase and weather disagree: the weather's index changes {slope.ratio:.3f} ± {slope.u:.3f} times as much "
            "as by the phase; above 1 the path's air changes less than the sensors'"
        )
    k, first = len(readings.thermometers), len(fit.calibrated)
    for i, name in enumerate(readings.thermometers if k > 1 else ()):
        off, u_offset = float(fit.x[first + i]), float(readings.u_temperature_c[i])
        if abs(off) > AGREES * u_offset > 0.0:
            notes.append(
                f"{name} reads {off:+.2f} °C beside the others, {abs(off) / u_offset:.0f} of its u: offset or place"
            )
    if absolute.status == CycleStatus.SURE:
        apart, u = float(absolute.group_index) - 1.0 - index_0, float(np.hypot(absolute.u, u_0))
        if abs(apart) > AGREES * u:
            notes.append(f"path length and weather disagree by {apart / PPM:+.2f} ppm, {abs(apart) / u:.1f} of its u")
    return tuple(notes)
