"""Rangers and targets on the moving telescope: place and uncertainty.

R_i and gamma of a feed-arm ranger follow azimuth and elevation (first order), gravity and temperature (the structural
model), measured corrections, and the arm's vibration, predicted by the phase-locked filter.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.errors import InputError
from catseye.geometry.antenna.deformation import TelescopePosture, motion_jacobian
from catseye.geometry.antenna.frames import ground_from_alidade_at
from catseye.geometry.frames.frame import Transform, Transforms
from catseye.geometry.frames.rotation import skew
from catseye.geometry.mirror.pointing import MirrorStation, counts_jacobian
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.structural_model import StructuralModel
from catseye.records.site.target import FeedArmRanger
from catseye.reduction.site.stations import feed_arm_station
from catseye.reduction.structure.antenna import Antenna
from catseye.reduction.structure.corrections import group_of
from catseye.signal.vibration.filter import FilterState

FEED_ARM = "feed_arm"


@dataclass(frozen=True, eq=False)
class Driven:
    """Telescope motion about a time, from its control system.

    time                             s, to which azimuth and elevation belong
    azimuth, elevation               rad
    azimuth_rate, elevation_rate     rad/s
    temperature_c                    degrees C of the structure
    u_azimuth, u_elevation           rad, of the encoders
    """

    time: float
    azimuth: float
    elevation: float
    azimuth_rate: float
    elevation_rate: float
    temperature_c: float
    u_azimuth: float
    u_elevation: float

    def posture(self, times: ArrayLike) -> TelescopePosture:
        """Posture of the telescope at times (...), s, near its own.

        Both axes at constant rates.

        Source: [PARKER04] section 2.6.1, positions and velocities from the monitor and control system.
        """
        ahead = np.asarray(times, dtype=float) - self.time
        azimuth, elevation = self.azimuth + self.azimuth_rate * ahead, self.elevation + self.elevation_rate * ahead
        return TelescopePosture(azimuth, elevation, np.full(ahead.shape, self.temperature_c))


@dataclass(frozen=True, eq=False)
class FrameCorrections:
    """Corrections to the frames' shifts and turns, with covariance.

    six           frame or group: (..., 6) m and rad, F of them
    covariance    (..., 6F, 6F), in the order of six
    replaces      True if the covariance replaces the model's own (measured by `correct_posture` in the posture for
                  which it is used: in another one, the model's scatter is new), False if it is added
    """

    six: Mapping[str, np.ndarray]
    covariance: np.ndarray
    replaces: bool = False


@dataclass(frozen=True, eq=False)
class MovingRanger:
    """Feed-arm ranger at one or more times.

    station       of batch shape (...)
    covariance    (..., 6, 6): scan point, ground frame, m; then the small turn of the mount about ground axes, rad
    """

    station: MirrorStation
    covariance: np.ndarray

    def counts_covariance(self, points: ArrayLike, of_points: ArrayLike | None = None) -> np.ndarray:
        """Covariance (..., 2, 2), counts^2, of the encoder counts for points.

        Points (..., 3), m, of the ground frame.

        points       m, whose batch axes broadcast against the station's
        of_points    (..., 3, 3) m^2, independent of the ranger's; zero if None

        A mount turned by w and moved by s sees a point R as a fixed one sees R - s - w x (R - S).
        """
        by_point, _ = counts_jacobian(self.station, points)
        arm = np.asarray(points, dtype=float) - self.station.scan_point
        by_pose = np.concatenate([np.broadcast_to(-np.eye(3), (*arm.shape, 3)), skew(arm)], axis=-1)
        slopes = by_point @ by_pose
        covariance = slopes @ self.covariance @ np.swapaxes(slopes, -1, -2)
        if of_points is not None:
            covariance = covariance + by_point @ np.asarray(of_points, dtype=float) @ np.swapaxes(by_point, -1, -2)
        return covariance


def tracked(
    antenna: Antenna, target: str, coordinates: ArrayLike, *, covariance: ArrayLike, posture: TelescopePosture
) -> tuple[np.ndarray, np.ndarray]:
    """Displacements (N, 3), m, of a target in its frame's axes.

    With covariances: samples for the vibration filter.

    antenna       the structural model, for the target's place at rest
    target        of one of its groups, such as one at the top of the feed arm
    coordinates   (N, 3), m, ground frame, as ground rangers track it
    covariance    (3, 3) or (N, 3, 3), m^2
    posture       (N,), of each

    Source: [PARKER04] section 2.6.1, the arm tracked by ground rangers.
    """
    group = group_of(antenna, target)
    points = antenna.groups[group]
    frame_from_ground = antenna.ground_from(points.frame, posture).inverse()
    at_rest = antenna.in_frame(group, posture)[..., points.names.index(target), :]
    turn = frame_from_ground.rotation
    noise = turn @ np.asarray(covariance, dtype=float) @ np.swapaxes(turn, -1, -2)
    return frame_from_ground.points(coordinates) - at_rest, noise


def vibrating(
    record: StructuralModel, state: FilterState, times: ArrayLike, *, seen_at: tuple[Antenna, str] | None = None
) -> FrameCorrections:
    """Motion of the frames by vibration at times (...), s.

    Predicted from the filter's state.

    record    whose vibrations are the state's modes, in the same order
    state     of the filter, not after the times; two axes, those of the quadrant detector, or with `seen_at` three
    times     (...), s
    seen_at   the antenna and the target on the vibrating frame that the filter follows by `tracked`

    A target's displacement is, to first order, the mode's shift and turn at its place; the detector's x and y are
    recovered by least squares. Raises InputError where the modes of record and state differ in
    number, where the state has other axes, or where the target does not stand on the frame that vibrates.
    """
    axes = 2 if seen_at is None else 3
    if len(record.vibration) != len(state.modes) or state.axes != axes:
        raise InputError(
            f"the filter follows {len(state.modes)} modes on {state.axes} axes, the structural model has "
            f"{len(record.vibration)} vibrations seen on {axes}: start the filter from the model's"
        )
    values, spread = state.predicted_modes(times)
    flat = values.reshape(*values.shape[:-2], -1)
    frames = tuple(dict.fromkeys(mode.frame for mode in record.vibration))
    response = np.zeros((6 * len(frames), flat.shape[-1]))
    for k, mode in enumerate(record.vibration):
        first = 6 * frames.index(mode.frame)
        columns = []
        for letter in "xy":
            turn = np.array(getattr(mode, f"turn_arcsec_per_mm_{letter}")) * ARCSECOND / MILLIMETRE
            columns.append([*getattr(mode, f"shift_per_{letter}"), *turn])
        by_detector = np.array(columns).T
        if seen_at is not None:
            by_detector = by_detector @ np.linalg.pinv(_displaced(*seen_at, mode.frame) @ by_detector)
        response[first : first + 6, axes * k : axes * (k + 1)] = by_detector
    six = flat @ response.T
    frame_motion = {frame: six[..., 6 * i : 6 * i + 6] for i, frame in enumerate(frames)}
    return FrameCorrections(frame_motion, response @ spread @ response.T)


def _displaced(antenna: Antenna, target: str, frame: str) -> np.ndarray:
    """Displacement (3, 6) of a target in its frame by the frame's motion."""
    points = antenna.groups[group_of(antenna, target)]
    if points.frame != frame:
        raise InputError(f"target {target!r} stands on {points.frame!r}, the vibration is of {frame!r}: track another")
    return motion_jacobian(np.zeros(6), antenna.pivot(frame), points.position[points.names.index(target)])


