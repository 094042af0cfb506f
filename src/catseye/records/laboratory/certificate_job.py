"""Records of a certificate: the laboratory that issues it, and the job it is issued for.

    LaboratoryRecord   LAB.toml, the same for all its certificates
    CertificateJob     JOB.toml, one for each certificate

Whatever is missing is printed as "not stated".
"""

from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from catseye.records.files.reading import Folder
from catseye.records.files.record import Record, Version, Within, broken_rule
from catseye.records.files.refusal import refusal, unreadable

LONGEST = 2000  # characters of a text: half a page
LARGEST_LOGO = 1_000_000  # bytes
PNG, SVG = b"\x89PNG\r\n\x1a\n", b"<svg"
LOGOS = {".png": "png", ".svg": "svg"}
SIMPLE, GUARDED = "simple-acceptance", "guarded-acceptance"
DecisionRuleName = Literal["simple-acceptance", "guarded-acceptance"]


def _printable(text: str) -> str:
    """Text without control characters; line ends become spaces."""
    line = " ".join(text.split())
    if not line:
        raise broken_rule("an empty text (leave the key out: it is then printed as not stated)")
    if not line.isprintable():
        raise broken_rule("a text with a control character (expected printable characters)")
    return line


Text = Annotated[str, Field(max_length=LONGEST), AfterValidator(_printable)]
Lines = Annotated[tuple[Text, ...], Field(strict=False, max_length=12)]
Bound = Annotated[float, Within(-1e12, 1e12)]


class Signatory(Record):
    """Person who signs: name, and the role beneath it.

    name   name of the person
    role   under the name
    """

    name: Text
    role: Text


class LaboratoryRecord(Record):
    """Laboratory that issues certificates.

    name, address    name and address in the certificate's heading
    contact          telephone, mail, web, a line each
    logo             PNG or SVG file beside the record
    accreditation    body and number of the accreditation
    number_prefix    before the number of each certificate
    traceability     statement on the traceability of the laboratory's standards
    signatory        persons who sign, in order
    """

    format: Annotated[int | str, Version("laboratory")]
    name: Text
    address: Lines = ()
    contact: Lines = ()
    logo: Text | None = None
    accreditation: Text | None = None
    number_prefix: Text | None = None
    traceability: Text | None = None
    signatory: Annotated[tuple[Signatory, ...], Field(strict=False, max_length=6)] = ()

    @field_validator("logo")
    @classmethod
    def _is_beside_the_record(cls, logo: str | None) -> str | None:
        if logo is None or (Path(logo).name == logo and Path(logo).suffix.lower() in LOGOS):
            return logo
        raise broken_rule(f"logo = {logo!r} is not a PNG or SVG file beside the record (expected a name as logo.svg)")


class Customer(Record):
    """Customer of a calibration: name, address and contact.

    name      name of the customer
    address   lines of the address
    contact   person or address to write to
    """

    name: Text
    address: Lines = ()
    contact: Text | None = None


Span = Annotated[tuple[float, float], Field(strict=False)]


class WorkEnvironment(Record):
    """Lowest and highest value during the work, and the standard uncertainty of each.

    temperature_c      lowest and highest temperature of the air
    pressure_hpa       lowest and highest pressure
    humidity_percent   lowest and highest relative humidity
    """

    temperature_c: Span | None = None
    pressure_hpa: Span | None = None
    humidity_percent: Span | None = None
    u_temperature_c: Annotated[float, Within(0, 100)] | None = None
    u_pressure_hpa: Annotated[float, Within(0, 100)] | None = None
    u_humidity_percent: Annotated[float, Within(0, 100)] | None = None

    @field_validator("temperature_c", "pressure_hpa", "humidity_percent")
    @classmethod
    def _is_a_range(cls, span: tuple[float, float] | None, info: ValidationInfo) -> tuple[float, float] | None:
        name = info.field_name or ""
        low, high = {"temperature_c": (-60, 80), "pressure_hpa": (300, 1200), "humidity_percent": (0, 100)}[name]
        if span is not None and not low <= span[0] <= span[1] <= high:
            raise broken_rule(
                f"{name} = {list(span)} is not the lowest and the highest value (expected {low} to {high}, in order)"
            )
        return span


class ReferenceStandard(Record):
    """Standard that gives traceability, with its own certificate.

    name             name of the standard
    serial           serial number of the standard
    certificate      number of its certificate
    laboratory       laboratory that issued its certificate
    calibrated_on, valid_until   dates
    traceability     realisation of the unit, such as "SI metre by PTB"
    """

    name: Text
    serial: int | Text | None = None
    certificate: Text | None = None
    laboratory: Text | None = None
    calibrated_on: date | None = None
    valid_until: date | None = None
    traceability: Text | None = None

    def expired(self, day: date) -> bool:
        """True if the standard's certificate had ended by a day."""
        return self.valid_until is not None and self.valid_until < day


