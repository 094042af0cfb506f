"""Normal equations of a refractometer's night, outliers removed.

Every thermometer's index against the phase.

See `refractometer_calibration` for observations and unknowns.
"""

import numpy as np

from catseye.atmosphere.index.air import MODELS
from catseye.atmosphere.weather.humidity import vapour_pressure_hpa
from catseye.constants import MILLIMETRE, PPM
from catseye.errors import EstimationError
from catseye.reduction.air.group_index import phase_slope
from catseye.reduction.air.refractometer_night import (
    FEWEST_AFTER_JUMP,
    FollowedPhase,
    PathReadings,
    PathWeather,
    ReadingStatus,
)

CRITICAL = 3.5  # |w| beyond which a value is rejected: one good value in 2000
ROUNDS = 30  # cap of rounds of rejection and reinstatement
MOST_KNOTS = 48  # of the drift
FEWEST_PLACES = 3  # least thermometers for an estimate of the air's differences between them


def drift_name(hours: float) -> str:
    """Parameter of the drift at a knot.

    hours   since the first reading

    >>> drift_name(1.5)
    'drift at 1.50 h'
    """
    return f"drift at {hours:.2f} h"


class PathFit:
    """Normal equations of one night, and its used values.

    Units ppm, °C, hPa, %, rad.

    Columns: one index a calibrated section, thermometers, barometer, hygrometer, formula, length, knots of the drift.
    """

    def __init__(self, readings: PathReadings, weather: PathWeather, followed: FollowedPhase) -> None:
        self.readings, self.weather, self.followed = readings, weather, followed
        sheet = readings.sheet
        self.per_radian = 1.0 / (-float(phase_slope(sheet.path_length_m, modulation_hz=sheet.modulation_hz)) * PPM)
        good = followed.status == ReadingStatus.FOLLOWED
        fits = good & readings.has_weather
        numbers = range(len(followed.sections))
        self.calibrated = [s for s in numbers if np.sum(fits & (followed.section == s)) >= FEWEST_AFTER_JUMP]
        if not self.calibrated:
            raise EstimationError(
                f"{readings.file}: no section of the phase has {FEWEST_AFTER_JUMP} readings with weather"
            )
        self.rows = np.flatnonzero(fits & np.isin(followed.section, self.calibrated))
        self.good = good & np.isin(followed.section, self.calibrated)
        self.phase_0 = np.array([followed.phase[self.rows[followed.section[self.rows] == s]].mean()
                                 for s in self.calibrated])  # fmt: skip
        self.hours = readings.hours
        self.knots = self._knots()
        self.names, self.prior = self._parameters()
        design = self.at(np.arange(len(readings)))
        self.common = design[self.rows]
        self.change = self.common[:, self.names.index("length")]
        self.slopes = weather.slopes[self.rows] / PPM
        self.there = np.isfinite(weather.index[self.rows])
        self.mean = float(np.nanmean(weather.index[self.rows]))
        y = (np.where(self.there, weather.index[self.rows], self.mean) - self.mean) / PPM
        self.y = y + self.change[:, None]
        noise = (sheet.noise_temperature_c, sheet.noise_pressure_hpa, sheet.noise_humidity_percent)
        self.noise_t = np.maximum(np.abs(self.slopes[:, 0]) * noise[0], 1e-6)
        self.u_phase = readings.u_phase[self.rows] * self.per_radian
        self.noise_c = self.u_phase**2 + (self.slopes[:, 1] * noise[1]) ** 2 + (self.slopes[:, 2] * noise[2]) ** 2
        self.value_in = self.there.copy()
        self.reading_in = np.ones(len(self.rows), dtype=bool)
        self.scatter, self.air, self.correlation, self.places = 1.0, 0.0, 1.0, 1.0

    def _knots(self) -> np.ndarray:
        """Hours of the drift's knots, zero at the first reading.

        Empty where the sheet has no drift.
        """
        span = float(self.hours[-1])
        if self.readings.sheet.drift_mrad_per_root_hour == 0.0 or span == 0.0:
            return np.zeros(0)
        return np.linspace(0.0, span, int(min(max(np.ceil(span), 1), MOST_KNOTS)) + 1)[1:]

    def _parameters(self) -> tuple[tuple[str, ...], np.ndarray]:
        """Names, and the matrix of prior weights."""
        r, sheet = self.readings, self.readings.sheet
        chosen, measured = MODELS[sheet.air_model], np.isfinite(self.weather.index)
        p, h = (float(np.mean(column[self.rows])) for column in (r.pressure_hpa, r.humidity_percent))
        t, light = float(np.nanmean(r.temperature_c[measured])), {"wavelength_um": sheet.wavelength_um}
        vapour = vapour_pressure_hpa(t, p, h, chosen.vapour_formula)
        formula = float(chosen.uncertainty(t, p, vapour, **light, co2_ppm=sheet.co2_ppm)) / PPM
        u_length = sheet.u_path_length_mm * MILLIMETRE / sheet.path_length_m
        u = [*r.u_temperature_c, sheet.u_pressure_hpa, sheet.u_humidity_percent, formula, u_length]
        names = [f"index {s + 1}" for s in self.calibrated]
        names += [*r.thermometers, "pressure_hpa", "humidity_percent", "formula", "length"]
        first = len(self.calibrated)
        prior = np.zeros((len(names) + len(self.knots),) * 2)
        for k, value in enumerate(u, start=first):
            prior[k, k] = 1.0 / max(value, 1e-9) ** 2
        increments = np.eye(len(self.knots)) - np.eye(len(self.knots), k=-1)
        if len(self.knots):
            rate = sheet.drift_mrad_per_root_hour * 1e-3
            steps = np.diff(self.knots, prepend=0.0)
            prior[len(names) :, len(names) :] = increments.T @ (increments / (rate**2 * steps)[:, None])
        return (*names, *(drift_name(h) for h in self.knots)), prior

    def at(self, rows: np.ndarray) -> np.ndarray:
        """Derivatives of the path's index minus dphi/K at readings (ppm).

        By section, length, drift.
        """
        f = self.followed
        design = np.zeros((len(rows), len(self.names)))
        for k, s in enumerate(self.calibrated):
            in_section = f.section[rows] == s
            design[in_section, k] = 1.0
            design[in_section, self.names.index("length")] = (
                f.phase[rows[in_section]] - self.phase_0[k]
            ) * self.per_radian
        if len(self.knots):
            grid = np.concatenate([[0.0], self.knots])
            first = len(self.names) - len(self.knots)
            for k in range(len(self.knots)):
                design[:, first + k] = self.per_radian * np.interp(self.hours[rows], grid, np.eye(len(grid))[k + 1])
        return design

    def weights(self) -> tuple[np.ndarray, np.ndarray]:
        """Weights (n, k) of each value's noise, and (n,) g.

        The weight matrix of a reading is diag(d) - g d d'.
        """
        d = np.where(self.value_in & self.reading_in[:, None], 1.0, 0.0) / (self.scatter * self.noise_t[:, None]) ** 2
        return d, 1.0 / (1.0 / (self.noise_c + self.air**2) + d.sum(axis=1))

    def design(self) -> np.ndarray:
        """Design (n, k, q) of every value.

        The path's index, and effects of sensors and formula on the weather's.
        """
        k = self.y.shape[1]
        full = np.repeat(self.common[:, None, :], k, axis=1)
        first = len(self.calibrated)
        full[:, np.arange(k), first + np.arange(k)] = self.slopes[:, :1]
        full[:, :, first + k], full[:, :, first + k + 1] = self.slopes[:, 1:2], self.slopes[:, 2:3]
        full[:, :, first + k + 2] = -1.0
        return full

    def solve(self) -> None:
        full, (d, g) = self.design(), self.weights()
        flat, root = full.reshape(-1, full.shape[2]), np.sqrt(d).ravel()
        pooled = np.einsum("nk,nkq->nq", d, full)
        weighted = np.einsum("nk,nk->n", d, self.y)
        normal = (flat * root[:, None]).T @ (flat * root[:, None]) - (pooled * g[:, None]).T @ pooled
        right = (flat * d.ravel()[:, None]).T @ self.y.ravel() - pooled.T @ (g * weighted)
        self.data = normal / self.correlation
        self.covariance = _inverse(self.data + self.prior)
        self.x = self.covariance @ (right / self.correlation)
        self.v = self.y - full @ self.x

    def tests(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residuals (n,) of readings' means, and w of readings and values.

        w (n,) of readings and w (n, k) of single values, used or not.
        """
        value_weight = 1.0 / (self.scatter * self.noise_t[:, None]) ** 2 * self.there
        d = value_weight * self.value_in
        d = np.where(d.sum(axis=1, keepdims=True) > 0.0, d, value_weight)
        total = d.sum(axis=1)
        common = self.noise_c + self.air**2
        mean = np.einsum("nk,nk->n", d, self.v) / total
        w_reading = mean / np.sqrt(1.0 / total + common)
        other_weight = (
            total[:, None] - d
        )  # a value against the mean of the others: both share the reading's common noise
        with np.errstate(divide="ignore", invalid="ignore"):
            other_mean = (total[:, None] * mean[:, None] - d * self.v) / other_weight
            apart = np.where(self.there & (other_weight > 0.0), self.v - other_mean, np.nan)
            w_value = _about_medians(apart) / np.sqrt(1.0 / value_weight + 1.0 / other_weight)
        alone = (other_weight <= 0.0) | ~self.there
        return mean, w_reading, np.where(alone, 0.0, w_value)

    def run(self) -> None:
        """Reject and reinstate values until nothing changes.

        Scatter and its correlation in time are estimated in each round.
        """
        self.x = np.zeros(len(self.names))
        self.x[: len(self.calibrated)] = [
            np.nanmedian(np.where(self.there, self.y, np.nan)[self.followed.section[self.rows] == s])
            for s in self.calibrated
        ]
        self.v = self.y - self.design() @ self.x
        for _ in range(ROUNDS):
            self._spread()
            _, w_reading, w_value = self.tests()
            worst = np.abs(w_value) >= np.abs(w_value).max(axis=1, keepdims=True)  # of a reading one at a time
            value_in = self.there & ~((np.abs(w_value) > CRITICAL) & (worst | ~self.value_in))
            reading_in = np.abs(w_reading) <= CRITICAL
            unchanged = np.array_equal(value_in, self.value_in) and np.array_equal(reading_in, self.reading_in)
            self.value_in, self.reading_in = value_in, reading_in
            before = (self.scatter, self.air, self.correlation)
            self.solve()
            self._spread()
            current = (self.scatter, self.air, self.correlation)
            if unchanged and np.allclose(before, current, rtol=1e-3, atol=1e-4):
                break
        self.solve()
        self._places()

    def _places(self) -> None:
        """Enlarge the thermometers' offsets' u by their differences.

        Thermometers further apart than their offsets allow represent the path's mean as badly.
        """
        k, first = len(self.readings.thermometers), len(self.calibrated)
        if k < FEWEST_PLACES:
            return
        thermometers = np.arange(first, first + k)
        self.places = max(1.0, float(np.sqrt(self.x[thermometers] ** 2 @ np.diag(self.prior)[thermometers] / (k - 1))))
        self.prior[thermometers, thermometers] /= self.places**2
        self.solve()

    def _spread(self) -> None:
        """Robust noise of thermometers and air, and its correlation in time.

        From the residuals.
        """
        d = np.where(self.there, 1.0, 0.0)
        count = d.sum(axis=1)
        mean = (d * self.v).sum(axis=1) / count
        several = count > 1
        if several.any():
            remainder = _about_medians(np.where(self.there, self.v - mean[:, None], np.nan)[several])
            spread = remainder / (self.noise_t[several] * np.sqrt(1.0 - 1.0 / count[several]))[:, None]
            self.scatter = max(1.0, _spread_of(spread[np.isfinite(spread)]))
        expected = (self.scatter * self.noise_t) ** 2 / count + self.noise_c
        self.air = float(np.sqrt(max(_spread_of(mean) ** 2 - float(np.median(expected)), 0.0)))
        keep = self.reading_in
        self.correlation = _correlation((mean / np.sqrt(expected + self.air**2))[keep])


def _inverse(normal: np.ndarray) -> np.ndarray:
    """Inverse of a normal matrix with very different units."""
    size = np.sqrt(np.diag(normal))
    return np.linalg.inv(normal / np.outer(size, size)) / np.outer(size, size)


def _about_medians(apart: np.ndarray) -> np.ndarray:
    """Values (n, k) of each thermometer against the others, minus its median.

    The median is its offset or its place.
    """
    usual = [np.nanmedian(one) if np.isfinite(one).any() else 0.0 for one in apart.T]
    return apart - usual


def _spread_of(values: np.ndarray) -> float:
    """Robust standard deviation about zero."""
    return float(1.4826 * np.median(np.abs(values))) if len(values) else 0.0


def _correlation(values: np.ndarray) -> float:
    """Factor on the variance of a mean: 1 + 2 sum of autocorrelations.

    Up to where pairs of them are no longer above 0.

    Source: the initial positive sequence of [GEYER92].
    """
    n = len(values)
    if n < 4 * FEWEST_AFTER_JUMP:
        return 1.0
    centred = values - values.mean()
    size = 1 << (2 * n - 1).bit_length()
    power = np.abs(np.fft.rfft(centred, size)) ** 2
    auto = np.fft.irfft(power, size)[: n // 2]
    if auto[0] <= 0.0:
        return 1.0
    auto = auto / auto[0]
    pairs = auto[: len(auto) // 2 * 2].reshape(-1, 2).sum(axis=1)
    stop = int(np.argmax(pairs <= 0.0)) if np.any(pairs <= 0.0) else len(pairs)
    return float(max(1.0, 2.0 * pairs[:stop].sum() - 1.0))
