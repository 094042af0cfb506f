"""What a kind of calibration is: a layout of table and sheet, and the recipe that makes a Calibration of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.records.files.readings import SheetLayout, SheetReadings
from catseye.reduction.calibrations.calibration import Calibration, Quantity
from catseye.reduction.calibrations.fit import CalibrationFit

PROVENANCE = ("instrument", "serial", "measured_on", "valid_until", "by", "report")


@dataclass(frozen=True)
class CalibrationKind:
    """One kind of calibration.

    about     what it finds, one line for the command line
    layout    of its table and sheet
    recipe    function (readings, reject) -> Calibration; reject: leave out what the tests reject
    """

    about: str
    layout: SheetLayout
    recipe: Callable[[SheetReadings, bool], Calibration]


def provenance(readings: SheetReadings) -> dict[str, object]:
    """Who measured what with which files, then every other key of the sheet as it was given."""
    sheet = readings.sheet
    stated = {key: getattr(sheet, key) for key in PROVENANCE}
    rest = {
        key: value
        for key, value in sheet.model_dump().items()
        if key not in stated and key not in ("format", "kind") and value is not None
    }
    return {**stated, "inputs_sha256": dict(readings.hashes), "sheet": rest}


def quantities(
    keys: Sequence[tuple[str, str, str]],
    values: np.ndarray,
    covariance: np.ndarray,
    *,
    fit: CalibrationFit | None = None,
    turn: np.ndarray | None = None,
) -> tuple[Quantity, ...]:
    """Quantities from (key, unit, meaning), values and covariance in the units.

    fit, turn   what they come from, and the derivatives (q, p) by its parameters: the part of u that was estimated from
                few readings widens the interval

    Source: [JCGM100] G.4.1, Welch and Satterthwaite; the scatter's own degrees as `effective_degrees` has them.
    """
    variance = np.diag(covariance)
    coverage = np.full(len(variance), 2.0)
    if fit is not None and np.isfinite(fit.effective).any():
        slope = np.eye(len(variance)) if turn is None else np.asarray(turn, dtype=float)
        estimated = np.einsum("qp,pr,qr->q", slope, fit.scattered, slope)
        least = np.array([np.min(fit.effective[row != 0.0], initial=np.inf) for row in slope])
        coverage = student(least * (variance / np.maximum(estimated, 1e-300)) ** 2, 2.0)
    return tuple(
        Quantity(key, float(v), float(np.sqrt(s)), unit, meaning, float(k))
        for (key, unit, meaning), v, s, k in zip(keys, values, variance, coverage, strict=True)
    )


def student(degrees: ArrayLike, deviations: float) -> np.ndarray:
    """Standard deviations, of a scatter from so many degrees of freedom, that hold as much as these of a normal one.

    >>> student([2.0, np.inf], 3.0).round(2).tolist()
    [19.21, 3.0]
    """
    from scipy.special import ndtr, stdtrit

    most = np.minimum(degrees, 1e9)
    return np.where(most < 1e9, stdtrit(most, ndtr(deviations)), deviations)


def residuals_by_number(fit: CalibrationFit, scale: float) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Curves of the residuals in order of the readings, in units of `scale`: for readings that share no other axis."""
    count, on = np.arange(1, len(fit.residual) + 1), fit.active
    residual = fit.residual / scale
    return {
        "readings": (count[on], residual[on]),
        "left out": (count[~on], residual[~on]),
        "fit": (count, np.zeros(len(count))),
    }


def scatter_notes(fit: CalibrationFit, unit: str, scale: float, *, sought: int | None = None) -> tuple[str, ...]:
    """How the readings scatter and from how many degrees of freedom, in a unit of `scale` SI units.

    sought   how many of the first parameters are of interest; all if None
    """
    from scipy.special import stdtrit

    notes = []
    for name, deviation in fit.components.items():
        notes.append(f"{name}: {deviation / scale:.3g} {unit} (standard deviation, estimated from the readings)")
    least = float(np.min(fit.effective[:sought]))
    if np.isfinite(least):
        factor = float(stdtrit(least, 0.975))
        notes.append(
            f"the estimated scatter has {least:.3g} effective degrees of freedom: for it alone the coverage factor of "
            f"95 % is {factor:.2f}; the intervals count it"
        )
    if fit.suspects.any():
        notes.append(
            f"{np.count_nonzero(fit.suspects)} suspect values are still used; --reject leaves them out, or a reason in "
            "the column left_out"
        )
    return tuple(notes)
