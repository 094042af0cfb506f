"""Sentences of answers from an archive."""

from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.gateways.writers.passage import Passage

if TYPE_CHECKING:
    from catseye.records.query.sql import SqlRows
    from catseye.reduction.query.again import ReReduction
    from catseye.reduction.query.certificates import NightCertificates
    from catseye.reduction.query.nights import NightRows
    from catseye.reduction.query.point import PointSeries
    from catseye.reduction.query.pose import PoseSeries
    from catseye.reduction.query.ranger import RangerSeries
    from catseye.reduction.query.surface import SurfaceNights

MICROMETRE = 1e-6  # m
DAY_ZERO = datetime(1858, 11, 17, tzinfo=UTC)
MOST_NAMED = 6  # records named in a sentence


def date_of(mjd: float) -> str:
    """Calendar date, UTC.

    >>> date_of(61041.2)
    '2026-01-01'
    """
    return (DAY_ZERO + timedelta(days=float(mjd))).date().isoformat()


def span_of(mjd: np.ndarray) -> str:
    """Number of nights with first and last date."""
    first, last = date_of(mjd.min()), date_of(mjd.max())
    return f"1 night, {first}" if len(mjd) == 1 else f"{len(mjd)} nights, {first} to {last}"


def _range(values: np.ndarray, unit: str, form: str) -> str:
    finite = values[np.isfinite(values)]
    if not len(finite):
        return "unknown"
    low, high = format(finite.min(), form), format(finite.max(), form)
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"


def _three(values: np.ndarray, form: str) -> str:
    return ", ".join(format(value, form) for value in values)


def _circumstances(mjd: np.ndarray, elevation: np.ndarray, temperature: np.ndarray) -> Passage:
    return Passage(
        "Nights",
        f"{span_of(mjd)}; elevation {_range(elevation / DEGREE, '°', '.1f')}, air {_range(temperature, '°C', '.1f')}.",
    )


def point_passages(series: "PointSeries") -> list[Passage]:
    """Place, scatter beside the claim, and circumstances of a point's series."""
    mean, u = series.mean, np.median(series.u, axis=0) / MILLIMETRE
    frame = f"{series.frame} frame"
    passages = [
        Passage(
            "The point",
            f"{series.point}, {series.body[-1]}, on average at x {mean.place[0]:.5f}, y {mean.place[1]:.5f}, "
            f"z {mean.place[2]:.5f} m in the {frame}.",
        )
    ]
    if len(series.x) > 1:
        claim = "" if np.isnan(mean.factor) else f"; scatter over claim, squared: {mean.factor:.3g}"
        passages.append(
            Passage(
                "The scatter",
                f"x, y, z scatter by {_three(series.scatter / MILLIMETRE, '.3f')} mm, where a night claims "
                f"u {_three(u, '.3f')} mm{claim}.",
            )
        )
    passages.append(_circumstances(series.mjd, series.elevation, series.temperature_c))
    if series.unplaced:
        passages.append(Passage("Left out", f"{series.unplaced} nights have no pose of the dish."))
    return passages


def ranger_passages(series: "RangerSeries") -> list[Passage]:
    """Each parameter's drift, and the nights."""
    from catseye.reduction.query.ranger import ZERO

    passages = []
    for drift in series.drifts:
        scale, unit = (MILLIMETRE, " mm") if drift.parameter == ZERO else (1.0, "")
        title = "The zero" if drift.parameter == ZERO else drift.parameter.capitalize()
        if drift.line is None:
            text = "no night says more of it than its calibration."
        elif np.isnan(drift.rate):
            text = f"{drift.line.value / scale:+.4g}{unit} in a single night; no drift."
        else:
            clear = "a clear drift" if drift.is_clear else "no clear drift"
            text = (
                f"{drift.rate / scale:+.3g}{unit} a year, u {drift.u_rate / scale:.2g}{unit}: {clear}, by "
                f"{drift.nights} nights; scatter over claim, squared: {drift.line.factor:.3g}."
            )
        passages.append(Passage(title, text))
    nights = np.unique(series.mjd)
    passages.append(Passage("Nights", f"{span_of(nights)}; each without the calibration that all of them share."))
    return passages


