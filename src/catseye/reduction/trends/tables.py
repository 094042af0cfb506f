"""Series of an archive: points by kind, poses, zeros, thermometers, certificates, nights."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from catseye.aliases import Array, Progress
from catseye.errors import InputError
from catseye.estimation.series.correlated import measured
from catseye.estimation.series.line import without_prior
from catseye.records.archive.layout import POSE_PRODUCTS, PRODUCTS
from catseye.records.archive.reading import ArchiveFolder, read_table
from catseye.reduction.query.ranger import SHEET, ZERO, sheet_steps
from catseye.reduction.trends.bodies import BodyPoints
from catseye.reduction.trends.rigid import positive

POSTURE = ("azimuth", "elevation", "temperature_c")
MOST_READINGS = 2_500_000  # of one kind of points: 0.5 GB; beyond it nights are passed over evenly
LEAST_SCATTER = 1e-3  # degrees C, of a night's mean: a single reading tells none
COLUMNS = ("point", "mjd", *POSTURE, "x", "y", "z", *PRODUCTS)


@dataclass(frozen=True, eq=False)
class ArchivedNights:
    """Nights of an archive in order of time.

    night           (N,) identifiers
    mjd             (N,) days
    points          (N,) number of points
    verdict         (N,) "good", "doubtful" or "failed"
    temperature_c   (N,) of the air
    refractivity_ppm   (N,) mean over the paths
    variance_factor    (N,)
    """

    night: np.ndarray
    mjd: Array
    points: np.ndarray
    verdict: np.ndarray
    temperature_c: Array
    refractivity_ppm: Array
    variance_factor: Array

    def __len__(self) -> int:
        return len(self.night)


@dataclass(frozen=True, eq=False)
class PoseReadings:
    """Poses of one body.

    body            name
    mjd             (T,) rising
    elevation       (T,) rad
    temperature_c   (T,) degrees C
    six             (T, 6) m and rad
    covariance      (T, 6, 6)
    """

    body: str
    mjd: Array
    elevation: Array
    temperature_c: Array
    six: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class SingleSeries:
    """Readings of one quantity of one instrument.

    subject         ranger or station
    parameter       name of the quantity
    mjd             (T,) rising
    value, u        (T,)
    temperature_c   (T,) degrees C; NaN where unknown
    prior, u_prior  (T,) of the calibration; NaN without
    """

    subject: str
    parameter: str
    mjd: Array
    value: Array
    u: Array
    temperature_c: Array
    prior: Array
    u_prior: Array


def read_nights(archive: ArchiveFolder, since: float | None, until: float | None) -> ArchivedNights:
    """Nights of an archive between two times; InputError without any."""
    names = tuple(ArchivedNights.__dataclass_fields__)
    table = read_table(archive, "nights", names, since=since, until=until)
    order = np.argsort(table["mjd"], kind="stable")
    if not len(order):
        kept = "between these times" if since is not None or until is not None else "in it"
        raise InputError(f"{archive.directory}: no night {kept} (expected an archive with nights)")
    return ArchivedNights(**{name: table[name][order] for name in names})


def body_names(archive: ArchiveFolder, nights: ArchivedNights) -> tuple[dict[str, int], tuple[str, ...]]:
    """Kinds of points, each with its number of points, and bodies with a pose, over the nights."""
    since, until = float(nights.mjd[0]) - 1.0, float(nights.mjd[-1]) + 1.0
    rows = read_table(archive, "points", ("point", "body"), since=since, until=until)
    point = rows["point"]  # sorted
    first = np.flatnonzero(np.concatenate([[True], point[1:] != point[:-1]])) if len(point) else np.zeros(0, int)
    kinds, count = np.unique(rows["body"][first], return_counts=True)
    poses = read_table(archive, "poses", ("body",), since=since, until=until)["body"]
    return dict(zip(kinds.tolist(), count.tolist(), strict=True)), tuple(np.unique(poses).tolist())


def read_body(
    archive: ArchiveFolder, kind: str, nights: ArchivedNights, progress: Progress | None = None
) -> tuple[BodyPoints, int]:
    """Points of one kind through the nights, and of how many nights one was taken.

    Rows without a usable covariance are left out. Many nights are read part by part, so that memory is bounded; where
    a kind has too many readings, every second, third, ... night is taken.
    """
    most = int(np.max(nights.points))
    stride = max(1, -(-len(nights) * most // MOST_READINGS))
    wanted = nights.night[::stride]
    size = max(1, 200_000 // max(most, 1))
    parts: list[dict[str, np.ndarray]] = []
    for i in range(0, len(wanted), size):
        if progress is not None:
            progress(f"reading {kind}", i, len(wanted))
        some = tuple(wanted[i : i + size].tolist())
        parts.append(read_table(archive, "points", COLUMNS, where={"body": kind, "night": some}))
    rows = {name: np.concatenate([part[name] for part in parts]) for name in COLUMNS}
    names, at = np.unique(rows["point"], return_inverse=True)
    mjd, first, when = np.unique(rows["mjd"], return_index=True, return_inverse=True)
    x = np.full((len(mjd), len(names), 3), np.nan)
    covariance = np.full((len(mjd), len(names), 3, 3), np.nan)
    x[when, at] = np.column_stack([rows[axis] for axis in "xyz"])
    for name in PRODUCTS:
        i, j = "xyz".index(name[0]), "xyz".index(name[1])
        covariance[when, at, i, j] = covariance[when, at, j, i] = rows[name]
    usable = positive(covariance) & measured(x)
    x[~usable] = np.nan
    points = BodyPoints(
        name=kind,
        names=tuple(names.tolist()),
        mjd=mjd,
        azimuth=rows["azimuth"][first],
        elevation=rows["elevation"][first],
        temperature_c=rows["temperature_c"][first],
        x=x,
        covariance=covariance,
    )
    some_nights, some_points = usable.any(axis=1), usable.any(axis=0)
    return points.part(some_nights, some_points), stride


def read_poses(archive: ArchiveFolder, bodies: Sequence[str], nights: ArchivedNights) -> list[PoseReadings]:
    """Poses of bodies; those with an unobserved direction are left out."""
    columns = ("body", "mjd", "elevation", "temperature_c", "unobserved", *POSE_PRODUCTS)
    columns += tuple(f"{what}_{axis}" for what in ("translation", "rotation") for axis in "xyz")
    rows = _of_nights(archive, "poses", columns, nights)
    listed = []
    for body in bodies:
        at = np.flatnonzero((rows["body"] == body) & (rows["unobserved"] == ""))
        at = at[np.unique(rows["mjd"][at], return_index=True)[1]]
        if not len(at):
            continue
        covariance = np.empty((len(at), 6, 6))
        for name in POSE_PRODUCTS:
            i, j = int(name[1]) - 1, int(name[2]) - 1
            covariance[:, i, j] = covariance[:, j, i] = rows[name][at]
        six = np.column_stack([rows[f"{w}_{axis}"][at] for w in ("translation", "rotation") for axis in "xyz"])
        good = np.isfinite(six).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2))
        good[good] = np.linalg.eigvalsh(_unit(covariance[good]))[:, 0] > 1e-10
        at, six, covariance = at[good], six[good], covariance[good]
        listed.append(
            PoseReadings(
                body=body,
                mjd=rows["mjd"][at],
                elevation=rows["elevation"][at],
                temperature_c=rows["temperature_c"][at],
                six=six,
                covariance=covariance,
            )
        )
    return listed


def _unit(covariance: Array) -> Array:
    """Correlations (T, 6, 6); -1 where a variance is not positive."""
    variance = np.einsum("tii->ti", covariance)
    size = np.sqrt(np.where(variance > 0.0, variance, np.nan))
    unit = covariance / (size[:, :, None] * size[:, None, :])
    return np.where(np.isfinite(unit).all(axis=(1, 2))[:, None, None], unit, -np.eye(6))


def read_zeros(archive: ArchiveFolder, nights: ArchivedNights) -> list[SingleSeries]:
    """Zeros and other parameters of the rangers as the ranges alone show them: the calibration's share taken out.

    A night that adds nothing to the calibration is left out. Zeros count from the D0 of the last night's sheet; another
    head on the same ranger is another series, named after both.
    """
    names = ("ranger", "parameter", "mjd", "value", "u", "u_adjusted", "prior", "u_prior", "temperature_c")
    rows = _of_nights(archive, "zeros", names, nights)
    sheets = _of_nights(archive, "certificates", (*SHEET, "ranger", "kind"), nights)
    listed = []
    for ranger in np.unique(rows["ranger"]):
        chosen = {name: values[rows["ranger"] == ranger] for name, values in rows.items()}
        mirrors = (sheets["ranger"] == ranger) & (sheets["kind"] == "mirror")
        heads, steps = sheet_steps({name: sheets[name][mirrors] for name in SHEET}, chosen["night"])
        moved = np.where(chosen["parameter"] == ZERO, steps, 0.0)
        u = np.where(np.isfinite(chosen["u_adjusted"]), chosen["u_adjusted"], chosen["u"])
        value, u = without_prior(chosen["value"] + moved, u, chosen["prior"] + moved, chosen["u_prior"])
        usable = np.isfinite(value) & np.isfinite(u)
        different = np.unique(heads).tolist()
        for parameter, head in product(np.unique(chosen["parameter"]), different):
            at = np.flatnonzero(usable & (chosen["parameter"] == parameter) & (heads == head))
            at = at[np.unique(chosen["mjd"][at], return_index=True)[1]]
            listed.append(
                SingleSeries(
                    subject=str(ranger) if len(different) == 1 else f"{ranger} with {head or 'no sheet'}",
                    parameter=str(parameter),
                    mjd=chosen["mjd"][at],
                    value=value[at],
                    u=u[at],
                    temperature_c=chosen["temperature_c"][at],
                    prior=(chosen["prior"] + moved)[at],
                    u_prior=chosen["u_prior"][at],
                )
            )
    return [series for series in listed if len(series.mjd)]


@dataclass(frozen=True, eq=False)
class StationReadings:
    """Thermometers of the stations, night by night.

    stations    S names
    mean        (S, N) degrees C; NaN without a reading
    scatter     (S, N) standard deviation of the mean
    by_ranges   errors as the reductions estimated them from the ranges
    """

    stations: tuple[str, ...]
    mean: Array
    scatter: Array
    by_ranges: tuple[SingleSeries, ...]


def read_thermometers(archive: ArchiveFolder, nights: ArchivedNights) -> StationReadings:
    """Readings of the stations' thermometers, and their errors by the ranges, once a night."""
    names = ("station", "night", "mjd", "temperature_c", "t_error_c", "u_t_error_c")
    rows = _of_nights(archive, "weather", names, nights)
    stations = np.unique(rows["station"])
    index = {night: k for k, night in enumerate(nights.night.tolist())}
    when = np.array([index.get(night, -1) for night in rows["night"].tolist()], dtype=int)
    count = len(nights)
    means, scatters, by_ranges = [], [], []
    for station in stations:
        chosen = (rows["station"] == station) & (when >= 0)
        mean, scatter = _night_means(when[chosen], rows["temperature_c"][chosen], count)
        means.append(mean)
        scatters.append(scatter)
        error, _ = _night_means(when[chosen], rows["t_error_c"][chosen], count)
        u, _ = _night_means(when[chosen], rows["u_t_error_c"][chosen], count)
        by_ranges.append(_single(str(station), "ranges", nights, error, u))
    return StationReadings(
        stations=tuple(stations.tolist()),
        mean=np.array(means).reshape(-1, count),
        scatter=np.array(scatters).reshape(-1, count),
        by_ranges=tuple(one for one in by_ranges if len(one.mjd)),
    )


