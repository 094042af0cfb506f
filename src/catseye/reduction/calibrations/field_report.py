"""The notes' two calibration reports: fields in printed order, filled from a record or blank.

Source: [PARKER04] Figures 2.2 and 2.4.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import TypeAlias

import numpy as np

from catseye.constants import DEGREE
from catseye.geometry.mirror.mount import gamma, lambda_
from catseye.records.files.reading import Folder
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.monument import MonumentGeometry
from catseye.reduction.calibrations.budget import UNSTATED, Contribution, combined, significant
from catseye.reduction.calibrations.calibration import Quantity
from catseye.verdict import Verdict

U_OF_ANY_PHASE = math.pi / math.sqrt(3.0)  # rad: unknown angle, uniform over a turn
SUBSCRIPTS = "₁₂₃"
Reported: TypeAlias = MonumentGeometry | MirrorGeometry  # records that fill a report
FieldValue: TypeAlias = str | int | float | date | None


@dataclass(frozen=True)
class ReportEntry:
    """Field of the form.

    name    as printed in the notes
    key     key in the record
    unit    unit of the value; empty for text and for the motion chip's integers
    u       key of the standard uncertainty, if the record has one
    sense   positive direction, or description
    aid     additional notation of an angle: dms or arcsec
    """

    name: str
    key: str
    unit: str = ""
    u: str = ""
    sense: str = ""
    aid: str = ""


@dataclass(frozen=True)
class Form:
    """Report form: title and place in the notes, fields, matrix."""

    title: str
    figure: str
    record: type[Reported]
    entries: tuple[ReportEntry, ...]
    symbol: str
    matrix: str
    angles: tuple[str, ...]
    u_angles: tuple[str, ...]
    rule: str
    turned: Callable[..., np.ndarray]


@dataclass(frozen=True)
class ReportField:
    """Field with value and u from the record; None: missing.

    budget   contributions to u
    """

    entry: ReportEntry
    value: FieldValue = None
    u: float | None = None
    budget: tuple[Contribution, ...] = ()

    @property
    def number(self) -> float | None:
        """Value as a number; None for another one."""
        return float(self.value) if isinstance(self.value, int | float) else None


@dataclass(frozen=True)
class Report:
    """Form filled from a record, or blank.

    kind         monument or mirror
    file         name of the record's file, empty for a blank form
    sha256       hash of that file
    fields       in the form's order, the matrix last
    provenance   of the record: date, person, validity, report
    notes        of the record
    """

    kind: str
    file: str
    sha256: str
    fields: tuple[ReportField, ...]
    provenance: dict[str, str | date | None]
    notes: str = ""

    @property
    def missing(self) -> tuple[ReportEntry, ...]:
        """Entries missing in the record; empty for a blank form."""
        return tuple(field.entry for field in self.fields if field.value is None) if self.file else ()

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Measured numbers, with u = 0 where held and nan where the record has none; settings are integers."""
        return tuple(
            Quantity(
                key=field.entry.key,
                value=field.value,
                u=math.nan if field.u is None else field.u,
                unit=field.entry.unit,
                meaning=", ".join(filter(None, (field.entry.name, field.entry.sense))),
                budget=field.budget,
            )
            for field in self.fields
            if isinstance(field.value, float)
        )

    @property
    def verdict(self) -> Verdict:
        """Good for a blank form and for one without missing fields."""
        if not self.file:
            return Verdict("good", "a blank form, with nothing to judge")
        if self.missing:
            return Verdict("doubtful", f"{len(self.missing)} of {len(self.fields)} fields are missing in {self.file}")
        return Verdict("good", f"all {len(self.fields)} fields are in {self.file}")


def _servo(axis: int) -> tuple[ReportEntry, ...]:
    """Motion chip settings of an axis, 0 azimuth, 1 elevation."""
    commands = (
        ("ABV", "velocity", "2⁻¹⁶ counts/sample"),
        ("ABA", "acceleration", "2⁻¹⁶ counts/sample²"),
        ("FKP", "proportional gain", ""),
        ("FKI", "integral gain", ""),
        ("FKD", "derivative gain", ""),
        ("FIL", "integration limit", ""),
        ("FSI", "derivative interval", ""),
        ("ERL", "position error limit", "counts"),
    )
    return tuple(
        ReportEntry(f"{name} {axis}", f"{name.lower()}_{axis}", unit, sense=what) for name, what, unit in commands
    )