def moving_ranger(
    ranger: FeedArmRanger,
    mirror: MirrorGeometry,
    antenna: Antenna,
    *,
    drive: Driven,
    times: ArrayLike,
    u_mount: float,
    u_position: float = 0.010,
    known: tuple[FrameCorrections, ...] = (),
) -> MovingRanger:
    """Station of a feed-arm ranger at some times.

    With the covariance of its scan point and of the turn of its mount.

    ranger      with mount_z and mount_y
    mirror      in it
    antenna     the structural model, with a frame feed_arm
    drive       the telescope's motion about these times
    times       (...), s
    u_mount     rad, of each turn of the mount on the arm
    u_position  m, of each coordinate of the scan point without one in the record
    known       corrections and vibrations; their six are added

    Raises InputError where the record has no orientation of the mount, ValidityError outside the model's range.

    Source: [PARKER04] section 2.6.1: R_i and gamma are functions of azimuth, elevation and vibration.
    """
    times = np.asarray(times, dtype=float)
    posture, added = drive.posture(times), _sum_by_frame(known)
    arm_from_reflector = antenna.ground_from(
        FEED_ARM, _somewhere(posture), deformed=False
    ).inverse() @ antenna.ground_from("reflector", _somewhere(posture), deformed=False)
    still = feed_arm_station(ranger, mirror, Transform("ground", "reflector", np.eye(3), np.zeros(3)))
    at_rest = arm_from_reflector.points(still.scan_point)
    ground_from_arm = antenna.ground_from(FEED_ARM, posture, added=added)
    turn = Transforms("ground", FEED_ARM, ground_from_arm.rotation, np.zeros(3)) @ arm_from_reflector
    station = MirrorStation.from_matrix(
        ground_from_arm.points(at_rest),
        still.gamma @ np.swapaxes(turn.rotation, -1, -2),
        offset=still.offset,
        beta=still.beta,
        zeros=still.zeros,
    )
    by_motion = antenna.derivatives(FEED_ARM, at_rest, posture, added=added)
    turns = antenna.turns(FEED_ARM, posture, added)
    slopes = {name: np.concatenate([by_motion[name], turns[name]], axis=-2) for name in by_motion}
    by_axes = np.concatenate([antenna.axis_derivatives(station.scan_point, posture), _axis_turns(posture)], axis=-2)
    covariance = _propagated(antenna, posture, slopes, known) + _of_axes(by_axes, drive)
    u = u_position if ranger.u_position_mm is None else ranger.u_position_mm * MILLIMETRE
    return MovingRanger(station, covariance + np.diag(np.repeat([u**2, u_mount**2], 3)))


