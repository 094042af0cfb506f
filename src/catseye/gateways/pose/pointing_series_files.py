"""Files of a pointing fit and of a track profile."""

from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from catseye.constants import ARCSECOND
from catseye.errors import InputError
from catseye.gateways.pose.charts import correlation_table, fit_charts, track_charts
from catseye.gateways.pose.pointing_series_objects import (
    FORMAT,
    TRACK,
    fit_object,
    fit_words,
    model_record,
    track_object,
)
from catseye.gateways.pose.tables import OBSERVATIONS, TILT, observations_csv, tilt_csv
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.output import atomic_file
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.report import Card, ReportSection, ResultReport, TableBlock, Text, origin_section
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.report_parts import ReportTable, number, text, uncertainty
from catseye.gateways.writers.samplers_fits import SamplerColumn, SamplerTable, join_tables
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.records.files.toml_text import record_toml
from catseye.records.laboratory.star_offsets import MARK as STARS
from catseye.records.laboratory.star_offsets import star_offsets_text
from catseye.records.site.pointing_model import FORMAT as MODEL
from catseye.reduction.pose.pointing_fit import PointingFit
from catseye.reduction.pose.series_comparison import PointingFindings
from catseye.reduction.pose.track_profile import TrackProfile


def write_fit(result: PointingFindings, *, directory: Path, settings: Mapping[str, Any]) -> None:
    """Write table, JSON, model, report, and last the provenance."""
    when, fit = datetime.now(UTC), result.fit
    files: Files = {
        "observations.csv": lambda: observations_csv(result),
        "pointing.json": lambda: json_page(fit_object(result)),
        "pointing.toml": lambda: record_toml(model_record(fit, f"fit of {result.observations.name}")),
        "report.html": lambda: report_page(fit_report(result, when)),
    }
    provenance = {"format": FORMAT, "made_by": "catseye pointing fit", "settings": dict(settings)}
    write_files(files, directory, {**provenance, **origin(when, result.hashes)})
    series = SamplerTable(
        "SERIES",
        {
            "TERM": SamplerColumn("", np.array(fit.series.terms)),
            "VALUE": SamplerColumn("rad", fit.series.values),
            "COVARIANCE": SamplerColumn("rad2", fit.series.covariance, "one row per term"),
        },
        comment="pointing series, encoders minus sky",
    )
    join_tables(directory, [OBSERVATIONS], tables={"SERIES": series})


def write_model(fit: PointingFit, path: Path) -> None:
    """Write the series alone, atomically."""
    with atomic_file(path, "model", f'format = "{MODEL}"') as pieces:
        pieces.append(record_toml(model_record(fit, path.stem)))


def write_used_stars(result: PointingFindings, path: Path) -> None:
    """Write the stars that were used as TPOINT text, atomically.

    Raises InputError for observations without stars.
    """
    stars, used = result.observations.stars, result.fit.used
    if stars is None:
        raise InputError(f"stars {path}: there are no stars in poses (expected a TPOINT file)")
    columns = ("azimuth", "elevation", "azimuth_encoder", "elevation_encoder", "auxiliary")
    selected = replace(stars, **{name: getattr(stars, name)[used] for name in columns})
    with atomic_file(path, "stars", STARS) as pieces:
        pieces.append(star_offsets_text(selected))


def fit_report(result: PointingFindings, when: datetime) -> ResultReport:
    """Report of a pointing fit."""
    fit = result.fit
    u = np.sqrt(np.diag(fit.series.covariance)) / ARCSECOND
    return ResultReport(
        title=f"Pointing series from {result.observations.source}",
        subtitle=_subtitle(when),
        verdict=fit.verdict,
        cards=[
            Card(term, f"{value:+.2f}″", f"u = {w:.2f}″")
            for term, value, w in zip(fit.series.terms, fit.series.values / ARCSECOND, u, strict=True)
        ],
        passages=[Passage(title, words) for title, words in fit_words(result)],
        sections=[
            ReportSection(
                "terms",
                "Terms",
                [
                    TableBlock("terms", _terms(result)),
                    Text("ΔA cos E = CA + NPAE sin E + IA cos E + AW cos A sin E + AN sin A sin E;"),
                    Text("ΔE = −IE − AW sin A + AN cos A + HZCZ sin E + HZSZ cos E: encoders minus sky."),
                    Text("Correlations: terms near ±1 cannot be separated by these directions."),
                    TableBlock("correlations", correlation_table(fit)),
                ],
            ),
            ReportSection("residuals", "Residuals", fit_charts(fit)),
            origin_section(when, result.hashes),
        ],
        label="catseye: pointing",
    )