FORMS = {
    "monument": Form(
        title="Laser Monument Calibration Report",
        figure="after the notes' Figure 2.2, rev 1/20/96",
        record=MonumentGeometry,
        entries=(
            ReportEntry("ZY", "monument"),
            ReportEntry("DATE", "measured_on"),
            ReportEntry("INITIALS", "by"),
            ReportEntry("ZP NUMBER", "zp"),
            ReportEntry("CONTROL PANEL", "control_panel"),
            ReportEntry("ETHERNET ADDRESS", "ethernet_address"),
            ReportEntry("IP ADDRESS", "ip_address"),
            ReportEntry("x", "x_mm", "mm", "u_x_mm", "fixed point, east"),
            ReportEntry("y", "y_mm", "mm", "u_y_mm", "fixed point, north"),
            ReportEntry("z", "z_mm", "mm", "u_z_mm", "fixed point, up"),
            ReportEntry("azimuth", "azimuth_deg", "deg", "u_alpha1_rad", "of ẑ, clockwise from north", "dms"),
            ReportEntry(
                "α₁ (π − azimuth)", "alpha1_rad", "rad", "u_alpha1_rad", "+ : ẑ from south towards east", "dms"
            ),
            ReportEntry("α₂ (rotation about ẑ)", "alpha2_rad", "rad", "u_alpha2_rad", "+ : x̂ rises", "arcsec"),
            ReportEntry(
                "α₃ (rotation about x̂)", "alpha3_rad", "rad", "u_alpha3_rad", "+ : ẑ (v-block) sinks", "arcsec"
            ),
            ReportEntry("LATITUDE", "latitude_deg", "deg", sense="north", aid="dms"),
            ReportEntry("LONGITUDE", "longitude_deg", "deg", sense="east; west is negative", aid="dms"),
            ReportEntry("ELEVATION", "elevation_m", "m", sense="above sea level"),
            ReportEntry("WV X", "wv_x_m", "m", sense="state plane, east"),
            ReportEntry("WV Y", "wv_y_m", "m", sense="state plane, north"),
            ReportEntry("WV Z", "wv_z_m", "m", sense="NAVD88, up"),
        ),
        symbol="γ",
        matrix="gamma",
        angles=("alpha1_rad", "alpha2_rad", "alpha3_rad"),
        u_angles=("u_alpha1_rad", "u_alpha2_rad", "u_alpha3_rad"),
        rule="(x̂, ŷ, ẑ) = γ · (east, north, up), computed from α₁, α₂, α₃ by eq. 2.5",
        turned=gamma,
    ),
    "mirror": Form(
        title="Laser Mirror Assembly Calibration Report",
        figure="after the notes' Figure 2.4, rev 1/20/96",
        record=MirrorGeometry,
        entries=(
            ReportEntry("ZP", "zp"),
            ReportEntry("DATE", "measured_on"),
            ReportEntry("INITIALS", "by"),
            ReportEntry("LASER NUMBER", "laser_number"),
            ReportEntry("DETECTOR NUMBER", "detector_number"),
            ReportEntry("HEAD NUMBER", "head_number"),
            ReportEntry("OSCILLATOR NUMBER", "oscillator_number"),
            ReportEntry("LEAKAGE SIGNAL", "leakage_amplitude_volt", "V", "u_leakage_volt", "amplitude"),
            ReportEntry("LEAKAGE SIGNAL", "leakage_phase_rad", "rad", "u_leakage_volt", "phase"),
            ReportEntry("D₀", "d0_mm", "mm", "u_d0_mm", "scan point to internal cube"),
            ReportEntry("Δx", "dx_mm", "mm", "u_offset_mm", "+ : ball to scan point along x̂"),
            ReportEntry("Δy", "dy_mm", "mm", "u_offset_mm", "+ : up, along ŷ"),
            ReportEntry("Δz", "dz_mm", "mm", "u_offset_mm", "+ : towards v-block, along ẑ"),
            ReportEntry("β₁ rotation about x (θ)", "beta1_rad", "rad", "u_beta_rad", "+ : z̃ sinks", "arcsec"),
            ReportEntry("β₂ rotation about y (ϕ)", "beta2_rad", "rad", "u_beta_rad", "+ : z̃ to x̂", "arcsec"),
            ReportEntry("Nₐ₀", "na0", "counts", "u_zero_counts", "Θ = 0: beam along x̃ at Φ = 90°"),
            ReportEntry("Nₑ₀", "ne0", "counts", "u_zero_counts", "Φ = 0: beam along z̃"),
            ReportEntry("AZ LOW LIMIT", "az_low_limit", "counts"),
            ReportEntry("AZ HIGH LIMIT", "az_high_limit", "counts"),
            ReportEntry("AZM ZRG", "azm_zrg", "counts", sense="at the cube"),
            *_servo(0),
            ReportEntry("ELV ZRG", "elv_zrg", "counts", sense="at the cube"),
            *_servo(1),
        ),
        symbol="λ",
        matrix="lambda",
        angles=("beta1_rad", "beta2_rad"),
        u_angles=("u_beta_rad", "u_beta_rad"),
        rule="(x̃, ỹ, z̃) = λ · (x̂, ŷ, ẑ), computed from β₁, β₂ by eq. 2.11",
        turned=lambda_,
    ),
}
PROVENANCE = ("serial", "measured_on", "valid_until", "by", "report")


