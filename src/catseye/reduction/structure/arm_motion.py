"""Motion of the feed arm and of a ranger on it, ahead in time, by the followed vibration."""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.errors import InputError
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.records.night.vibration_series import VibrationSeries
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.target import FeedArmRanger
from catseye.reduction.structure.antenna import Antenna
from catseye.reduction.structure.corrections import group_of
from catseye.reduction.structure.following import FollowedVibration, VibrationSamples
from catseye.reduction.structure.moving_ranger import Driven, moving_ranger, tracked, vibrating


@dataclass(frozen=True, eq=False)
class ArmMotion:
    """Motion of a frame by its vibration, l times after the end of the last sample.

    frame        that vibrates
    pivot        (3,) m, of its turns, its own axes
    six          (l, 6): shift, m, then turn, rad, about its axes
    covariance   (l, 6, 6)
    ranger       name of a ranger on it; None: none asked
    place        (l, 3) m, its scan point, ground frame; None without a ranger
    moved        (l, 3) m, of it by the vibration alone, ground axes
    spread       (l, 6, 6): covariance of scan point, m, and turn of the mount about ground axes, rad, by everything
    """

    frame: str
    pivot: Array
    six: Array
    covariance: Array
    ranger: str | None = None
    place: Array | None = None
    moved: Array | None = None
    spread: Array | None = None


def still_posture(posture: tuple[float, float], temperature_c: float, count: int) -> TelescopePosture:
    """Posture of a telescope at rest, for `count` times."""
    return TelescopePosture(*(np.full(count, v) for v in (*posture, temperature_c)))


def samples_of_target(
    series: VibrationSeries,
    antenna: Antenna,
    target: str,
    *,
    posture: tuple[float, float],
    temperature_c: float,
    u: float,
    window: float,
) -> VibrationSamples:
    """Displacements of a target in its frame's axes, as ground rangers track it.

    series    of the kind "ground"
    target    of one of the model's groups
    posture   azimuth, elevation, rad, of a telescope at rest
    u         m, of each coordinate

    Source: [PARKER04] section 2.6.1; `moving_ranger.tracked`.
    """
    at = still_posture(posture, temperature_c, len(series.seconds))
    values, noise = tracked(antenna, target, series.values, covariance=u**2 * np.eye(3), posture=at)
    return VibrationSamples(("x", "y", "z"), series.seconds, values, noise, window)


def arm_motion(
    vibration: FollowedVibration,
    antenna: Antenna,
    *,
    target: str | None = None,
    ranger: tuple[FeedArmRanger, MirrorGeometry] | None = None,
    posture: tuple[float, float] | None = None,
    temperature_c: float = 15.0,
) -> ArmMotion:
    """Motion of the frame that vibrates, and of a ranger on it, at the leads of a followed vibration.

    target    that was tracked; None: a quadrant detector was read
    ranger    of the feed arm, with its mirror; with the posture
    posture   azimuth, elevation, rad, of a telescope at rest

    Raises InputError for vibrations of several frames, and as `vibrating` and `moving_ranger`.
    """
    frames = {mode.frame for mode in antenna.record.vibration}
    if len(frames) != 1:
        raise InputError(f"the structural model vibrates in {len(frames)} frames (expected one)")
    frame = frames.pop()
    times = vibration.samples.end + vibration.leads
    seen_at = None if target is None else (antenna, target)
    if target is not None:
        group_of(antenna, target)  # a name that is none of its targets is refused here
    swing = vibrating(antenna.record, vibration.state, times, seen_at=seen_at)
    motion = ArmMotion(frame, antenna.pivot(frame), swing.six[frame], swing.covariance)
    if ranger is None or posture is None:
        return motion
    arm, mirror = ranger
    drive = Driven(
        time=float(times[0]),
        azimuth=posture[0],
        elevation=posture[1],
        azimuth_rate=0.0,
        elevation_rate=0.0,
        temperature_c=temperature_c,
        u_azimuth=0.0,
        u_elevation=0.0,
    )
    u_mount = arm.u_mount_rad or 0.0
    moving, still = (
        moving_ranger(arm, mirror, antenna, drive=drive, times=times, u_mount=u_mount, known=corrections)
        for corrections in ((swing,), ())
    )
    return ArmMotion(
        frame,
        motion.pivot,
        motion.six,
        motion.covariance,
        ranger=arm.name,
        place=moving.station.scan_point,
        moved=moving.station.scan_point - still.station.scan_point,
        spread=moving.covariance,
    )
