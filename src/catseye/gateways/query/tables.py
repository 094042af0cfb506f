"""Tables of answers from an archive."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.gateways.writers.columns import Column, Table

if TYPE_CHECKING:
    from catseye.reduction.query.again import ReReduction
    from catseye.reduction.query.certificates import NightCertificates
    from catseye.reduction.query.nights import NightRows
    from catseye.reduction.query.point import PointSeries
    from catseye.reduction.query.pose import PoseSeries
    from catseye.reduction.query.ranger import RangerSeries
    from catseye.reduction.query.surface import SurfaceSeries

MICROMETRE = 1e-6  # m
PAGE = "query.md"
AXES = "xyz"


def _night() -> Column[Any]:
    return Column("night", "", "identifier of the night", lambda s: s.night)


def _mjd() -> Column[Any]:
    return Column("mjd_utc", "d", "middle of the night's shots, Modified Julian Date", lambda s: s.mjd, ".6f")


def _posture() -> tuple[Column[Any], ...]:
    return (
        Column("azimuth_deg", "deg", "azimuth of the telescope", lambda s: s.azimuth / DEGREE, ".4f"),
        Column("elevation_deg", "deg", "elevation of the telescope", lambda s: s.elevation / DEGREE, ".4f"),
        _temperature(),
    )


def _temperature() -> Column[Any]:
    doc = "air temperature, mean of the night"
    return Column("temperature_c", "deg_C", doc, lambda s: s.temperature_c, ".3f")


def _axis(of: Callable[[Any], np.ndarray], k: int, source: Any) -> np.ndarray:
    return of(source)[:, k]


def _three(
    name: str, unit: str, doc: str, of: Callable[[Any], np.ndarray], form: str, *, suffix: str = ""
) -> tuple[Column[Any], ...]:
    """Column for each axis of a vector a row."""
    ending = f"_{suffix or unit}"
    return tuple(
        Column(f"{name}{axis}{ending}", unit, f"{doc} {axis}", partial(_axis, of, k), form)
        for k, axis in enumerate(AXES)
    )


POINT: "Table[PointSeries]" = Table(
    "point.csv",
    PAGE,
    (
        _night(),
        _mjd(),
        Column("body", "", "kind of the point", lambda s: s.body),
        *_three("", "m", "coordinate", lambda s: s.x, ".7f"),
        *_three("u_", "mm", "standard uncertainty of", lambda s: s.u / MILLIMETRE, ".4f"),
        *_three("deviation_", "mm", "coordinate less its weighted mean,", lambda s: s.deviation / MILLIMETRE, ".4f"),
        Column("shots", "", "used shots to or from it", lambda s: s.shots),
        *_posture(),
    ),
)
ZEROS: "Table[RangerSeries]" = Table(
    "zeros.csv",
    PAGE,
    (
        Column(
            "parameter", "", "`zero` (m), or another parameter of the ranger in its own unit", lambda s: s.parameter
        ),
        _night(),
        _mjd(),
        Column("value", "", "estimate of the night, calibration included", lambda s: s.value),
        Column("u", "", "its standard uncertainty", lambda s: s.u),
        Column("own", "", "estimate by the night's observations alone", lambda s: s.own[0]),
        Column("u_own", "", "its standard uncertainty", lambda s: s.own[1]),
        Column("prior", "", "value of the calibration", lambda s: s.prior),
        Column("u_prior", "", "its standard uncertainty", lambda s: s.u_prior),
        _temperature(),
    ),
)
DRIFT: "Table[RangerSeries]" = Table(
    "drift.csv",
    PAGE,
    (
        Column("parameter", "", "as in zeros.csv", lambda s: [d.parameter for d in s.drifts]),
        Column("nights", "", "number that say something of it", lambda s: [d.nights for d in s.drifts]),
        Column("rate", "", "of the line through them, a year of 365.25 days", lambda s: [d.rate for d in s.drifts]),
        Column(
            "u_rate", "", "its standard uncertainty, from claim and scatter", lambda s: [d.u_rate for d in s.drifts]
        ),
        Column(
            "factor",
            "",
            "squared scatter about the line over the claim, expectation 1",
            lambda s: [float("nan") if d.line is None else d.line.factor for d in s.drifts],
            ".3f",
        ),
    ),
)
POSE: "Table[PoseSeries]" = Table(
    "pose.csv",
    PAGE,
    (
        _night(),
        _mjd(),
        Column("frame", "", "of the vectors", lambda s: s.frame),
        *_three("translation_", "mm", "translation from nominal,", lambda s: s.translation / MILLIMETRE, ".4f"),
        *_three("rotation_", "arcsec", "rotation vector from nominal,", lambda s: s.rotation / ARCSECOND, ".4f"),
        *_three("u_translation_", "mm", "u of translation", lambda s: s.u[:, :3] / MILLIMETRE, ".4f"),
        *_three("u_rotation_", "arcsec", "u of rotation", lambda s: s.u[:, 3:] / ARCSECOND, ".4f"),
        *_posture(),
        Column("unobserved", "", "directions that the night does not show", lambda s: s.unobserved),
    ),
)
SURFACE: "Table[SurfaceSeries]" = Table(
    "surface.csv",
    PAGE,
    (
        _night(),
        _mjd(),
        Column("prisms", "", "number of prisms", lambda s: [len(each.rows) for each in s.surfaces]),
        Column("focal_length_m", "m", "of the best paraboloid", lambda s: s.column("focal_length"), ".6f"),
        Column(
            "u_focal_length_mm",
            "mm",
            "standard uncertainty from those of the prisms",
            lambda s: s.column("u_focal_length") / MILLIMETRE,
            ".4f",
        ),
        Column(
            "rms_um",
            "um",
            "half-path error of the surface alone; empty where the noise hides it",
            lambda s: s.rms / MICROMETRE,
            ".2f",
        ),
        Column(
            "measured_rms_um",
            "um",
            "half-path error as measured, noise included",
            lambda s: np.sqrt(np.maximum(s.column("measured"), 0.0)) / MICROMETRE,
            ".2f",
        ),
        Column(
            "noise_rms_um",
            "um",
            "expected part of the prisms' uncertainties",
            lambda s: np.sqrt(s.column("noise")) / MICROMETRE,
            ".2f",
        ),
        *_posture(),
    ),
)


def _for_terms(of: Callable[["SurfaceSeries"], np.ndarray], source: "SurfaceSeries") -> np.ndarray:
    """Value of each night for each of its terms."""
    return np.repeat(of(source), len(source.terms))


TERMS: "Table[SurfaceSeries]" = Table(
    "terms.csv",
    PAGE,
    (
        Column("night", "", "identifier of the night", partial(_for_terms, lambda s: s.night)),
        Column("mjd_utc", "d", "as in surface.csv", partial(_for_terms, lambda s: s.mjd), ".6f"),
        Column(
            "elevation_deg",
            "deg",
            "elevation of the telescope",
            partial(_for_terms, lambda s: s.elevation / DEGREE),
            ".4f",
        ),
        Column("temperature_c", "deg_C", "air temperature", partial(_for_terms, lambda s: s.temperature_c), ".3f"),
        Column("term", "", "Zernike term", lambda s: [term.name for term in s.terms] * len(s.night)),
        Column(
            "term_um",
            "um",
            "its part of the half-path errors, rms",
            lambda s: s.column("term").ravel() / MICROMETRE,
            ".3f",
        ),
        Column(
            "u_term_um",
            "um",
            "standard uncertainty from those of the prisms",
            lambda s: s.column("u_term").ravel() / MICROMETRE,
            ".3f",
        ),
    ),
)
PRISMS: "Table[SurfaceSeries]" = Table(
    "prisms.csv",
    PAGE,
    (
        Column("point", "", "prism", lambda s: s.prisms),
        Column("x_m", "m", "mean x in the nominal reflector frame", lambda s: s.places[:, 0], ".4f"),
        Column("y_m", "m", "mean y in the nominal reflector frame", lambda s: s.places[:, 1], ".4f"),
        Column("nights", "", "number of nights", lambda s: s.of_prisms()[0]),
        Column("half_path_um", "um", "mean half-path error", lambda s: s.of_prisms()[1] / MICROMETRE, ".2f"),
        Column(
            "scatter_um",
            "um",
            "standard deviation over the nights",
            lambda s: s.of_prisms()[2] / MICROMETRE,
            ".2f",
        ),
    ),
)
CERTIFICATES: "Table[NightCertificates]" = Table(
    "certificates.csv",
    PAGE,
    (
        Column("instrument", "", "name of the record", lambda s: s.instrument),
        Column("kind", "", "`mirror`, `monument`, `triplet` or `site`", lambda s: s.kind),
        Column(
            "validity",
            "",
            "`valid`, `expired`, `measured later` or `no end stated`, on the night",
            lambda s: [v.value for v in s.validity],
        ),
        Column("left_d", "", "days from the night to the end of the last valid day", lambda s: s.left, ".1f"),
        Column("valid_from_utc", "d", "day of measurement, Modified Julian Date", lambda s: s.valid_from, ".0f"),
        Column("valid_until_utc", "d", "last valid day, Modified Julian Date", lambda s: s.valid_until, ".0f"),
        Column("value", "", "main value of the record", lambda s: s.value),
        Column("u", "", "its standard uncertainty", lambda s: s.u),
        Column("unit", "", "unit of both", lambda s: s.unit),
        Column("file", "", "file of the record in the campaign", lambda s: s.file),
        Column("sha256", "", "SHA-256 of that file", lambda s: s.sha256),
    ),
)


def _stored(name: str, source: "NightRows") -> np.ndarray:
    return source.rows[name]


def _as_stored(name: str, doc: str, form: str = "") -> Column["NightRows"]:
    return Column(name, "", doc, partial(_stored, name), form)


NIGHTS: "Table[NightRows]" = Table(
    "nights.csv",
    PAGE,
    (
        _as_stored("night", "identifier"),
        Column("mjd_utc", "d", "middle of the shots, Modified Julian Date", lambda s: s.rows["mjd"], ".6f"),
        _as_stored("name", "name of the campaign, or of site and run"),
        _as_stored("source", "`campaign` or `journal`"),
        _as_stored("points", "number of points"),
        _as_stored("shots", "number of shots"),
        _as_stored("rejected", "number of rejected shots"),
        _as_stored("variance_factor", "[pvv] over degrees of freedom", ".4f"),
        Column("azimuth_deg", "deg", "azimuth of the telescope", lambda s: s.rows["azimuth"] / DEGREE, ".4f"),
        Column("elevation_deg", "deg", "elevation of the telescope", lambda s: s.rows["elevation"] / DEGREE, ".4f"),
        Column("temperature_c", "deg_C", "air temperature", lambda s: s.rows["temperature_c"], ".3f"),
        _as_stored("version", "version of catseye that made the result"),
        _as_stored("verdict", "`good`, `doubtful` or `failed`"),
        _as_stored("why", "reason of the verdict"),
        _as_stored("digest", "SHA-256 over the result"),
    ),
)
AGAIN: "Table[ReReduction]" = Table(
    "again.csv",
    PAGE,
    (
        Column("point", "", "point", lambda s: s.point),
        Column("body", "", "kind of the point", lambda s: s.body),
        *_three("d", "mm", "today's less archived", lambda s: s.change / MILLIMETRE, ".5f"),
        *_three("u_d", "mm", "standard uncertainty of the difference", lambda s: s.u_change / MILLIMETRE, ".5f"),
        Column("over_u", "", "largest difference of an axis over its archived u", lambda s: s.over_u, ".3f"),
        *_three("", "m", "today's", lambda s: s.x, ".7f"),
        *_three("u_", "mm", "standard uncertainty of today's", lambda s: s.u / MILLIMETRE, ".4f"),
    ),
)
