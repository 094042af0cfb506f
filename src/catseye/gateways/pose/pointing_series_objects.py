"""Pointing fits, comparisons, predictions and track profiles as JSON and text."""

from typing import Any, cast

import numpy as np

from catseye.constants import ARCSECOND, DEGREE
from catseye.geometry.antenna.pointing_series import PointingSeries
from catseye.records.site.pointing_model import PointingModel, Term
from catseye.reduction.pose.pointing_fit import PointingFit
from catseye.reduction.pose.prediction import PointingPrediction
from catseye.reduction.pose.series_comparison import PointingFindings, SeriesComparison
from catseye.reduction.pose.track_profile import TrackProfile

FORMAT = "catseye-pointing-1"
TRACK = "catseye-track-profile-1"
AXES = ("azimuth times cos E", "elevation")  # of a correction


def series_object(series: PointingSeries) -> dict[str, Any]:
    """Terms in arcsec with covariance; null if unknown."""
    has_covariance = bool(np.any(series.covariance != 0.0))
    u = np.sqrt(np.diag(series.covariance)) / ARCSECOND
    return {
        "terms": list(series.terms),
        "values_arcsec": dict(zip(series.terms, series.values / ARCSECOND, strict=True)),
        "u_arcsec": dict(zip(series.terms, u, strict=True)) if has_covariance else None,
        "covariance_arcsec2": series.covariance / ARCSECOND**2 if has_covariance else None,
    }


def fit_object(result: PointingFindings) -> dict[str, Any]:
    """Object that `catseye pointing fit --json` prints."""
    fit, observations, comparison = result.fit, result.observations, result.comparison
    return {
        "format": FORMAT,
        "verdict": fit.verdict.to_object(),
        "source": observations.source,
        "sign": "correction: encoders minus sky; azimuth times cos E and elevation",
        **series_object(fit.series),
        "correlation": fit.correlation,
        "observations": len(fit.azimuth),
        "used": int(fit.used.sum()),
        "rejected": [where for where, used in zip(observations.where, fit.used, strict=True) if not used],
        "sky_rms_arcsec": fit.sky_rms / ARCSECOND,
        "chi2": fit.pvv,
        "degrees_of_freedom": fit.degrees_of_freedom,
        "variance_factor": fit.variance_factor,
        "scaled_by_variance_factor": fit.scaled,
        "condition": fit.condition,
        "weak": [
            {"parts": w.parts, "u_arcsec": w.u / ARCSECOND, "u_on_the_sky_arcsec": w.u_on_the_sky / ARCSECOND}
            for w in fit.weak
        ],
        "comparison": None if comparison is None else comparison_object(comparison),
    }


def comparison_object(comparison: SeriesComparison) -> dict[str, Any]:
    """Object of this fit minus the other."""
    u = np.sqrt(np.maximum(np.diag(comparison.covariance), 0.0)) / ARCSECOND
    return {
        "difference_arcsec": dict(zip(comparison.terms, comparison.difference / ARCSECOND, strict=True)),
        "u_difference_arcsec": dict(zip(comparison.terms, u, strict=True)),
        "chi2": comparison.chi2,
        "degrees_of_freedom": len(comparison.terms),
        "p": comparison.p,
        "rms_on_the_sky_arcsec": comparison.rms_on_the_sky / ARCSECOND,
        "u_rms_on_the_sky_arcsec": float(np.sqrt(np.mean(np.sum(comparison.u_on_the_sky**2, axis=1)))) / ARCSECOND,
    }


def fit_words(result: PointingFindings) -> list[tuple[str, str]]:
    """Title and text of each passage, in order."""
    fit, observations, compared = result.fit, result.observations, result.comparison
    used_text = f"{int(fit.used.sum())} of {len(fit.used)} observations used, from {observations.source}"
    passages = [("Observed", used_text)]
    passages += [("Left out", where) for where, used in zip(observations.where, fit.used, strict=True) if not used]
    scatter = "uncertainties are from the scatter" if fit.scaled else f"variance factor {fit.variance_factor:.2f}"
    passages.append(
        ("Sky rms", f"{fit.sky_rms / ARCSECOND:.2f} arcsec, {fit.degrees_of_freedom} degrees of freedom; {scatter}")
    )
    passages += [("Weak", w.text) for w in fit.weak]
    if compared is not None:
        agree = f"; chi-square {compared.chi2:.1f} of {len(compared.terms)} terms, p {compared.p:.2g}"
        passages.append(
            (
                "Compared",
                f"{compared.rms_on_the_sky / ARCSECOND:.2f} arcsec rms apart on the sky between 10 and 80 degrees of "
                f"elevation{agree if np.isfinite(compared.chi2) else ''}",
            )
        )
    return passages


