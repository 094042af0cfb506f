"""Results of the tests of an epoch's records: each record's own test, contradictions, and their explanations."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from catseye.estimation.least_squares.adjustment import NONCENTRALITY

ALIKE, FIXED_SURVEY = " alike", " or fixed survey of "  # in names of records that move all points, or all but one
UNCHECKED_U = 10.0  # stated uncertainties of a record; a larger error that stays hidden leaves the record unchecked


class RecordGroup(StrEnum):
    """Group of records that one kind of certificate, sheet or reading states."""

    MONUMENTS = "monuments"
    OFFSETS = "mirror offsets"
    BENCHMARKS = "benchmarks"
    TRIPLETS = "triplet sheets"
    GLASS = "glass constants"
    POSITIONS = "typed positions"
    POSTURE = "posture"
    MODULATION = "modulation"
    PRESSURE = "pressure"
    HUMIDITY = "humidity"
    THERMOMETERS = "thermometers"
    SOUND = "path temperatures"
    ZEROS = "ranger zeros"
    LEAKAGE = "leakage"
    ELECTRONICS = "electronics"  # a ranger's drift in time beyond its reference shots
    HEADS = "head effects"
    MOVEMENTS = "movements"  # of a body or a monument during the campaign: recorded as none
    LINES = "single lines"  # shots of one ranger on one target
    COMMON = "errors in common"  # of many records: of one batch, one gauge, one survey


@dataclass(frozen=True)
class RecordTest:
    """Test of one number of a record against everything else.

    group     of the record
    record    for people: "monument ZY103"
    where     file and key: "monuments/ZY103.toml: x_mm"
    part      of several numbers: "east"; "" of one
    unit      of the next three
    u         standard uncertainty that the record states
    error     of the record, by everything else: positive where it states too much; NaN where nothing tests it
    u_error   standard uncertainty of that; infinite where nothing tests it
    """

    group: RecordGroup
    record: str
    where: str
    part: str
    unit: str
    u: float
    error: float
    u_error: float

    @property
    def w(self) -> float:
        """Error over its standard uncertainty; NaN where nothing tests the record."""
        return self.error / self.u_error if np.isfinite(self.u_error) else float("nan")

    @property
    def detectable(self) -> float:
        """Smallest error that the test finds four times in five; infinite where nothing tests the record."""
        return NONCENTRALITY * self.u_error

    @property
    def in_common(self) -> bool:
        """True for an error that many records share, or of the mirror or monument that holds the datum."""
        return self.record.endswith(ALIKE) or FIXED_SURVEY in self.record

    @property
    def unchecked(self) -> bool:
        """True where an error of many stated uncertainties would not be found."""
        return self.u > 0.0 and self.detectable > UNCHECKED_U * self.u


@dataclass(frozen=True)
class GroupTest:
    """Test of all records of one group together.

    statistic     chi squared
    degrees       its degrees of freedom
    probability   of as large a statistic by chance
    """

    group: RecordGroup
    statistic: float
    degrees: int
    probability: float


@dataclass(frozen=True)
class RecordError:
    """A wrong record that explains a contradiction.

    group     of the record
    record    for people: "monument ZY103"
    where     file and keys
    parts     of its numbers: ("east", "north", "up"); ("",) of a single one
    unit      of errors
    errors    of the record, one a part, as in `RecordTest`
    u         standard uncertainties of these
    gain      decrease of the weighted sum of squares if the record is wrong
    of        owner of the record: a ranger, a station, a target; "" of what all have in common
    """

    group: RecordGroup
    record: str
    where: str
    parts: tuple[str, ...]
    unit: str
    errors: tuple[float, ...]
    u: tuple[float, ...]
    gain: float
    of: str = ""

    @property
    def text(self) -> str:
        """Record with the sizes of its errors.

        >>> RecordError(RecordGroup.MONUMENTS, "monument ZY103", "monuments/ZY103.toml: x_mm, y_mm, z_mm",
        ...             ("east", "north", "up"), "mm", (1.0, -0.12, 0.0), (0.05, 0.06, 0.04), 400.0).text
        'monument ZY103 by east +1.000, north -0.120, up +0.000 mm (monuments/ZY103.toml: x_mm, y_mm, z_mm)'
        """
        digits = max(0, 1 - int(np.floor(np.log10(min(self.u))))) if min(self.u) > 0.0 else 2
        numbers = [f"{part} {error:+.{digits}f}".strip() for part, error in zip(self.parts, self.errors, strict=True)]
        where = f" ({self.where})" if self.where else ""
        return f"{self.record} by {', '.join(numbers)} {self.unit}{where}"


@dataclass(frozen=True)
class Contradiction:
    """A contradiction between records and ranges, and its explanations.

    explanations   best first; one where its gain exceeds all others' by the margin
    """

    explanations: tuple[RecordError, ...]

    @property
    def named(self) -> RecordError | None:
        """Only explanation; None where several explain it about as well."""
        return self.explanations[0] if len(self.explanations) == 1 else None

    @property
    def text(self) -> str:
        """Contradiction in one sentence."""
        if self.named is not None:
            return f"the ranges contradict {self.named.text}"
        return f"the ranges contradict one of these: {'; or '.join(e.text for e in self.explanations)}"


@dataclass(frozen=True)
class ClassScatter:
    """Scatter of the shots of one class of points.

    name     of the class: "feed arm", "dish", "alidade", "ground"
    factor   variance factor of its shots against their own claim
    shots    used
    sway_m   m, standard deviation of a displacement from shot to shot that the claim includes; 0 without one
    degrees  of freedom of the factor; NaN where unknown
    """

    name: str
    factor: float
    shots: int
    sway_m: float = 0.0
    degrees: float = float("nan")
