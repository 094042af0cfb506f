"""Flexible model of a group of points from many epochs.

With its predictions.

In the axes of the frame that carries the group, each point is at its place on the rigid telescope, plus

    the group's shift and turn about a pivot    for every function of posture and temperature that is not the points'
    the point's own shift                       for "place": a constant; for "each": for every function

The functions are 1, sinE, cosE, with two harmonics sin2E, cos2E, with temperatures t (degrees C off the reference),
and for hysteresis `up`: 1 after the elevation rose, -1 after it fell. The scatter of an epoch that no function predicts
(wind, sunshine) is estimated too, by moments: a shift and turn of the group, new in each, and a shift of each point.
"""

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.constants import DEGREE
from catseye.errors import EstimationError, InputError, ValidityError
from catseye.estimation.harmonic.body import rigid_design, rigid_part
from catseye.estimation.harmonic.labels import HarmonicLabels
from catseye.estimation.harmonic.series import HarmonicFit, Spread, fit_harmonics
from catseye.geometry.antenna.deformation import PostureTerms, TelescopePosture

Own = Literal["place", "each"]
ROUNDING = 1e-9  # of an eigenvalue of a covariance scaled to ones
PASSES = 3  # of fit and scatter; the second changes a scatter by some percent, the third by less than one
UP = "up"


@dataclass(frozen=True)
class SeriesModel:
    """Functions of a flexible model.

    For each point or for the rigid body.

    harmonics     of elevation, 1 or 2
    temperature   True for a coefficient of temperature
    hysteresis    True for a term of the last elevation move's direction
    own           "place": each point has its own constant; "each": its own coefficients of all functions
    scatter       True to estimate the scatter of epochs; else only the measurements' covariance
    """

    harmonics: int = 1
    temperature: bool = True
    hysteresis: bool = False
    own: Own = "place"
    scatter: bool = True

    def __post_init__(self) -> None:
        if self.harmonics not in (1, 2):
            raise ValidityError(f"{self.harmonics} harmonics of elevation (expected 1 or 2)")
        if self.own not in get_args(Own):
            raise ValidityError(f"own = {self.own!r} (expected {' or '.join(get_args(Own))})")

    @property
    def functions(self) -> tuple[str, ...]:
        """Names of the functions, the constant first."""
        waves = ("sinE", "cosE", "sin2E", "cos2E")[: 2 * self.harmonics]
        return ("1", *waves, *(("t",) if self.temperature else ()), *((UP,) if self.hysteresis else ()))

    @property
    def own_count(self) -> int:
        """Number of functions, from the first, that each point has of its own."""
        return 1 if self.own == "place" else len(self.functions)

    def rows(self, posture: TelescopePosture, way: ArrayLike, reference_c: float) -> Array:
        """Values (..., k) of the functions.

        posture       (...)
        way           (...), 1 after the elevation rose, -1 after it fell
        reference_c   degrees C at which t is 0
        """
        named = tuple(name for name in self.functions if name != UP)
        values = PostureTerms(named, reference_c).rows(posture)
        if not self.hysteresis:
            return values
        ways = np.broadcast_to(np.asarray(way, dtype=float), values.shape[:-1])
        return np.concatenate([values, ways[..., None]], axis=-1)


@dataclass(frozen=True, eq=False)
class GroupSeries:
    """Group of points in T epochs, in the axes of its rigid frame.

    group, frame    names
    names           n points
    mjd             (T,) UTC; NaN where unknown
    posture         (T,) elevation and azimuth, rad, and temperature, degrees C; NaN where unknown
    way             (T,) 1 after the elevation rose, -1 after it fell, 0 where it did not move or is unknown
    places          (T, n, 3) m; NaN where not measured
    spread          covariance of the places, as `estimation.harmonic.series` takes it
    pivot           (3,) m, of the group's turns
    labels          T names of the epochs, for messages
    """

    group: str
    frame: str
    names: tuple[str, ...]
    mjd: Array
    posture: TelescopePosture
    way: Array
    places: Array
    spread: Spread
    pivot: Array
    labels: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.places)

    def part(self, epochs: NDArray[np.intp]) -> "GroupSeries":
        """Some of the epochs, with the points measured in any of them."""
        with_points = np.isfinite(self.places[epochs]).all(axis=2).any(axis=0)
        at = np.flatnonzero(with_points)

        def cut(q: Array | None, axes: int) -> Array | None:
            if q is None:
                return None
            selected = q[epochs] if len(q) > 1 else q
            if axes == 2:
                rows = (3 * at[:, None] + np.arange(3)).ravel()
                return selected[:, rows[:, None], rows]
            return selected[:, at] if selected.shape[1] > 1 else selected

        spread = Spread(cut(self.spread.full, 2), cut(self.spread.points, 1), cut(self.spread.shared, 1))
        posture = (np.asarray(v, dtype=float)[epochs] for v in vars(self.posture).values())
        return replace(
            self,
            names=tuple(self.names[i] for i in at),
            mjd=self.mjd[epochs],
            posture=TelescopePosture(*posture),
            way=self.way[epochs],
            places=self.places[np.ix_(epochs, at)],
            spread=spread,
            labels=tuple(self.labels[i] for i in epochs) if self.labels else (),
        )


