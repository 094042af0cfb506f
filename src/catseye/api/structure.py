"""`structure`: flexible models of groups of points, and vibration."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.night import NightResult
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.errors import ArgumentError, InputError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.records.network.solved_points import SolvedPoints
    from catseye.reduction.structure.epochs import ReadEpochs
    from catseye.reduction.structure.findings import StructureFindings
    from catseye.reduction.structure.series import Own
    from catseye.reduction.structure.vibration import Vibration

    Source = str | os.PathLike[str] | NightResult | SolvedPoints


@dataclass(frozen=True, eq=False, repr=False)
class StructureResult(Result):
    """Flexible model of n points of the telescope: by k functions of elevation, temperature and direction.

    found    model, epochs left out, prediction, notes
    hashes   SHA-256 of each file read, by its name
    read     files and folders that were read
    """

    found: "StructureFindings"
    hashes: dict[str, str] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the n points of the group."""
        return self.found.fit.series.names

    @property
    def functions(self) -> tuple[str, ...]:
        """Names of the k functions, the constant first."""
        return self.found.fit.model.functions

    @property
    def coefficients(self) -> np.ndarray:
        """Shift, m, and turn, rad, of the group by each function, (k, 6)."""
        return self.found.fit.six_of()[0].T

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the coefficients, (6k, 6k), function by function."""
        return self.found.fit.six_of()[1]

    @property
    def predicted(self) -> np.ndarray | None:
        """Points (e, n, 3) m at the e elevations asked for, in the frame; None without any."""
        return None if self.found.predicted is None else self.found.predicted.place

    @property
    def predicted_covariance(self) -> np.ndarray | None:
        """Covariance (e, n, 3, 3) m² of each predicted point."""
        return None if self.found.predicted is None else self.found.predicted.covariance

    def passages(self) -> "Sequence[Passage]":
        """The group, its scatter, the epochs left out, predicted points, notes."""
        from catseye.gateways.structure.objects import structure_passages

        return structure_passages(self.found)

    def rows(self) -> list[str]:
        """Lines of a terminal: shift and turn of the group by each function, with u."""
        from catseye.gateways.structure.objects import motion_lines

        return motion_lines(self.found.fit)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye structure --json`."""
        from catseye.gateways.structure.objects import structure_object

        return structure_object(self.found)

    def tables(self) -> "dict[str, QTable]":
        """`coefficients`: a row a function; `residuals`: a row a point and epoch; `prediction` where asked for."""
        series, residual = self.found.fit.series, self.found.fit.fit.residual
        six, covariance = self.found.fit.six_of()
        u = np.sqrt(np.maximum(np.diag(covariance), 0.0)).reshape(-1, 6)
        scales = [(f"shift_{axis}", MILLIMETRE, "mm") for axis in "xyz"]
        scales += [(f"turn_{axis}", ARCSECOND, "arcsec") for axis in "xyz"]
        coefficients = {
            "function": (self.functions, ""),
            **{name: (six[c] / scale, unit) for c, (name, scale, unit) in enumerate(scales)},
            **{f"u_{name}": (u[:, c] / scale, unit) for c, (name, scale, unit) in enumerate(scales)},
        }
        t, p = np.nonzero(np.isfinite(residual).all(axis=2))
        residuals = {
            "epoch": ([series.labels[k] for k in t], ""),
            "elevation": (np.asarray(series.posture.elevation)[t] / DEGREE, "deg"),
            "point": ([self.names[k] for k in p], ""),
            **{f"residual_{axis}": (residual[t, p, k] / MILLIMETRE, "mm") for k, axis in enumerate("xyz")},
        }
        tables = {"coefficients": quantities(coefficients), "residuals": quantities(residuals, frame=series.frame)}
        if self.found.predicted is not None:
            tables["prediction"] = self._prediction()
        return tables

    def _prediction(self) -> "QTable":
        """A row an elevation and point."""
        predicted = self.found.predicted
        assert predicted is not None  # its caller looked
        count = len(self.found.request.elevation_deg)
        u = np.sqrt(np.einsum("enii->eni", predicted.covariance)).reshape(-1, 3) / MILLIMETRE
        columns = {
            "elevation": (np.repeat(self.found.request.elevation_deg, len(predicted.names)), "deg"),
            "point": (list(predicted.names) * count, ""),
            **{axis: (predicted.place[..., k].ravel(), "m") for k, axis in enumerate("xyz")},
            **{f"u_{axis}": (u[:, k], "mm") for k, axis in enumerate("xyz")},
        }
        return quantities(columns, frame=self.found.fit.series.frame)

    def figures(self) -> "dict[str, Figure]":
        """Motion of the group with elevation, and residuals of the points."""
        from catseye.gateways.structure.figures import motion_figure, residual_figure

        return {
            "motion": motion_figure(self.found.fit),
            "residuals": residual_figure(self.found.fit, self.found.check),
        }

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.structure.report import structure_report

        return structure_report(self.found, when, self.hashes)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye structure --out`."""
        from catseye.gateways.structure.files import write_structure

        write_structure(self.found, directory, self.hashes, progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Files and folders that were read."""
        return self.read


@dataclass(frozen=True, eq=False, repr=False)
class VibrationResult(Result):
    """Vibration of a telescope from ranges at full rate.

    found      series, spectra, peaks, modes, notes
    zero_mjd   MJD of 0 s of the series, UTC
    hashes     SHA-256 of each file of the run, by its name
    read       journal that was read
    """

    found: "Vibration"
    zero_mjd: float
    hashes: dict[str, str] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    def passages(self) -> "Sequence[Passage]":
        """The series, the highest peaks, the modes, notes."""
        from catseye.gateways.structure.objects import vibration_passages

        return vibration_passages(self.found)

    def rows(self) -> list[str]:
        """Lines of a terminal: none besides the passages."""
        return []

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye structure --vibration --json`."""
        from catseye.gateways.structure.objects import vibration_object

        return vibration_object(self.found)

    def tables(self) -> "dict[str, QTable]":
        """`modes`: a row a mode; `peaks`: a row a peak; `spectra`: a row a series and frequency."""
        modes, peaks, spectrum = self.found.modes, self.found.peaks, self.found.spectrum
        names = [one.name for one in self.found.series]
        return {
            "modes": quantities(
                {
                    "frequency": ([mode.frequency_hz for mode in modes], "Hz"),
                    "u_frequency": ([mode.u_frequency_hz for mode in modes], "Hz"),
                    "damping_ratio": ([mode.damping_ratio for mode in modes], ""),
                    "rms": ([float(np.sqrt(mode.covariance[0, 0])) for mode in modes], "m"),
                }
            ),
            "peaks": quantities(
                {
                    "frequency": ([peak.peak.frequency_hz for peak in peaks], "Hz"),
                    "likely": ([peak.likely_hz for peak in peaks], "Hz"),
                    "decided": ([peak.decided for peak in peaks], ""),
                    "over_background": ([peak.peak.over for peak in peaks], ""),
                }
            ),
            "spectra": quantities(
                {
                    "series": (np.repeat(names, len(spectrum.frequency_hz)), ""),
                    "frequency": (np.tile(spectrum.frequency_hz, len(names)), "Hz"),
                    "density": (spectrum.density.T.ravel(), "m2 / Hz"),
                }
            ),
        }

    def figures(self) -> "dict[str, Figure]":
        """Spectra of all series, with the peaks."""
        from catseye.gateways.structure.figures import spectrum_figure

        return {"spectra": spectrum_figure(self.found)}

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.structure.report import vibration_report

        return vibration_report(self.found, when, self.hashes)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye structure --vibration --out`."""
        from catseye.gateways.structure.files import write_vibration

        write_vibration(self.found, directory, zero_mjd=self.zero_mjd, inputs=self.hashes, progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file of the run."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Journal that was read, as a path."""
        return self.read


@with_units
def structure(
    *sources: "Source",
    points: str | Sequence[str] = (),
    epochs: "str | os.PathLike[str] | None" = None,
    journal: "str | os.PathLike[str] | None" = None,
    vibration: "str | os.PathLike[str] | None" = None,
    run: Annotated[Any, In("", whole=True, text=True)] = None,
    every_s: Annotated[Any, In("s", one=True)] = 0.0,
    group: str = "group",
    frame: str = "reflector",
    pivot: Annotated[Any, In("m", many=True)] = None,
    harmonics: Annotated[Any, In("", whole=True)] = 1,
    temperature: bool = True,
    hysteresis: bool = False,
    own: "Own" = "place",
    scatter: bool = True,
    independent: bool = False,
    folds: Annotated[Any, In("", whole=True)] = 5,
    predict_deg: Annotated[Any, In("deg", many=True)] = (),
    temperature_c: Annotated[Any, In("deg_C", one=True)] = None,
    way: Annotated[Any, In("", one=True)] = 0.0,
    stretch_s: Annotated[Any, In("s", one=True)] = None,
    less: str | None = None,
    progress: Progress | None = None,
) -> StructureResult | VibrationResult:
    """Flexible model of a group of points, or its vibration.

    sources         what `reduce` gave or wrote, or folders that hold it; or `epochs`, or `journal`
    points          names of points, or patterns such as "ZEG*"
    epochs          table of reductions and the telescope's postures (docs/formats/structure.md)
    journal         journal whose solutions are the epochs
    vibration       journal whose ranges show a vibration: a VibrationResult, by points, run, stretch_s and less
    run             of the journal: number, or the beginning of its uuid; the last without
    every_s         least time between two epochs of a journal; 0: all
    group           its name, for the report
    frame           that carries the points
    pivot           (3,) m, of turns, in the frame; the middle of the points without
    harmonics       of elevation, 1 or 2
    temperature, hysteresis   a coefficient of temperature; of the way the elevation went last
    own             of each point: "place", a constant; "each", all functions
    scatter         estimate what is new in each epoch, as by wind
    independent     take points of an epoch as independent: for many hundred
    folds           stretches of epochs left out in turn, which check the model; 0: none
    predict_deg     elevations to predict, at temperature_c (the mean of the epochs without), after a way of 1, risen,
                    to -1, fallen
    stretch_s       length of a segment of a spectrum: resolution is 1.5 over it
    less            RANGER:TARGET, a series taken off each other one of its ranger
    progress        called with (what, done, of how many)

    Raises InputError for what cannot be used, EstimationError for a model that the epochs do not determine.
    """
    names = [points] if isinstance(points, str) else list(points)
    if not names:
        raise ArgumentError("points is needed: a name or a pattern such as 'ZEG*'", "points")
    if vibration is not None:
        return _vibration(str(vibration), names, run, stretch_s, less, progress)
    from catseye.reduction.structure.findings import PredictionRequest, model_structure
    from catseye.reduction.structure.group import group_series
    from catseye.reduction.structure.series import SeriesModel

    if not -1.0 <= way <= 1.0:
        raise InputError(f"way = {way:g} (expected -1, fallen, to 1, risen)")
    read, places = _read(sources, epochs, journal, run, every_s)
    place, correlated = _pivot(pivot), not independent
    series = group_series(read.epochs, names, group=group, frame=frame, pivot=place, correlated=correlated)
    model = SeriesModel(harmonics, temperature, hysteresis, own, scatter)
    request = PredictionRequest(tuple(np.atleast_1d(predict_deg).tolist()), temperature_c, way)
    found = model_structure(series, read, model=model, folds=folds, request=request, progress=progress)
    return StructureResult(verdict=found.verdict, found=found, hashes=read.inputs, read=places)


def _pivot(pivot: Sequence[float] | None) -> np.ndarray | None:
    """Pivot of turns, (3,) m; InputError for another count."""
    if pivot is None:
        return None
    if len(pivot) != 3:
        raise InputError(f"pivot has {len(pivot)} numbers (expected x, y, z in m)")
    return np.array(pivot, dtype=float)


def _read(
    sources: "Sequence[Source]",
    epochs: "str | os.PathLike[str] | None",
    journal: "str | os.PathLike[str] | None",
    run: int | str | None,
    every_s: float,
) -> "tuple[ReadEpochs, tuple[Path, ...]]":
    """Epochs of reductions or of a journal, and the files and folders read."""
    from catseye.coordinator.journal.structure import read_journal_epochs
    from catseye.records.network.solved_points import SolvedPoints
    from catseye.reduction.structure.epochs import read_epochs

    if journal is not None:
        if sources or epochs is not None:
            raise InputError("journal stands alone (expected no reductions and no epochs beside it)")
        return read_journal_epochs(str(journal), run=run, every_s=every_s), (Path(journal),)
    listed = None if epochs is None else place_of(epochs)
    found = [
        _solved(each) if isinstance(each, NightResult | SolvedPoints) else place_of(each, output=True)
        for each in sources
    ]
    places = [each for each in (*found, listed) if isinstance(each, Path)]
    return read_epochs(found, listed), tuple(places)


def _solved(source: "NightResult | SolvedPoints") -> "SolvedPoints":
    """Points of a night, or themselves."""
    from catseye.reduction.pose.dish_ways import solved_points

    if isinstance(source, NightResult):
        return replace(solved_points(source.reduction), verdict=source.verdict)
    return source


def _vibration(
    journal: str,
    points: list[str],
    run: int | str | None,
    stretch: float | None,
    less: str | None,
    progress: Progress | None,
) -> VibrationResult:
    """Spectra and modes of a journal's ranges."""
    from catseye.coordinator.journal.structure import read_range_series
    from catseye.reduction.structure.vibration import less_series
    from catseye.reduction.structure.vibration import vibration as vibration_of

    if progress is not None:
        progress("reading ranges", 0, 0)
    wanted = points if less is None else [*points, less.partition(":")[2]]
    series, hashes, zero_mjd = read_range_series(journal, wanted, run=run)
    if less is not None:
        series = less_series(series, less)
    if progress is not None:
        progress("finding modes", 0, 0)
    found = vibration_of(series, stretch=stretch)
    return VibrationResult(verdict=found.verdict, found=found, zero_mjd=zero_mjd, hashes=hashes, read=(Path(journal),))
