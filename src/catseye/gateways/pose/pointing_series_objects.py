"""Pointing fits, comparisons and track profiles as JSON and text, and readers of their inputs."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np

from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import InputError
from catseye.gateways.pose.objects import FORMAT as POSE
from catseye.geometry.antenna.pointing_series import PointingSeries, published
from catseye.records.files.reading import Folder, read_record
from catseye.records.files.verdicts import stored_verdict
from catseye.records.laboratory.star_offsets import StarOffsets, read_star_offsets
from catseye.records.site.pointing_model import PointingModel, Term
from catseye.reduction.pose.pointing_fit import PointingFit, SeriesComparison
from catseye.reduction.pose.track_profile import TrackProfile
from catseye.reduction.pose.verdicts import fit_verdict
from catseye.verdict import Verdict

FORMAT = "catseye-pointing-1"
TRACK = "catseye-track-profile-1"
PUBLISHED = "published"


@dataclass(frozen=True, eq=False)
class Observed:
    """Corrections to fit: from a TPOINT file, or from poses of `catseye pose --pointing`.

    source      "stars" or "metrology"
    azimuth, elevation  (n,) rad
    correction  (n, 2) rad
    covariance  (2n, 2n) rad^2 of metrology; None for stars
    where       n places for messages
    stars       of the file, if it is one
    hashes      SHA-256 by name
    sources     verdicts of poses
    """

    source: str
    azimuth: np.ndarray
    elevation: np.ndarray
    correction: np.ndarray
    covariance: np.ndarray | None
    where: tuple[str, ...]
    stars: StarOffsets | None
    hashes: dict[str, str]
    sources: dict[str, Verdict | None] = field(default_factory=dict)


def read_observed(files: Sequence[Path]) -> Observed:
    """Corrections of one TPOINT file or several pose.json with pointing; InputError for a mixture."""
    json_files = [f for f in files if f.suffix == ".json"]
    if not json_files:
        if len(files) != 1:
            raise InputError(f"{files[1]}: a second file of stars (expected one TPOINT file, or poses as .json)")
        stars = read_star_offsets(files[0])
        where = tuple(f"{stars.file} line {k}" for k in stars.line)
        hashes = {stars.file: stars.digest}
        return Observed("stars", stars.azimuth, stars.elevation, stars.correction, None, where, stars, hashes)
    if len(json_files) != len(files):
        foreign = next(f for f in files if f not in json_files)
        raise InputError(f"{foreign}: is not .json like the poses (expected one TPOINT file, or poses only)")
    folders = [Folder(f.parent) for f in files]
    rows = [_pose(folder, f) for folder, f in zip(folders, files, strict=True)]
    q = np.zeros((2 * len(rows), 2 * len(rows)))
    for k, (_, _, spread, _) in enumerate(rows):
        q[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = spread
    hashes = {str(f): d for folder, f in zip(folders, files, strict=True) for d in folder.hashes.values()}
    angles = np.array([r[0] for r in rows])
    values = np.array([r[1] for r in rows])
    names = tuple(map(str, files))
    sources = dict(zip(names, (r[3] for r in rows), strict=True))
    return Observed("metrology", angles[:, 0], angles[:, 1], values, q, names, None, hashes, sources)


def _pose(folder: Folder, path: Path) -> tuple[tuple[float, float], np.ndarray, np.ndarray, Verdict | None]:
    """Azimuth and elevation (rad), correction (2,), covariance (2, 2) and verdict of a pose.json."""
    try:
        stored = json.loads(folder.text(path.name))
    except (ValueError, RecursionError) as problem:
        raise InputError(f"{path}: is not JSON: {problem}") from problem
    if not isinstance(stored, dict) or stored.get("format") != POSE:
        raise InputError(f"{path}: is not a pose (expected format '{POSE}', as catseye pose --out writes it)")
    if not stored.get("pointing") or not stored.get("posture"):
        raise InputError(f"{path}: has no pointing or no posture (expected both: catseye pose --pointing prime --out)")
    try:
        offset, posture = stored["pointing"], stored["posture"]
        angles = float(posture["azimuth_deg"]) * DEGREE, float(posture["elevation_deg"]) * DEGREE
        value = np.array(offset["correction"], dtype=float)[:2]
        spread = np.array(offset["covariance"], dtype=float)[:2, :2]
    except (KeyError, TypeError, ValueError, IndexError) as problem:
        raise InputError(f"{path}: pointing cannot be read: {problem}") from problem
    if value.shape != (2,) or spread.shape != (2, 2) or not np.isfinite([*angles, *value, *spread.ravel()]).all():
        raise InputError(f"{path}: pointing has wrong sizes (expected 3 numbers and 3 x 3, finite)")
    return angles, value, spread, stored_verdict(str(path), stored)


def read_series(text: str) -> tuple[PointingSeries, dict[str, str], Verdict | None]:
    """Series by name ("published") or from its TOML file, input hashes and verdict of the file."""
    if text == PUBLISHED:
        return published(), {}, None
    path = Path(text)
    folder = Folder(path.parent)
    record = folder.record(path.name, PointingModel) if path.suffix == ".toml" else read_record(path, PointingModel)
    return record.series, dict(folder.hashes), record.judged


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


def fit_object(fit: PointingFit, observed: Observed, compared: SeriesComparison | None) -> dict[str, Any]:
    """Object that `catseye pointing fit --json` prints."""
    return {
        "format": FORMAT,
        "verdict": fit_verdict(fit).to_object(),
        "source": observed.source,
        "sign": "correction: encoders minus sky; azimuth times cos E and elevation",
        **series_object(fit.series),
        "correlation": fit.correlation,
        "observations": len(fit.azimuth),
        "used": int(fit.used.sum()),
        "rejected": [where for where, used in zip(observed.where, fit.used, strict=True) if not used],
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
        "comparison": None if compared is None else comparison_object(compared),
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


def fit_words(fit: PointingFit, observed: Observed, compared: SeriesComparison | None) -> list[tuple[str, str]]:
    """Title and text of each passage, in order."""
    used_text = f"{int(fit.used.sum())} of {len(fit.used)} observations used, from {observed.source}"
    passages = [("Observed", used_text)]
    passages += [("Left out", where) for where, used in zip(observed.where, fit.used, strict=True) if not used]
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


def fit_rows(fit: PointingFit, compared: SeriesComparison | None) -> list[tuple[str, ...]]:
    """Term, value, u, and the difference with its u if compared; arcsec."""
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


def model_record(fit: PointingFit, name: str) -> PointingModel:
    """Record of the fit, rounded to a micro arc second."""
    q, judged = fit.series.covariance / ARCSECOND**2, fit_verdict(fit)
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


def track_verdict(profile: TrackProfile) -> Verdict:
    """Verdict from the scatter against the claim, undetermined parts, and the poses' verdicts."""
    return _track_verdict(profile).resting_on(profile.sources)


def _track_verdict(profile: TrackProfile) -> Verdict:
    degrees = profile.degrees_of_freedom
    if degrees < 1:
        return Verdict("doubtful", "as many readings as coefficients: the profile is unchecked")
    factor, without = profile.pvv / degrees, ""
    if profile.series.undetermined:
        without = "; without the wave of one turn, which an inclinometer alone cannot separate from its zero"
    if factor > 1.0 + 3.0 * (2.0 / degrees) ** 0.5:
        return Verdict("doubtful", f"readings scatter more than claimed (variance factor {factor:.2f}){without}")
    return Verdict("good", f"readings scatter about the profile as claimed (variance factor {factor:.2f}){without}")


def track_object(profile: TrackProfile) -> dict[str, Any]:
    """Object that `catseye pointing track --json` prints: rad."""
    series = profile.series
    axis, spread = series.axis
    return {
        "format": TRACK,
        "verdict": track_verdict(profile).to_object(),
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