def _sum_by_frame(corrections: tuple[FrameCorrections, ...]) -> dict[str, np.ndarray]:
    """Sum of corrections and vibrations, by frame."""
    total: dict[str, np.ndarray] = {}
    for one in corrections:
        for name, six in one.six.items():
            total[name] = total[name] + np.asarray(six) if name in total else np.asarray(six, dtype=float)
    return total


def _propagated(
    antenna: Antenna,
    posture: TelescopePosture,
    slopes: Mapping[str, np.ndarray],
    corrections: tuple[FrameCorrections, ...],
) -> np.ndarray:
    """Covariance propagated by the slopes (..., r, 6) of each frame."""
    measured = {name for one in corrections if one.replaces for name in one.six}
    total: np.ndarray = np.zeros((1, 1))
    for name, slope in slopes.items():
        if name in antenna.motions and name not in measured:
            total = total + slope @ antenna.motions[name].six_covariance(posture) @ np.swapaxes(slope, -1, -2)
    some = next(iter(slopes.values()))
    for one in corrections:
        parts = [slopes.get(name, np.zeros((*some.shape[-2:],))) for name in one.six]
        batch = np.broadcast_shapes(*(part.shape[:-2] for part in parts))
        slope = np.concatenate([np.broadcast_to(part, (*batch, *part.shape[-2:])) for part in parts], axis=-1)
        total = total + slope @ one.covariance @ np.swapaxes(slope, -1, -2)
    return total


def _of_axes(slopes: np.ndarray, drive: Driven) -> np.ndarray:
    """Covariance from the encoders of azimuth and elevation."""
    u = np.array([drive.u_azimuth, drive.u_elevation])[: slopes.shape[-1]]
    return (slopes * u**2) @ np.swapaxes(slopes, -1, -2)


def _axis_turns(posture: TelescopePosture) -> np.ndarray:
    """Small turn (..., 3, 2) about ground axes by azimuth and elevation.

    A radian of each.
    """
    across = ground_from_alidade_at(posture.azimuth).rotation[..., :, 0]
    return np.stack(np.broadcast_arrays(np.array([0.0, 0.0, -1.0]), across), axis=-1)


def _somewhere(posture: TelescopePosture) -> TelescopePosture:
    """Arbitrary posture for relations that are the same in all.

    Two frames at rest.
    """
    first = [float(np.ravel(v)[0]) for v in (posture.azimuth, posture.elevation, posture.temperature_c)]
    return TelescopePosture(*first)
