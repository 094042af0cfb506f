"""`baseline`: pillars of an EDM baseline, and the instrument that measured it."""

import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import date, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.laboratory import certificate_page, certificate_places
from catseye.api.reading import place_of
from catseye.api.result import Result, SinglePage, digest_of, quantities
from catseye.api.units import In, with_units
from catseye.constants import MILLIMETRE
from catseye.errors import ArgumentError
from catseye.reduction.baseline.settings import BaselineSettings

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.reduction.baseline.result import BaselineCalibration
    from catseye.reduction.calibrations.conformity import CertificateIssue

LARGEST = 1e4  # mm, ppm, °C, hPa, %: beyond it a unit was meant otherwise
HEIGHTS_M = (-9000.0, 9000.0)
ORDERS = (1, 4)  # of cyclic terms
UNCERTAINTIES = (
    "u_temperature_c", "u_pressure_hpa", "u_humidity_percent", "u_scale_ppm", "u_centring_mm", "specified_ppm",
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class BaselineResult(Result):
    """EDM baseline: n pillars along the line, and the instrument.

    pillars            names
    x                  (n, 2) m: along the line from the first pillar, and to its left
    zero, u_zero       m: observed = (1 + scale) distance + zero
    scale_ppm, u_scale_ppm   nan where no known baseline tells it
    calibration        everything else: sets, tests of ISO 17123-4, noise, budget
    hashes             SHA-256 of each file read, by its name
    issue              laboratory and job of a certificate, with statements of conformity
    read               files that were read
    provenance         of the record: serial, measured_on, by, report; None where unknown
    """

    pillars: tuple[str, ...]
    x: np.ndarray
    zero: float
    u_zero: float
    scale_ppm: float
    u_scale_ppm: float
    calibration: "BaselineCalibration"
    issue: "CertificateIssue"
    hashes: dict[str, str] = field(default_factory=dict)
    read: tuple[Path, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)

    def passages(self) -> "Sequence[Passage]":
        """The shots, zero, scale, scatter, tests, notes and conformity."""
        from catseye.gateways.baseline.objects import passages
        from catseye.gateways.calibrations.summary import conformity_passages

        return [*passages(self.calibration), *conformity_passages(self.issue.conformities)]

    def headline(self) -> "Sequence[Passage]":
        """The three passages on shots, zero and scale."""
        return self.passages()[:3]

    def rows(self) -> Iterator[str]:
        """Distances of all pairs of pillars as lines of text."""
        for s in self.calibration.spans:
            yield f"{'':<14}{s.start:>6} - {s.end:<6} {s.distance:12.5f} m   u {s.u * 1e3:.3f} mm"

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye baseline --json`."""
        from catseye.gateways.baseline.objects import baseline_object

        return baseline_object(self.calibration)

    def tables(self) -> "dict[str, QTable]":
        """`distances`: a row a pair of pillars; `pillars`: a row a pillar."""
        pairs = self.calibration.spans
        distances = {
            "from": ([s.start for s in pairs], ""),
            "to": ([s.end for s in pairs], ""),
            "distance": ([s.distance for s in pairs], "m"),
            "u_distance": ([s.u / MILLIMETRE for s in pairs], "mm"),
        }
        pillars = {"pillar": (self.pillars, ""), "x": (self.x[:, 0], "m"), "y": (self.x[:, 1], "m")}
        return {"distances": quantities(distances), "pillars": quantities(pillars)}

    def figures(self) -> "dict[str, Figure]":
        """The line, residuals, weather, corrections, and cyclic terms where there are such."""
        from catseye.gateways.baseline.figures import baseline_figures

        return baseline_figures(self.calibration)

    def pages(self) -> dict[str, SinglePage]:
        """`record`: the pillars with full covariance, to calibrate against; `certificate`, PDF or HTML by its name."""
        from catseye.gateways.baseline.certificate import baseline_subject
        from catseye.gateways.baseline.files import MARK, record_text
        from catseye.gateways.certificates.file import CertificateFile

        def text(now: datetime, path: Path) -> str:
            name = path.stem[:200] or "baseline"
            return record_text(self.calibration, self.hashes, name=name, **self.provenance)

        made = partial(baseline_subject, self.calibration, self.hashes, self.provenance)
        page = certificate_page(CertificateFile(made, self.issue))
        return {"record": SinglePage(MARK, text), "certificate": page}

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.baseline.report import baseline_report

        return baseline_report(self.calibration, when, self.hashes)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye baseline --out`."""
        from catseye.gateways.baseline.files import write_calibration

        write_calibration(self.calibration, directory, self.hashes, progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Files that `save` leaves alone: those read."""
        return self.read


@with_units
def baseline(
    observations: "str | os.PathLike[str]",
    *,
    heights: "str | os.PathLike[str] | None" = None,
    against: "str | os.PathLike[str] | None" = None,
    reference_index: Annotated[Any, In("", one=True)] = BaselineSettings.reference_index,
    wavelength_um: Annotated[Any, In("um", one=True)] = BaselineSettings.wavelength_um,
    co2_ppm: Annotated[Any, In("ppm", one=True)] = BaselineSettings.co2_ppm,
    model: str = BaselineSettings.air_model,
    corrected: bool = BaselineSettings.corrected,
    refraction: Annotated[Any, In("", one=True)] = BaselineSettings.refraction,
    reference_height_m: Annotated[Any, In("m", one=True)] = None,
    u_temperature_c: Annotated[Any, In("deg_C", difference=True, one=True)] = BaselineSettings.u_temperature_c,
    u_pressure_hpa: Annotated[Any, In("hPa", one=True)] = BaselineSettings.u_pressure_hpa,
    u_humidity_percent: Annotated[Any, In("percent", one=True)] = BaselineSettings.u_humidity_percent,
    u_scale_ppm: Annotated[Any, In("ppm", one=True)] = BaselineSettings.u_scale_ppm,
    u_direction_arcsec: Annotated[Any, In("arcsec", one=True)] = BaselineSettings.u_direction_arcsec,
    u_centring_mm: Annotated[Any, In("mm", one=True)] = BaselineSettings.u_centring_mm,
    unit_length_m: Annotated[Any, In("m", one=True)] = None,
    cyclic_orders: Annotated[Any, In("", whole=True)] = BaselineSettings.orders,
    specified_mm: Annotated[Any, In("mm", one=True)] = BaselineSettings.specified_mm,
    specified_ppm: Annotated[Any, In("ppm", one=True)] = BaselineSettings.specified_ppm,
    level: Annotated[Any, In("", one=True)] = BaselineSettings.level,
    reject: bool = BaselineSettings.reject,
    serial: str | None = None,
    measured_on: "date | str | None" = None,
    by: str | None = None,
    report: str | None = None,
    laboratory: "str | os.PathLike[str] | None" = None,
    job: "str | os.PathLike[str] | None" = None,
    progress: Progress | None = None,
) -> BaselineResult:
    """Pillars of an EDM baseline, and the instrument's errors, with tests of ISO 17123-4.

    observations         shots with their weather (docs/formats/baseline.md)
    heights, against     heights of pillars, level without; known pillars (BASELINE.toml), which fix the scale
    reference_index      group index of the displayed lengths
    wavelength_um, co2_ppm, model   carrier in vacuum, µm; carbon dioxide, ppm; formula of the index
    corrected            the lengths contain the first velocity correction already
    refraction         coefficient of refraction
    reference_height_m   height of the distances, m; None: the first pillar's
    u_temperature_c, u_pressure_hpa, u_humidity_percent   standard uncertainties common to all shots
    u_scale_ppm          of the instrument's frequency, without known pillars
    u_direction_arcsec, u_centring_mm   of a set's direction, and across the line
    unit_length_m, cyclic_orders   half a wave, m, of cyclic terms, and their orders 1 to 4; None: no such terms
    specified_mm, specified_ppm    standard deviation a + b D claimed by the maker
    level, reject        level of each test; leave out what the tests reject, one by one
    serial, measured_on, by, report   provenance of the record that `save_pages(record=...)` writes
    laboratory, job      who issues the certificate, for whom and how (docs/formats/certificates.md)
    progress             called with (what, done, of how many)

    Raises InputError: files that cannot be used; ArgumentError: an invalid setting; EstimationError: no solution.
    """
    settings = BaselineSettings(
        air_model=model, wavelength_um=wavelength_um, co2_ppm=co2_ppm, reference_index=reference_index,
        corrected=corrected, refraction=refraction, u_temperature_c=u_temperature_c, u_pressure_hpa=u_pressure_hpa,
        u_humidity_percent=u_humidity_percent, u_scale_ppm=u_scale_ppm, u_direction_arcsec=u_direction_arcsec,
        u_centring_mm=u_centring_mm, unit_length=unit_length_m, orders=cyclic_orders, specified_mm=specified_mm,
        specified_ppm=specified_ppm, level=level, reject=reject, reference_height=reference_height_m,
    )  # fmt: skip
    _require_valid(settings)
    provenance = {"serial": serial, "measured_on": _day(measured_on), "by": by, "report": report}
    issued = certificate_places(laboratory, job)
    return _calibrated((observations, heights, against), settings, provenance, issued=issued, progress=progress)


def _calibrated(
    inputs: "Sequence[str | os.PathLike[str] | None]",
    settings: BaselineSettings,
    provenance: dict[str, Any],
    *,
    issued: "tuple[Path | None, Path | None]",
    progress: Progress | None,
) -> BaselineResult:
    """Baseline from its files: observations, heights, known pillars.

    issued   records of the certificate: laboratory and job

    The text of a file is read once, with its digest.
    """
    from catseye.records.laboratory.baseline import read_baseline, read_heights, read_observations
    from catseye.reduction.baseline.certified import baseline_quantities
    from catseye.reduction.baseline.instrument import calibrate_baseline
    from catseye.reduction.calibrations.conformity import certificate_issue

    files = [None if each is None else place_of(each) for each in inputs]
    shots_file, heights_file, known_file = files
    assert shots_file is not None
    shots = read_observations(shots_file)
    hashes = {shots_file.name: shots.digest}
    tops = None
    if heights_file is not None:
        tops = read_heights(heights_file)
        hashes[heights_file.name] = tops.digest
    known = None
    if known_file is not None:
        known = read_baseline(known_file)
        hashes[known_file.name] = digest_of(known_file)
    found = calibrate_baseline(shots, tops, known, settings=settings, progress=progress)
    issue = certificate_issue(baseline_quantities(found), *issued)
    zero, u_zero = found.solution.of("zero")
    scale, u_scale = found.solution.of("scale")
    return BaselineResult(
        verdict=found.verdict,
        pillars=tuple(found.names[i] for i in found.order),
        x=np.stack([found.solution.x, found.solution.y], axis=1)[found.order],
        zero=zero,
        u_zero=u_zero,
        scale_ppm=1e6 * scale,
        u_scale_ppm=1e6 * u_scale,
        calibration=found,
        issue=issue,
        hashes=hashes,
        read=(*(path for path in files if path is not None), *issue.records.read),
        provenance=provenance,
    )


def _require_valid(settings: BaselineSettings) -> None:
    """Raise ArgumentError for a setting outside its limits."""
    for name in UNCERTAINTIES:
        value = getattr(settings, name)
        if not 0.0 <= value <= LARGEST:
            text = f"{name} = {value} is not an uncertainty of a distance meter (expected 0 to {LARGEST:g})"
            raise ArgumentError(text, name)
    above_zero = {
        "u_direction_arcsec": settings.u_direction_arcsec,
        "specified_mm": settings.specified_mm,
        "unit_length_m": settings.unit_length,
    }
    for name, value in above_zero.items():
        if value is not None and not 0.0 < value <= LARGEST:
            raise ArgumentError(f"{name} = {value} is not above zero and at most {LARGEST:g}", name)
    limits = {
        "refraction": (settings.refraction, -math.inf, math.inf),
        "reference_height_m": (settings.reference_height, *HEIGHTS_M),
        "cyclic_orders": (settings.orders, *ORDERS),
    }
    for name, (value, low, high) in limits.items():
        if value is not None and not (math.isfinite(value) and low <= value <= high):
            raise ArgumentError(f"{name} = {value} is invalid (expected {low:g} to {high:g})", name)
    if not 0.0 < settings.level < 1.0:
        raise ArgumentError(f"level = {settings.level} is not a probability between 0 and 1", "level")


def _day(day: "date | str | None") -> date | None:
    """Day of a date, or of a text as 2026-11-21."""
    if day is None or isinstance(day, date):
        return day
    try:
        return date.fromisoformat(day)
    except ValueError as problem:
        raise ArgumentError(f"measured_on = {day!r} is not a day as 2026-11-21", "measured_on") from problem
