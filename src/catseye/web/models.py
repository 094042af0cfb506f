"""Shapes of the JSON API: SI units without a suffix, MJD for instants, arrays are columns, null is unknown.

They make the OpenAPI document; tests hold every answer of a real site to them.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Number = float | None
Column = list[Number]
Names = list[str]
Mjd = Annotated[float, Field(description="MJD, UTC, d")]
Verdict = Annotated[str | None, Field(description="good, doubtful or failed")]
Severity = Literal["debug", "note", "warning", "alarm"]
Command = Literal["MODE", "DROP", "TAKE", "STREAM", "SET", "PREPARE", "START", "CLOCK"]
Who = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[ -~]*$", description="name of the person")]
Line = Annotated[str, Field(min_length=1, max_length=900, pattern=r"^[ -~]*$")]
Word = Annotated[str, Field(max_length=256, pattern=r"^[ -~]*$")]


class Shape(BaseModel):
    """Object of the API: no other keys than its own."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class ErrorAnswer(Shape):
    """Refusal in one line."""

    error: str


class ServiceAnswer(Shape):
    """The service: its subject, and permissions."""

    version: str
    kind: Literal["site", "journal", "result"]
    name: str
    commands: bool
    history: bool
    needs_token: bool
    now: Mjd


class SiteRanger(Shape):
    """Ranger of a site and its place, m."""

    name: str
    x: Number
    y: Number
    z: Number
    kind: Literal["ground", "feed", "other"]


class SiteTargets(Shape):
    """Targets of a site, m."""

    name: Names
    x: Column
    y: Column
    z: Column
    body: Names


class Outline(Shape):
    """Line of the antenna's structure, m."""

    name: str
    body: str
    x: Column
    y: Column
    z: Column


class RunAnswer(Shape):
    """Run of a journal."""

    run: int
    uuid: str
    started: Number
    ended: Number


class Direction(Shape):
    """Azimuth and elevation, rad."""

    azimuth: Number
    elevation: Number


class SiteAnswer(Shape):
    """Map of a site, its journal's runs and the span of its history."""

    name: str
    latitude: Number = Field(description="rad")
    longitude: Number = Field(description="rad, east positive")
    height: Number = Field(description="m")
    time_zone: str | None = Field(description="IANA")
    posture: Direction | None = Field(default=None, description="of the records, for which the structure is drawn")
    rangers: list[SiteRanger]
    targets: SiteTargets
    structure: list[Outline]
    runs: list[RunAnswer]
    since: Number
    until: Number


class ShotCounts(Shape):
    """Shots that the coordinator numbered, and those that its journal holds durably."""

    numbered: int | None
    acknowledged: int | None


class ProblemAnswer(Shape):
    """Alarm of a site, and who has acknowledged or shelved it."""

    id: str
    severity: str
    text: str
    since: Number
    acknowledged_by: str | None
    acknowledged_at: Number
    shelved_by: str | None
    shelved_until: Number


class EpochSummaryAnswer(Shape):
    """Epoch in a line."""

    number: int
    mjd: Number
    points: int | None
    shots: int | None
    rejected: int | None
    variance_factor: Number
    degrees_of_freedom: Number
    refractivity_ppm: Number
    verdict: Verdict
    verdict_text: str | None = None
    azimuth: Number
    elevation: Number
    run: int | None = Field(default=None, description="of the journal")
    seq: int | None = Field(default=None, description="number of the entry in the journal")


class PostureAnswer(Direction):
    """Posture of the antenna, rad and rad/s."""

    mjd: Mjd
    azimuth_rate: Number
    elevation_rate: Number


class WeatherAnswer(Shape):
    """Reading of a weather station."""

    station: str
    mjd: Number
    temperature_c: Number
    pressure_hpa: Number
    humidity_percent: Number


class SunAnswer(Direction):
    """Place of the Sun and half angle of the cone that is avoided, rad."""

    cone: Number
    avoided: bool | None = None


class LastShot(Shape):
    """Last shot of a ranger, m."""

    number: int | None
    target: str | None
    status: str | None
    range: Number
    u_range: Number
    misfit: Number


class RangerRow(Shape):
    """Ranger in a line of the state."""

    name: str
    mjd: Number = Field(description="of its last shot")
    state: str | None
    word: str | None
    sign: str | None
    trouble: str | None
    shots: int | None
    failures: int | None
    stream: Any
    last: LastShot | None
    next: str | None = Field(description="target of the next shot")
    next_mjd: Number = None


