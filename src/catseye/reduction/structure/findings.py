"""Recipe of a structure: a flexible model of a group, checked and predicted, and the verdict on it.

The verdict is by its predictions of epochs left out, omissions from its claims, and its inputs' verdicts.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from catseye.aliases import Progress
from catseye.constants import DEGREE
from catseye.reduction.structure.check import FOLDS, LeaveOut, left_out
from catseye.reduction.structure.epochs import ReadEpochs
from catseye.reduction.structure.series import GroupSeries, Prediction, SeriesModel, StructureFit, fit_structure
from catseye.verdict import Verdict

LARGEST_RATIO = 1.5  # of departure over claim, epochs left out
INDEPENDENT = "Points of an epoch were taken as independent: what they share makes the claims too small."
COLD = "No epoch says a temperature: the model has no coefficient of it."


@dataclass(frozen=True)
class PredictionRequest:
    """Postures at which a structure is predicted.

    elevation_deg   k of them
    temperature_c   of the structure; None: the mean of the epochs
    way             1 after the elevation rose, -1 after it fell
    """

    elevation_deg: tuple[float, ...] = ()
    temperature_c: float | None = None
    way: float = 0.0


@dataclass(frozen=True, eq=False)
class StructureFindings:
    """Flexible model of a group of points, with its check and prediction.

    fit         the model
    check       epochs left out; None: none was
    request     postures of the prediction
    predicted   group at these; None without any
    sources     verdict of each epoch, by its label
    doubts      notes that the claims are too small, or that a prediction is extrapolated
    remarks     further notes for the reader
    """

    fit: StructureFit
    check: LeaveOut | None
    request: PredictionRequest
    predicted: Prediction | None
    sources: Mapping[str, Verdict | None]
    doubts: tuple[str, ...]
    remarks: tuple[str, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """All notes for the reader: doubts, then remarks."""
        return (*self.doubts, *self.remarks)

    @property
    def verdict(self) -> Verdict:
        """Verdict by the epochs left out, the doubts, and the epochs' own verdicts."""
        return _own_verdict(self.check).hearing(self.doubts).resting_on(self.sources)


def model_structure(
    series: GroupSeries,
    read: ReadEpochs,
    *,
    model: SeriesModel | None = None,
    folds: int = FOLDS,
    request: PredictionRequest | None = None,
    progress: Progress | None = None,
) -> StructureFindings:
    """Flexible model of a group of points, checked and predicted.

    series     group through the epochs, by `group_series`
    read       these epochs, with their notes
    model      functions; without a coefficient of temperature where no epoch says one
    folds      stretches of epochs left out in turn; 0: none
    request    postures to predict
    progress   called with (what, done, of how many)

    Raises InputError and EstimationError in one line.
    """
    what, wanted = model or SeriesModel(), request or PredictionRequest()
    remarks, doubts = read.notes, read.doubts
    if series.spread.full is None:
        doubts += (INDEPENDENT,)
    if what.temperature and not np.isfinite(np.asarray(series.posture.temperature_c)).any():
        remarks += (COLD,)
        what = replace(what, temperature=False)
    fit = fit_structure(series, what)
    check = left_out(series, what, folds=folds, progress=progress) if folds else None
    predicted = None
    if wanted.elevation_deg:
        elevation = np.array(wanted.elevation_deg) * DEGREE
        predicted = fit.predict(elevation, temperature_c=wanted.temperature_c, way=wanted.way)
        doubts += predicted.outside
    return StructureFindings(
        fit=fit,
        check=check,
        request=wanted,
        predicted=predicted,
        sources=read.sources,
        doubts=doubts,
        remarks=remarks,
    )


def _own_verdict(check: LeaveOut | None) -> Verdict:
    if check is None:
        return Verdict("doubtful", "no epoch was left out to check the model's predictions")
    if not np.isfinite(check.ratio):
        return Verdict("doubtful", "too few epochs to check the model's predictions")
    if check.ratio > LARGEST_RATIO:
        return Verdict(
            "doubtful", f"epochs left out miss their prediction by {check.ratio:.2f} times the claimed uncertainty"
        )
    return Verdict("good", f"epochs left out are predicted as claimed (ratio {check.ratio:.2f})")