def beside_others(readings: StationReadings, nights: ArchivedNights, doubted: frozenset[str]) -> list[SingleSeries]:
    """Night means of each station less the median of the other stations.

    doubted   stations that are compared, and nobody is compared with
    """
    listed = []
    for k, station in enumerate(readings.stations):
        others = [j for j, other in enumerate(readings.stations) if j != k and other not in doubted]
        if others:
            away = readings.mean[k] - _column_median(readings.mean[others])
            listed.append(_single(station, "stations", nights, away, np.maximum(readings.scatter[k], LEAST_SCATTER)))
    return [one for one in listed if len(one.mjd)]


def _single(subject: str, parameter: str, nights: ArchivedNights, value: Array, u: Array) -> SingleSeries:
    good = np.isfinite(value) & np.isfinite(u) & (u > 0.0)
    at = np.flatnonzero(good)
    at = at[np.unique(nights.mjd[at], return_index=True)[1]]
    blank = np.full(len(at), np.nan)
    return SingleSeries(
        subject=subject,
        parameter=parameter,
        mjd=nights.mjd[at],
        value=value[at],
        u=u[at],
        temperature_c=nights.temperature_c[at],
        prior=blank,
        u_prior=blank,
    )


def _night_means(when: np.ndarray, values: Array, count: int) -> tuple[Array, Array]:
    """Mean (count,) of each night's values, and the standard deviation of the mean; NaN without."""
    good = np.isfinite(values)
    number = np.bincount(when[good], minlength=count)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.bincount(when[good], values[good], minlength=count) / number
        square = np.bincount(when[good], (values[good] - mean[when[good]]) ** 2, minlength=count)
        return mean, np.sqrt(square / np.maximum(number - 1, 1) / number)


def _column_median(values: Array) -> Array:
    """Median of each column, missing values passed over; NaN where all are."""
    finite = np.isfinite(values).any(axis=0)
    result = np.full(values.shape[1], np.nan)
    if finite.any():
        result[finite] = np.nanmedian(values[:, finite], axis=0)
    return result


def read_certificates(archive: ArchiveFolder, nights: ArchivedNights) -> dict[str, np.ndarray]:
    """Rows of the certificates of these nights, by column."""
    return _of_nights(archive, "certificates", None, nights)


def _of_nights(
    archive: ArchiveFolder, kind: str, columns: tuple[str, ...] | None, nights: ArchivedNights
) -> dict[str, np.ndarray]:
    """Columns of a table for the nights, by time: a day around them, then by night where the table says it."""
    first, last = float(nights.mjd[0]) - 1.0, float(nights.mjd[-1]) + 1.0
    names = None if columns is None else tuple(dict.fromkeys((*columns, "night")))
    rows = read_table(archive, kind, names, since=first, until=last)
    inside = np.isin(rows["night"], nights.night)
    return {name: values[inside] for name, values in rows.items()}