class StateAnswer(Shape):
    """State of a site: live, or of the journal at an instant."""

    mjd: Number = Field(description="of the site's clock; null before its first word")
    received: Number = Field(description="MJD of the coordinator's last word, by this machine's clock")
    source: Literal["live", "journal"]
    connected: bool
    trouble: str | None = Field(default=None, description="why it is not connected")
    word: str | None
    mode: str | None
    round: int | None
    shots: ShotCounts | None
    telescope: str | None = None
    clock: str | None
    disk: str | None
    journal: str | None
    lease: str | None = Field(description="name of its holder")
    problems: list[ProblemAnswer]
    verdict: Verdict
    verdict_text: str | None = None
    epoch: EpochSummaryAnswer | None
    posture: PostureAnswer | None
    weather: list[WeatherAnswer]
    sun: SunAnswer | None
    rangers: list[RangerRow]


class EpochsAnswer(Shape):
    """Epochs, oldest first."""

    epochs: list[EpochSummaryAnswer]


class Covariance(Shape):
    """Covariance of each point, m^2."""

    xx: Column
    xy: Column
    xz: Column
    yy: Column
    yz: Column
    zz: Column


class EpochPoints(Shape):
    """Points of an epoch, m."""

    name: Names
    body: Names
    x: Column
    y: Column
    z: Column
    covariance: Covariance
    shots: list[int | None]


class Beams(Shape):
    """Shots of an epoch as beams, with their standardised residuals."""

    ranger: Names
    target: Names
    shot: list[int | None]
    w: Column


class NamedValues(Shape):
    """Values by name with their standard uncertainties."""

    name: Names
    value: Column
    u: Column


class RangerZeros(Shape):
    """Zero of each ranger, m."""

    ranger: Names
    value: Column
    u: Column


class RejectedShot(Shape):
    """Shot that an epoch does not use."""

    shot: int | None
    ranger: str | None
    target: str | None
    status: str | None = None
    reason: str


class EpochAnswer(EpochSummaryAnswer):
    """Epoch: points with covariance, beams, structure at its posture, air, zeros, doubts."""

    points: EpochPoints  # type: ignore[assignment]  # the summary counts them
    beams: Beams
    structure: list[Outline]
    air: NamedValues
    zeros: RangerZeros
    jitter_mm: dict[str, Number] | None
    doubts: list[str]
    notes: list[str]
    biases: dict[str, Any] | None
    rejected: list[RejectedShot]  # type: ignore[assignment]  # the summary counts them
    pose: dict[str, Any] | None


class ResidualsAnswer(Shape):
    """Residuals of an epoch's shots, m; w is standardised."""

    shot: list[int | None]
    ranger: Names
    target: Names
    mjd: Column
    elevation: Column
    residual: Column
    u: Column
    w: Column
    status: Names
    by: str | None = None


class SeriesName(Shape):
    """Series that can be asked for."""

    name: str
    label: str
    unit: str


class SeriesNamesAnswer(Shape):
    """Series that are there."""

    names: list[SeriesName]


class Series(SeriesName):
    """One quantity over time; low and high are the least and the largest of a bin."""

    mjd: Column
    value: Column
    u: Column | None
    low: Column | None
    high: Column | None


class SeriesAnswer(Shape):
    """Series on one time axis."""

    names: list[Series]
    gaps: Number = Field(description="s without a value from which on a line breaks")


class DroppedAnswer(Shape):
    """Map of dropped channels: shots of each ranger in each bin."""

    rangers: Names
    bins: Column
    width: Number = Field(default=None, description="of a bin, d")
    good: list[list[int]]
    failed: list[list[int]]


class ShotsAnswer(Shape):
    """Shots as columns, m."""

    number: list[int | None]
    mjd: Column
    ranger: Names
    target: Names
    status: Names
    range: Column
    u_range: Column
    misfit: Column


class CorrectionStep(Shape):
    """Step from phase to range."""

    name: str
    value: Number
    unit: str


class CertificateAnswer(Shape):
    """Certificate behind a value."""

    instrument: str
    file: str
    sha256: str | None = None
    serial: str | None = None
    measured_on: str | None = None
    valid_from: str | None
    valid_until: str | None
    valid: bool | None = Field(default=None, description="at the instant of the answer")
    by: str | None = None
    report: str | None = None


class ShotAnswer(Shape):
    """Shot with all that went into its range."""

    number: int
    run: int | None = None
    mjd: Mjd
    ranger: str
    target: str
    status: str
    text: str | None
    range: Number
    u_range: Number
    misfit: Number
    amplitude_v: Number
    phase: Number = Field(description="rad")
    cycles: int | None = None
    samples_per_cycle: int | None = None
    if_hz: Number = None
    epoch: int | None
    correction: list[CorrectionStep]
    weather: list[WeatherAnswer]
    posture: PostureAnswer | None
    certificate: CertificateAnswer | None
    has_samples: bool


