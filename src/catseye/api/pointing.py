"""`fit_pointing` and `predict_pointing`: the antenna's pointing series."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import ArgumentError, InputError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.geometry.antenna.pointing_series import PointingSeries
    from catseye.records.laboratory.star_offsets import StarOffsets
    from catseye.records.network.written_pose import WrittenPose
    from catseye.records.site.folder import SiteFolder
    from catseye.records.site.pointing_model import NamedSeries, PointingModel
    from catseye.records.site.structural_model import StructuralModel
    from catseye.reduction.pose.corrections import PointingObservations
    from catseye.reduction.pose.prediction import PointingPrediction
    from catseye.reduction.pose.series_comparison import PointingFindings
    from catseye.reduction.structure.beam import BeamOffset

ZENITH_DEG = 89.999  # nearer to the zenith azimuth is not defined
AXES = ("azimuth_cos_e", "elevation")


@dataclass(frozen=True, eq=False, repr=False)
class SeriesResult(Result):
    """Pointing series of k terms from n observations.

    terms       names
    values      (k,) rad
    covariance  (k, k) rad^2
    residuals   (n, 2) rad, azimuth times cos E and elevation, observed minus fitted
    used        (n,) bool
    sky_rms     rad, root mean square of the used residuals' lengths
    difference  (m,) rad, of the terms common with the other series, this minus the other; None unless compared
    findings    everything else
    settings    what was asked for
    read        files that were read
    """

    terms: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    residuals: np.ndarray
    used: np.ndarray
    sky_rms: float
    difference: np.ndarray | None
    findings: "PointingFindings"
    settings: dict[str, Any] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    def passages(self) -> "Sequence[Passage]":
        """Observations, their scatter, weak combinations and the comparison."""
        from catseye.gateways.pose.pointing_series_objects import fit_words
        from catseye.gateways.writers.passage import Passage

        return [Passage(title, text) for title, text in fit_words(self.findings)]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye pointing fit --json`."""
        from catseye.gateways.pose.pointing_series_objects import fit_object

        return fit_object(self.findings)

    def lines(self) -> list[str]:
        """Lines of the terms that the command prints."""
        from catseye.gateways.pose.pointing_series_objects import fit_lines

        return fit_lines(self.findings)

    def tables(self) -> "dict[str, QTable]":
        """`terms`: a row a term; `observations`: a row a direction."""
        fit = self.findings.fit
        terms = {
            "term": (self.terms, ""),
            "value": (self.values / ARCSECOND, "arcsec"),
            "u": (np.sqrt(np.diag(self.covariance)) / ARCSECOND, "arcsec"),
        }
        observations = {
            "place": (self.findings.observations.where, ""),
            "azimuth": (fit.azimuth / DEGREE, "deg"),
            "elevation": (fit.elevation / DEGREE, "deg"),
            **{f"correction_{axis}": (fit.observed[:, k] / ARCSECOND, "arcsec") for k, axis in enumerate(AXES)},
            **{f"residual_{axis}": (self.residuals[:, k] / ARCSECOND, "arcsec") for k, axis in enumerate(AXES)},
            **{f"w_{axis}": (fit.w[:, k], "") for k, axis in enumerate(AXES)},
            "used": (self.used, ""),
        }
        return {"terms": quantities(terms), "observations": quantities(observations)}

    def figures(self) -> "dict[str, Figure]":
        """Residuals, the same on the sky, and correlations of the terms."""
        from catseye.gateways.pose.pointing_series_figures import fit_figures

        return fit_figures(self.findings.fit)

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.pose.pointing_series_files import fit_report

        return fit_report(self.findings, when)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye pointing fit --out`."""
        from catseye.gateways.pose.pointing_series_files import write_fit

        write_fit(self.findings, directory=directory, settings=self.settings)

    def save_model(self, path: "str | os.PathLike[str]") -> None:
        """Write the series with its covariance as MODEL.toml.

        path   new, or an earlier file of catseye

        Raises InputError for another's file, one that was read, or where nothing can be written.
        """
        from catseye.gateways.pose.pointing_series_files import write_model

        write_model(self.findings.fit, self._refuse_input("model", path))

    def save_stars(self, path: "str | os.PathLike[str]") -> None:
        """Write the stars used as TPOINT text.

        path   new, or an earlier file of catseye

        Raises InputError for another's file, one that was read, a fit of poses, or where nothing can be written.
        """
        from catseye.gateways.pose.pointing_series_files import write_used_stars

        write_used_stars(self.findings, self._refuse_input("stars", path))

    def _refuse_input(self, what: str, path: "str | os.PathLike[str]") -> Path:
        """Path of a file to be written; InputError for one that was read."""
        if any(Path(path).resolve() == file.resolve() for file in self.read):
            raise InputError(f"{what} {path}: is an input (expected another file)")
        return Path(path)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.findings.hashes

    def sources(self) -> tuple[Path, ...]:
        """Files that were read, which `save` leaves alone."""
        return self.read


@with_units
def fit_pointing(
    files: "str | os.PathLike[str] | StarOffsets | Sequence[str | os.PathLike[str] | WrittenPose]",
    *,
    against: "str | os.PathLike[str] | PointingModel | None" = None,
    terms: Sequence[str] | None = None,
    u_arcsec: Annotated[Any, In("arcsec", one=True)] = None,
    reject: bool = False,
    structure: "str | os.PathLike[str] | StructuralModel | None" = None,
    site: "str | os.PathLike[str] | SiteFolder | None" = None,
    temperature_c: Annotated[Any, In("deg_C", one=True)] = None,
) -> SeriesResult:
    """Pointing series by least squares, with covariance and what it cannot tell apart.

    files      TPOINT file of stars, or several pose.json with pointing (`pose` with pointing="prime")
    against    "published", MODEL.toml or its record, or STARS.dat, which is fitted likewise: compare with it
    terms      to fit, of "IA", "IE", "CA", "NPAE", "AW", "AN", "HZCZ", "HZSZ"; all without
    u_arcsec   of each coordinate of a star; from the scatter without
    reject     leave out observations with |w| beyond 4, one by one
    structure  structural model: the series is that of what it leaves, with the same argument for `predict_pointing`
    site       its paraboloid, with `structure`
    temperature_c   of the structure, with `structure`; the model's reference without

    Raises ArgumentError for invalid terms or u_arcsec, InputError for files that cannot be used, EstimationError where
    the observations do not determine the terms.

    >>> fit = fit_pointing("pointing/stars.dat", against="published")
    >>> fit.verdict.word, len(fit.terms), bool(fit.findings.comparison.p > 0.01)
    ('good', 8, True)
    """
    from catseye.geometry.antenna.pointing_series import TERMS
    from catseye.reduction.pose.corrections import PointingObservations
    from catseye.reduction.pose.series_comparison import find_pointing

    chosen = list(TERMS) if terms is None else list(terms)
    if not chosen or len(set(chosen)) != len(chosen) or not set(chosen) <= set(TERMS):
        raise ArgumentError(f"terms = {','.join(chosen)!r} is not a selection of {','.join(TERMS)}", "terms")
    if u_arcsec is not None and not (np.isfinite(u_arcsec) and u_arcsec > 0.0):
        raise ArgumentError(f"u_arcsec = {u_arcsec} is not above zero", "u_arcsec")
    observations, read = _observations(files)
    reference = None if against is None else _reference(against)
    bend = _bend(structure, site, temperature_c)
    if bend is not None:
        observations = bend.subtracted(observations)
        reference = bend.subtracted(reference) if isinstance(reference, PointingObservations) else reference
    findings = find_pointing(
        observations,
        reference,
        terms=chosen,
        u=None if u_arcsec is None else u_arcsec * ARCSECOND,
        reject=reject,
    )
    fit = findings.fit
    named = against if against is None or isinstance(against, str | os.PathLike) else against.name
    return SeriesResult(
        verdict=findings.verdict,
        terms=fit.series.terms,
        values=fit.series.values,
        covariance=fit.series.covariance,
        residuals=fit.residual,
        used=fit.used,
        sky_rms=fit.sky_rms,
        difference=None if findings.comparison is None else findings.comparison.difference,
        findings=findings,
        settings={
            "terms": chosen,
            "u_arcsec": u_arcsec,
            "reject": reject,
            "against": None if named is None else str(named),
            "structure": None if bend is None else bend.title,
        },
        read=read if bend is None else (*read, *bend.read),
    )


@dataclass(frozen=True, eq=False)
class _StructuralBend:
    """Beam's offset by a structural model, for any directions.

    offsets   function of azimuth and elevation (n,), rad
    title     of the model
    hashes    SHA-256 of each file read, by its name
    read      files and folders that were read
    """

    offsets: "Callable[[np.ndarray, np.ndarray], BeamOffset]"
    title: str
    hashes: dict[str, str]
    read: tuple[Path, ...]

    def subtracted(self, observations: "PointingObservations") -> "PointingObservations":
        """Observations without the correction by the model."""
        bent = self.offsets(observations.azimuth, observations.elevation)
        return replace(
            observations,
            correction=observations.correction - bent.correction,
            hashes=observations.hashes | self.hashes,
        )

    def added(self, prediction: "PointingPrediction") -> "PointingPrediction":
        """Prediction with the correction by the model."""
        from catseye.reduction.pose.prediction import with_structure

        shape = prediction.azimuth.shape
        bent = self.offsets(prediction.azimuth.ravel(), prediction.elevation.ravel())
        covariance = bent.covariance[:, :2, :2].reshape(*shape, 2, 2)
        return with_structure(prediction, bent.correction.reshape(*shape, 2), covariance)


def _bend(structure: Any, site: Any, temperature_c: float | None) -> _StructuralBend | None:
    """Structural model's bend of the beam; None without a model, ArgumentError for half of the arguments."""
    if structure is None:
        for name, value in (("site", site), ("temperature_c", temperature_c)):
            if value is not None:
                raise ArgumentError(f"{name} needs structure, a structural model", name, "structure")
        return None
    if site is None:
        raise ArgumentError("structure needs site, whose paraboloid counts", "structure", "site")
    from catseye.api.telescope.displacement import antenna_from, site_from
    from catseye.geometry.antenna.deformation import TelescopePosture
    from catseye.reduction.pose.pointing_offsets import site_aperture
    from catseye.reduction.structure.beam import model_beam

    antenna, hashes, read = antenna_from(structure)
    records, more = site_from(site)
    warm = antenna.record.reference_temperature_c if temperature_c is None else float(temperature_c)
    aperture = site_aperture(records)

    def offsets(azimuth: np.ndarray, elevation: np.ndarray) -> "BeamOffset":
        return model_beam(antenna, aperture, TelescopePosture(azimuth, elevation, warm))

    return _StructuralBend(offsets, antenna.record.title, hashes | records.hashes, (*read, *more))


def _observations(files: Any) -> "tuple[PointingObservations, tuple[Path, ...]]":
    """Corrections of files or records, and the paths of the files."""
    from catseye.records.laboratory.star_offsets import StarOffsets
    from catseye.records.network.written_pose import WrittenPose
    from catseye.reduction.pose.corrections import PointingObservations, read_pointing_observations

    if isinstance(files, StarOffsets):
        return PointingObservations.of_stars(files), ()
    several = [files] if isinstance(files, str | os.PathLike) else list(files)
    if not several:
        raise ArgumentError("files is empty (expected a TPOINT file, or poses)", "files")
    records = [each for each in several if isinstance(each, WrittenPose)]
    if len(records) == len(several):
        return PointingObservations.of_poses(records), ()
    paths = tuple(place_of(each) for each in several)
    return read_pointing_observations(paths), paths


def _reference(against: "str | os.PathLike[str] | PointingModel") -> "PointingObservations | NamedSeries":
    """Series to compare with, or observations that give it."""
    from catseye.records.site.pointing_model import PUBLISHED, NamedSeries, PointingModel, read_series
    from catseye.reduction.pose.corrections import read_pointing_observations

    if isinstance(against, PointingModel):
        return NamedSeries(against.name, against.series, against.judged)
    text = str(against)
    if text == PUBLISHED:
        return read_series(text)
    path = place_of(against)
    if path.suffix == ".toml":
        return replace(read_series(path), name=text)
    return replace(read_pointing_observations([path]), name=text)


@dataclass(frozen=True, eq=False, repr=False)
class PredictionResult(Result):
    """Encoder corrections of directions (...).

    correction  (..., 2) rad, azimuth times cos E and elevation: encoders minus sky
    u           (..., 2) rad; None where the model has no covariance
    covariance  (..., 2, 2) rad^2; None likewise
    encoders    (..., 2) rad, azimuth and elevation that the encoders show
    prediction  everything else
    hashes      SHA-256 of each file read, by its name
    read        files that were read
    """

    correction: np.ndarray
    u: np.ndarray | None
    covariance: np.ndarray | None
    encoders: np.ndarray
    prediction: "PointingPrediction"
    hashes: dict[str, str] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    def passages(self) -> "Sequence[Passage]":
        """The model, and the number of directions."""
        from catseye.gateways.writers.passage import Passage

        n = self.prediction.azimuth.size
        return [Passage("Model", f"{self.prediction.model}; {n} direction{'' if n == 1 else 's'}")]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye pointing predict --json`."""
        from catseye.gateways.pose.pointing_series_objects import prediction_object

        return prediction_object(self.prediction)

    def lines(self) -> list[str]:
        """Lines of corrections and encoders that the command prints."""
        from catseye.gateways.pose.pointing_series_objects import prediction_lines

        return prediction_lines(self.prediction)

    def tables(self) -> "dict[str, QTable]":
        """`corrections`: a row a direction."""
        correction, encoders = self.correction.reshape(-1, 2), self.encoders.reshape(-1, 2)
        u = np.full(correction.shape, np.nan) if self.u is None else self.u.reshape(-1, 2)
        columns = {
            "azimuth": (self.prediction.azimuth.ravel() / DEGREE, "deg"),
            "elevation": (self.prediction.elevation.ravel() / DEGREE, "deg"),
            **{f"correction_{axis}": (correction[:, k] / ARCSECOND, "arcsec") for k, axis in enumerate(AXES)},
            **{f"u_{axis}": (u[:, k] / ARCSECOND, "arcsec") for k, axis in enumerate(AXES)},
            "azimuth_encoder": (encoders[:, 0] / DEGREE, "deg"),
            "elevation_encoder": (encoders[:, 1] / DEGREE, "deg"),
        }
        return {"corrections": quantities(columns)}

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Files that were read, which `save` leaves alone."""
        return self.read


