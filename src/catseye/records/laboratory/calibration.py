"""RECORD.toml of a calibration: results, full covariance, tests, readings, provenance."""

from datetime import date
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from catseye.records.files.record import Name, Record, Version, broken_rule

Words = Annotated[str, Field(min_length=1)]
Positive = Annotated[float, Field(ge=0.0)]
AGREES = 1e-9  # relative: u² and the diagonal are roundings of one number


class CalibratedQuantity(Record):
    """Quantity: key with its unit, value, standard uncertainty, and meaning.

    coverage   factor of u for an interval of 95.45 %; default 2
    key        name, which ends in the unit
    value      estimate
    u          standard uncertainty
    unit       unit of value and u; empty for a pure number
    meaning    description, with its sign
    """

    key: Words
    value: float
    u: Positive
    unit: str
    meaning: str
    coverage: Positive = 2.0


class CovarianceTable(Record):
    """Full covariance matrix in the order of the keys, in the product of their units.

    order    keys of the quantities
    matrix   rows of the covariance matrix
    """

    order: Annotated[tuple[str, ...], Field(strict=False)]
    matrix: Annotated[tuple[Annotated[tuple[float, ...], Field(strict=False)], ...], Field(strict=False)]


class DecisionTable(Record):
    """Test; statistic, limit and passed are missing if the readings did not allow it.

    least   True if the limit is a minimum, not a maximum
    grave   True if a failure rejects the result; else it makes it doubtful
    name    name of the test
    statistic  value of the test statistic
    limit   critical value
    passed  true if the test passed
    text    result as a sentence
    """

    name: Words
    statistic: float | None = None
    limit: float | None = None
    passed: bool | None = None
    text: str
    least: bool = False
    grave: bool = True


class ReadingsTable(Record):
    """Readings with residuals, as on the certificate.

    columns   names
    rows      cells of each reading, in the order of the columns
    """

    columns: Annotated[tuple[str, ...], Field(strict=False)]
    rows: Annotated[tuple[Annotated[tuple[float | int | str, ...], Field(strict=False)], ...], Field(strict=False)]


class CalibrationRecord(Record):
    """Complete record; `record` holds the values to copy into the instrument's record.

    kind                 kind of calibration
    title                heading of the certificate
    instrument           calibrated instrument
    serial               serial number
    measured_on          day of the readings
    valid_until          last day of validity
    by                   person who measured
    report               reference to the report
    made_by              program and version that wrote the record
    verdict              good, doubtful or failed
    variance_factor      variance factor of the adjustment; missing without degrees of freedom
    degrees_of_freedom   readings less parameters
    method               description of the calibration
    notes                remarks, one a text
    record               values to copy into the record of the instrument
    quantity             calibrated quantities
    covariance           covariance of the quantities
    decision             tests of the readings
    plausible            limits of the instrument, tested
    readings             table of the readings with residuals
    inputs_sha256        SHA-256 of each input file by its name
    sheet                keys of the sheet, as they were read
    """

    format: Annotated[str, Version("calibration")]
    kind: Name
    title: Words
    instrument: Words
    serial: int | Words
    measured_on: date
    valid_until: date
    by: Words
    report: Words
    made_by: Words
    verdict: Words | None = None
    variance_factor: Positive | None = None
    degrees_of_freedom: Annotated[int, Field(ge=0)]
    method: str
    notes: Annotated[tuple[str, ...], Field(strict=False)] = ()
    record: dict[str, Any]
    quantity: Annotated[tuple[CalibratedQuantity, ...], Field(strict=False, min_length=1)]
    covariance: CovarianceTable
    decision: Annotated[tuple[DecisionTable, ...], Field(strict=False)] = ()
    plausible: Annotated[tuple[DecisionTable, ...], Field(strict=False)] = ()
    readings: ReadingsTable
    inputs_sha256: dict[str, str]
    sheet: dict[str, Any]

    @model_validator(mode="after")
    def _has_a_covariance_of_its_quantities(self) -> "CalibrationRecord":
        keys = tuple(q.key for q in self.quantity)
        if self.covariance.order != keys:
            raise broken_rule(
                f"covariance.order = {list(self.covariance.order)} (expected {list(keys)}, the quantities)"
            )
        n = len(keys)
        if len(self.covariance.matrix) != n or any(len(row) != n for row in self.covariance.matrix):
            raise broken_rule(f"covariance.matrix is not {n} by {n}, as there are {n} quantities")
        matrix = np.array(self.covariance.matrix)
        scale = np.array([q.u for q in self.quantity])
        bound = np.outer(scale, scale)
        if np.any(np.abs(matrix - matrix.T) > AGREES * bound):
            raise broken_rule("covariance.matrix is not symmetric")
        if np.any(np.abs(np.diag(matrix) - scale**2) > AGREES * scale**2):
            raise broken_rule("covariance.matrix does not have the squares of u on its diagonal")
        safe = np.where(scale > 0.0, scale, 1.0)
        if np.linalg.eigvalsh(matrix / np.outer(safe, safe)).min() < -1e-9:
            raise broken_rule("covariance.matrix is not positive: a combination of quantities would have u² below 0")
        return self

    @model_validator(mode="after")
    def _is_a_table(self) -> "CalibrationRecord":
        width = len(self.readings.columns)
        for number, row in enumerate(self.readings.rows, start=1):
            if len(row) != width:
                raise broken_rule(f"readings.rows, row {number} has {len(row)} cells (expected {width})")
        return self