class Specification(Record):
    """Limits of a quantity, in its unit.

    key            key of the quantity
    lower, upper   limits; one may be missing
    source         source of the limits: a specification, a standard
    """

    key: Text
    lower: Bound | None = None
    upper: Bound | None = None
    source: Text | None = None

    @model_validator(mode="after")
    def _is_a_range(self) -> "Specification":
        if self.lower is None and self.upper is None:
            raise broken_rule(f"specification of {self.key}: lower and upper are missing (expected one of them)")
        if self.lower is not None and self.upper is not None and self.lower >= self.upper:
            raise broken_rule(
                f"specification of {self.key}: lower = {self.lower:g} is not below upper = {self.upper:g}"
            )
        return self


class CertificateJob(Record):
    """Calibration job as its certificate states it.

    number           number of the certificate, after the laboratory's prefix
    issued_on, received_on   dates of issue and of the item's receipt; the issue is today's without
    order            customer's order
    procedure        document of the procedure
    place            place of the calibration
    item             description of the item: maker and model
    condition        condition of the item on receipt
    adjustment       work on the item, with results before and after
    deviations       deviations from the procedure
    remarks          opinions and interpretations
    replaces         number of the certificate that this one amends
    interval_agreed  True if the customer agreed to a date of validity on the certificate
    decision_rule    for statements of conformity
    customer, environment, reference, specification   see there
    """

    format: Annotated[int | str, Version("job")]
    number: Text | None = None
    issued_on: date | None = None
    received_on: date | None = None
    order: Text | None = None
    procedure: Text | None = None
    place: Text | None = None
    item: Text | None = None
    condition: Text | None = None
    adjustment: Text | None = None
    deviations: Text | None = None
    remarks: Text | None = None
    replaces: Text | None = None
    interval_agreed: bool = False
    decision_rule: DecisionRuleName | None = None
    customer: Customer | None = None
    environment: WorkEnvironment = WorkEnvironment()
    reference: Annotated[tuple[ReferenceStandard, ...], Field(strict=False)] = ()
    specification: Annotated[tuple[Specification, ...], Field(strict=False)] = ()

    @model_validator(mode="after")
    def _has_a_rule_for_its_limits(self) -> "CertificateJob":
        if self.specification and self.decision_rule is None:
            raise broken_rule(
                f"decision_rule is missing (expected with [[specification]]: {SIMPLE!r} or {GUARDED!r}, as agreed with "
                "the customer)"
            )
        keys = [each.key for each in self.specification]
        for key in keys:
            if keys.count(key) > 1:
                raise broken_rule(f"specification of {key} stands twice (expected once)")
        return self


NO_JOB = CertificateJob(format="catseye-job-1")


@dataclass(frozen=True, eq=False)
class CertificateRecords:
    """Laboratory and job of a certificate.

    laboratory   None: not stated
    logo         bytes of its logo; empty without one
    job          all of it missing where there is none
    read         files that were read
    """

    laboratory: LaboratoryRecord | None = None
    logo: bytes = b""
    job: CertificateJob = NO_JOB
    read: tuple[Path, ...] = field(default=())

    @property
    def number(self) -> str | None:
        """Number of the certificate, with the laboratory's prefix; None: not stated."""
        if self.job.number is None:
            return None
        prefix = None if self.laboratory is None else self.laboratory.number_prefix
        return f"{prefix or ''}{self.job.number}"


def read_certificate_records(laboratory: Path | None, job: Path | None) -> CertificateRecords:
    """Read a laboratory's record with its logo, and a job.

    laboratory, job   files; None: not stated

    Raises InputError for a file that is missing or no such record, and for a logo that is no picture.
    """
    issuer, logo, read = None, b"", []
    if laboratory is not None:
        folder = Folder(laboratory.parent)
        issuer = folder.record(laboratory.name, LaboratoryRecord)
        read.append(laboratory)
        if issuer.logo is not None:
            logo = _logo(folder, issuer.logo)
            read.append(laboratory.parent / issuer.logo)
    commission = NO_JOB
    if job is not None:
        commission = Folder(job.parent).record(job.name, CertificateJob)
        read.append(job)
    return CertificateRecords(issuer, logo, commission, tuple(read))


def _logo(folder: Folder, name: str) -> bytes:
    """Bytes of a logo; InputError if it is too large or not of the format that its name says."""
    try:
        content = folder.path(name).read_bytes()
    except OSError as problem:
        raise unreadable(name, problem) from problem
    if len(content) > LARGEST_LOGO:
        raise refusal(name, f"holds {len(content)} bytes (expected a logo of at most {LARGEST_LOGO})")
    is_png = Path(name).suffix.lower() == ".png"
    if content.startswith(PNG) if is_png else SVG in content[:4096]:
        return content
    raise refusal(name, f"is not {'a PNG' if is_png else 'an SVG'} picture (expected what its name says)")
