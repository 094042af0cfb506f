"""What a calibration gives, whatever was calibrated: quantities with covariance, residuals, decisions, provenance."""

from dataclasses import dataclass, field

import numpy as np

from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.fit import CalibrationFit

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
    """

    key: str
    value: float
    u: float
    unit: str
    meaning: str
    coverage: float = 2.0


@dataclass(frozen=True, eq=False)
class Calibration:
    """The outcome of one calibration: everything that its record and its certificate show.

    kind         "reference-distance", "leakage", ...: as `catseye calibrate` calls it
    title        "Reference distance D0 of ZP103"
    provenance   of the readings: serial, measured_on, valid_until, by, report, and what else the sheet says
    quantities   what was found, in order
    covariance   (q, q) of the quantities, in their units
    columns      headings of the table of readings, each with its unit in the name
    rows         of that table: the readings, what was corrected, the residual, the test statistic, used or why not
    decisions    tests
    variance_factor, degrees_of_freedom   of the adjustment; NaN and 0 where nothing was redundant
    notes        what a person should know, one line each
    curve        x, y, what was fitted for the figure: name -> (x, y) arrays; "readings" and "fit" at least; where they
                 are there, "residuals" and "spectrum" are drawn below, "left out" among the readings
    axes         labels of that figure
    method       how the readings became the quantities, in a few sentences for the certificate
    record       what can be copied into the record that the quantities belong to, by its keys: numbers or lists
    equal_axes   the figure is a plane: both axes to one scale
    fit          the adjustment behind it, if there was one
    explained    share of the readings' variance that the model explains, where no fit tells
    plausible    its numbers against what the kind's instruments can give, by `plausibility.judged`
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

    @property
    def states(self) -> tuple[str, ...]:
        """What became of each reading; empty where the rows are results and no readings."""
        return tuple(str(row[-1]) for row in self.rows) if self.columns and self.columns[-1] == STATE else ()

    def value(self, key: str) -> float:
        """The quantity of that key; KeyError where there is none."""
        return self._named(key).value

    def u(self, key: str) -> float:
        """Its standard uncertainty; KeyError where there is none."""
        return self._named(key).u

    def _named(self, key: str) -> Quantity:
        for quantity in self.quantities:
            if quantity.key == key:
                return quantity
        raise KeyError(key)
