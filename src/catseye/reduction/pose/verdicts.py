"""Verdicts of poses and of pointing fits.

By their own tests, the instrument's plausible sizes, and their inputs' verdicts.
"""

from typing import NamedTuple

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, SPEED_OF_LIGHT
from catseye.estimation.shapes.pose import RIGID
from catseye.reduction.pose.pointing_fit import PointingFit
from catseye.reduction.pose.pointing_offsets import PointingOffset
from catseye.reduction.pose.pose import GroupPose
from catseye.reduction.pose.star_readings import better_readings
from catseye.verdict import Verdict

UNLIKELY = 1e-4  # chance, on either side, below which a stated uncertainty does not fit the scatter
LOWEST_FREQUENCY = 1.15e9  # Hz, lowest of the Gregorian receivers: their widest beam
APERTURE = 100.0  # m across: [GBTPM01]'s telescope
TENTH = 0.1  # of the beam's width: a pointing error of it costs 3 % of the gain, exp(-4 ln 2 / 100)
SECTOR = 24.0 * DEGREE  # a turn written in hours; in radians it is 6.3. In less azimuth the axis's lean is undetermined
LOWEST = 6.0 * DEGREE  # a right angle written in hours; in radians it is 1.6. No telescope sees stars below it only


class PoseFindings(NamedTuple):
    """Result of `catseye pose`: the group's pose, and on request the beam."""

    pose: GroupPose
    beam: PointingOffset | None


def pose_status(result: PoseFindings) -> str:
    """Status "converged", or the evidence against the pose.

    From the fit, or from its own test, in words.
    """
    pose = result.pose.pose
    if pose.motion.status != "converged":
        return pose.motion.status
    if pose.motion.degrees_of_freedom and pose.p < RIGID:
        what = "the pose, and the beam that follows from it," if result.beam is not None else "the pose"
        return (
            f"the group does not move as one (p {pose.p:.2g}): {what} is a mean of its points' motions; see residuals"
        )
    return "converged"


def pose_verdict(result: PoseFindings) -> Verdict:
    """Verdict on a pose.

    Rigidity of the group, its place against the posture, and the verdicts of both epochs.
    """
    group = result.pose
    epochs = [epoch for epoch in (group.epoch, group.earlier) if epoch is not None]
    return _own_verdict(result).resting_on({epoch.campaign or epoch.file: epoch.verdict for epoch in epochs})


def _own_verdict(result: PoseFindings) -> Verdict:
    pose, status = result.pose.pose, pose_status(result)
    if status != "converged":
        return Verdict("doubtful", status)
    if not pose.motion.degrees_of_freedom:
        return Verdict("doubtful", "as many coordinates as unknowns: nothing checks that the group moved as one")
    if result.pose.posture is not None and result.pose.posture.doubt:
        return Verdict("doubtful", result.pose.posture.doubt)
    removed = f", {len(pose.left_out)} left out" if pose.left_out else ""
    return Verdict("good", f"{len(pose.names)} points move as one{removed} (p {pose.p:.2g})")


def largest_sky_rms() -> float:
    """Largest residual of a usable series, rad: a tenth of the widest beam.

    The beam of an aperture D at the wavelength l is 1.2 l / D wide at half power. The published series leaves 7.39
    arc seconds.

    Source: [GBTPM01] for the telescope and its fit.

    >>> round(largest_sky_rms() / ARCSECOND, 1)
    64.5
    """
    return TENTH * 1.2 * SPEED_OF_LIGHT / LOWEST_FREQUENCY / APERTURE


def fit_verdict(fit: PointingFit) -> Verdict:
    """Verdict on a pointing fit.

    Separation of terms, scatter against claimed or plausible values, columns that fit better in another reading.
    """
    return _fit_verdict(fit).resting_on(fit.sources)


def _fit_verdict(fit: PointingFit) -> Verdict:
    if fit.degrees_of_freedom < 1:
        return Verdict("doubtful", "as many observations as terms: nothing checks the series")
    rms = fit.sky_rms / ARCSECOND
    if fit.stars and (alternatives := better_readings(fit)):
        named = ", or as well if ".join(reading.text for reading in alternatives)
        return Verdict("doubtful", f"{rms:.2f} arc seconds rms on the sky; it fits better if {named}")
    if fit.stars and (doubt := _implausible_sky(fit)):
        return Verdict("doubtful", doubt)
    if fit.sky_rms > largest_sky_rms():
        limit = largest_sky_rms() / ARCSECOND
        return Verdict(
            "doubtful",
            f"{rms:.2f} arc seconds rms on the sky, beyond {limit:.0f}, a tenth of the beam at the telescope's lowest "
            "frequency: check columns and units",
        )
    if not fit.scaled and (doubt := _contradicted(fit)):
        return Verdict("doubtful", doubt)
    undetermined = [w for w in fit.weak if w.u_on_the_sky > fit.sky_rms]
    if undetermined:
        return Verdict("doubtful", f"the observations do not separate {', '.join(undetermined[0].parts)}")
    return Verdict(
        "good", f"{int(fit.used.sum())} observations determine the terms, {rms:.2f} arc seconds rms on the sky"
    )


def _implausible_sky(fit: PointingFit) -> str:
    """Implausible star positions as a text; "" for a usual sky."""
    a, e = fit.azimuth[fit.used], fit.elevation[fit.used]
    if np.all(e < LOWEST):
        return f"every elevation is below {LOWEST / DEGREE:.0f} degrees: radians or hours for degrees?"
    if np.ptp(a) <= SECTOR and np.ptp(e) > np.ptp(a):
        return f"all azimuths lie within {np.ptp(a) / DEGREE:.1f} degrees, elevations do not: radians or hours?"
    if np.all(a <= 0.0) and np.ptp(a) > np.pi:
        return "all azimuths are below zero, over more than half a turn: are they counted clockwise from north?"
    return ""


def _contradicted(fit: PointingFit) -> str:
    """Contradiction of scatter and stated uncertainty; "" for none."""
    from scipy import special

    degrees, factor = fit.degrees_of_freedom, fit.variance_factor
    if factor > 1.0 + 3.0 * (2.0 / degrees) ** 0.5:
        return f"observations scatter more than claimed (variance factor {factor:.2f})"
    if fit.stars and special.chdtr(degrees, fit.pvv) < UNLIKELY:
        return f"observations scatter less than claimed (variance factor {factor:.2g}): is its unit arc seconds?"
    return ""
