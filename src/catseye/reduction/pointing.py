"""From records to stations: which mirror stands how, how well that is known, and where it may turn."""

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import InputError
from catseye.geometry.frame import Transform
from catseye.geometry.imperfect import Imperfections
from catseye.geometry.pointing import Station
from catseye.records.mirror import MirrorGeometry
from catseye.records.monument import MonumentGeometry
from catseye.records.target import FeedArmRanger

AXES = ("axis_offset_mm", "mirror_offset_mm", "beam_x_mm", "beam_y_mm")
TILTS = ("face_tilt_rad", "beam_tilt_x_rad", "beam_tilt_y_rad")


def station_of(monument: MonumentGeometry, mirror: MirrorGeometry) -> Station:
    """The mirror on that monument.

    Source: [PARKER04] Figures 2.2 and 2.4, transformations 1 to 6.
    """
    return Station(
        np.array([monument.x_mm, monument.y_mm, monument.z_mm]) * MILLIMETRE,
        np.array([monument.alpha1_rad, monument.alpha2_rad, monument.alpha3_rad]),
        offset_of(mirror),
        np.array([mirror.beta1_rad, mirror.beta2_rad]),
        np.array([mirror.na0, mirror.ne0]),
    )


def feed_arm_station(ranger: FeedArmRanger, mirror: MirrorGeometry, ground_from_reflector: Transform) -> Station:
    """The mirror of a ranger on the feed arm, as the telescope stands.

    ground_from_reflector    of that posture

    Raises InputError where the record does not say how its mount is turned.

    Source: [PARKER04] section 2.6.1: R_i and gamma are functions of the posture.
    """
    if ranger.mount_z is None or ranger.mount_y is None:
        raise InputError(
            f"feedarm.toml: ranger {ranger.name!r} has no mount_z, mount_y (expected unit vectors, reflector frame), "
            "so that nothing says where its mirror points"
        )
    z = np.array(ranger.mount_z) / np.linalg.norm(ranger.mount_z)
    y = np.array(ranger.mount_y) - z * (z @ np.array(ranger.mount_y))
    y /= np.linalg.norm(y)
    mount_from_reflector = np.stack([np.cross(y, z), y, z])
    return Station.from_matrix(
        ground_from_reflector.points(np.array(ranger.nominal_scan_point_mm) * MILLIMETRE),
        mount_from_reflector @ ground_from_reflector.rotation.T,
        offset=offset_of(mirror),
        beta=np.array([mirror.beta1_rad, mirror.beta2_rad]),
        zeros=np.array([mirror.na0, mirror.ne0]),
    )


def offset_of(mirror: MirrorGeometry) -> np.ndarray:
    """(3,) m, mount axes: from the fixed point to the scan point."""
    return np.array([mirror.dx_mm, mirror.dy_mm, mirror.dz_mm]) * MILLIMETRE


def imperfections_of(mirror: MirrorGeometry) -> Imperfections | None:
    """What the record says of offsets, tilts and encoder errors; None where it knows of none."""
    found = Imperfections(
        axes=np.array([getattr(mirror, key) for key in AXES]) * MILLIMETRE,
        tilts=np.array([getattr(mirror, key) for key in TILTS]),
        azimuth_waves=np.array([mirror.azimuth_encoder_cosine_counts, mirror.azimuth_encoder_sine_counts]),
        elevation_waves=np.array([mirror.elevation_encoder_cosine_counts, mirror.elevation_encoder_sine_counts]),
    )
    return found if found.matter else None


def station_covariance(monument: MonumentGeometry, mirror: MirrorGeometry) -> tuple[np.ndarray, tuple[str, ...]]:
    """(13, 13), of the station's parameters in their units, and the keys that the records lack: counted as known.

    The records give one u each and no correlations.
    """
    lacking: list[str] = []

    def u(record: object, key: str, factor: float = 1.0) -> float:
        value = getattr(record, key)
        if value is None:
            lacking.append(key)
            return 0.0
        return float(value) * factor

    place = [u(monument, f"u_{axis}_mm", MILLIMETRE) for axis in "xyz"]
    turn = [u(monument, f"u_alpha{k}_rad") for k in (1, 2, 3)]
    offset = [u(mirror, "u_offset_mm", MILLIMETRE)] * 3
    beta = [u(mirror, "u_beta_rad")] * 2
    zeros = [u(mirror, "u_zero_counts")] * 2
    return np.diag(np.square([*place, *turn, *offset, *beta, *zeros])), tuple(lacking)
