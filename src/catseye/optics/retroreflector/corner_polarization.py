"""Cube corners in polarized light: Jones matrices of six reflection orders.

Axes of the reflector: z out of it towards the ranger, an edge at azimuth 0, as in `solid_prism` and `hollow_cube`.
Light is described across the direction d to the ranger, in axes (u, v): u is x made square to d, v = d x u. Going and
coming use the same two axes, as the ranger sees them: u to the right and v up, looking at the reflector. In them a
mirror straight on is -1, and a corner of three perfect mirrors +1, whatever the direction: each turns the field by half
a turn about its normal, and three half turns about square axes are none.

Every ray meets all three faces under the same three angles. There are six orders, each in one sector of the
aperture. A ray that enters in one sector leaves in the opposite one, where another takes the reverse path: their
matrices are each other's transpose.

Reflection from a corner does not change the path length, but the six phases differ: on the axis of the far field the
six add as amplitudes. Close by, and in all the returned light together, they add as powers.

Source: [PARKER04] section 6.2.5.
"""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.errors import ValidityError
from catseye.optics.polarization import Complex, Surface, reflection_matrix, surface, transfer

ORDERS = tuple(permutations(range(3)))  # faces in the order met
REVERSED = tuple(ORDERS.index(order[::-1]) for order in ORDERS)
THIRDS = 2.0 * np.pi / 3.0 * np.arange(3)
EDGES = np.stack([np.cos(THIRDS) * np.sqrt(2 / 3), np.sin(THIRDS) * np.sqrt(2 / 3), np.full(3, np.sqrt(1 / 3))], 1)
RAYS = 2880  # directions about the middle in which an aperture is divided among the sectors


@dataclass(frozen=True)
class Corner:
    """Cube corner in polarized light.

    index       phase index of what fills it over that of the air: 1 for a hollow one
    mirror      what its three faces reflect, from within: see `optics.polarization.surface`
    bare_face   True for a solid one without antireflection coating, whose face reflects s and p
    """

    index: float
    mirror: Surface
    bare_face: bool = False

    def __post_init__(self) -> None:
        if not 1.0 <= self.index < 4.0:
            raise ValidityError(f"index {self.index:g} of what fills the corner is outside 1 to 4")


def hollow_corner(metal: complex) -> Corner:
    """Cube corner of three metal mirrors.

    metal   index n + ik of the metal at the wavelength; infinite for a perfect conductor

    Source: `optics.polarization.reflection`.

    >>> sector_jones(hollow_corner(complex("inf")), 0.3, 1.0)[2].real.round(12) + 0.0
    array([[1., 0.], [0., 1.]])
    """
    return Corner(1.0, surface(inside=1.0, outside=metal))


def solid_corner(index: float, outside: complex = 1.0, *, bare_face: bool = False) -> Corner:
    """Prism of glass as a cube corner.

    index       phase index of the glass over that of the air, above 1
    outside     index behind its three faces: 1 for bare glass, n + ik for metal
    bare_face   as in `Corner`

    Source: `optics.polarization.reflection`. [PLAYER88] finds a quarter wave plate at an index that the abstract prints
    as 1.76476 (0.10 deg off): 1.767476 with a digit lost, as we infer.

    >>> from catseye.optics.polarization import retardance
    >>> round(float(np.degrees(retardance(sector_jones(solid_corner(1.767476), 0.0)[0]))), 4)
    90.0
    """
    return Corner(index, surface(inside=index, outside=outside), bare_face)


def sector_jones(corner: Corner, incidence: ArrayLike, azimuth: ArrayLike = 0.0) -> Complex:
    """Jones matrices (..., 6, 2, 2) of ORDERS, axes (u, v), power-normalized.

    corner      the corner
    incidence   (...) rad, 0 to below a right angle, of the direction to the ranger from z
    azimuth     (...) rad, of that direction about z, from an edge

    Raises ValidityError where a face cannot be reached: beyond an internal incidence of 35.26 deg some corners are
    missed.

    Source: [YUN11] for the matrices in three dimensions; [LIU97] and [PECK62] for the six ways, straight on. Exact for
    plane waves. The phase of the path, equal for all six, is omitted.

    >>> j = sector_jones(solid_corner(1.5112), 0.0)
    >>> bool(np.allclose(j[0] @ j[0].conj().T, np.eye(2)))
    True
    """
    toward, (u, v) = _axes(incidence, azimuth)
    inward, enter = _into(corner, -toward)
    missed = np.any(inward @ EDGES.T >= 0.0, axis=-1)
    if missed.any():
        i, a = (x[missed].flat[0] for x in np.broadcast_arrays(incidence, azimuth))
        raise ValidityError(
            f"incidence {i:.4g} rad at azimuth {a:.4g}: the light no longer meets all three faces "
            "(expected a smaller incidence)"
        )
    leave = _out_of(corner, toward)
    frame = np.stack([u, v], axis=-1)
    matrices = []
    for order in ORDERS:
        k, chain = inward, enter
        for face in order:
            k, step = reflection_matrix(k, EDGES[face], corner.mirror)
            chain = step @ chain
        matrices.append(np.swapaxes(frame, -1, -2) @ leave @ chain @ frame)
    return np.stack(matrices, axis=-3)


