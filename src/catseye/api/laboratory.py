"""`calibrate`, `triplet` and `baseline`: what the laboratory and the EDM baseline say of instruments and targets."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, digest_of, quantities
from catseye.api.units import In, with_units
from catseye.constants import MILLIMETRE
from catseye.errors import InputError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.baseline.instrument import BaselineCalibration
    from catseye.reduction.baseline.lengths import BaselineSettings
    from catseye.reduction.calibrations.calibration import Calibration
    from catseye.reduction.triplet.result import TripletReduction


@dataclass(frozen=True, eq=False, repr=False)
class CalibrationResult(Result):
    """A calibration from a table of readings: q quantities.

    kind          as `catseye calibrate` calls it
    keys          names of the quantities, each with its unit
    values, u     (q,) in those units; u has all known causes together
    covariance    (q, q) in those units
    record        what can be copied into the record of the instrument
    calibration   everything else: residuals, tests, figure, provenance
    read          files that were read
    """

    kind: str
    keys: tuple[str, ...]
    values: np.ndarray
    u: np.ndarray
    covariance: np.ndarray
    record: dict[str, Any]
    calibration: "Calibration"
    read: tuple[Path, ...]

    def passages(self) -> "Sequence[Passage]":
        """Quantity, result, tests and readings."""
        from catseye.gateways.calibrations.certificate import passages
        from catseye.gateways.writers.passage import Passage

        return [Passage(title, text) for title, text in passages(self.calibration)]

    def headline(self) -> "Sequence[Passage]":
        """The calibration and what was found."""
        from itertools import takewhile

        return list(takewhile(lambda passage: passage.title in ("Calibration", "Found", ""), self.passages()))[:6]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye calibrate --json`."""
        from catseye.gateways.calibrations.certificate_record import calibration_object

        return calibration_object(self.calibration)

    def tables(self) -> "dict[str, QTable]":
        """`quantities`: a row a quantity, in its own unit, which stands beside it; `readings`: a row a reading."""
        found = self.calibration.quantities
        columns = {
            "quantity": (self.keys, ""),
            "value": (self.values, ""),
            "u": (self.u, ""),
            "coverage_factor": ([q.coverage for q in found], ""),
            "unit": ([q.unit for q in found], ""),
            "meaning": ([q.meaning for q in found], ""),
        }
        rows = list(zip(*self.calibration.rows, strict=True))
        readings = {name: (list(row), "") for name, row in zip(self.calibration.columns, rows, strict=True)}
        return {"quantities": quantities(columns), "readings": quantities(readings)}

    def figures(self) -> "dict[str, Figure]":
        """Readings and what is left of them."""
        from catseye.gateways.calibrations.certificate_figure import calibration_figure

        return {"readings": calibration_figure(self.calibration)}

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """record.toml and certificate.html, as --write and --certificate have them, with tables, figure and JSON."""
        from catseye.gateways.calibrations.certificate import certificate
        from catseye.gateways.calibrations.certificate_record import calibration_toml

        def record(now: "datetime") -> str:
            return calibration_toml(self.calibration)

        def page(now: "datetime") -> str:
            return certificate(self.calibration, now)

        self.write_files(directory, progress, {"record.toml": record, "certificate.html": page})

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the readings and of their sheet."""
        return {path.name: digest_of(path) for path in self.read if path.is_file()}

    def sources(self) -> tuple[Path, ...]:
        """The readings and their sheet."""
        return self.read


def calibrate(
    kind: str,
    readings: "str | os.PathLike[str]",
    sheet: "str | os.PathLike[str] | None" = None,
    *,
    reject: bool = False,
) -> CalibrationResult:
    """A calibration from a table of readings: quantities with covariance, residuals and tests.

    kind       what is calibrated, as `catseye calibrate --help` lists
    readings   table (docs/formats/calibrations.md)
    sheet      who, when, with what; the file beside the table with the ending .toml without
    reject     leave out readings that the tests reject, one by one

    A calibration whose tests fail is a result, too: its verdict is "failed" and its values stand.
    Raises InputError for an unknown kind and for files that cannot be used.

    >>> calibrate("linearity", "calibrations/linearity.csv").kind
    'linearity'
    """
    from catseye.gateways.calibrations.certificate_record import calibration_verdict
    from catseye.reduction.calibrations.kinds import calibrate as calibrated

    table = place_of(readings)
    beside = None if sheet is None else place_of(sheet)
    found = calibrated(kind, table, beside, reject=reject)
    return CalibrationResult(
        calibration_verdict(found),
        found.kind,
        tuple(q.key for q in found.quantities),
        np.array([q.value for q in found.quantities]),
        np.array([q.u for q in found.quantities]),
        np.asarray(found.covariance),
        dict(found.record),
        found,
        (table, table.with_suffix(".toml") if beside is None else beside),
    )


@dataclass(frozen=True, eq=False, repr=False)
class TripletsResult(Result):
    """Triplet units measured in the laboratory, n of them, in the order of their sheets.

    names         of the units
    h_corr, u_h_corr       (n,) m: ball centre above the prisms' mid-point, towards the prism side
    l_mpbc, u_l_mpbc       (n,) m: the same from the surface plate
    difference    (n,) m, of the two
    accepted      (n,) bool: |difference| within the memo's 0.15 mm
    conformity_probability   (n,)
    units         everything else: file and reduction of each sheet
    hashes        SHA-256 of each file
    """

    names: tuple[str, ...]
    h_corr: np.ndarray
    u_h_corr: np.ndarray
    l_mpbc: np.ndarray
    u_l_mpbc: np.ndarray
    difference: np.ndarray
    accepted: np.ndarray
    conformity_probability: np.ndarray
    units: "tuple[tuple[Path, TripletReduction], ...]"
    hashes: dict[Path, str] = field(default_factory=dict)

    def passages(self) -> "Sequence[Passage]":
        """The heights, their difference and what is worth knowing, unit by unit."""
        from catseye.gateways.triplet.sheet import results
        from catseye.gateways.writers.passage import Passage

        told = []
        for path, unit in self.units:
            named = [Passage(unit.measurement.triplet, path.name)] if len(self.units) > 1 else []
            told += [*named, *(Passage(title, text) for title, text in results(unit))]
        return told

    def to_object(self) -> Any:
        """JSON object of `catseye triplet --json`: one object, or a list of them for several sheets."""
        from catseye.gateways.triplet.objects import triplet_object

        objects = [triplet_object(unit, path.name) for path, unit in self.units]
        return objects[0] if len(objects) == 1 else objects

    def tables(self) -> "dict[str, QTable]":
        """`triplets`: a row a unit."""
        columns = {
            "triplet": (self.names, ""),
            "h_corr": (self.h_corr / MILLIMETRE, "mm"),
            "u_h_corr": (self.u_h_corr / MILLIMETRE, "mm"),
            "l_mpbc": (self.l_mpbc / MILLIMETRE, "mm"),
            "u_l_mpbc": (self.u_l_mpbc / MILLIMETRE, "mm"),
            "difference": (self.difference / MILLIMETRE, "mm"),
            "accepted": (self.accepted, ""),
            "conformity_probability": (self.conformity_probability, ""),
        }
        return {"triplets": quantities(columns)}

    def figures(self) -> "dict[str, Figure]":
        """The placements of each unit against its limits."""
        from catseye.gateways.triplet.figure import triplet_figure

        return {path.stem: triplet_figure(unit) for path, unit in self.units}

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye triplet --out`."""
        from catseye.gateways.triplet.files import write_triplets

        write_triplets(dict(self.units), directory, self.hashes, progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each sheet, by its name."""
        return {path.name: digest for path, digest in self.hashes.items()}

    def sources(self) -> tuple[Path, ...]:
        """Files of the sheets, which `save` leaves alone."""
        return tuple(path for path, _ in self.units)


def triplet(*sheets: "str | os.PathLike[str]", progress: Progress | None = None) -> TripletsResult:
    """Triplet units from their laboratory sheets: H_corr with uncertainty, accepted or not.

    sheets     files of measured units (docs/formats/triplet.md)
    progress   called with (what, done, of how many)

    Raises InputError for a sheet that cannot be used, and without any.

    >>> triplet("triplets/TR01.toml").accepted.tolist()
    [True]
    """
    from catseye.gateways.triplet.objects import triplet_verdict
    from catseye.gateways.writers.verdict import worst
    from catseye.records.files.reading import Folder
    from catseye.records.laboratory.triplet_measurement import TripletMeasurement
    from catseye.reduction.triplet.unit import reduce_triplet

    if not sheets:
        raise InputError("triplet needs a sheet (expected one file or more)")
    units: list[tuple[Path, TripletReduction]] = []
    hashes: dict[Path, str] = {}
    for done, sheet in enumerate(sheets):
        path = place_of(sheet)
        if progress is not None:
            progress("reducing", done, len(sheets))
        folder = Folder(path.parent)
        units.append((path, reduce_triplet(folder.record(path.name, TripletMeasurement))))
        hashes[path] = folder.hashes[path.name]
    found = [unit for _, unit in units]
    return TripletsResult(
        worst([triplet_verdict(unit) for unit in found]),
        tuple(unit.measurement.triplet for unit in found),
        np.array([unit.h_corr for unit in found]),
        np.array([unit.u_h_corr for unit in found]),
        np.array([unit.l_mpbc for unit in found]),
        np.array([unit.u_l_mpbc for unit in found]),
        np.array([unit.difference for unit in found]),
        np.array([unit.accepted for unit in found]),
        np.array([unit.conformity_probability for unit in found]),
        tuple(units),
        hashes,
    )


@dataclass(frozen=True, eq=False, repr=False)
class BaselineResult(Result):
    """An EDM baseline: n pillars in their order along the line, and the instrument that measured it.

    pillars            names
    x                  (n, 2) m: along the line from the first pillar, and to its left
    zero, u_zero       m: observed = (1 + scale) distance + zero
    scale_ppm, u_scale_ppm   nan where no known baseline tells it
    calibration        everything else: sets, tests of ISO 17123-4, noise, budget
    hashes             SHA-256 of each file read, by its name
    read               files that were read
    """

    pillars: tuple[str, ...]
    x: np.ndarray
    zero: float
    u_zero: float
    scale_ppm: float
    u_scale_ppm: float
    calibration: "BaselineCalibration"
    hashes: dict[str, str] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    def passages(self) -> "Sequence[Passage]":
        """The shots, zero, scale, scatter, tests and notes."""
        from catseye.gateways.baseline.objects import passages

        return passages(self.calibration)

    def headline(self) -> "Sequence[Passage]":
        """The three passages on shots, zero and scale."""
        return self.passages()[:3]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye baseline --json`."""
        from catseye.gateways.baseline.objects import baseline_object

        return baseline_object(self.calibration)

    def tables(self) -> "dict[str, QTable]":
        """`distances`: a row a pair of pillars; `pillars`: a row a pillar."""
        from catseye.gateways.baseline.objects import spans

        pairs = spans(self.calibration)
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
    settings: Annotated["BaselineSettings | None", In("name")] = None,
    progress: Progress | None = None,
) -> BaselineResult:
    """Pillars of an EDM baseline, and an instrument's zero, scale and cyclic terms, with ISO 17123-4's tests.

    observations   shots with their weather (docs/formats/baseline.md)
    heights        of pillars; level without
    against        known pillars (BASELINE.toml): finds the instrument's scale, too
    settings       air, instrument's claims, levels of tests: `catseye.reduction.baseline.lengths.BaselineSettings`;
                   those of `catseye baseline` without
    progress       called with (what, done, of how many)

    Raises InputError for files that cannot be used and EstimationError where the pillars do not settle.
    """
    from catseye.gateways.baseline.objects import baseline_verdict
    from catseye.records.laboratory.baseline import read_baseline, read_heights, read_observations
    from catseye.reduction.baseline.instrument import calibrate_baseline
    from catseye.reduction.baseline.lengths import BaselineSettings

    given = [None if each is None else place_of(each) for each in (observations, heights, against)]
    shots_file, heights_file, known_file = given
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
    found = calibrate_baseline(shots, tops, known, settings=settings or BaselineSettings(), progress=progress)
    zero, u_zero = found.solution.of("zero")
    scale, u_scale = found.solution.of("scale")
    return BaselineResult(
        baseline_verdict(found),
        tuple(found.names[i] for i in found.order),
        np.stack([found.solution.x, found.solution.y], axis=1)[found.order],
        zero,
        u_zero,
        1e6 * scale,
        1e6 * u_scale,
        found,
        hashes,
        tuple(path for path in given if path is not None),
    )
