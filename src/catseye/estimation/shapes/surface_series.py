"""Paraboloids through the same points at many epochs: pose, focal length, deviations, covariance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.shapes.paraboloid import (
    PARAMETERS,
    POSE,
    TEXTS,
    Measure,
    ParaboloidStatus,
    fit_paraboloid,
    ordered,
)
from catseye.geometry.frames.frame import Transform

LARGE = 20_000  # points times epochs from which the compiled form is faster, import included


@dataclass(frozen=True, eq=False)
class SurfaceSeries:
    """Fits of T epochs of k points.

    A failed epoch has nan and a status with the reason.

    free         fitted parts
    parameters   (T, p) m and rad: vertex in the nominal paraboloid's axes, tilts about its x and y, focal length
                 less the nominal one; of these the free ones
    covariance   (T, p, p)
    deviation    (T, k) m, normal, above zero towards the focus; nan for missing points
    points       (T,) number of points measured
    status       (T,) values of `ParaboloidStatus`
    """

    free: tuple[str, ...]
    parameters: np.ndarray
    covariance: np.ndarray
    deviation: np.ndarray
    points: np.ndarray
    status: np.ndarray

    def require_converged(self) -> "SurfaceSeries":
        """Return this series, or raise EstimationError naming the first failed epoch."""
        bad = np.flatnonzero(self.status != ParaboloidStatus.CONVERGED)
        if len(bad):
            status = ParaboloidStatus(int(self.status[bad[0]]))
            raise EstimationError(
                f"epoch {bad[0] + 1} of {len(self.status)}: {TEXTS[status]}, "
                f"{self.points[bad[0]]} points measured; {len(bad)} epochs failed",
                reason=status,
            )
        return self


def fit_series(
    points: np.ndarray,
    variance: np.ndarray,
    nominal: Transform,
    *,
    focal_length: float,
    free: Sequence[str] = POSE,
    weights: np.ndarray | None = None,
    measure: Measure = "normal",
    compiled: bool | None = None,
) -> SurfaceSeries:
    """Fit each epoch as `fit_paraboloid`.

    points         (T, k, 3) m, in the frame `nominal.to`; nan for missing points
    variance       (k,) or (T, k) m^2, of the points along their normals; points independent
    nominal        outer frame from the nominal paraboloid's
    focal_length   m, fixed, or the start value
    free           of "vertex", "axis", "focal-length"
    weights        (k,) of squares; default 1
    measure        "normal" or "half-path"
    compiled       True: by the kernel (2209 points of 1000 epochs in seconds); False: plain Python; None: by size

    Raises EstimationError for unknown parts of a paraboloid and for inconsistent shapes.
    """
    points, free = np.asarray(points, dtype=float), ordered(free)
    if points.ndim != 3 or points.shape[2] != 3:
        raise EstimationError(f"points of a series have the shape {points.shape} (expected epochs, points, 3)")
    epochs, k, _ = points.shape
    weights = np.ones(k) if weights is None else np.ascontiguousarray(weights, dtype=float)
    variance = np.array(np.broadcast_to(variance, (epochs, k)), dtype=float, order="C")  # writable: one kernel for all
    if compiled is None:
        compiled = epochs * k >= LARGE
    if not compiled:
        return _plainly(points, variance, nominal, focal_length, free, weights, measure)
    from catseye.estimation.shapes.surface_series_kernel import series  # numba is heavy

    chosen = np.repeat([name in free for name in PARAMETERS], list(PARAMETERS.values()))
    columns = np.flatnonzero(chosen).astype(np.int64)
    local = np.ascontiguousarray((points - nominal.translation) @ nominal.rotation)
    parameters, covariance, deviation, measured, status = series(
        local, variance, weights, columns, float(focal_length), measure == "half-path"
    )
    return SurfaceSeries(
        free=free,
        parameters=parameters,
        covariance=covariance,
        deviation=deviation,
        points=measured,
        status=status,
    )


def _plainly(
    points: np.ndarray,
    variance: np.ndarray,
    nominal: Transform,
    focal_length: float,
    free: tuple[str, ...],
    weights: np.ndarray,
    measure: Measure,
) -> SurfaceSeries:
    """Fit every epoch with `fit_paraboloid`, in the nominal paraboloid's frame."""
    nominal_frame = Transform(nominal.from_, nominal.from_, np.eye(3), np.zeros(3))
    epochs, k, _ = points.shape
    p = sum(PARAMETERS[name] for name in free)
    local = (points - nominal.translation) @ nominal.rotation
    series = SurfaceSeries(
        free=free,
        parameters=np.full((epochs, p), np.nan),
        covariance=np.full((epochs, p, p), np.nan),
        deviation=np.full((epochs, k), np.nan),
        points=np.isfinite(local).all(axis=2).sum(axis=1),
        status=np.zeros(epochs, dtype=np.int64),
    )
    for epoch in range(epochs):
        finite = np.isfinite(local[epoch]).all(axis=1)
        blocks = variance[epoch, finite, None, None] * np.eye(3)
        try:
            fit = fit_paraboloid(
                local[epoch, finite],
                blocks,
                nominal_frame,
                focal_length=focal_length,
                free=free,
                weights=weights[finite],
                measure=measure,
            )
        except EstimationError as problem:
            if not isinstance(problem.reason, ParaboloidStatus):
                raise
            series.status[epoch] = problem.reason
            continue
        parts = {
            "vertex": fit.translation,
            "axis": fit.rotation[:2],
            "focal-length": np.array([fit.focal_length - focal_length]),
        }
        series.parameters[epoch] = np.concatenate([parts[name] for name in free]) if free else []
        series.covariance[epoch] = fit.parameter_covariance
        series.deviation[epoch, finite] = fit.deviation
    return series