def sector_shares(
    corner: Corner,
    incidence: ArrayLike,
    azimuth: ArrayLike = 0.0,
    *,
    aperture: float,
    height: float,
) -> Array:
    """Shares (..., 6) of the clear area by ORDERS; they sum to 1.

    corner             the corner
    incidence, azimuth (...) rad, as for `sector_jones`
    aperture, height   m, above 0: radius of the clear, round face, and the corner's depth behind it

    Seen along the light within, the edges and their continuations divide the clear area, which is what the face and its
    image turned about the corner have in common. Order i and its reverse take opposite, equal parts.

    Source: geometry; the area by directions, exact to some 1e-5. A sixth each straight on.

    >>> sector_shares(solid_corner(1.5), 0.0, aperture=0.02, height=0.03).round(6)
    array([0.166667, 0.166667, 0.166667, 0.166667, 0.166667, 0.166667])
    """
    for name, value in (("aperture", aperture), ("height", height)):
        if not 0.0 < value < np.inf:
            raise ValidityError(f"{name} = {value:g} m is not above 0 and finite")
    inward, _ = _into(corner, -_axes(incidence, azimuth)[0])
    angle = (np.arange(RAYS) + 0.5) * (2.0 * np.pi / RAYS)
    out = np.stack([np.cos(angle), np.sin(angle)], axis=1)  # in the face's plane, about where the axis ray enters
    middle = -height * inward[..., :2] / -inward[..., 2:]  # there the ray through the corner meets the face
    reach = np.minimum(_to_rim(out, middle, aperture), _to_rim(-out, middle, aperture))
    dark = np.any(reach <= 0.0, axis=-1)
    if dark.any():
        i = np.broadcast_to(incidence, dark.shape)[dark].flat[0]
        raise ValidityError(f"incidence {i:.4g} rad: no part of the face returns light")
    # positions of the faces along a ray offset by `out`, nearest first
    when = (out @ EDGES[:, :2].T) / -(inward @ EDGES.T)[..., None, :]
    first, last = np.argmin(when, axis=-1), np.argmax(when, axis=-1)
    area = reach**2
    shares = [np.sum(np.where((first == a) & (last == c), area, 0.0), axis=-1) for a, _, c in ORDERS]
    return np.stack(shares, axis=-1) / np.sum(area, axis=-1)[..., None]


def far_field_jones(jones: ArrayLike, shares: ArrayLike | None = None) -> Complex:
    """Jones matrix (2, 2) on the far field's axis, over a perfect reflector.

    The reflector has equal aperture.

    jones    (6, 2, 2) of the sectors
    shares   (6,) of the area, a sixth each when not given; the light falls evenly

    Source: Fraunhofer's integral on the axis, [GOODMAN05] section 4.3; [CHANG71] for corners. Exact for a perfect
    corner (no dihedral offsets) in even light.

    >>> light = far_field_jones(sector_jones(solid_corner(1.457), 0.0)) @ [1.0, 0.0]
    >>> round(float(np.sum(np.abs(light) ** 2)), 3)
    0.264
    """
    weights = np.full(6, 1.0 / 6.0) if shares is None else np.asarray(shares, dtype=float)
    return np.einsum("s,sij->ij", weights, np.asarray(jones, dtype=complex))


def returned_power(
    jones: ArrayLike, field: ArrayLike, *, analyser: ArrayLike | None = None, shares: ArrayLike | None = None
) -> Array:
    """Share (...) of the power returned in total, optionally through an analyser.

    jones      (..., 6, 2, 2) of the sectors
    field      (..., 2) Jones vectors of the light that falls on it, of unit power
    analyser   (..., 2) of unit power: the state that passes; None for no analyser
    shares     (..., 6) of the area, a sixth each when not given

    Source: sum of powers: Parseval's theorem makes it the power of the whole far field as well. Exact.

    >>> j = sector_jones(hollow_corner(complex("inf")), 0.0)
    >>> float(returned_power(j, [1.0, 0.0], analyser=[1.0, 0.0]).round(12))
    1.0
    """
    back = np.einsum("...sij,...j->...si", np.asarray(jones, dtype=complex), np.asarray(field, dtype=complex))
    if analyser is None:
        power = np.sum(np.abs(back) ** 2, axis=-1)
    else:
        power = np.abs(np.einsum("...i,...si->...s", np.conj(np.asarray(analyser, dtype=complex)), back)) ** 2
    return np.asarray(np.sum(power * (1.0 / power.shape[-1] if shares is None else np.asarray(shares)), axis=-1))