class Spectrum(Shape):
    """Amplitude spectrum of a buffer."""

    frequency_hz: Column
    amplitude_v: Column


class Harmonic(Shape):
    """Harmonic of the modulation."""

    n: int
    frequency_hz: Number
    amplitude_v: Number


class CyclePhase(Shape):
    """Phase of each cycle: s and rad."""

    t: Column
    phase: Column


class SamplesAnswer(Shape):
    """Samples of a shot and its spectrum."""

    number: int | None = None
    sample_rate_hz: Number
    volts: Column
    spectrum: Spectrum
    harmonics: list[Harmonic]
    cycle_phase: CyclePhase
    fit: dict[str, Number]


class PointAnswer(Shape):
    """History of a point, m, and its last shots."""

    name: str
    body: str
    mjd: Column
    epoch: list[int | None] = []
    x: Column
    y: Column
    z: Column
    covariance: Covariance
    shots: ShotsAnswer


class RangerAnswer(BaseModel):
    """Ranger: its line of the state, its station, servo, certificates and recent commands."""

    model_config = ConfigDict(frozen=True, extra="allow")

    name: str
    kind: Literal["ground", "feed", "other"]
    station: Any
    zero: Any
    servo: Any
    certificates: list[Any]
    commands: Any


class InstrumentAnswer(CertificateAnswer):
    """Calibrated instrument."""

    kind: str
    quantity: str = ""
    value: Any
    u: Any
    unit: str | None


class CalibrationsAnswer(Shape):
    """Calibrations behind a site's numbers."""

    mjd: Number = None
    instruments: list[InstrumentAnswer]


class AirPaths(Shape):
    """Air along each path."""

    ranger: Names
    target: Names
    length: Column
    refractivity_ppm: Column
    u: Column
    temperature_c: Column


class AirAnswer(Shape):
    """Air of an epoch."""

    epoch: int | None = None
    mjd: Number = None
    refractivity_ppm: Number = None
    paths: AirPaths
    profile: dict[str, Any] | None
    stations: list[Any]


class ComparisonAnswer(BaseModel):
    """Points of two epochs, second less first, m."""

    model_config = ConfigDict(frozen=True, extra="allow")

    name: Names
    dx: Column
    dy: Column
    dz: Column
    covariance: Covariance
    significant: list[bool | None]
    verdict: Verdict


class SurfacePoints(Shape):
    """Deviations of the surface, m."""

    name: Names
    x: Column
    y: Column
    deviation: Column = Field(description="along the normal")
    half_path: Column = []
    u: Column


class Actuators(Shape):
    """Actuators of the surface, m."""

    name: Names
    x: Column
    y: Column
    value: Column


class ZernikeTerm(Shape):
    """Zernike coefficient, m."""

    n: int
    m: int
    number: int | None = None
    name: str
    value: Number
    u: Number


class Aperture(Shape):
    """Circle over which the Zernike polynomials are orthogonal, m."""

    x: Number
    y: Number
    radius: Number


class SurfaceAnswer(Shape):
    """Surface of an epoch."""

    epoch: int | None = None
    points: SurfacePoints
    actuators: Actuators | None
    aperture: Aperture | None = None
    zernike: list[ZernikeTerm]
    rms: Number
    focal_length: Number = None
    verdict: Verdict
    verdict_text: str | None = None


class EventsAnswer(Shape):
    """Events as columns, oldest first."""

    mjd: Column
    severity: Names
    who: Names
    kind: Names
    text: Names


class CommandBody(Shape):
    """Command to the coordinator."""

    command: Command
    parameters: list[Word] = Field(default=[], max_length=64)
    who: Who


class CommandAnswer(Shape):
    """Outcome of a command, in the coordinator's words."""

    command: str
    values: list[str]
    at: Number = Field(description="MJD")
    lease_from: str | None = Field(default=None, description="who had the lease before; null: nobody")


class ConsoleBody(Shape):
    """Line for a ranger's console."""

    line: Line
    who: Who


class ConsoleAnswer(Shape):
    """Answers of a ranger."""

    replies: list[str]


class WhoBody(Shape):
    """Name of who acts on an alarm."""

    who: Who


class ShelfBody(WhoBody):
    """Name of who shelves an alarm, and for how long."""

    minutes: float = Field(gt=0.0, le=1440.0)


class Report(BaseModel):
    """Report of a finished result, as its page holds it."""

    model_config = ConfigDict(frozen=True, extra="allow")

    format: Literal["catseye-report-1"]
    title: str
