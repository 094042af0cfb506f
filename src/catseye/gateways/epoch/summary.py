"""Summary of a reduction in sentences, for readers outside the project."""

from collections import Counter

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE, SECONDS_PER_DAY
from catseye.gateways.epoch.record_tests import checks_sentences, records_sentence
from catseye.gateways.epoch.tables import kinds_of
from catseye.gateways.epoch.third_order import third_order_passage
from catseye.gateways.writers.passage import Passage
from catseye.records.night.campaign import REFERENCE
from catseye.reduction.epoch.epoch import Reduction
from catseye.reduction.epoch.reason import ShotStatus
from catseye.reduction.epoch.verdict import factor_spread

MEANING = {
    "blocked": "no return",
    "reflected": "stray reflection",
    "undecided": "shots that contradict each other, cause undetermined",
    "clipped": "the converter was overdriven",
    "dead": "converter or cable fault",
    "noise unknown": "too few samples to estimate the noise",
    "bad reference": "obstruction in the beam of the internal cube",
    "no reference": "the drift of the electronics is unknown",
}


def passages(reduction: Reduction) -> list[Passage]:
    """Passages on the night, shots, feed arm, dish, air, records and reliability."""
    records = records_sentence(reduction.coordinates)
    return [
        Passage("The night", _night(reduction)),
        Passage("The shots", _shots(reduction)),
        Passage("The feed arm", _feed_arm(reduction)),
        Passage("The dish", _dish(reduction)),
        *([] if reduction.third_order is None else [third_order_passage(reduction.third_order)]),
        Passage("The air", _air(reduction)),
        *([Passage("The records", records)] if records else []),
        Passage("Reliability", " ".join([_trust(reduction), *checks_sentences(reduction.coordinates)])),
        *([Passage("Notes", "; ".join(reduction.notes) + ".")] if reduction.notes else []),
    ]


