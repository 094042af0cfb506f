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
Command = Literal["MODE", "DROP", "TAKE", "STREAM", "SET", "PREPARE", "START", "DISCARD", "CLOCK", "REFERENCE", "MOVED"]
Who = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[ -~]*$", description="name of the person")]
Line = Annotated[str, Field(min_length=1, max_length=900, pattern=r"^[ -~]*$")]
Word = Annotated[str, Field(max_length=256, pattern=r"^[ -~]*$")]


class Shape(BaseModel):
    """Object of the API: no other keys than its own."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class ErrorJson(Shape):
    """Refusal in one line of text."""

    error: str


class ServiceJson(Shape):
    """The service: its subject, and permissions."""

    version: str
    kind: Literal["site", "journal", "result"]
    name: str
    commands: bool
    history: bool
    needs_token: bool
    now: Mjd


class SiteRangerJson(Shape):
    """Ranger of a site and its place, m."""

    name: str
    x: Number
    y: Number
    z: Number
    kind: Literal["ground", "feed", "other"]


class SiteTargetsJson(Shape):
    """Targets of a site and their places, m."""

    name: Names
    x: Column
    y: Column
    z: Column
    body: Names


class OutlineJson(Shape):
    """Line of the antenna's structure, m."""

    name: str
    body: str
    x: Column
    y: Column
    z: Column


class RunJson(Shape):
    """Run of a journal with its span."""

    run: int
    uuid: str
    started: Number
    ended: Number


class DirectionJson(Shape):
    """Azimuth and elevation, rad."""

    azimuth: Number
    elevation: Number


class SiteJson(Shape):
    """Map of a site, its journal's runs and the span of its history."""

    name: str
    latitude: Number = Field(description="rad")
    longitude: Number = Field(description="rad, east positive")
    height: Number = Field(description="m")
    time_zone: str | None = Field(description="IANA")
    posture: DirectionJson | None = Field(default=None, description="of the records, for which the structure is drawn")
    rangers: list[SiteRangerJson]
    targets: SiteTargetsJson
    structure: list[OutlineJson]
    runs: list[RunJson]
    since: Number
    until: Number


class ShotCountsJson(Shape):
    """Shots that the coordinator numbered, and those that its journal holds durably."""

    numbered: int | None
    acknowledged: int | None


class ProblemJson(Shape):
    """Alarm of a site, and who has acknowledged or shelved it."""

    id: str
    severity: str
    text: str
    since: Number
    acknowledged_by: str | None
    acknowledged_at: Number
    shelved_by: str | None
    shelved_until: Number


class EpochSummaryJson(Shape):
    """Summary of an epoch: counts, verdict, posture."""

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


class PostureJson(DirectionJson):
    """Posture of the antenna, rad and rad/s."""

    mjd: Mjd
    azimuth_rate: Number
    elevation_rate: Number


class WeatherJson(Shape):
    """Reading of a weather station."""

    station: str
    mjd: Number
    temperature_c: Number
    pressure_hpa: Number
    humidity_percent: Number


class SunJson(DirectionJson):
    """Place of the Sun and half angle of the cone that is avoided, rad."""

    cone: Number
    avoided: bool | None = None


class LastShotJson(Shape):
    """Last shot of a ranger, m."""

    number: int | None
    target: str | None
    status: str | None
    range: Number
    u_range: Number
    misfit: Number


class RangerRowJson(Shape):
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
    last: LastShotJson | None
    next: str | None = Field(description="target of the next shot")
    next_mjd: Number = None


class StateJson(Shape):
    """State of a site: live, or of the journal at an instant."""

    mjd: Number = Field(description="of the site's clock; null before its first word")
    received: Number = Field(description="MJD of the coordinator's last word, by this machine's clock")
    source: Literal["live", "journal"]
    connected: bool
    trouble: str | None = Field(default=None, description="why it is not connected")
    word: str | None
    mode: str | None
    round: int | None
    shots: ShotCountsJson | None
    telescope: str | None = None
    clock: str | None
    disk: str | None
    journal: str | None
    lease: str | None = Field(description="name of its holder")
    problems: list[ProblemJson]
    verdict: Verdict
    verdict_text: str | None = None
    epoch: EpochSummaryJson | None
    posture: PostureJson | None
    weather: list[WeatherJson]
    sun: SunJson | None
    rangers: list[RangerRowJson]


class EpochsJson(Shape):
    """Summaries of epochs, oldest first."""

    epochs: list[EpochSummaryJson]


