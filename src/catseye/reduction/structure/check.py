"""Cross-validation of a structure's model.

Epochs left out, measured minus predicted.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array, Progress
from catseye.errors import EstimationError, InputError
from catseye.reduction.structure.series import (
    EpochScatter,
    GroupSeries,
    SeriesModel,
    StructureFit,
    fit_structure,
    widened,
)

FOLDS = 5


@dataclass(frozen=True, eq=False)
class LeaveOut:
    """Predictions of epochs that a fit did not use.

    residual       (T, n, 3) m, measured minus predicted; NaN where not measured
    covariance     (T, n, 3, 3) m^2, claimed: of the prediction, of the epoch's own scatter, of the measurement
    fold           (T,) fold of each epoch
    extrapolated   (T,) True where elevation or temperature was outside the fitted epochs
    """

    residual: Array
    covariance: Array
    fold: NDArray[np.intp]
    extrapolated: NDArray[np.bool_]

    @property
    def normalised(self) -> Array:
        """Squared residuals over their covariance, (T, n), expectation 3.

        NaN where not measured.
        """
        weighted = np.linalg.solve(self.covariance, self.residual[..., None])[..., 0]
        return np.einsum("tni,tni->tn", self.residual, weighted)

    @property
    def ratio(self) -> float:
        """Rms of the residuals over the claimed uncertainty.

        Expectation 1; above it too little was claimed.
        """
        return float(np.sqrt(np.nanmean(self.normalised) / 3.0))

    @property
    def ratio_inside(self) -> float:
        """`ratio` of the epochs that were not extrapolated; nan without any."""
        inside = ~self.extrapolated
        return float(np.sqrt(np.nanmean(self.normalised[inside]) / 3.0)) if inside.any() else float("nan")

    @property
    def rms(self) -> float:
        """Root mean square of the coordinates' differences, m."""
        return float(np.sqrt(np.nanmean(self.residual**2)))


def left_out(
    series: GroupSeries, model: SeriesModel | None = None, *, folds: int = FOLDS, progress: Progress | None = None
) -> LeaveOut:
    """Prediction of each epoch by a fit without it.

    The series in `folds` stretches of time, one left out in turn.

    series     epochs, in order of time
    model      as for `fit_structure`
    folds      2 up, at most as many as epochs

    Stretches, not single epochs: errors that neighbours in time share would otherwise predict themselves. Raises
    EstimationError with the stretch where the other epochs no longer determine the model.
    """
    what = model or SeriesModel()
    if not 2 <= folds <= len(series):
        raise InputError(f"{folds} stretches of {len(series)} epochs (expected 2 to {len(series)})")
    fold = np.arange(len(series)) * folds // len(series)
    residual = np.full(series.places.shape, np.nan)
    covariance = np.full((*series.places.shape, 3), np.nan)
    extrapolated = np.zeros(len(series), dtype=bool)
    for k in range(folds):
        if progress is not None:
            progress("leaving out", k, folds)
        out = np.flatnonzero(fold == k)
        try:
            fit = fit_structure(series.part(np.flatnonzero(fold != k)), what)
        except EstimationError as problem:
            first, last = (series.labels[i] if series.labels else str(i) for i in (out[0], out[-1]))
            raise EstimationError(f"without epochs {first} to {last}: {problem}") from problem
        at = np.array([series.names.index(name) for name in fit.series.names])
        _fill_predictions(fit, series, out, at, residual, covariance, extrapolated)
    return LeaveOut(residual, covariance, fold, extrapolated)


def _fill_predictions(
    fit: StructureFit,
    series: GroupSeries,
    out: NDArray[np.intp],
    at: NDArray[np.intp],
    residual: Array,
    covariance: Array,
    extrapolated: NDArray[np.bool_],
) -> None:
    """Fill in residuals and claimed covariances of the epochs left out."""
    e = np.asarray(series.posture.elevation)[out]
    warm = np.asarray(series.posture.temperature_c)[out] if fit.model.temperature else None
    prediction = fit.predict(e, temperature_c=warm, way=series.way[out])
    residual[np.ix_(out, at)] = series.places[np.ix_(out, at)] - prediction.place
    covariance[np.ix_(out, at)] = prediction.covariance + of_points(series)[np.ix_(out, at)]
    for i, epoch in enumerate(out):
        single = fit.predict(e[i : i + 1], temperature_c=None if warm is None else warm[i : i + 1])
        extrapolated[epoch] = bool(single.outside)


def of_points(series: GroupSeries, scatter: EpochScatter | None = None) -> Array:
    """Covariance (T, n, 3, 3), m^2, of each place.

    With the scatter of an epoch if present.
    """
    arms = np.nanmean(series.places, axis=0) - series.pivot
    spread = series.spread if scatter is None else widened(series.spread, arms, scatter)
    shape = (*series.places.shape, 3)
    if spread.full is not None:
        n = shape[1]
        blocks = spread.full.reshape(-1, n, 3, n, 3)[:, np.arange(n), :, np.arange(n)]  # (n, T, 3, 3)
        return np.broadcast_to(np.swapaxes(blocks, 0, 1), shape)
    assert spread.points is not None  # a spread has one of the two
    covariance = np.broadcast_to(spread.points, shape)
    if spread.shared is not None:
        covariance = covariance + np.einsum("tniq,tnlq->tnil", spread.shared, spread.shared)
    return covariance
