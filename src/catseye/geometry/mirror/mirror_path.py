"""Change of range from offsets of mirror axes and beam.

The two axes and the beam do not meet in one point.

Mirror axes as in section 2.2 of the notes: origin O at the scan point, the foot on the azimuth axis of the
perpendicular that it shares with the elevation axis; z along the azimuth axis towards laser and detector. The beam
comes in along -z; at the beam angles (Theta, Phi) it leaves along

    u = (sin Phi cos Theta, sin Phi sin Theta, cos Phi),   and the face's normal is   m = (u + z) / |u + z|.

Four offsets, metres, in this order:
    axis     e   elevation axis from the azimuth axis, along h = (cos Theta', sin Theta', 0), which turns with the mount
    mirror   s   reflecting face from the elevation axis, above zero along its outward normal m
    beam x, beam y   of the incoming beam from the azimuth axis; these axes do not turn

The mount stands at Theta' = Theta and Phi' = Phi in the direct pointing, at Theta' = Theta + pi and Phi' = -Phi in the
prime pointing: both give the same u and m, but h is reversed, so that e changes its sign and s and the beam do not.

The face lies in m.x = c, c = s + e sin(Phi'/2). The image of O in it is 2 c m, which for a beam along z shortens the
path by 2 c m_z = 2 c cos(Phi/2), and moves the outgoing beam off O across by
    w = (beam.h - 2 c sin(Phi'/2)) along increasing Phi',  beam.k along increasing Theta' (k = z x h).
The middle of the beam meets a target at the distance R from O at the length sqrt(R^2 - w^2) along the beam. The path
from any plane across the incoming beam is hence, apart from a constant and exactly, longer than R by

    sqrt(R^2 - w^2) - R - 2 c cos(Phi/2)   =   -(2 s cos(Phi/2) + e sin(Phi')) - w^2 / 2R + ...

The return path is the same for any sideways shift by the retroreflector: the wave is plane. So this is the change of
range. Assumptions: the beam is parallel to the azimuth axis and its middle is on the target (a peaked return).

The notes say (section 2.4) that the autocollimation distance differs between direct and prime pointing by twice the
offset of the mirror from the mechanical axis. That holds for the elevation axis off the azimuth axis, times sin Phi;
the face off the elevation axis (s) shows in neither, since both pointings turn the same face to the same side. Their
statement that the back retroreflector shows the offset of the two axes is right.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import TWO_PI
from catseye.errors import ValidityError

ITERATIONS = 60  # rounds of `beam_angles`; each gains a factor of some R / 2c
SETTLED = 1e-14  # m/m


def direction_angles(vector: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Theta (...) in [-pi/2, 3 pi/2) and Phi (...) in [0, pi], rad, in mirror axes.

    vector    (..., 3), any unit, not null

    Source: [PARKER04] eq. 2.14 with the quadrant it omits, 2.15 by the arctangent (its arccosine loses half the digits
    near the axis), 2.19. Exact. On the azimuth axis itself Theta is 0.

    >>> [round(float(a), 6) for a in direction_angles([0.0, -1.0, 1.0])]
    [-1.570796, 0.785398]
    """
    x, y, z = np.moveaxis(_shaped(vector, 3, "vector"), -1, 0)
    theta = np.arctan2(y, x)
    return np.where(theta < -0.5 * np.pi, theta + TWO_PI, theta), np.arctan2(np.hypot(x, y), z)


