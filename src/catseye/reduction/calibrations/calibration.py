"""Result of a calibration of any kind.

Quantities with covariance, residuals, decisions, provenance.
"""

from dataclasses import dataclass, field

import numpy as np

from catseye.reduction.calibrations.budget import Contribution
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.fit import CalibrationFit
from catseye.verdict import Verdict

MOST_NAMED = 8  # suspect readings that a verdict names
STATE = "state"  # last column of a table of readings: used, suspect, rejected, or left out with a reason
Cell = str | int | float  # of a table of readings
RecordValue = str | float | list[str] | list[float] | dict[str, float]  # a dict where several records have a part


@dataclass(frozen=True)
class Quantity:
    """One calibrated number.

    key      its name in files, with its unit: "d0_mm"
    value    in that unit
    u        standard uncertainty, in that unit, all known causes together
    unit     for people: "mm"
    meaning  one line for the certificate
    coverage factor k of the interval value ± k u that holds it with 95.45 %: 2, more where u rests on few readings
    budget   contributions to u, which add in quadrature
    degrees  of freedom of u, effective
    """

    key: str
    value: float
    u: float
    unit: str
    meaning: str
    coverage: float = 2.0
    budget: tuple[Contribution, ...] = ()
    degrees: float = float("inf")


@dataclass(frozen=True, eq=False)
class Calibration:
    """Result of one calibration, for its record and its certificate.

    kind         "reference-distance", "leakage", ...: as `catseye calibrate` calls it
    title        "Reference distance D0 of ZP103"
    provenance   of the readings: serial, measured_on, valid_until, by, report, and other keys of the sheet
    quantities   results, in order
    covariance   (q, q) of the quantities, in their units
    columns      headings of the table of readings, each with its unit in the name
    rows         of that table: the readings, corrections, the residual, the test statistic, used or the reason against
                 it
    decisions    tests
    variance_factor, degrees_of_freedom   of the adjustment; NaN and 0 where nothing was redundant
    notes        for the user, one line each
    curve        for the figure: name -> (x, y) arrays; "readings" and "fit" at least; where they
                 exist, "residuals", "spectrum" and "averages" are drawn below, "left out" among the readings
    axes         labels of that figure
    method       method of the evaluation, in a few sentences for the certificate
    record       entries for the record of the quantities, by its keys: numbers or lists
    equal_axes   the figure is a plane: both axes to one scale
    fit          the adjustment, or None
    explained    share of the readings' variance that the model explains, without a fit
    conditions   lowest and highest temperature_c, pressure_hpa, humidity_percent of the readings, where stated
    plausible    its numbers against the limits of the kind's instruments, by `plausibility.judged`
    """

    kind: str
    title: str
    provenance: dict[str, object]
    quantities: tuple[Quantity, ...]
    covariance: np.ndarray
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    decisions: tuple[CheckOutcome, ...] = ()
    variance_factor: float = float("nan")
    degrees_of_freedom: int = 0
    notes: tuple[str, ...] = ()
    curve: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    axes: tuple[str, str] = ("", "")
    method: str = ""
    record: dict[str, RecordValue] = field(default_factory=dict)
    equal_axes: bool = False
    fit: CalibrationFit | None = None
    explained: float = float("nan")
    plausible: tuple[CheckOutcome, ...] = ()
    conditions: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def states(self) -> tuple[str, ...]:
        """State of each reading; empty where the rows are results."""
        return tuple(str(row[-1]) for row in self.rows) if self.columns and self.columns[-1] == STATE else ()

    @property
    def verdict(self) -> Verdict:
        """Verdict from the calibration's own tests; failed tests are named."""
        off = sorted((o for o in self.plausible if o.passed is False), key=lambda o: not o.grave)
        if off and off[0].grave:
            return Verdict("failed", off[0].text)
        failed = [decision for decision in self.decisions if decision.passed is False]
        if any(decision.grave for decision in failed):
            plural = "s" if len(failed) > 1 else ""
            names = "; ".join(decision.name for decision in failed)
            return Verdict("failed", f"{len(failed)} of its own test{plural} failed: {names}")
        if off or failed:
            return Verdict("doubtful", "; ".join(outcome.text for outcome in (*failed, *off)))
        if self.degrees_of_freedom < 1 and not any(d.passed for d in self.decisions):
            return Verdict("doubtful", "no redundancy: nothing was measured twice and no test is possible")
        suspects = [number for number, state in enumerate(self.states, start=1) if state == "suspect"]
        if suspects:
            named = ", ".join(map(str, suspects[:MOST_NAMED])) + (" ..." if len(suspects) > MOST_NAMED else "")
            return Verdict("doubtful", f"suspect readings: {named}")
        passed = sum(decision.passed is True for decision in self.decisions)
        return Verdict("good", f"its own tests passed ({passed})" if passed else "no test failed")

    def value(self, key: str) -> float:
        """Quantity with that key; KeyError without one."""
        return self._named(key).value

    def u(self, key: str) -> float:
        """Standard uncertainty of a quantity; KeyError without one."""
        return self._named(key).u

    def _named(self, key: str) -> Quantity:
        for quantity in self.quantities:
            if quantity.key == key:
                return quantity
        raise KeyError(key)