@dataclass(frozen=True, eq=False)
class EpochScatter:
    """Scatter of epochs that no function predicts.

    covariance   (6, 6) m and rad, of the group's shift and turn
    u_point      m, of each coordinate of each point in addition
    """

    covariance: Array
    u_point: float

    @property
    def u_six(self) -> Array:
        """Standard uncertainties of shift and turn, (6,) m and rad."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def root(self) -> Array:
        """Factor (6, r) of the covariance, r its rank."""
        size = np.where(self.u_six > 0.0, self.u_six, 1.0)
        values, vectors = np.linalg.eigh(self.covariance / np.outer(size, size))
        real = values > ROUNDING
        return size[:, None] * vectors[:, real] * np.sqrt(values[real])


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predicted places of a group.

    names          n
    place          (P, n, 3) m, in the axes of the rigid telescope's frame
    covariance     (P, n, 3, 3) m^2 of each point, scatter of epochs included
    six            (P, 6) m and rad, the group's shift and turn from the mean of the fitted epochs
    six_covariance (P, 6, 6), scatter of epochs included; NaN where the points determine no rigid motion
    outside        quantities outside the range of the fit: extrapolated
    """

    names: tuple[str, ...]
    place: Array
    covariance: Array
    six: Array
    six_covariance: Array
    outside: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class StructureFit:
    """Flexible model fitted to a group's epochs.

    series, model   of the fit
    rest            (n, 3) m, mean of each point's places, origin of the displacements
    reference_c     degrees C at which t is 0: the mean of the epochs
    fit             the coefficients: functions of the body are those after the points' own
    scatter         of each epoch
    """

    series: GroupSeries
    model: SeriesModel
    rest: Array
    reference_c: float
    fit: HarmonicFit
    scatter: EpochScatter

    @property
    def arms(self) -> Array:
        """Points from their body's pivot, (n, 3) m."""
        return self.rest - self.series.pivot

    def six_of(self) -> tuple[Array, Array]:
        """Shift and turn (6, k) per unit of each function, with covariance.

        m and rad; covariance (6 k, 6 k), by functions.
        """
        m, k = self.model.own_count, len(self.model.functions)
        order = np.concatenate([np.arange(k - m, k), np.arange(k - m)])  # the fit has the body's own first
        at = (6 * order[:, None] + np.arange(6)).ravel()
        six = np.concatenate([self.fit.six, self.fit.rigid], axis=1)
        return six, self.fit.six_covariance[np.ix_(at, at)]

    @property
    def residual_motion(self) -> Array:
        """Shift and turn (T, 6) of each epoch's residuals, m and rad; nan where they determine none."""
        motion = np.full((len(self.series), 6), np.nan)
        for t, residual in enumerate(self.fit.residual):
            measured = np.isfinite(residual).all(axis=1)
            part = rigid_part(self.arms[measured]) if measured.sum() >= 3 else None
            if part is not None:
                motion[t] = [float(np.einsum("ni,ni->", one, residual[measured])) for one in part]
        return motion

    def predict(
        self, elevation: ArrayLike, *, temperature_c: ArrayLike | None = None, way: ArrayLike = 0.0
    ) -> Prediction:
        """Predicted places of the points, with covariance.

        elevation       (P,) rad
        temperature_c   (P,) degrees C; None: the reference
        way             (P,) 1 after the elevation rose, -1 after it fell; 0 is the mean of both

        Raises InputError for values that are not finite. Outside the fitted epochs `outside` lists the extrapolated
        quantities.
        """
        posture = self._target_posture(elevation, temperature_c)
        rows = self.model.rows(posture, way, self.reference_c)
        if not np.isfinite(rows).all():
            raise InputError("a prediction's elevation, temperature or way is not a finite number (expected numbers)")
        m = self.model.own_count
        local_rows, body = rows[:, :m], rows[:, m:]
        place = self.rest + self.fit.displacement(body, local_rows, self.arms)
        covariance = self.fit.covariance(body, local_rows, self.arms) + self._fresh()
        six, q = self.six_of()
        change = rows - self.model.rows(
            fitted_posture(self.series, self.model), self.series.way, self.reference_c
        ).mean(axis=0)
        k = rows.shape[1]
        shared = np.einsum("pa,aibj,pb->pij", change, q.reshape(k, 6, k, 6), change, optimize=True)
        spread = shared + self.scatter.covariance
        return Prediction(
            names=self.series.names,
            place=place,
            covariance=covariance,
            six=change @ six.T,
            six_covariance=spread,
            outside=self.outside(posture, way),
        )

    def outside(self, posture: TelescopePosture, way: ArrayLike = 0.0) -> tuple[str, ...]:
        """Quantities of a posture outside the fitted range, as texts."""
        notes = []
        quantities: list[tuple[str, ArrayLike, ArrayLike, float, str]] = [
            ("elevation", posture.elevation, self.series.posture.elevation, DEGREE, "deg")
        ]
        if self.model.temperature:
            quantities.append(("temperature", posture.temperature_c, self.series.posture.temperature_c, 1.0, "C"))
        for name, values, fitted, unit, text in quantities:
            low, high = float(np.min(fitted)) / unit, float(np.max(fitted)) / unit
            x = np.atleast_1d(np.asarray(values, dtype=float)) / unit
            for value in x[(x < low - 1e-9) | (x > high + 1e-9)]:
                notes.append(f"{name} {value:.6g} {text} is outside {low:.6g} to {high:.6g} {text}: extrapolated")
        if self.model.hysteresis and np.any(np.abs(np.asarray(way, dtype=float)) > 1.0):
            notes.append("way is outside -1 to 1: extrapolated")
        return tuple(notes)

    def _target_posture(self, elevation: ArrayLike, temperature_c: ArrayLike | None) -> TelescopePosture:
        e = np.atleast_1d(np.asarray(elevation, dtype=float))
        warm = np.broadcast_to(self.reference_c if temperature_c is None else np.asarray(temperature_c, float), e.shape)
        return TelescopePosture(np.zeros_like(e), e, warm)

    def _fresh(self) -> Array:
        """Covariance (n, 3, 3), m^2, of the scatter of epochs."""
        r = rigid_design(self.arms)
        return np.einsum("nij,jk,nlk->nil", r, self.scatter.covariance, r) + self.scatter.u_point**2 * np.eye(3)


