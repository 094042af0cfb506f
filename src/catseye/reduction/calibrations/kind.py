"""Kind of calibration: layout of table and sheet, and its recipe.

The recipe makes a Calibration of them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from catseye.records.files.readings import SheetLayout, SheetReadings
from catseye.reduction.calibrations.budget import SharedInput, significant, welch_satterthwaite
from catseye.reduction.calibrations.calibration import Calibration, Quantity
from catseye.reduction.calibrations.fit import CalibrationFit

PROVENANCE = ("instrument", "serial", "measured_on", "valid_until", "by", "report")


@dataclass(frozen=True)
class PlausibleSpan:
    """Plausible values of a number.

    low, high   bounds, in the number's own unit
    reason      source of the bounds: the instrument
    u           largest useful standard uncertainty; None: that of knowing only the span
    """

    low: float
    high: float
    reason: str
    u: float | None = None

    @property
    def most_u(self) -> float:
        """Largest useful standard uncertainty; a larger one adds nothing to the span.

        Source: [JCGM100] 4.3.7 (a quantity known to lie between two bounds and nothing else).

        >>> round(PlausibleSpan(-3.0, 3.0, "").most_u, 3)
        1.732
        """
        return float((self.high - self.low) / np.sqrt(12.0)) if self.u is None else self.u


@dataclass(frozen=True)
class ReadingScatter:
    """Largest standard deviation of a reading of this kind.

    most     in `unit`
    size     of that unit in the fit's own
    reason   the instrument, with its source
    """

    most: float
    unit: str
    size: float
    reason: str


@dataclass(frozen=True)
class Plausibility:
    """Limits of a kind's readings and results.

    Stated once beside its recipe; `plausibility.judged` compares.

    scatter     of a reading; None where nothing is adjusted
    sizes       pattern of quantities' keys -> their span, in the units of the keys
    explained   least share of the readings' variance that the model explains; 0 where the quantity may be zero
    columns     column -> span of its readings, beyond which one is more likely mistyped than measured
    varying     column -> its period, 0 if it has none: modulo that it must take two values at least
    """

    scatter: ReadingScatter | None = None
    sizes: Mapping[str, PlausibleSpan] = field(default_factory=dict)
    explained: float = 0.0
    columns: Mapping[str, PlausibleSpan] = field(default_factory=dict)
    varying: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class CalibrationKind:
    """One kind of calibration.

    about       its result, one line for the command line
    layout      of its table and sheet
    recipe      function (readings, reject) -> Calibration; reject: leave out what the tests reject
    plausible   limits of its readings and its result
    """

    about: str
    layout: SheetLayout
    recipe: Callable[[SheetReadings, bool], Calibration]
    plausible: Plausibility


def provenance(readings: SheetReadings) -> dict[str, object]:
    """Provenance: who measured what with which files, then the sheet's other keys."""
    sheet = readings.sheet
    stated = {key: getattr(sheet, key) for key in PROVENANCE}
    other_keys = {
        key: value
        for key, value in sheet.model_dump().items()
        if key not in stated and key not in ("format", "kind") and value is not None
    }
    return {**stated, "inputs_sha256": dict(readings.hashes), "sheet": other_keys}


def quantities(
    keys: Sequence[tuple[str, str, str]],
    values: np.ndarray,
    covariance: np.ndarray,
    *,
    fit: CalibrationFit | None = None,
    turn: np.ndarray | None = None,
    inputs: Sequence[SharedInput] = (),
) -> tuple[Quantity, ...]:
    """Quantities from (key, unit, meaning), values and covariance, each with its budget.

    In the units of the keys.

    fit, turn   their source, and the derivatives (n, p) by its parameters, or (n, p + q) by its effects, too
    inputs      further sources, independent of the fit

    Source: [JCGM100] G.4.1, Welch and Satterthwaite; the scatter's own degrees by `CovarianceParts`.
    """
    calibrated = []
    for number, ((key, unit, meaning), value, variance) in enumerate(
        zip(keys, values, np.diag(covariance), strict=True)
    ):
        rows = [each.contribution(number, unit) for each in inputs]
        if fit is not None:
            slope = np.eye(len(values))[number] if turn is None else np.asarray(turn, dtype=float)[number]
            rows = [*fit.parts.contributions(slope, unit), *rows]
        degrees = welch_satterthwaite(rows)
        calibrated.append(
            Quantity(
                key=key,
                value=float(value),
                u=float(np.sqrt(variance)),
                unit=unit,
                meaning=meaning,
                coverage=float(student(degrees, 2.0)),
                budget=significant(rows),
                degrees=degrees,
            )
        )
    return tuple(calibrated)


def student(degrees: ArrayLike, deviations: float) -> np.ndarray:
    """Standard deviations of Student's distribution, equivalent to normal ones.

    For a scatter with so many degrees of freedom.

    >>> student([2.0, np.inf], 3.0).round(2).tolist()
    [19.21, 3.0]
    """
    from scipy.special import ndtr, stdtrit

    most = np.minimum(degrees, 1e9)
    return np.where(most < 1e9, stdtrit(most, ndtr(deviations)), deviations)


def residuals_by_number(fit: CalibrationFit, scale: float) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Residuals in order of the readings, in units of `scale`, as curves.

    For readings without another common axis.
    """
    count, on = np.arange(1, len(fit.residual) + 1), fit.active
    residual = fit.residual / scale
    return {
        "readings": (count[on], residual[on]),
        "left out": (count[~on], residual[~on]),
        "fit": (count, np.zeros(len(count))),
    }


def scatter_notes(fit: CalibrationFit, unit: str, scale: float, *, sought: int | None = None) -> tuple[str, ...]:
    """Notes on the readings' scatter and its degrees of freedom.

    In a unit of `scale` SI units.

    sought   number of leading parameters of interest; all if None
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