def path_change(
    theta: ArrayLike, phi: ArrayLike, distance: ArrayLike, offsets: ArrayLike, *, prime: ArrayLike = False
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Range less distance from the scan point (...), m, and derivatives (..., 4).

    theta, phi   (...), rad: angles of the outgoing beam; Phi 0 to pi (a mount's own angle Phi' below 0 is prime)
    distance     (...), m: straight from the scan point to the target, above the beam's displacement there
    offsets      (..., 4), m: axis, mirror, beam x, beam y
    prime        (...), bool: the mount stands at (Theta + pi, -Phi)

    The derivatives are by the four offsets, at a fixed beam direction. Raises ValidityError where the beam passes
    the scan point further off than the target.

    Source: [PARKER04] section 5.3 names the effect (d_l, d_d, D_i), eq. 2.16-2.18, 2.25 and 2.26 the angles; the
    formula is derived above. Exact for a plane wave and plane mirror.

    >>> change, slopes = path_change(0.0, np.pi / 2, 100.0, [1e-3, 0.0, 0.0, 0.0])
    >>> round(float(change), 7), slopes[:2].round(4).tolist()
    (-0.001, [-1.0, -1.4142])
    """
    prime = np.asarray(prime, dtype=bool)
    e, s, beam_x, beam_y = np.moveaxis(_shaped(offsets, 4, "offsets"), -1, 0)
    mount = np.asarray(theta, dtype=float) + np.where(prime, np.pi, 0.0)
    half = 0.5 * np.where(prime, -1.0, 1.0) * np.asarray(phi, dtype=float)
    r = np.asarray(distance, dtype=float)
    sine, cosine, along, across = np.sin(half), np.cos(half), np.cos(mount), np.sin(mount)
    c = s + e * sine
    w1 = beam_x * along + beam_y * across - 2.0 * c * sine
    w2 = beam_y * along - beam_x * across
    w_squared = w1**2 + w2**2
    clear = ~(r**2 <= w_squared)  # NaN gives NaN
    if not np.all(clear):
        first = np.unravel_index(np.argmin(clear), clear.shape)
        near, off = (float(np.broadcast_to(v, clear.shape)[first]) for v in (r, np.sqrt(w_squared)))
        raise ValidityError(
            f"distance {near:.4f} m is not above {off:.4f} m, by which the mirror's offsets move the beam aside: "
            "check their unit"
        )
    length = np.sqrt(r**2 - w_squared)
    change = -w_squared / (length + r) - 2.0 * c * cosine
    zero = np.zeros_like(c + length)
    by_c = np.stack(np.broadcast_arrays(sine, 1.0, zero, zero), axis=-1)
    by_w1 = np.stack(np.broadcast_arrays(-2.0 * sine**2, -2.0 * sine, along, across + zero), axis=-1)
    by_w2 = np.stack(np.broadcast_arrays(zero, zero, -across, along), axis=-1)
    slopes = -(w1[..., None] * by_w1 + w2[..., None] * by_w2) / length[..., None] - 2.0 * cosine[..., None] * by_c
    return change, slopes


def beam_angles(
    target: ArrayLike, offsets: ArrayLike, *, prime: ArrayLike = False
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Theta and Phi (...), rad, of the outgoing beam that meets a target.

    As for `path_change`.

    target     (..., 3), m, mirror axes
    offsets    (..., 4), m: axis, mirror, beam x, beam y
    prime      (...), bool: the mount stands at (Theta + pi, -Phi)

    Without offsets these are the target's own angles. They are found by turning the beam until it passes
    through the target. NaN after 60 turns: a target nearer than the beam is displaced, or so near to Phi = pi, straight
    behind the mirror, that the grazing beam passes it on all sides.

    Source: [PARKER04] eq. 2.13-2.18 and the displacement derived above. To 1e-14 rad.

    >>> [round(float(a), 6) for a in beam_angles([0.0, 10.0, 0.0], [0.0, 0.001, 0.0, 0.0])]
    [1.570796, 1.570938]
    """
    at = _shaped(target, 3, "target")
    e, s, beam_x, beam_y = np.moveaxis(_shaped(offsets, 4, "offsets"), -1, 0)
    sign = np.where(np.asarray(prime, dtype=bool), -1.0, 1.0)
    theta, phi = direction_angles(at)
    u = at / np.linalg.norm(at, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        for _ in range(ITERATIONS):
            (sin_t, cos_t), (sin_p, cos_p) = (np.sin(theta), np.cos(theta)), (np.sin(phi), np.cos(phi))
            up = np.stack([cos_p * cos_t, cos_p * sin_t, -sin_p], axis=-1)
            aside = np.stack([-sin_t, cos_t, np.zeros_like(sin_t)], axis=-1)
            sine = np.sin(0.5 * phi)  # in prime, h, the sine and the direction of w1 all change sign
            w1 = beam_x * cos_t + beam_y * sin_t - 2.0 * (s + sign * e * sine) * sine
            w2 = beam_y * cos_t - beam_x * sin_t
            along = at - w1[..., None] * up - w2[..., None] * aside
            along = along / np.linalg.norm(along, axis=-1, keepdims=True)
            moved, u = np.max(np.abs(along - u), axis=-1), along
            theta, phi = direction_angles(u)
            if not np.any(moved > SETTLED):
                break
    settled = moved <= 10.0 * SETTLED
    return np.where(settled, theta, np.nan), np.where(settled, phi, np.nan)


def _shaped(values: ArrayLike, last: int, what: str) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=float)
    if array.shape[-1:] != (last,):
        raise ValidityError(f"{what} has shape {array.shape}, expected (..., {last})")
    return array
