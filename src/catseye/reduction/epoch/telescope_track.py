"""Campaign during which the telescope moved rigidly.

Motion by its postures; its points are those of its middle.
"""

from dataclasses import replace

import numpy as np

from catseye.constants import DEGREE, SECONDS_PER_DAY
from catseye.records.night.campaign import Campaign, ObservedSite
from catseye.reduction.epoch.unknowns import middle_of
from catseye.reduction.site.motion import PostureTrack, TelescopeCarrier, frames_of
from catseye.reduction.site.places import RangedPoint
from catseye.reduction.structure.site_bending import bending_of


def motion_of(campaign: ObservedSite) -> TelescopeCarrier | None:
    """Motion of the telescope's points from the campaign's middle.

    To each shot; None of a telescope at rest.
    """
    if not campaign.postures:
        return None
    track = PostureTrack.of(campaign.postures)
    middle = middle_of(campaign.shots.mjd_utc)
    return TelescopeCarrier(campaign, track, frames_of(campaign), middle, bending=bending_of(campaign))


def at_middle_posture(campaign: Campaign) -> Campaign:
    """Campaign at the posture of its middle.

    Its points hold for that; unchanged if the telescope was at rest.
    """
    motion = motion_of(campaign)
    if motion is None:
        return campaign
    azimuth, elevation = motion.track.at(motion.epoch)
    posture = {"azimuth_deg": float(azimuth) / DEGREE % 360.0, "elevation_deg": float(elevation) / DEGREE}
    stands = campaign.site.campaign.model_copy(update=posture)
    return replace(campaign, site=campaign.site.model_copy(update={"campaign": stands}))


def buffer_middles(campaign: ObservedSite, rows: np.ndarray) -> np.ndarray:
    """Middles of some shots' buffers, MJD.

    A moving target is there at that time; for an epoch the times are these already.
    """
    shots = campaign.shots
    if not campaign.postures:
        return np.asarray(shots.mjd_utc[rows])
    half = 0.5 * shots.cycles[rows] / campaign.site.ranging.if_hz
    return np.asarray(shots.mjd_utc[rows] + half / SECONDS_PER_DAY)


def moved_ends(
    campaign: ObservedSite, row: int, ends: tuple[np.ndarray, np.ndarray], place: RangedPoint
) -> tuple[tuple[np.ndarray, np.ndarray], RangedPoint]:
    """Scan point and target of one shot at its time.

    And the target's face; moved from the campaign's middle to that shot.
    """
    motion = motion_of(campaign)
    if motion is None:
        return ends, place
    names = campaign.shots.ranger[row], campaign.shots.target[row]
    turn, shift = motion.carried(names, buffer_middles(campaign, np.array([row, row])))
    a, b = (turn[k] @ end + shift[k] for k, end in enumerate(ends))
    if place.axis is not None:
        place = replace(place, axis=turn[1] @ place.axis)
    return (a, b), place