class CovarianceJson(Shape):
    """Covariance of each point, m^2."""

    xx: Column
    xy: Column
    xz: Column
    yy: Column
    yz: Column
    zz: Column


class EpochPointsJson(Shape):
    """Points of an epoch with covariance, m."""

    name: Names
    body: Names
    x: Column
    y: Column
    z: Column
    covariance: CovarianceJson
    shots: list[int | None]


class BeamsJson(Shape):
    """Shots of an epoch as beams, with their standardised residuals."""

    ranger: Names
    target: Names
    shot: list[int | None]
    w: Column


class NamedValuesJson(Shape):
    """Values by name with their standard uncertainties."""

    name: Names
    value: Column
    u: Column


class RangerZerosJson(Shape):
    """Zero of each ranger with its u, m."""

    ranger: Names
    value: Column
    u: Column


class RejectedShotJson(Shape):
    """Shot that an epoch does not use."""

    shot: int | None
    ranger: str | None
    target: str | None
    status: str | None = None
    reason: str


class EpochJson(EpochSummaryJson):
    """Epoch: points with covariance, beams, structure at its posture, air, zeros, doubts."""

    points: EpochPointsJson  # type: ignore[assignment]  # the summary counts them
    beams: BeamsJson
    structure: list[OutlineJson]
    air: NamedValuesJson
    zeros: RangerZerosJson
    jitter_mm: dict[str, Number] | None
    doubts: list[str]
    notes: list[str]
    biases: dict[str, Any] | None
    rejected: list[RejectedShotJson]  # type: ignore[assignment]  # the summary counts them
    pose: dict[str, Any] | None


class ResidualsJson(Shape):
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


class SeriesNameJson(Shape):
    """Series that can be asked for."""

    name: str
    label: str
    unit: str


class SeriesNamesJson(Shape):
    """Names of all series, with labels and units."""

    names: list[SeriesNameJson]


class SeriesLineJson(SeriesNameJson):
    """One quantity over time; low and high are the least and the largest of a bin."""

    mjd: Column
    value: Column
    u: Column | None
    low: Column | None
    high: Column | None


class SeriesJson(Shape):
    """Series on one time axis."""

    names: list[SeriesLineJson]
    gaps: Number = Field(description="s without a value from which on a line breaks")


class DroppedJson(Shape):
    """Map of dropped channels: shots of each ranger in each bin."""

    rangers: Names
    bins: Column
    width: Number = Field(default=None, description="of a bin, d")
    good: list[list[int]]
    failed: list[list[int]]


class ShotsJson(Shape):
    """Shots as columns, oldest first, m."""

    number: list[int | None]
    mjd: Column
    ranger: Names
    target: Names
    status: Names
    range: Column
    u_range: Column
    misfit: Column


class CorrectionStepJson(Shape):
    """Step from phase to range."""

    name: str
    value: Number
    unit: str


class CertificateJson(Shape):
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


class ShotJson(Shape):
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
    correction: list[CorrectionStepJson]
    weather: list[WeatherJson]
    posture: PostureJson | None
    certificate: CertificateJson | None
    has_samples: bool


class SpectrumJson(Shape):
    """Amplitude spectrum of a buffer."""

    frequency_hz: Column
    amplitude_v: Column


class HarmonicJson(Shape):
    """Harmonic of the modulation."""

    n: int
    frequency_hz: Number
    amplitude_v: Number


class CyclePhaseJson(Shape):
    """Phase of each cycle: s and rad."""

    t: Column
    phase: Column


class SamplesJson(Shape):
    """Samples of a shot and its spectrum."""

    number: int | None = None
    sample_rate_hz: Number
    volts: Column
    spectrum: SpectrumJson
    harmonics: list[HarmonicJson]
    cycle_phase: CyclePhaseJson
    fit: dict[str, Number]


class PointJson(Shape):
    """History of a point, m, and its last shots."""

    name: str
    body: str
    mjd: Column
    epoch: list[int | None] = []
    x: Column
    y: Column
    z: Column
    covariance: CovarianceJson
    shots: ShotsJson


class RangerJson(BaseModel):
    """Ranger: its line of the state, its station, servo, certificates and recent commands."""

    model_config = ConfigDict(frozen=True, extra="allow")

    name: str
    kind: Literal["ground", "feed", "other"]
    station: Any
    zero: Any
    servo: Any
    certificates: list[Any]
    commands: Any


class InstrumentJson(CertificateJson):
    """Calibrated instrument and its certificate."""

    kind: str
    quantity: str = ""
    value: Any
    u: Any
    unit: str | None