def feed_arm_rows(reduction: Reduction) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Name, coordinates (m) and standard uncertainties (mm) of each feed-arm ranger."""
    coordinates = reduction.coordinates
    u = coordinates.u / MILLIMETRE
    return [
        (name, coordinates.x[row], u[row])
        for row, (name, kind) in enumerate(kinds_of(reduction).items())
        if kind == "feed-arm ranger"
    ]


def pointing(reduction: Reduction) -> tuple[float, float] | None:
    """Azimuth and elevation of the fitted axis, degrees; the azimuth near the nominal one."""
    if reduction.surface is None:
        return None
    x, y, z = reduction.surface.pose()["axis"]
    nominal = reduction.campaign.site.campaign.azimuth_deg
    azimuth = float(np.arctan2(x, y)) / DEGREE
    return nominal + (azimuth - nominal + 180.0) % 360.0 - 180.0, float(np.arcsin(z)) / DEGREE


def _night(reduction: Reduction) -> str:
    campaign = reduction.campaign
    posture, shots = campaign.site.campaign, campaign.shots
    ground, arm = len(campaign.monuments), len(campaign.feedarm.ranger)
    minutes = (shots.mjd_utc[-1] - shots.mjd_utc[0]) * SECONDS_PER_DAY / 60.0
    return (
        f"In {posture.name} the telescope stood at azimuth {posture.azimuth_deg:g}°, elevation "
        f"{posture.elevation_deg:g}° while {ground + arm} laser rangers, {ground} on the ground and {arm} on the feed "
        f"arm, fired {len(shots)} shots in "
        f"{minutes:.0f} minutes, at retroreflectors on the dish and the structure and at their own reference cubes."
    )


def _shots(reduction: Reduction) -> str:
    count = Counter(reduction.status)
    index = {int(shot): k for k, shot in enumerate(reduction.campaign.shots.shot)}
    references = sum(
        reduction.campaign.shots.target[k] == REFERENCE and shot not in reduction.rejected for shot, k in index.items()
    )
    words = Counter(reason.status for reason in reduction.rejected.values())
    reasons = ", ".join(
        f"{number} {word}" + (f" ({MEANING[word]})" if word in MEANING else "") for word, number in words.most_common()
    )
    rejected = f"{len(reduction.rejected)} were rejected: {reasons}" if reduction.rejected else "none was rejected"
    return (
        f"{count[ShotStatus.USED]} ranges went into one adjustment; {references} shots on the reference cubes tracked "
        f"the drift of the electronics; {rejected}."
    )


def _feed_arm(reduction: Reduction) -> str:
    rows = feed_arm_rows(reduction)
    if not rows:
        return "No ranger on the feed arm was seen."
    centre = np.mean([x for _, x, _ in rows], axis=0)
    worst = np.max([u for _, _, u in rows], axis=0)
    return (
        f"{len(rows)} rangers around x {centre[0]:.1f}, y {centre[1]:.1f}, z {centre[2]:.1f} m (east, north, up from "
        f"the pintle), determined to {worst[0]:.2f} mm east, {worst[1]:.2f} mm north and {worst[2]:.2f} mm up or "
        "better (standard uncertainty)."
    )


def _dish(reduction: Reduction) -> str:
    surface = reduction.surface
    if surface is None:
        return "Too few of its prisms were seen to determine its pose."
    shift = surface.fit.translation / MILLIMETRE
    u = np.sqrt(np.diag(surface.fit.covariance))
    turn = surface.fit.rotation / ARCSECOND
    aim = pointing(reduction)
    assert aim is not None
    return (
        f"{surface.count_text} lie on a paraboloid of {surface.focal_length:g} m focal length to "
        f"{surface.rms / MILLIMETRE:.3f} mm rms. Against the nominal posture its vertex is at "
        f"{shift[0]:+.2f}, {shift[1]:+.2f}, {shift[2]:+.2f} mm east, north, up "
        f"(u {', '.join(f'{sigma / MILLIMETRE:.2f}' for sigma in u[:3])}) and it is turned by "
        f"{turn[0]:+.1f}, {turn[1]:+.1f}, {turn[2]:+.1f} arc seconds about those axes "
        f"(u {', '.join(f'{sigma / ARCSECOND:.1f}' for sigma in u[3:])}): its axis points to azimuth {aim[0]:.4f}°, "
        f"elevation {aim[1]:.4f}°."
    )


def _air(reduction: Reduction) -> str:
    coordinates = reduction.coordinates
    weather = reduction.campaign.weather
    stations = list(coordinates.air.items())[:-1]
    offsets = ", ".join(f"{name} {value:+.2f} °C (u {u:.2f})" for name, (value, u) in stations)
    return (
        f"{weather.temperature_c.mean():.1f} °C, {weather.pressure_hpa.mean():.1f} hPa, "
        f"{weather.humidity_percent.mean():.0f} % humidity on average; it slowed the light by "
        f"{coordinates.refractivity_ppm:.2f} parts in a million. Estimated from the ranges, the "
        f"thermometers read too high by: {offsets}."
    )


def _trust(reduction: Reduction) -> str:
    factor, degrees = reduction.coordinates.variance_factor, reduction.coordinates.degrees_of_freedom
    if not (np.isfinite(factor) and degrees >= 1.0):
        return "Nothing was measured twice, so the claimed uncertainties are unchecked."
    spread = factor_spread(degrees)
    ratio = 100.0 * (np.sqrt(factor) - 1.0)
    if abs(factor - 1.0) <= 2.0 * spread:
        verdict = "the measurements scatter as their uncertainties claim"
    elif factor < 1.0:
        verdict = f"the measurements scatter {-ratio:.0f} % less than claimed: the uncertainties here are conservative"
    else:
        verdict = f"the measurements scatter {ratio:.0f} % more than claimed: the uncertainties here are too small"
    return f"Variance factor {factor:.2f} with {degrees:.0f} degrees of freedom (expected 1 ± {spread:.2f}): {verdict}."
