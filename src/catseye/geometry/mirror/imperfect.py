"""Beam of a mirror with offsets, tilts and encoder waves.

The mount stands at (Theta', Phi'), the encoders' turn; in the prime pointing Phi' is below zero. Mirror axes, with
h = (cos Theta', sin Theta', 0) and k = z x h = (-sin Theta', cos Theta', 0):

    elevation axis   along k through e h
    face's normal    m = cos(t) [cos(Phi'/2) z + sin(Phi'/2) h] + sin(t) k,     t the face's tilt
    face             m . x = m . e h + s = c
    laser            through (x_b, y_b, 0), coming in along d = -(t_x, t_y, sqrt(1 - t_x^2 - t_y^2))

and the beam leaves along u = d - 2 (d . m) m from where the laser meets the face. Without tilts this is the beam of
`mirror_path`, whose inverse to counts (`beam_angles`) excludes tilts; here it is found by aiming off the target by
the miss of the beam.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError
from catseye.geometry.mirror.encoder import COUNTS_PER_RADIAN, HALF_TURN
from catseye.geometry.mirror.mirror_path import direction_angles
from catseye.geometry.mirror.pointing import MirrorBeam, MirrorStation, in_mirror_axes

ITERATIONS = 60  # each gains a factor of the largest tilt, or of offset over distance
SETTLED = 2e-15  # of a direction


@dataclass(frozen=True, eq=False)
class Imperfections:
    """Imperfections of one mirror, added to the six transformations.

    axes              (4,), m: axis offset e, mirror offset s, beam x, beam y, as in `mirror_path`
    tilts             (3,), rad: of the face towards k, of the incoming beam (x, y of the direction it comes from)
    azimuth_waves     (2, n), counts: cosine and sine terms, orders 1 to n of Theta', of the encoder's error (positive
                      too high)
    elevation_waves   (2, m), counts: the same of the elevation encoder, orders of the mirror's own turn Phi'/2

    Raises ValidityError for other shapes, and tilts of 0.1 rad and more.
    """

    axes: NDArray[np.float64]
    tilts: NDArray[np.float64]
    azimuth_waves: NDArray[np.float64]
    elevation_waves: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name, shape in (("axes", (4,)), ("tilts", (3,)), ("azimuth_waves", (2, -1)), ("elevation_waves", (2, -1))):
            array = np.array(getattr(self, name), dtype=float)
            if array.ndim != len(shape) or array.shape[0] != shape[0] or not np.isfinite(array).all():
                raise ValidityError(f"{name} of a mirror have shape {array.shape}, expected {shape}, finite")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if np.any(np.abs(self.tilts) >= 0.1):
            raise ValidityError(f"tilts {self.tilts.tolist()} rad of a mirror are not below 0.1")

    @property
    def matter(self) -> bool:
        """True if any imperfection differs from zero."""
        return any(np.any(part) for part in (self.axes, self.tilts, self.azimuth_waves, self.elevation_waves))


def imperfect_ray(station: MirrorStation, imperfections: Imperfections, at_counts: ArrayLike) -> MirrorBeam:
    """Beam at encoder counts: origin on the face, m, and direction, (..., 3), ground.

    station      of batch shape that broadcasts with the counts'
    at_counts    (..., 2), azimuth and elevation, as read

    Where the back of the mirror faces the laser the result is that of the face's plane.

    Source: derived above; [PARKER04] eq. 2.16 to 2.22 where all is zero. Exact, by reflection.
    """
    leaves, u = _beam(_mount(station, imperfections, at_counts), imperfections)
    to_ground = np.swapaxes(station.mirror_from_ground, -1, -2)
    turned = [np.einsum("...ij,...j->...i", to_ground, v) for v in (leaves, u)]
    return MirrorBeam(station.scan_point + turned[0], turned[1])


def imperfect_counts(
    station: MirrorStation, imperfections: Imperfections, points: ArrayLike, *, prime: ArrayLike = False
) -> NDArray[np.float64]:
    """Encoder counts (..., 2) at which the beam meets points.

    station    of batch shape that broadcasts with the points'
    points     (..., 3), m, ground
    prime      (...), bool: by the other setting of the mount, half a turn of azimuth above the direct one

    NaN without a solution: so near to the azimuth axis that the tilts decide where the beam goes, straight behind
    the mirror, or nearer than the beam is displaced.

    Source: derived above. Converged to 2e-15 rad.
    """
    target = in_mirror_axes(station, points)
    unit_target = target / np.linalg.norm(target, axis=-1, keepdims=True)
    sign = np.where(np.asarray(prime, dtype=bool), -1.0, 1.0)
    toward, moved = unit_target, np.full(unit_target.shape[:-1], np.inf)
    with np.errstate(invalid="ignore"):
        for _ in range(ITERATIONS):
            mount = _mount_of(toward, sign)
            leaves, u = _beam(mount, imperfections)
            sight = target - leaves
            miss = sight / np.linalg.norm(sight, axis=-1, keepdims=True) - u
            aside = toward + miss
            toward = aside / np.linalg.norm(aside, axis=-1, keepdims=True)
            moved = np.max(np.abs(miss), axis=-1)
            if not np.any(moved > SETTLED):
                break
        settled = moved <= 10.0 * SETTLED
    return np.where(settled[..., None], _read(station, imperfections, mount), np.nan)


def imperfect_face_counts(
    station: MirrorStation, imperfections: Imperfections, points: ArrayLike
) -> NDArray[np.float64]:
    """Encoder counts (..., 2) at which the face looks at points.

    Autocollimation, direct pointing.

    station, points    as for `imperfect_counts`

    The retroreflector in the mirror's back looks there half a turn of elevation further on, where the waves differ.

    Source: [PARKER04] eq. 2.23 with the normal m above: m_z = cos(t) cos(Phi'/2) and m's turn about z solved. NaN
    within the face's tilt of the azimuth axis, where no setting looks.
    """
    target = in_mirror_axes(station, points)
    m = target / np.linalg.norm(target, axis=-1, keepdims=True)
    sine, cosine = np.sin(imperfections.tilts[0]), np.cos(imperfections.tilts[0])
    across = np.hypot(m[..., 0], m[..., 1])
    with np.errstate(invalid="ignore"):
        along = np.sqrt(across**2 - sine**2)  # cos(t) sin(Phi'/2)
    turn = np.arctan2(m[..., 1], m[..., 0]) - np.arctan2(sine, along)
    turn = np.where(turn < -0.5 * np.pi, turn + 2.0 * np.pi, turn)
    half = np.arctan2(along / cosine, m[..., 2] / cosine)
    return _read(station, imperfections, np.stack([turn, 2.0 * half], axis=-1))


def imperfect_back_counts(
    station: MirrorStation, imperfections: Imperfections, face_counts: ArrayLike
) -> NDArray[np.float64]:
    """Elevation counts (...) of the back retroreflector from `face_counts` (..., 2).

    It looks in the same direction as the face.

    Source: [PARKER04] eq. 2.24: half a turn of the mirror further.
    """
    ideal = _mount(station, imperfections, face_counts)
    ideal = ideal + np.array([0.0, 2.0 * HALF_TURN / COUNTS_PER_RADIAN])
    return _read(station, imperfections, ideal)[..., 1]


def _mount_of(direction: NDArray, sign: NDArray) -> NDArray:
    """Theta', Phi' (..., 2), rad, of an ideal mount for a direction (..., 3) in mirror axes."""
    theta, phi = direction_angles(direction)
    return np.stack([theta + np.where(sign < 0.0, np.pi, 0.0), sign * phi], axis=-1)


def _beam(mount: NDArray, imperfections: Imperfections) -> tuple[NDArray, NDArray]:
    """Beam origin on the face, m, and direction, in mirror axes."""
    e, s, beam_x, beam_y = imperfections.axes
    face, tilt_x, tilt_y = imperfections.tilts
    turn, half = mount[..., 0], 0.5 * mount[..., 1]
    zero = np.zeros_like(turn)
    h = np.stack([np.cos(turn), np.sin(turn), zero], axis=-1)
    k = np.stack([-np.sin(turn), np.cos(turn), zero], axis=-1)
    m = np.cos(face) * np.sin(half)[..., None] * h + np.sin(face) * k
    m[..., 2] += np.cos(face) * np.cos(half)
    d = -np.array([tilt_x, tilt_y, np.sqrt(1.0 - tilt_x**2 - tilt_y**2)])
    start = np.array([beam_x, beam_y, 0.0])
    c = e * np.sum(m * h, axis=-1) + s
    facing = m @ d
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (c - m @ start) / facing
        return start + along[..., None] * d, d - 2.0 * facing[..., None] * m


def _mount(station: MirrorStation, imperfections: Imperfections, at_counts: ArrayLike) -> NDArray:
    """Theta', Phi' (..., 2), rad, of the mount from encoder readings."""
    n = np.asarray(at_counts, dtype=float)
    if n.shape[-1:] != (2,):
        raise ValidityError(f"counts have shape {n.shape}, expected (..., 2)")
    turns = []
    for axis, waves in enumerate((imperfections.azimuth_waves, imperfections.elevation_waves)):
        read = (n[..., axis] - station.zeros[..., axis]) / COUNTS_PER_RADIAN
        turn = read
        for _ in range(ITERATIONS if waves.size else 0):
            before, turn = turn, read - _wave(turn, waves) / COUNTS_PER_RADIAN
            if not np.any(np.abs(turn - before) > SETTLED):
                break
        turns.append(turn)
    return np.stack(np.broadcast_arrays(turns[0], 2.0 * turns[1]), axis=-1)


def _read(station: MirrorStation, imperfections: Imperfections, mount: NDArray) -> NDArray:
    """Encoder readings (..., 2), counts, with the mount at Theta', Phi'."""
    turns = (mount[..., 0], 0.5 * mount[..., 1])
    waves = (imperfections.azimuth_waves, imperfections.elevation_waves)
    return np.stack(
        np.broadcast_arrays(
            *(
                turn * COUNTS_PER_RADIAN + station.zeros[..., axis] + _wave(turn, wave)
                for axis, (turn, wave) in enumerate(zip(turns, waves, strict=True))
            )
        ),
        axis=-1,
    )


def _wave(turn: NDArray, waves: NDArray) -> NDArray:
    """Encoder error, counts, positive too high, at an axis's turn."""
    order = np.arange(1, waves.shape[1] + 1)
    angle = turn[..., None] * order
    return np.cos(angle) @ waves[0] + np.sin(angle) @ waves[1]