def fit_rows(result: PointingFindings) -> list[tuple[str, ...]]:
    """Term, value, u, and the difference with its u if compared; arcsec."""
    fit, compared = result.fit, result.comparison
    u = np.sqrt(np.diag(fit.series.covariance)) / ARCSECOND
    rows: list[tuple[str, ...]] = []
    for k, term in enumerate(fit.series.terms):
        row = [term, f"{fit.series.values[k] / ARCSECOND:+.2f}", f"{u[k]:.2f}"]
        if compared is not None:
            i = compared.terms.index(term) if term in compared.terms else -1
            apart = np.sqrt(np.maximum(np.diag(compared.covariance), 0.0)) / ARCSECOND
            row += [f"{compared.difference[i] / ARCSECOND:+.2f}", f"{apart[i]:.2f}"] if i >= 0 else ["", ""]
        rows.append(tuple(row))
    return rows


def fit_lines(result: PointingFindings) -> list[str]:
    """Lines of the terms under their heads."""
    heads = ("term", "arcsec", "u", *(("difference", "u") if result.comparison is not None else ()))
    return [f"{'':<14}{row[0]:<6}" + "".join(f"{cell:>12}" for cell in row[1:]) for row in (heads, *fit_rows(result))]


def model_record(fit: PointingFit, name: str) -> PointingModel:
    """Record of the fit, rounded to a micro arc second."""
    q, judged = fit.series.covariance / ARCSECOND**2, fit.verdict
    return PointingModel(
        format="catseye-pointing-series-1",
        name=name[:200] or "pointing",
        terms=cast("tuple[Term, ...]", fit.series.terms),
        values_arcsec=tuple(round(float(v), 6) for v in fit.series.values / ARCSECOND),
        covariance_arcsec2=tuple(tuple(float(f"{v:.12g}") for v in row) for row in 0.5 * (q + q.T)),
        sky_rms_arcsec=round(fit.sky_rms / ARCSECOND, 6),
        verdict=None if judged.word == "good" else judged.word,
        why="" if judged.word == "good" else judged.why,
    )


def prediction_object(prediction: PointingPrediction) -> dict[str, Any]:
    """Object that `catseye pointing predict --json` prints: rad, encoders in degrees."""
    return {
        "verdict": prediction.verdict.to_object(),
        "model": prediction.model,
        "order": list(AXES),
        "correction": prediction.correction,
        "covariance": prediction.covariance,
        "structure": prediction.structure,
        "encoders": {
            "azimuth_deg": prediction.encoders[0] / DEGREE,
            "elevation_deg": prediction.encoders[1] / DEGREE,
        },
    }


def prediction_lines(prediction: PointingPrediction) -> list[str]:
    """Lines of corrections and encoders, three a direction."""
    values, encoders = np.atleast_2d(prediction.correction), np.atleast_2d(np.stack(prediction.encoders, axis=-1))
    u = None if prediction.u is None else np.atleast_2d(prediction.u)
    lines = []
    for k, pair in enumerate(values):
        for axis, name in enumerate(AXES):
            u_text = f"u {u[k, axis] / ARCSECOND:.3f}" if u is not None else "u unknown"
            lines.append(f"{name:<22}{pair[axis] / ARCSECOND:+12.3f} arcsec   {u_text}")
        lines.append(f"{'encoders':<22}{encoders[k, 0] / DEGREE:12.6f} {encoders[k, 1] / DEGREE:12.6f} deg")
    return lines


def track_object(profile: TrackProfile) -> dict[str, Any]:
    """Object that `catseye pointing track --json` prints: rad."""
    series = profile.series
    axis, spread = series.axis
    return {
        "format": TRACK,
        "verdict": profile.verdict.to_object(),
        "frame": "ground: rotations of the alidade about east and north",
        "harmonics": series.harmonics,
        "coefficients": dict(zip(series.names, series.values, strict=True)),
        "u_coefficients": dict(zip(series.names, np.sqrt(np.diag(series.covariance)), strict=True)),
        "undetermined": list(series.undetermined),
        "covariance": series.covariance,
        "AN": axis[0],
        "AW": axis[1],
        "covariance_AN_AW": spread,
        "inclinometer_zero": None if profile.zero is None else profile.zero[0],
        "u_inclinometer_zero": None if profile.zero is None else np.sqrt(np.diag(profile.zero[1])),
        "poses": profile.poses,
        "readings": len(profile.azimuth) - profile.poses,
        "chi2": profile.pvv,
        "degrees_of_freedom": profile.degrees_of_freedom,
        "p": profile.p,
    }
