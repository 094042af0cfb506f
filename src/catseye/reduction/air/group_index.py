"""Group index from the phase of a fixed path (refractometer).

Absolute and relative, and benchmark paths.

With L = D - D0 (less the glass of the target) and phi the target's phase after the reference's,
n_g = c/(2 L f) (N - phi/2pi), so that dphi/dn_g = -(4 pi f/c) L. The notes' 1.31 prints "+ phi/2pi"; 5.18 requires
minus, and with it 1.32 to 1.34 and 1.36 to 1.38 change their sign: as printed, changes of the air have the wrong
sign. 1.34 prints 6283 rad (c taken as 3e8 m/s), 6287.535 is right; 1.39 cuts 1.988e-8 to 1.98e-8.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.atmosphere.index.air import MODELS
from catseye.atmosphere.weather.humidity import vapour_pressure_hpa
from catseye.constants import MILLIMETRE, SPEED_OF_LIGHT, TWO_PI
from catseye.errors import ValidityError
from catseye.reduction.epoch.air.field import AirField
from catseye.signal.cycles.whole import CycleStatus, decision, fraction, unwrapped_length

if TYPE_CHECKING:
    from catseye.records.site.target import BenchmarkRow
    from catseye.reduction.epoch.epoch import Reduction

MODULATION_HZ = 1500e6


def phase_slope(path_length: ArrayLike, *, modulation_hz: float = MODULATION_HZ) -> NDArray[np.float64]:
    """Change of the phase for each unit of group index, rad.

    Below zero, as the phase falls with the optical length.

    path_length     m, above 0: D - D0, one way
    modulation_hz   Hz, above 0

    Source: [PARKER04] eqs. 1.32, 1.34 with the sign of 5.18 (1.32 prints plus). Exact.

    >>> round(float(phase_slope(100.0)), 3)
    -6287.535
    """
    length = np.asarray(path_length, dtype=float)
    for name, value, unit in (("path length", length, "m"), ("modulation frequency", np.asarray(modulation_hz), "Hz")):
        if not np.all(value > 0.0):
            raise ValidityError(f"{name} {float(np.min(value))} {unit} is not above 0")
    return -2.0 * TWO_PI * modulation_hz * length / SPEED_OF_LIGHT


def group_index(
    phase: ArrayLike, cycles: ArrayLike, *, path_length: ArrayLike, modulation_hz: float = MODULATION_HZ
) -> NDArray[np.float64]:
    """Group index along a path of known length, from phase and cycles.

    phase           rad, the target's after the reference's
    cycles          N, whole half wavelengths that belong to this phase
    path_length     m, above 0: D - D0
    modulation_hz   Hz, above 0

    Source: [PARKER04] eq. 1.31 with the sign of 5.18 (1.31 prints plus). Exact.

    >>> round(float(group_index(4.0, 1002, path_length=100.0)), 9)
    1.00067063
    """
    turns = np.asarray(cycles) - np.asarray(phase, dtype=float) / TWO_PI
    if np.any(np.isinf(turns)):
        raise ValidityError("phase or cycles are infinite; give nan for missing ones")
    return -TWO_PI * turns / phase_slope(path_length, modulation_hz=modulation_hz)


def length_sensitivity(
    phase_change: ArrayLike, *, path_length: ArrayLike, modulation_hz: float = MODULATION_HZ
) -> NDArray[np.float64]:
    """Change of the relative index per metre of error in path length, 1/m.

    phase_change    rad, since the calibration
    path_length     m, above 0: D - D0
    modulation_hz   Hz, above 0

    Source: [PARKER04] eqs. 1.37, 1.38 with the sign of 5.18 (printed with minus; 1.39 gives the size alone). Exact.

    >>> f"{float(length_sensitivity(0.5, path_length=100.0)) * 0.025:.3e}"  # 1.39 prints 1.98e-8
    '1.988e-08'
    """
    length = np.asarray(path_length, dtype=float)
    return -np.asarray(phase_change, dtype=float) / (length * phase_slope(length, modulation_hz=modulation_hz))


@dataclass(frozen=True, eq=False)
class AbsoluteIndex:
    """Group index from phase and length alone, one value a phase.

    group_index   nan where the whole cycles are uncertain
    u             its standard uncertainty
    cycles        N, the nearest integer
    margin        m, additional error of the expected optical length before N changes
    status        int8 of `CycleStatus`: SURE, THIN or UNKNOWN
    """

    group_index: NDArray[np.float64]
    u: NDArray[np.float64]
    cycles: NDArray[np.int64]
    margin: NDArray[np.float64]
    status: NDArray[np.int8]


def absolute_group_index(
    phase: ArrayLike,
    *,
    path_length: ArrayLike,
    u_path_length: ArrayLike,
    expected_index: ArrayLike,
    u_expected_index: ArrayLike,
    u_phase: ArrayLike,
    modulation_hz: float = MODULATION_HZ,
) -> AbsoluteIndex:
    """Absolute group index along a path of certified length.

    Its whole cycles are the nearest integer with a margin of 5 sigma.

    phase              rad, any: the target's after the reference's
    path_length        m, above 0: D - D0, with u_path_length (m)
    expected_index     group index to be expected, from the weather, with u_expected_index
    u_phase            rad
    modulation_hz      Hz, above 0

    At 100 m and 1500 MHz a whole cycle is 1000 ppm of index: the length decides, the weather is almost negligible. The
    same length error then is in every index of the path; 0.1 mm in 100 m is 1 ppm.

    Source: [PARKER04] eq. 1.31 with the sign of 5.18; rule of `signal.cycles.whole.decision`; [JCGM100] eq. 10.

    >>> sure = {"u_path_length": 2e-5, "u_expected_index": 1e-6, "u_phase": 1e-3}
    >>> absolute = absolute_group_index(1.0, path_length=100.0, expected_index=1.00025, **sure)
    >>> int(absolute.cycles), round(float(absolute.group_index), 9), float(f"{absolute.u:.2g}")
    (1001, 1.000148457, 2.6e-07)
    """
    length, u_length = np.asarray(path_length, dtype=float), np.asarray(u_path_length, dtype=float)
    half = 0.5 * SPEED_OF_LIGHT / modulation_hz
    part = fraction(phase, 0.0)
    expected = np.asarray(expected_index, dtype=float)
    u_coarse = np.hypot(expected * u_length, length * np.asarray(u_expected_index, dtype=float))
    chosen = decision(expected * length, part, half, u_coarse=u_coarse, u_phase=u_phase)
    index = group_index(part, chosen.cycles, path_length=length, modulation_hz=modulation_hz)
    by_phase = phase_slope(length, modulation_hz=modulation_hz)
    u = np.hypot(index * u_length / length, np.asarray(u_phase, dtype=float) / by_phase)
    sure = chosen.status == CycleStatus.SURE
    return AbsoluteIndex(
        np.where(sure, index, np.nan), np.where(sure, u, np.nan), chosen.cycles, chosen.margin, chosen.status
    )


@dataclass(frozen=True, eq=False)
class BenchmarkSeries:
    """Certified path of a campaign as a refractometer, a row per shot.

    Shots with a phase, in order of time.

    benchmark, ranger   names
    mjd_utc             (m,)
    used                (m,) bool: used in the adjustment
    path, u_path        (m,) group refractivity by phase, certificate and the ranger's own sheet, and its u
    u_common            part of it common to all rows: certificate, D0, residual leakage
    weather, u_weather  (m,) by the stations' readings, and the u of their sensors' offsets and of the formula
    adjusted            (m,) with the offsets of the adjustment
    too_warm_c, u_too_warm_c   °C, bias of the thermometers that would explain the mean difference of the used
                        shots, and its u from the path's side; nan where none was used
    """

    benchmark: str
    ranger: str
    mjd_utc: NDArray[np.float64]
    used: NDArray[np.bool_]
    path: NDArray[np.float64]
    u_path: NDArray[np.float64]
    u_common: float
    weather: NDArray[np.float64]
    u_weather: NDArray[np.float64]
    adjusted: NDArray[np.float64]
    too_warm_c: float
    u_too_warm_c: float

    @property
    def difference(self) -> NDArray[np.float64]:
        """Path's index minus the weather's as read, (m,)."""
        return self.path - self.weather

    @property
    def u_difference(self) -> NDArray[np.float64]:
        return np.hypot(self.u_path, self.u_weather)


def benchmark_refractometers(reduction: "Reduction") -> tuple[BenchmarkSeries, ...]:
    """Index of every benchmark path of a campaign, beside its weather.

    reduction   of a campaign

    The path's index depends on the certificate and the ranger's sheet alone, not on their adjusted values:
    (n - 1) from n = vacuum length / (certified distance - D0 - glass - obliquity - head). Benchmarks without a shot
    that has a phase are left out. The turbulence of the path counts as part of its index.

    Source: [PARKER04] eq. 1.31 with the sign of 5.18, 5.19; [JCGM100] eq. 13.
    """
    ranges = reduction.coordinates.ranges
    ends = list(zip(ranges.ranger, ranges.target, strict=True))
    points, series = set(reduction.coordinates.points), []
    field = AirField.of(reduction.campaign, reduction.settings)
    for benchmark in reduction.campaign.benchmarks:
        rows = [row for row, pair in enumerate(ends) if pair == (benchmark.ranger, benchmark.target)]
        if rows and {benchmark.ranger, benchmark.target} <= points:
            times = reduction.campaign.shots.mjd_utc[ranges.shot[rows]]
            series.append(_series(reduction, field, benchmark, np.array(rows)[np.argsort(times, kind="stable")]))
    return tuple(series)


def _series(reduction: "Reduction", field: AirField, benchmark: "BenchmarkRow", rows: np.ndarray) -> BenchmarkSeries:
    campaign, coordinates = reduction.campaign, reduction.coordinates
    ranges, shots = coordinates.ranges, coordinates.ranges.shot[rows]
    electronics, half = reduction.electronics[benchmark.ranger], campaign.half_wavelengths(shots)
    modulations = campaign.modulation_of(shots).tolist()
    sheet = campaign.mirror_of(benchmark.ranger)
    u_volt = np.array([sheet.at_modulation(hz).u_leakage_volt for hz in modulations])
    certified = benchmark.certified_distance_mm * MILLIMETRE
    constants = ranges.glass[rows] + ranges.obliquity[rows] + ranges.head[rows] + sheet.d0_mm * MILLIMETRE
    path = unwrapped_length(ranges.cycles[rows], ranges.phase[rows], half) / (certified - constants) - 1.0

    at = np.searchsorted(electronics.shots, shots)
    per_metre = half / TWO_PI / certified  # refractivity per radian
    leakage_slope = np.abs(1.0 / reduction.phases.phasor[shots] - 1.0 / electronics.reference[at])
    leakage = per_metre * u_volt * leakage_slope
    noise = np.diag(reduction.phases.u_phase[shots] ** 2) + electronics.joint(at)
    noise = np.outer(per_metre, per_metre) * noise
    u_length = np.hypot(benchmark.u_mm, sheet.u_d0_mm) * MILLIMETRE / certified
    u_common = float(np.hypot(u_length, leakage.mean()))
    u_path = np.sqrt(np.diag(noise) + leakage**2 + u_length**2)

    mjd = campaign.shots.mjd_utc[shots]
    a, b = (coordinates.x[coordinates.index(name)] for name in (benchmark.ranger, benchmark.target))
    no_parameters = np.zeros(len(field.names))
    air = field.along(mjd, np.tile(a, (len(rows), 1)), np.tile(b, (len(rows), 1)), no_parameters)
    t, p, h = field.smoothed(mjd).mean(axis=1).T
    chosen = MODELS[field.model]
    vapour = vapour_pressure_hpa(t, p, h, chosen.vapour_formula)
    formula = chosen.uncertainty(t, p, vapour, wavelength_um=field.wavelength_um)
    u_weather = np.sqrt(np.sum((air.slopes * field.sigmas) ** 2, axis=1) + formula**2)
    used = ranges.used[rows]
    count = max(int(used.sum()), 1)
    difference = float((path - air.refractivity)[used].sum()) / count if used.any() else np.nan
    per_c = float(air.slopes[:, : len(field.stations)].sum(axis=1).mean())
    u_mean = float(np.sqrt(noise[np.ix_(used, used)].sum() / count**2 + u_common**2)) if used.any() else np.nan
    return BenchmarkSeries(
        benchmark=benchmark.target,
        ranger=benchmark.ranger,
        mjd_utc=mjd,
        used=used,
        path=path,
        u_path=u_path,
        u_common=u_common,
        weather=air.refractivity,
        u_weather=u_weather,
        adjusted=ranges.refractivity[rows],
        too_warm_c=difference / per_c,
        u_too_warm_c=u_mean / per_c,
    )