class CalibrationsJson(Shape):
    """Calibrations behind a site's numbers."""

    mjd: Number = None
    instruments: list[InstrumentJson]


class AirPathsJson(Shape):
    """Air along each path of an epoch."""

    ranger: Names
    target: Names
    length: Column
    refractivity_ppm: Column
    u: Column
    temperature_c: Column


class AirJson(Shape):
    """Air of an epoch: paths, profile, stations."""

    epoch: int | None = None
    mjd: Number = None
    refractivity_ppm: Number = None
    paths: AirPathsJson
    profile: dict[str, Any] | None
    stations: list[Any]


class ComparisonJson(BaseModel):
    """Points of two epochs, second less first, m."""

    model_config = ConfigDict(frozen=True, extra="allow")

    name: Names
    dx: Column
    dy: Column
    dz: Column
    covariance: CovarianceJson
    significant: list[bool | None]
    verdict: Verdict


class SurfacePointsJson(Shape):
    """Deviations of the surface, m."""

    name: Names
    x: Column
    y: Column
    deviation: Column = Field(description="along the normal")
    half_path: Column = []
    u: Column


class ActuatorsJson(Shape):
    """Actuators of the surface, m."""

    name: Names
    x: Column
    y: Column
    value: Column


class ZernikeTermJson(Shape):
    """Zernike coefficient with its u, m."""

    n: int
    m: int
    number: int | None = None
    name: str
    value: Number
    u: Number


class ApertureJson(Shape):
    """Circle over which the Zernike polynomials are orthogonal, m."""

    x: Number
    y: Number
    radius: Number


class SurfaceJson(Shape):
    """Surface of the dish by an epoch."""

    epoch: int | None = None
    points: SurfacePointsJson
    actuators: ActuatorsJson | None
    aperture: ApertureJson | None = None
    zernike: list[ZernikeTermJson]
    rms: Number
    focal_length: Number = None
    verdict: Verdict
    verdict_text: str | None = None


class EventsJson(Shape):
    """Events as columns, oldest first."""

    mjd: Column
    severity: Names
    who: Names
    kind: Names
    text: Names


class ParameterJson(Shape):
    """Parameter of a running site, its values as texts."""

    name: str
    value: str
    waiting: str = Field(description="value that waits for START or the next round; none: no value waits")
    legal: str = Field(description="legal values, in words")
    choices: Names = Field(description="legal words, of a parameter of a few; else none")
    unit: str
    changes: str = Field(description="coordinator, plan, shots, answers, safety or output")
    meaning: str
    stage: str = Field(description="of the value that waits: set, prepared, started (until the round's end); none")


class InterlockJson(Shape):
    """Check of parameters together, or against the site's state."""

    parameters: Names
    rule: str = Field(description="what must hold, with its limit")
    refusal: str | None = Field(description="why the values that wait would be refused; null: they would not")


class ParametersJson(Shape):
    """Parameters of a running site, and their interlocks."""

    parameters: list[ParameterJson]
    interlocks: list[InterlockJson]


class SamplerJson(Shape):
    """Sampler: values kept, and their columns, whose names end with their unit."""

    name: str
    values: int
    columns: Names


class SamplersJson(Shape):
    """Samplers of a running site."""

    samplers: list[SamplerJson]


class SamplerValuesJson(Shape):
    """Last values of a sampler as columns, oldest first."""

    name: str
    mjd: Column
    columns: dict[str, list[Number | str]]


class CommandBody(Shape):
    """Command to the coordinator."""

    command: Command
    parameters: list[Word] = Field(default=[], max_length=64)
    who: Who


class CommandJson(Shape):
    """Outcome of a command, in the coordinator's words."""

    command: str
    values: list[str]
    at: Number = Field(description="MJD")
    lease_from: str | None = Field(default=None, description="who had the lease before; null: nobody")


class ConsoleBody(Shape):
    """Line for a ranger's console."""

    line: Line
    who: Who


class ConsoleJson(Shape):
    """Answers of a ranger to one line."""

    replies: list[str]


class WhoBody(Shape):
    """Name of who acts on an alarm."""

    who: Who


class ShelfBody(WhoBody):
    """Name of who shelves an alarm, and for how long."""

    minutes: float = Field(gt=0.0, le=1440.0)


class ReportJson(BaseModel):
    """Report of a finished result, as its page holds it."""

    model_config = ConfigDict(frozen=True, extra="allow")

    format: Literal["catseye-report-1"]
    title: str