def pose_passages(series: "PoseSeries") -> list[Passage]:
    """Extent of the motion, and circumstances."""
    single = len(series.night) == 1
    extent = series.motion[0] if single else np.ptp(series.motion, axis=0)
    u = np.median(series.u, axis=0)
    passages = [
        Passage(
            "The pose",
            f"{series.body}, {'off nominal by' if single else 'moved over'} "
            f"{_three(extent[:3] / MILLIMETRE, '.3f')} mm along x, y, z "
            f"(u of a night {_three(u[:3] / MILLIMETRE, '.3f')}), turned {'by' if single else 'over'} "
            f"{_three(extent[3:] / ARCSECOND, '.2f')} arcsec (u {_three(u[3:] / ARCSECOND, '.2f')}).",
        ),
        _circumstances(series.mjd, series.elevation, series.temperature_c),
    ]
    unseen = sorted({text for text in series.unobserved.tolist() if text})
    return passages + [Passage("Unobserved", f"{text}.") for text in unseen]


def surface_passages(series: "SurfaceNights") -> list[Passage]:
    """Focal length, rms, the strongest terms, circumstances, nights left out."""
    focal, rms = series.column("focal_length"), series.rms / MICROMETRE
    term = series.column("term") / MICROMETRE
    first = np.argsort(-np.ptp(term, axis=0), kind="stable")[:3].tolist()
    named = ", ".join(f"{series.terms[k].name} {_range(term[:, k], 'µm', '.0f')}" for k in first)
    passages = [
        Passage(
            "The surface",
            f"{len(series.prisms)} prisms; focal length {_range(focal, 'm', '.4f')} "
            f"(u of a night {np.median(series.column('u_focal_length')) / MILLIMETRE:.2f} mm), "
            f"half-path rms {_range(rms, 'µm', '.0f')}.",
        ),
        Passage("Terms", f"those that vary most: {named}."),
        _circumstances(series.mjd, series.elevation, series.temperature_c),
        Passage("Claim", "prisms count as independent: what air or zeros move on the whole dish is not in u."),
    ]
    if series.left_out:
        night, why = next(iter(series.left_out.items()))
        passages.append(Passage("Left out", f"{len(series.left_out)} nights, first {night}: {why}."))
    return passages


def certificates_passages(answer: "NightCertificates") -> list[Passage]:
    """Night, and the next certificate to end."""
    days = answer.left
    passages = [Passage("The night", f"{answer.night}, {date_of(answer.mjd)}: {len(days)} certificates.")]
    ahead = np.where(days > 0.0, days, np.nan)
    if np.isfinite(ahead).any():
        k = int(np.nanargmin(ahead))
        passages.append(
            Passage(
                "Next to end", f"{answer.instrument[k]}, {date_of(answer.valid_until[k])}, {days[k]:.0f} days after."
            )
        )
    return passages


def nights_passages(answer: "NightRows") -> list[Passage]:
    """Number and span of the nights."""
    if not answer.count:
        return [Passage("Nights", "none in this span.")]
    points, shots = int(answer.rows["points"].max()), int(answer.rows["shots"].sum())
    return [Passage("Nights", f"{span_of(answer.rows['mjd'])}; up to {points} points a night, {shots} shots.")]


def sql_passages(rows: "SqlRows") -> list[Passage]:
    """Rows and columns of an answer."""
    return [Passage("Answer", f"{rows.count} rows of {', '.join(rows.columns)}.")]


def again_passages(answer: "ReReduction") -> list[Passage]:
    """Differences, calibrations, shots and points in one result only."""
    at = answer.archived
    worst = int(np.argmax(np.linalg.norm(answer.change, axis=1))) if len(answer.point) else 0
    passages = [Passage("The night", f"{at.night}, {date_of(at.mjd)}, reduced by catseye {at.version} then.")]
    if len(answer.point):
        over = np.nanmax(answer.over_u, initial=0.0)
        passages.append(
            Passage(
                "Difference",
                f"{len(answer.point)} points; {answer.point[worst]} moves most, by "
                f"{_three(answer.change[worst] / MILLIMETRE, '+.4f')} mm "
                f"(u {_three(answer.u_change[worst] / MILLIMETRE, '.4f')}); up to {over:.2g} of an archived u.",
            )
        )
    if answer.changed:
        more = len(answer.changed) - MOST_NAMED
        tail = f" and {more} more" if more > 0 else ""
        passages.append(Passage("Changed", f"{', '.join(answer.changed[:MOST_NAMED])}{tail}."))
    if answer.selection:
        passages.append(Passage("Shots", f"{answer.selection} are used in one result only, which u leaves out."))
    if answer.lost or answer.new:
        passages.append(Passage("Points", f"{len(answer.lost)} only in the archive, {len(answer.new)} only today."))
    return passages