@with_units
def predict_pointing(
    azimuth_deg: Annotated[Any, In("deg")],
    elevation_deg: Annotated[Any, In("deg")],
    *,
    model: "str | os.PathLike[str] | PointingModel | PointingSeries" = "published",
    structure: "str | os.PathLike[str] | StructuralModel | None" = None,
    site: "str | os.PathLike[str] | SiteFolder | None" = None,
    temperature_c: Annotated[Any, In("deg_C", one=True)] = None,
) -> PredictionResult:
    """Predict the encoders' corrections for directions on the sky.

    azimuth_deg     on the sky, clockwise from north, -540 to 540; broadcasts with
    elevation_deg   on the sky, -5 to 89.999
    model           "published", MODEL.toml (`SeriesResult.save_model`) or its record, or a series
    structure       structural model, whose correction is added: the series must be that of what it leaves
                    (`fit_pointing` with `structure`), else gravity counts twice
    site            its paraboloid, with `structure`
    temperature_c   of the structure, with `structure`; the model's reference without

    Raises ArgumentError for a direction outside, InputError for a model that cannot be used.

    >>> prediction = predict_pointing(145.3, 30.0)
    >>> (prediction.correction / ARCSECOND).round(2).tolist()
    [-41.58, 273.84]
    """
    from catseye.reduction.pose.prediction import predict_pointing as predict

    azimuth, elevation = np.asarray(azimuth_deg, dtype=float), np.asarray(elevation_deg, dtype=float)
    for name, values, low, high in (
        ("azimuth_deg", azimuth, -540.0, 540.0),
        ("elevation_deg", elevation, -5.0, ZENITH_DEG),
    ):
        for value in values[~((values >= low) & (values <= high))].ravel()[:1]:
            raise ArgumentError(f"{name} = {value:g} is not {low:g} to {high:g} degrees", name)
    bend = _bend(structure, site, temperature_c)
    series, read = _series(model)
    prediction = predict(series, azimuth * DEGREE, elevation * DEGREE)
    hashes = series.hashes
    if bend is not None:
        prediction, read, hashes = bend.added(prediction), (*read, *bend.read), hashes | bend.hashes
    return PredictionResult(
        verdict=prediction.verdict,
        correction=prediction.correction,
        u=prediction.u,
        covariance=prediction.covariance,
        encoders=np.stack(prediction.encoders, axis=-1),
        prediction=prediction,
        hashes=hashes,
        read=read,
    )


def _series(model: Any) -> "tuple[NamedSeries, tuple[Path, ...]]":
    """Series by name, file, record or value, and the paths of the files."""
    from catseye.geometry.antenna.pointing_series import PointingSeries
    from catseye.records.site.pointing_model import PUBLISHED, NamedSeries, PointingModel, read_series

    if isinstance(model, PointingSeries):
        return NamedSeries("series", model), ()
    if isinstance(model, PointingModel):
        return NamedSeries(model.name, model.series, model.judged), ()
    if str(model) == PUBLISHED:
        return read_series(PUBLISHED), ()
    path = place_of(model)
    return replace(read_series(path), name=str(model)), (path,)