def _terms(result: PointingFindings) -> ReportTable:
    """Term, value and u, and the difference from the other series where compared."""
    fit, compared = result.fit, result.comparison
    columns = [
        text("term", "term", fit.series.terms),
        number("value", "value", fit.series.values / ARCSECOND, "″", 2, u="u"),
        uncertainty("u", "u", np.sqrt(np.diag(fit.series.covariance)) / ARCSECOND, "″", 2),
    ]
    if compared is not None:
        place = {term: k for k, term in enumerate(compared.terms)}
        rows = [place.get(term, -1) for term in fit.series.terms]
        u = [*np.sqrt(np.maximum(np.diag(compared.covariance), 0.0)) / ARCSECOND, np.nan]
        apart = [*np.asarray(compared.difference) / ARCSECOND, np.nan]
        columns += [
            number("difference", "minus the other", [apart[k] for k in rows], "″", 2, u="u_difference"),
            uncertainty("u_difference", "u of the difference", [u[k] for k in rows], "″", 2),
        ]
    return ReportTable(tuple(columns))


def _subtitle(when: datetime) -> str:
    return f"fitted by catseye on {when:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ"


def write_track(profile: TrackProfile, directory: Path, hashes: Mapping[str, str]) -> None:
    """Write table, JSON, report, and last the provenance."""
    when = datetime.now(UTC)
    files: Files = {
        "tilt.csv": lambda: tilt_csv(profile),
        "track.json": lambda: json_page(track_object(profile)),
        "report.html": lambda: report_page(track_report(profile, hashes, when)),
    }
    settings = {"harmonics": profile.series.harmonics}
    provenance = {"format": TRACK, "made_by": "catseye pointing track", "settings": settings}
    write_files(files, directory, {**provenance, **origin(when, hashes)})
    join_tables(directory, [TILT], frame="alidade rotated about east and north of the ground")


def track_rows(profile: TrackProfile) -> list[tuple[str, str, str]]:
    """Coefficient, value and u in arcsec; dashes if undetermined."""
    u = np.sqrt(np.diag(profile.series.covariance)) / ARCSECOND
    return [
        (name, f"{v / ARCSECOND:+.3f}", f"{w:.3f}") if np.isfinite(v) else (name, "-", "-")
        for name, v, w in zip(profile.series.names, profile.series.values, u, strict=True)
    ]


def track_lines(profile: TrackProfile) -> list[str]:
    """Lines of the coefficients."""
    return [f"{'':<14}{name:<16}{value:>10} arcsec   u {u}" for name, value, u in track_rows(profile)]


def track_words(profile: TrackProfile) -> list[tuple[str, str]]:
    """Title and text of each passage, in order."""
    (an, aw), spread = profile.series.axis
    readings = len(profile.azimuth) - profile.poses
    passages = [
        ("Observed", f"{profile.poses} poses, {readings} inclinometer readings"),
        (
            "Axis",
            f"AN {an / ARCSECOND:+.2f} ± {spread[0, 0] ** 0.5 / ARCSECOND:.2f}, "
            f"AW {aw / ARCSECOND:+.2f} ± {spread[1, 1] ** 0.5 / ARCSECOND:.2f} arcsec: positive leans north, west",
        ),
    ]
    if profile.zero is not None:
        zero, u = profile.zero[0] / ARCSECOND, np.sqrt(np.diag(profile.zero[1])) / ARCSECOND
        passages.append(
            ("Zero", f"of the inclinometer {zero[0]:+.2f} ± {u[0]:.2f}, {zero[1]:+.2f} ± {u[1]:.2f} arcsec about x, y")
        )
    if profile.series.undetermined:
        names = ", ".join(profile.series.undetermined)
        text = f"{names}: an inclinometer's zero has the same effect; poses of the alidade separate them"
        passages.append(("Undetermined", text))
    if profile.degrees_of_freedom:
        passages.append(
            (
                "Fit",
                f"chi-square {profile.pvv:.1f} with {profile.degrees_of_freedom} degrees of freedom, p {profile.p:.2g}",
            )
        )
    return passages


def _tilt_caption(profile: TrackProfile) -> str:
    without = " Without the wave of one turn, which is not determined." if profile.series.undetermined else ""
    return f"Rotation of the alidade about east and north; dashed: the mean, the axis's tilt.{without}"


def track_report(profile: TrackProfile, hashes: Mapping[str, str], when: datetime) -> ResultReport:
    """Report of a track profile."""
    names = profile.series.names
    coefficients = ReportTable(
        (
            text("coefficient", "coefficient", names),
            number("value", "value", profile.series.values / ARCSECOND, "″", 3, u="u"),
            uncertainty("u", "u", np.sqrt(np.diag(profile.series.covariance)) / ARCSECOND, "″", 3),
        )
    )
    tilt, *residuals = track_charts(profile, _tilt_caption(profile))
    return ResultReport(
        title="Track and azimuth bearing",
        subtitle=_subtitle(when),
        verdict=profile.verdict,
        passages=[Passage(title, words) for title, words in track_words(profile)],
        sections=[
            ReportSection("tilt", "Tilt by azimuth", [tilt, TableBlock("coefficients", coefficients), *residuals]),
            origin_section(when, hashes),
        ],
        label="catseye: track profile",
    )
