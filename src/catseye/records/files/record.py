"""Record base class: a frozen table of values without conversion, each with its plausible range.

    Record             any table of a file; a complete file also has a `format`
    └── Certificate    a calibration: with the provenance serial, measured_on, valid_until, by, report

A range detects a wrong unit, not an unusual instrument: metres for millimetres are refused, another telescope is not.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
EARLIEST_MJD, LATEST_MJD = 40_000.0, 100_000.0  # 1968 to 2132: excludes Julian Dates and Unix times


class Record(BaseModel):
    """Frozen; no unknown keys, infinities or conversions other than integers to numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)

    def __repr_args__(self) -> list[tuple[str | None, Any]]:
        """Fields of the short form that people see: those that have a value."""
        return [(name, value) for name, value in super().__repr_args__() if value is not None]


class Certificate(Record):
    """Calibration with its provenance; missing provenance in format version 1 reads as None.

    serial        serial number of the calibrated part
    measured_on   day of the calibration
    valid_until   last day of its validity
    by            person who measured
    report        reference to the report
    """

    serial: int | str | None = None
    measured_on: date | None = None
    valid_until: date | None = None
    by: str | None = None
    report: str | None = None


@dataclass(frozen=True)
class Within:
    """Plausible range of a number, both ends included; `above` excludes the lower end.

    >>> from pydantic import TypeAdapter
    >>> TypeAdapter(Annotated[float, Within(50, 1000)]).validate_python(180.685)
    180.685
    """

    low: float
    high: float
    above: bool = False

    def check(self, value: float) -> float:
        if self.low <= value <= self.high and not (self.above and value == self.low):
            return value
        raise out_of_range("range", self, size=value, before="above " if self.above else "")

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        low = "exclusiveMinimum" if self.above else "minimum"
        return {**handler(schema), low: self.low, "maximum": self.high}


@dataclass(frozen=True)
class Length:
    """Plausible range of a vector's length; `or_zero` also allows the null vector."""

    low: float
    high: float
    or_zero: bool = False

    def check(self, value: Sequence[float]) -> Sequence[float]:
        size = math.hypot(*value)
        if self.low <= size <= self.high or (self.or_zero and size == 0.0):
            return value
        raise out_of_range("length", self, size=size, before="0 or " if self.or_zero else "")

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self.check, handler(source))


@dataclass(frozen=True)
class Version:
    """Format of a file kind: 1, or the text `catseye-KIND-1`."""

    kind: str

    def check(self, value: object) -> int | str:
        if (type(value) is int and value == 1) or (type(value) is str and value == f"catseye-{self.kind}-1"):
            return value
        supported = f"1 or 'catseye-{self.kind}-1', the supported versions"
        raise PydanticCustomError("version", "expected {expected}", {"expected": supported})

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.check)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"enum": [1, f"catseye-{self.kind}-1"]}


def out_of_range(kind: str, bounds: Within | Length, *, size: float, before: str) -> PydanticCustomError:
    """Error for a number or a vector, with the data for guessing another unit."""
    expected = f"{before}{bounds.low:.10g} to {bounds.high:.10g}"
    floated = float(min(max(size, -1e300), 1e300))  # an integer may be too large for a float
    context = {"low": bounds.low, "high": bounds.high, "size": floated, "expected": expected}
    return PydanticCustomError(kind, "expected {expected}", context)


def broken_rule(text: str) -> PydanticCustomError:
    """Error for a rule on several values of a record; the text names them."""
    return PydanticCustomError("rule", "{text}", {"text": text})


def plain_name(value: str) -> str:
    """Name that is safe as a file name: only letters, digits and _ . -, no '..'."""
    if NAME.fullmatch(value) and ".." not in value:
        return value
    raise PydanticCustomError("name", "expected letters, digits, _ . - and no '..'")


Name = Annotated[str, AfterValidator(plain_name), Field(json_schema_extra={"pattern": f"^{NAME.pattern}$"})]
Mjd = Annotated[float, Within(EARLIEST_MJD, LATEST_MJD)]

# A vector may be a list, as in TOML; its numbers stay strict.
Pair = Annotated[tuple[float, float], Field(strict=False)]
Vector = Annotated[tuple[float, float, float], Field(strict=False)]
Position = Annotated[Vector, Length(500, 1e7)]  # mm
UnitVector = Annotated[Vector, Length(0.999, 1.001)]

Coordinate = Annotated[float, Within(-1e7, 1e7)]  # mm
Uncertainty = Annotated[float, Within(0, 100, above=True)]  # mm; zero would give infinite weight
Elevation = Annotated[float, Within(-500, 9000)]  # m above sea level
Latitude = Annotated[float, Within(-90, 90)]  # degrees
TelescopeAzimuth = Annotated[float, Within(-540, 540)]  # degrees: cable wraps exceed one turn
TelescopeElevation = Annotated[float, Within(-5, 95)]  # degrees