def fit_structure(series: GroupSeries, model: SeriesModel | None = None) -> StructureFit:
    """Least-squares fit of a group's flexible model to its epochs.

    series   its epochs
    model    functions; None: the defaults

    Raises InputError where a function's posture or temperature is unknown, EstimationError for what floats.

    Source: [RAO73] section 4a (least squares with a full covariance); the scatter of epochs by moments:
    covariance of its rigid parts minus that of the measurements, in the directions where it is larger.
    """
    what = model or SeriesModel()
    refuse_unknown(series, what)
    middle = np.nanmean(series.places, axis=0)
    reference_c = float(np.mean(np.asarray(series.posture.temperature_c, dtype=float))) if what.temperature else 0.0
    rows = what.rows(fitted_posture(series, what), series.way, reference_c)
    m = what.own_count
    labels = HarmonicLabels(series.group, series.names, what.functions, m)
    scatter = EpochScatter(np.zeros((6, 6)), 0.0)

    def fitted() -> StructureFit:
        spread = widened(series.spread, middle - series.pivot, scatter)
        try:
            harmonics = fit_harmonics(
                series.places - middle,
                middle - series.pivot,
                body=rows[:, m:],
                own=rows[:, :m],
                spread=spread,
                labels=labels,
            )
        except EstimationError as problem:
            functions = f"functions {', '.join(what.functions)}; {len(series)} epochs"
            raise EstimationError(f"group {series.group!r}: {problem} ({functions})") from problem
        return StructureFit(
            series=series, model=what, rest=middle, reference_c=reference_c, fit=harmonics, scatter=scatter
        )

    fit = fitted()
    if what.scatter:
        for _ in range(PASSES):
            before, scatter = scatter, scatter_of(fit)
            fit = fitted()
            if np.allclose(before.u_six, scatter.u_six, rtol=0.02) and before.u_point == scatter.u_point:
                break
    return fit


def fitted_posture(series: GroupSeries, model: SeriesModel) -> TelescopePosture:
    """Postures of the epochs for the functions.

    At the reference temperature 0 where temperature does not count.
    """
    e = np.asarray(series.posture.elevation, dtype=float)
    warm = np.asarray(series.posture.temperature_c, dtype=float) if model.temperature else np.zeros_like(e)
    return TelescopePosture(np.zeros_like(e), e, warm)


