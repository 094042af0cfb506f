"""Mirror stations from records, and mirror counts for points: CAL.EQ."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from catseye.constants import MILLIMETRE
from catseye.errors import InputError
from catseye.geometry.frames.frame import Transform
from catseye.geometry.mirror.encoder import (
    COUNTS_PER_TURN,
    autocollimation_counts,
    back_retro_counts,
    prime_counts,
    within,
)
from catseye.geometry.mirror.imperfect import (
    Imperfections,
    imperfect_back_counts,
    imperfect_counts,
    imperfect_face_counts,
)
from catseye.geometry.mirror.pointing import Aim, MirrorStation, aim
from catseye.records.site.folder import SiteFolder
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.monument import MonumentGeometry
from catseye.records.site.target import FeedArmRanger
from catseye.reduction.site.places import nominal_frame

FARTHEST = 2e4  # m between two points of a site whose coordinates lie within 10 km (`records.files.record.Coordinate`)
UNUSUAL = 1e3  # m, six times the longest line of the Green Bank site: more likely typed in millimetres
ANY_TURN = COUNTS_PER_TURN / np.sqrt(12.0)  # counts: unknown azimuth, uniform over a turn
STEPS = {"axes": 1e-6, "tilts": 1e-7}  # m, rad, for derivatives
AXES = ("axis_offset_mm", "mirror_offset_mm", "beam_x_mm", "beam_y_mm")
CountsSpread = Callable[[np.ndarray], tuple[np.ndarray, tuple[str, ...]]]
TILTS = ("face_tilt_rad", "beam_tilt_x_rad", "beam_tilt_y_rad")


def station_of(monument: MonumentGeometry, mirror: MirrorGeometry) -> MirrorStation:
    """Station of a mirror on a monument.

    Source: [PARKER04] Figures 2.2 and 2.4, transformations 1 to 6.
    """
    return MirrorStation(
        np.array([monument.x_mm, monument.y_mm, monument.z_mm]) * MILLIMETRE,
        np.array([monument.alpha1_rad, monument.alpha2_rad, monument.alpha3_rad]),
        offset_of(mirror),
        np.array([mirror.beta1_rad, mirror.beta2_rad]),
        np.array([mirror.na0, mirror.ne0]),
    )


def feed_arm_station(ranger: FeedArmRanger, mirror: MirrorGeometry, ground_from_reflector: Transform) -> MirrorStation:
    """Station of a feed-arm ranger's mirror at the telescope's posture.

    ground_from_reflector    at that posture

    Raises InputError where the record does not give the orientation of its mount.

    Source: [PARKER04] section 2.6.1: R_i and gamma are functions of the posture.
    """
    if ranger.mount_z is None or ranger.mount_y is None:
        raise InputError(
            f"feedarm.toml: ranger {ranger.name!r} has no mount_z, mount_y (expected unit vectors, reflector frame), "
            "so that its mirror's orientation is unknown"
        )
    z = np.array(ranger.mount_z) / np.linalg.norm(ranger.mount_z)
    y = np.array(ranger.mount_y) - z * (z @ np.array(ranger.mount_y))
    y /= np.linalg.norm(y)
    mount_from_reflector = np.stack([np.cross(y, z), y, z])
    return MirrorStation.from_matrix(
        ground_from_reflector.points(np.array(ranger.nominal_scan_point_mm) * MILLIMETRE),
        mount_from_reflector @ ground_from_reflector.rotation.T,
        offset=offset_of(mirror),
        beta=np.array([mirror.beta1_rad, mirror.beta2_rad]),
        zeros=np.array([mirror.na0, mirror.ne0]),
    )


def station_in(campaign: SiteFolder, name: str) -> MirrorStation | None:
    """Station of a campaign's ranger, at the nominal posture.

    None where no record gives the orientation of its mount.
    """
    mirror = campaign.mirror_of(name)
    if name in campaign.monuments:
        return station_of(campaign.monuments[name], mirror)
    ranger = next(r for r in campaign.feedarm.ranger if r.name == name)
    return None if ranger.mount_z is None else feed_arm_station(ranger, mirror, nominal_frame(campaign))


def offset_of(mirror: MirrorGeometry) -> np.ndarray:
    """Offset (3,), m, mount axes, from the fixed point to the scan point."""
    return np.array([mirror.dx_mm, mirror.dy_mm, mirror.dz_mm]) * MILLIMETRE


def imperfections_of(mirror: MirrorGeometry) -> Imperfections | None:
    """Offsets, tilts and encoder errors of a record; None without any."""
    imperfections = _imperfections(mirror)
    return imperfections if imperfections.matter else None


def _imperfections(mirror: MirrorGeometry) -> Imperfections:
    return Imperfections(
        axes=np.array([getattr(mirror, key) for key in AXES]) * MILLIMETRE,
        tilts=np.array([getattr(mirror, key) for key in TILTS]),
        azimuth_waves=np.array([mirror.azimuth_encoder_cosine_counts, mirror.azimuth_encoder_sine_counts]),
        elevation_waves=np.array([mirror.elevation_encoder_cosine_counts, mirror.elevation_encoder_sine_counts]),
    )


def imperfections_variance(
    station: MirrorStation, mirror: MirrorGeometry, to: np.ndarray, *, prime: ArrayLike = False
) -> np.ndarray:
    """Variance of the counts by the record's uncertainties.

    (..., 2), counts^2, for points (..., 3), m: uncertainties of offsets, tilts and encoder errors; zero where the
    record has none.

    prime    (...), bool: in the prime pointing, in place of the direct one

    Each term is independent. A cosine and a sine term of one order, of u each, give u^2 at any angle.

    Source: [JCGM100] eq. 10; derivatives by central differences of the traced ray.
    """
    complete = _imperfections(mirror)
    variance = np.zeros((*to.shape[:-1], 2))
    for part, u in (("axes", (mirror.u_axis_mm or 0.0) * MILLIMETRE), ("tilts", mirror.u_tilt_rad or 0.0)):
        if u == 0.0:
            continue
        values, step = getattr(complete, part), STEPS[part]
        for away in step * np.eye(len(values)):
            forward, backward = (
                imperfect_counts(station, replace(complete, **{part: values + sign * away}), to, prime=prime)
                for sign in (1, -1)
            )
            apart = forward - backward
            apart[..., 0] -= COUNTS_PER_TURN * np.round(apart[..., 0] / COUNTS_PER_TURN)  # Theta's cut between them
            variance += np.square(u * apart / (2.0 * step))
    orders = np.array([complete.azimuth_waves.shape[1], complete.elevation_waves.shape[1]])
    return variance + np.square(mirror.u_encoder_counts or 0.0) * orders


def station_covariance(monument: MonumentGeometry, mirror: MirrorGeometry) -> tuple[np.ndarray, tuple[str, ...]]:
    """Covariance (13, 13) of the station's parameters in their units.

    Also the keys that the records lack: their parameters count as exact.

    The records give one u each and no correlations.
    """
    lacking: list[str] = []
    place = [_u(monument, f"u_{axis}_mm", lacking, MILLIMETRE) for axis in "xyz"]
    turn = [_u(monument, f"u_alpha{k}_rad", lacking) for k in (1, 2, 3)]
    of_mirror, lacking_of_mirror = mirror_variances(mirror)
    return np.diag([*np.square([*place, *turn]), *of_mirror]), (*lacking, *lacking_of_mirror)


def mirror_variances(mirror: MirrorGeometry) -> tuple[list[float], tuple[str, ...]]:
    """Variances of the seven parameters of a mirror: offset, beta, zeros.

    Also the keys that the record lacks: their parameters count as exact.
    """
    lacking: list[str] = []
    offset = [_u(mirror, "u_offset_mm", lacking, MILLIMETRE)] * 3
    beta = [_u(mirror, "u_beta_rad", lacking)] * 2
    zeros = [_u(mirror, "u_zero_counts", lacking)] * 2
    return np.square([*offset, *beta, *zeros]).tolist(), tuple(lacking)


def _u(record: object, key: str, lacking: list[str], factor: float = 1.0) -> float:
    """Standard uncertainty of a record; 0 where it lacks the key, which is then listed."""
    value = getattr(record, key)
    if value is None:
        lacking.append(key)
        return 0.0
    return float(value) * factor


@dataclass(frozen=True, eq=False)
class Pointings:
    """Counts of one mirror for n points.

    Everything (n,) unless stated otherwise; CAL.EQ's answer and more.

    to                   (n, 3), m, ground
    aim                  range, Theta, Phi and counts of the six transformations
    counts               (n, 2) of the direct pointing, offsets, tilts and encoder errors of the record included
    prime                (n, 2) of the prime pointing: half a turn up or down, whichever is allowed, up where neither is
    autocollimation, back_retro   elevation counts at which the face, or the retroreflector behind it, looks there
    allowed, prime_allowed        azimuth within the limits
    u                    (n, 2), counts, of the direct pointing by the records; NaN where they are incomplete; of an
                         azimuth at most that of any turn; of an elevation on the azimuth axis itself NaN
    lacking              keys of uncertainties that the records lack
    """

    to: np.ndarray
    aim: Aim
    counts: np.ndarray
    prime: np.ndarray
    autocollimation: np.ndarray
    back_retro: np.ndarray
    allowed: np.ndarray
    prime_allowed: np.ndarray
    u: np.ndarray
    lacking: tuple[str, ...]

    def unusual(self, k: int) -> str:
        """Alternative reading of an unusually distant point; "" otherwise."""
        if self.aim.range[k] <= UNUSUAL:
            return ""
        less = ", ".join(f"{v:g}" for v in self.to[k] * MILLIMETRE)
        return f"the point is {self.aim.range[k]:.0f} m away; in millimetres it would be {less} m"


def pointings_of(
    station: MirrorStation, mirror: MirrorGeometry, to: np.ndarray, *, name: str, spread: CountsSpread
) -> Pointings:
    """Encoder counts of a station's mirror for points (n, 3), m, ground.

    name     of the ranger, for refusals
    spread   covariance (n, 2, 2) of the counts for points by the station, and the keys that the records lack

    Raises InputError for a point that has no direction, is farther than FARTHEST, or that the beam of this mirror
    cannot reach.

    Source: [PARKER04] Figure 2.5 (CAL.EQ), eq. 2.12 to 2.26.
    """
    imperfections = imperfections_of(mirror)
    for at in to[~np.all(np.abs(to) <= FARTHEST, axis=1)]:
        less = at * MILLIMETRE
        hint = (
            f": read as millimetres it is {', '.join(f'{v:g}' for v in less)} m" if np.all(abs(less) < UNUSUAL) else ""
        )
        raise InputError(
            f"point {', '.join(f'{v:.10g}' for v in at)} m is too far (expected within {FARTHEST:g} m){hint}"
        )
    aimed = aim(station, to)
    low, high = mirror.az_low_limit, mirror.az_high_limit
    direct = np.stack([aimed.azimuth_counts, aimed.elevation_counts], axis=-1)
    if imperfections is None:
        prime = np.stack(prime_counts(direct[:, 0], direct[:, 1], station.zeros[1]), axis=-1)
        face = autocollimation_counts(aimed.phi, station.zeros[1])
        back = back_retro_counts(aimed.phi, station.zeros[1])
    else:
        prime = imperfect_counts(station, imperfections, to, prime=True)
        direct = imperfect_counts(station, imperfections, to)
        faces = imperfect_face_counts(station, imperfections, to)
        face, back = faces[:, 1], imperfect_back_counts(station, imperfections, faces)
    for k in np.flatnonzero(~np.isfinite(np.column_stack([direct, prime, face, back])).all(axis=1)):
        raise InputError(
            f"point {', '.join(f'{v:.10g}' for v in to[k])} m, {aimed.range[k]:.4g} m from the scan point of "
            f"{mirror.zp} on {name}, {np.degrees(aimed.phi[k]):.4g} deg from its azimuth axis: no setting "
            "of the mirror looks there"
        )
    lower = prime[:, 0] - COUNTS_PER_TURN
    down = ~within(prime[:, 0], low, high) & within(lower, low, high)
    prime = np.column_stack([np.where(down, lower, prime[:, 0]), prime[:, 1]])
    u, lacking = counts_uncertainty(station, mirror, to, spread=spread)
    return Pointings(
        to=to,
        aim=aimed,
        counts=direct,
        prime=prime,
        autocollimation=face,
        back_retro=back,
        allowed=within(direct[:, 0], low, high),
        prime_allowed=within(prime[:, 0], low, high),
        u=u,
        lacking=lacking,
    )


def counts_uncertainty(
    station: MirrorStation, mirror: MirrorGeometry, to: np.ndarray, *, spread: CountsSpread, prime: ArrayLike = False
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Standard uncertainties (..., 2), counts, for points (..., 3), m, and the keys that the records lack.

    NaN where they lack one; of an azimuth at most that of any turn.

    station   of batch shape that broadcasts with the points'
    spread    covariance (..., 2, 2) of the direct counts for points by the station, and the keys
    prime     (...), bool: in the prime pointing, whose elevation is mirrored at ne0, so that the variances of
              independent zeros and angles stay the same

    Source: [JCGM102] eq. 3, first order.
    """
    covariance, lacking = spread(to)
    variance = np.diagonal(covariance, axis1=-2, axis2=-1) + imperfections_variance(station, mirror, to, prime=prime)
    u = np.sqrt(variance)
    u[..., 0] = np.fmin(u[..., 0], ANY_TURN)
    return np.full_like(u, np.nan) if lacking else u, lacking