def read_report(kind: str, path: Path) -> Report:
    """Form of a kind, filled from the record in a TOML file.

    kind    monument or mirror
    path    of the record

    Raises InputError if the file is missing or not a record of this kind.
    """
    folder = Folder(path.parent)
    record = folder.record(path.name, FORMS[kind].record)
    provenance = {key: getattr(record, key) for key in PROVENANCE}
    return Report(
        kind=kind,
        file=path.name,
        sha256=folder.hashes[path.name],
        fields=_filled(FORMS[kind], record),
        provenance=provenance,
        notes=record.notes or "",
    )


def blank_report(kind: str) -> Report:
    """Blank report form of a kind."""
    return Report(kind=kind, file="", sha256="", fields=_filled(FORMS[kind], None), provenance={})


def _filled(form: Form, record: Reported | None) -> tuple[ReportField, ...]:
    """Fields of the form, the matrix last."""
    stated = [(e, getattr(record, e.key, None), _uncertainty(e, record)) for e in form.entries]
    fields = [ReportField(e, value, u, _stated(e, u)) for e, value, u in stated]
    return (*fields, *_matrix(form, record))


def _stated(entry: ReportEntry, u: float | None) -> tuple[Contribution, ...]:
    """Budget of a stated uncertainty: the record has no more than its size."""
    if not u:
        return ()
    return (Contribution("u as the record states it", u, entry.unit or "1", "B", UNSTATED, math.inf, 1.0),)


def _uncertainty(entry: ReportEntry, record: Reported | None) -> float | None:
    """Standard uncertainty of a field in its own unit."""
    u = getattr(record, entry.u, None) if entry.u else None
    if u is None or getattr(record, entry.key) is None:
        return None
    if entry.key == "azimuth_deg":
        return float(u) / DEGREE
    if entry.key == "leakage_phase_rad":  # each quadrature has u; the phase of a phasor below u is arbitrary
        amplitude = getattr(record, "leakage_amplitude_volt", None)
        return min(float(u) / amplitude, U_OF_ANY_PHASE) if amplitude else U_OF_ANY_PHASE
    return float(u)


def _matrix(form: Form, record: Reported | None) -> tuple[ReportField, ...]:
    """Nine direction cosines, row by row, with u from the angles."""
    entries = [
        ReportEntry(f"{form.symbol}{SUBSCRIPTS[i]}{SUBSCRIPTS[j]}", f"{form.matrix}_{i + 1}{j + 1}")
        for i in range(3)
        for j in range(3)
    ]
    if record is None:
        return tuple(ReportField(entry) for entry in entries)
    angles = np.array([getattr(record, key) for key in form.angles])
    u = [getattr(record, key, None) for key in form.u_angles]
    values = form.turned(*angles).ravel()
    if any(value is None for value in u):
        return tuple(ReportField(e, float(value)) for e, value in zip(entries, values, strict=True))
    sizes = np.array(u, dtype=float)
    slopes = matrix_slopes(form.turned, angles).reshape(len(angles), -1)
    fields = []
    for number, (entry, value) in enumerate(zip(entries, values, strict=True)):
        rows = [
            Contribution(key, float(size), "rad", "B", UNSTATED, math.inf, float(slope))
            for key, size, slope in zip(form.angles, sizes, slopes[:, number], strict=True)
        ]
        fields.append(ReportField(entry, float(value), combined(rows), significant(rows)))
    return tuple(fields)


def matrix_slopes(turned: Callable[..., np.ndarray], angles: np.ndarray) -> np.ndarray:
    """Derivatives (n, 3, 3) of a rotation matrix's elements by its n angles, exact.

    turned    function from the angles to the matrix
    angles    (n,), rad
    """
    quarter = 0.5 * math.pi * np.eye(len(angles))
    return np.array([0.5 * (turned(*(angles + q)) - turned(*(angles - q))) for q in quarter])