def through_plate(jones: ArrayLike, plate: ArrayLike) -> Complex:
    """Jones matrices (..., 2, 2) of a reflector behind a plate.

    Out through the plate, round the reflector, back through the plate.

    jones   (..., 2, 2) of the reflector, in fixed axes
    plate   (2, 2) of the outward path; the return path is its transpose

    Source: reciprocity, [CHIPMAN18] section 5.5. Exact without magnetic fields: not for a Faraday rotator.

    >>> from catseye.optics.polarization import retarder
    >>> quarter = retarder(np.pi / 2, np.pi / 4)
    >>> abs(through_plate(np.eye(2), quarter)[1, 0]).round(12)  # all goes to the other side of a splitter
    np.float64(1.0)
    """
    plate = np.asarray(plate, dtype=complex)
    return plate.T @ np.asarray(jones, dtype=complex) @ plate


def _axes(incidence: ArrayLike, azimuth: ArrayLike) -> tuple[Array, tuple[Array, Array]]:
    """Directions (..., 3) to the ranger and the axes across them."""
    i, a = np.broadcast_arrays(np.asarray(incidence, float), np.asarray(azimuth, float))
    good = (i >= 0.0) & (i < 0.5 * np.pi)
    if not good.all():
        raise ValidityError(f"incidence {i[~good].flat[0]:.4g} rad is outside 0 to a right angle")
    toward = np.stack([np.sin(i) * np.cos(a), np.sin(i) * np.sin(a), np.cos(i)], axis=-1)
    u = np.array([1.0, 0.0, 0.0]) - toward[..., :1] * toward
    u = u / np.linalg.norm(u, axis=-1, keepdims=True)
    return toward, (u, np.cross(toward, u))


def _into(corner: Corner, outside: Array) -> tuple[Array, Complex]:
    """Directions within the corner of light along `outside`, and the face's matrices."""
    inward = _within(corner, outside, -1.0)
    return inward, transfer(outside, inward, _face_s(outside), *_face_gains(corner, outside, inward))


def _out_of(corner: Corner, outside: Array) -> Complex:
    """Matrices of the face for light leaving along `outside`, by reversal."""
    within = _within(corner, outside, 1.0)
    return transfer(within, outside, _face_s(outside), *_face_gains(corner, outside, within))


def _within(corner: Corner, outside: Array, sign: float) -> Array:
    """Refracted directions (..., 3), down or up."""
    flat = outside[..., :2] / corner.index
    return np.concatenate([flat, sign * np.sqrt(1.0 - np.sum(flat**2, axis=-1, keepdims=True))], axis=-1)


def _face_s(outside: Array) -> Array:
    """Vectors across the plane of incidence on the face."""
    size = np.hypot(outside[..., 0], outside[..., 1])[..., None]
    straight = size < 1e-12
    turned = np.stack([-outside[..., 1], outside[..., 0], np.zeros(outside.shape[:-1])], axis=-1)
    return np.where(straight, np.array([1.0, 0.0, 0.0]), turned / np.where(straight, 1.0, size))


def _face_gains(corner: Corner, outside: Array, inside: Array) -> tuple[ArrayLike, ArrayLike]:
    """Amplitudes transmitted by the face in s and p, as roots of power.

    The same in both directions.
    """
    if not corner.bare_face or corner.index == 1.0:
        return 1.0, 1.0
    c, d, n = np.abs(outside[..., 2]), np.abs(inside[..., 2]), corner.index
    common = 2.0 * np.sqrt(n * c * d)
    return common / (c + n * d), common / (n * c + d)


def _to_rim(out: Array, middle: Array, aperture: float) -> Array:
    """Distances (..., rays) from `middle` (..., 2) along `out` (rays, 2) to the rim; below 0 outside."""
    along = middle @ out.T
    square = along**2 + aperture**2 - np.sum(middle**2, axis=-1)[..., None]
    inside = (square > 0.0) & (np.sum(middle**2, axis=-1)[..., None] < aperture**2)
    return np.where(inside, np.sqrt(np.maximum(square, 0.0)) - along, -1.0)