def widened(spread: Spread, arms: Array, scatter: EpochScatter) -> Spread:
    """Spread with the scatter of epochs added.

    spread    of the measurements
    arms      (n, 3) m, from the pivot
    scatter   to be added
    """
    factor = rigid_design(arms) @ scatter.root
    point_variance = scatter.u_point**2
    if spread.full is not None:
        flat = factor.reshape(3 * len(arms), -1)
        return Spread(full=spread.full + (flat @ flat.T + point_variance * np.eye(3 * len(arms))))
    points = spread.points + point_variance * np.eye(3) if spread.points is not None else None
    if not factor.shape[2]:
        return Spread(points=points, shared=spread.shared)
    shared = factor[None]
    if spread.shared is not None:
        shape = (len(spread.shared), *factor.shape)
        shared = np.concatenate([spread.shared, np.broadcast_to(factor, shape)], axis=3)
    return Spread(points=points, shared=shared)


def scatter_of(fit: StructureFit) -> EpochScatter:
    """Scatter of epochs, by moments of the residuals' rigid parts.

    And of the remaining residuals.

    fit   its own scatter affects the weights only
    """
    series, arms, e = fit.series, fit.arms, fit.fit.residual
    variances = variances_of(series)
    count, m = len(series), fit.model.own_count
    degrees, own_degrees = (count / max(count - k, 1) for k in (len(fit.model.functions), m))
    squares, noise, remaining, expected = [], [], 0.0, 0.0
    for t in range(len(series)):
        at = np.flatnonzero(np.isfinite(e[t]).all(axis=1))
        part = rigid_part(arms[at]) if len(at) >= 3 else None
        if part is None:
            continue
        flat = part.reshape(6, -1)
        q = variances(t, at)
        keep = np.eye(3 * len(at)) if q.ndim == 2 else None
        six = flat @ e[t, at].ravel()
        squares.append(np.outer(six, six))
        remainder = e[t, at].ravel() - rigid_design(arms[at]).reshape(-1, 6) @ six
        remaining += float(remainder @ remainder)
        if keep is not None:
            noise.append(flat @ q @ flat.T)
            keep -= rigid_design(arms[at]).reshape(-1, 6) @ flat
            expected += float(np.sum((keep @ q) * keep))
        else:
            noise.append(np.einsum("jni,nil,knl->jk", part, q, part))
            expected += float(np.einsum("nii->", q)) * (1.0 - 2.0 / len(at))
    if not squares:
        return EpochScatter(np.zeros((6, 6)), 0.0)
    more = _excess(degrees * np.mean(squares, axis=0), np.mean(noise, axis=0))
    free = 3 * int(np.isfinite(e).all(axis=2).sum()) - 6 * len(squares)
    point_scatter = (own_degrees * remaining - expected) / free if free > 0 else 0.0
    return EpochScatter(more, float(np.sqrt(max(point_scatter, 0.0))))


def _excess(covariance: Array, noise: Array) -> Array:
    """Excess of a covariance (6, 6) over noise, where positive."""
    size = np.sqrt(np.diag(noise))
    root = size[:, None] * np.linalg.cholesky(noise / np.outer(size, size))
    inverse = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(inverse @ covariance @ inverse.T)
    half = root @ vectors * np.sqrt(np.maximum(values - 1.0, 0.0))
    return half @ half.T


def variances_of(series: GroupSeries):
    """Function of an epoch's points that gives their covariance.

    (3q, 3q), or (q, 3, 3) for independent points.
    """
    spread = series.spread

    def of(t: int, at: NDArray[np.intp]) -> Array:
        if spread.full is not None:
            rows = (3 * at[:, None] + np.arange(3)).ravel()
            return spread.full[t if len(spread.full) > 1 else 0][rows[:, None], rows]
        assert spread.points is not None  # a spread has one of the two
        q = spread.points[t if len(spread.points) > 1 else 0]
        return q[at] if len(q) > 1 else np.broadcast_to(q, (len(at), 3, 3))

    return of


def refuse_unknown(series: GroupSeries, model: SeriesModel) -> None:
    """Raise InputError where a function needs a quantity that an epoch lacks."""
    requirements = [("elevation", np.asarray(series.posture.elevation, dtype=float), "a posture")]
    if model.temperature:
        hint = "a temperature of the structure, or a model without"
        requirements.append(("temperature", np.asarray(series.posture.temperature_c, dtype=float), hint))
    for name, values, hint in requirements:
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            label = series.labels[bad[0]] if series.labels else f"{bad[0]} (counted from 0)"
            raise InputError(f"epoch {label}: its {name} is unknown (expected {hint})")
