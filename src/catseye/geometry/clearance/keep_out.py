"""Keep-out zones of a beam, and path checks against them.

Zones are cones about directions (the Sun) and boxes (structure, people); a path is checked against all.

The clearance of a beam from a zone is an angle: how far it must turn at least to come into the zone. It is continuous,
and it cannot shrink faster than beam and zone turn. So a beam with a clearance c is safe for c / rate without another
check, and a finite number of checks covers a path without gaps: conservative advancement. A path that comes nearer
than `TOUCH` counts as entering.

A mirror that shows its back (|Phi| above pi) is treated by the same formulas: nothing leaves there, but a face
polished on both sides would reflect the Sun's light so. That is conservative.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError
from catseye.geometry.mirror.encoder import BEAM_PER_COUNT
from catseye.geometry.mirror.pointing import MirrorStation, beam
from catseye.geometry.mirror.slew import MirrorSlew

BOXES_NEAR = 0.05  # rad: beyond it a path uses the sphere about a box, which is faster
COMPILED_FROM = 5000  # moves: for fewer, loading numba takes longer than the plain form
TOUCH = 5e-5  # rad, 10": the last clearance, less than a count of the elevation axis


class EntryStatus(IntEnum):
    """Status of a path against the zones."""

    FREE = 0
    ENTERS = 1
    STARTS_INSIDE = 2


@dataclass(frozen=True, eq=False)
class Entries:
    """Zone entries of paths (...).

    status    codes of EntryStatus
    time      s from the start to the entry, NaN without one
    zone      number of the zone entered, -1 without one
    looks     number of checks along the path
    """

    status: NDArray[np.int8]
    time: NDArray[np.float64]
    zone: NDArray[np.int64]
    looks: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ConeZone:
    """Directions within `half_angle` of an axis, which moves evenly to `later` along a path.

    direction     (..., 3), ground, any length; one for each path
    half_angle    (...), rad; -inf where the zone is inactive
    later         (..., 3), at the path's end; None: fixed
    """

    direction: NDArray[np.float64]
    half_angle: NDArray[np.float64]
    later: NDArray[np.float64] | None = None
    name: str = "the Sun"

    def __post_init__(self) -> None:
        for name in ("direction", "later"):
            if getattr(self, name) is not None:
                vector = np.asarray(getattr(self, name), dtype=float)
                size = np.linalg.norm(vector, axis=-1, keepdims=True)
                if vector.shape[-1:] != (3,) or not np.all((size > 0.0) & np.isfinite(size)):
                    raise ValidityError(f"{name} of a cone is not a non-zero vector (..., 3)")
                object.__setattr__(self, name, vector / size)
        half = np.asarray(self.half_angle, dtype=float)
        if not np.all(half < np.pi):
            raise ValidityError(f"half angle {float(np.max(half)):.6g} rad of a cone is not below pi: check its unit")
        object.__setattr__(self, "half_angle", half)

    def clearance(self, direction: ArrayLike, share: ArrayLike = 0.0) -> NDArray[np.float64]:
        """Angle (...), rad, from beams (..., 3), unit, to the zone; below zero inside.

        At a share 0 to 1 of the path.
        """
        axis = self.direction
        if self.later is not None:
            s = np.asarray(share, dtype=float)[..., None]
            axis = (1.0 - s) * axis + s * self.later
            axis = axis / np.linalg.norm(axis, axis=-1, keepdims=True)
        return _angle(np.asarray(direction, dtype=float), axis) - self.half_angle

    def rate(self, total: NDArray[np.float64]) -> NDArray[np.float64]:
        """Upper bound (...), rad/s, of the axis rate, for path times (...) s."""
        if self.later is None:
            return np.zeros_like(total)
        # A point that runs evenly along the chord turns fastest half-way, by 2 tan(a/2) where the arc has a.
        return 2.0 * np.tan(0.5 * _angle(self.direction, self.later)) / np.where(total > 0.0, total, np.inf)

    def __getitem__(self, index: Any) -> "ConeZone":
        """Zone entries of some of the paths."""
        direction = self.direction if self.direction.ndim == 1 else self.direction[index]
        later = self.later if self.later is None or self.later.ndim == 1 else self.later[index]
        half = self.half_angle if self.half_angle.ndim == 0 else self.half_angle[index]
        return ConeZone(direction, half, later, self.name)


@dataclass(frozen=True, eq=False)
class BoxZone:
    """Box with horizontal and vertical edges, turned about its middle axis.

    centre    (3,), m, ground
    size      (3,), m, full lengths before the turn, above 0
    turn      rad, right-handed about z: x towards y
    length    m, of the beam: parts further from the scan point are ignored
    why       reason, for a refusal
    """

    centre: NDArray[np.float64]
    size: NDArray[np.float64]
    turn: float = 0.0
    length: float = np.inf
    name: str = "a box"
    why: str = ""

    def __post_init__(self) -> None:
        for name in ("centre", "size"):
            object.__setattr__(self, name, np.array(getattr(self, name), dtype=float))
        sound = self.centre.shape == self.size.shape == (3,) and np.isfinite([*self.centre, self.turn]).all()
        if not (sound and np.all((self.size > 0.0) & np.isfinite(self.size)) and self.length > 0.0):
            raise ValidityError(
                f"{self.name}: centre, size and turn of a box are not 3, 3 and 1 numbers, sizes above 0"
            )

    def clearance(self, origin: ArrayLike, direction: ArrayLike, exact_below: float = np.inf) -> NDArray[np.float64]:
        """Angle (...), rad, from beams to a box; 0 on a hit.

        inf if the box is beyond reach.

        origin       (3,), m: one scan point; inside the box all beams are refused
        direction    (..., 3), unit
        exact_below  rad: above it the result may be less, the clearance of the sphere about the box
        """
        view = Outline.of(self, np.asarray(origin, dtype=float))
        return view.clearance(np.asarray(direction, dtype=float), exact_below)


@dataclass(frozen=True, eq=False)
class Outline:
    """Outline of a box from a scan point, independent of the beam.

    In the box's axes.

    at       (3,), m, the scan point from the box's centre; half (3,), m, half the box's size; to_box (3, 3)
    near     m to its nearest point
    corners  (c, 3), unit directions to the ends of its edges; poles (k, 3) of its edges, and the planes across their
             ends, `since` and `until` (k, 3): a direction is abreast of an edge if it is above both
    middle   (3,), unit, to its centre, and `radius`, rad, of the sphere about it; pi where that holds the scan point
    """

    at: NDArray[np.float64]
    half: NDArray[np.float64]
    to_box: NDArray[np.float64]
    length: float
    near: float
    corners: NDArray[np.float64]
    poles: NDArray[np.float64]
    since: NDArray[np.float64]
    until: NDArray[np.float64]
    middle: NDArray[np.float64]
    radius: float

    @classmethod
    def of(cls, box: BoxZone, origin: NDArray[np.float64]) -> "Outline":
        """Outline from origin (3,), m, ground."""
        to_box = _upright(box.turn)
        at, half = to_box @ (origin - box.centre), 0.5 * box.size
        a, b = _edges(at, half, box.length)
        poles = np.cross(a, b)
        sizes = np.linalg.norm(poles, axis=-1)
        broadside = sizes > 1e-12  # else an edge seen end on: a corner
        poles = poles[broadside] / sizes[broadside, None]
        distance, sphere = float(np.linalg.norm(at)), float(np.linalg.norm(half))
        return cls(
            at=at,
            half=half,
            to_box=to_box,
            length=box.length,
            near=float(np.linalg.norm(np.maximum(np.abs(at) - half, 0.0))),
            corners=np.concatenate([a, b]),
            poles=poles,
            since=np.cross(poles, a[broadside]),
            until=np.cross(b[broadside], poles),
            middle=-at / distance if distance > 0.0 else np.array([0.0, 0.0, 1.0]),
            radius=float(np.arcsin(sphere / distance)) if distance > sphere else np.pi,
        )

    def clearance(self, direction: NDArray[np.float64], exact_below: float = np.inf) -> NDArray[np.float64]:
        """Clearance as `BoxZone.clearance`; above `exact_below`, rad, that of the sphere."""
        if self.near == 0.0:
            return np.zeros(direction.shape[:-1])
        if self.near > self.length:
            return np.full(direction.shape[:-1], np.inf)
        d = direction @ self.to_box.T
        least = np.asarray(_angle(d, self.middle) - self.radius)
        near = least < exact_below
        least[near] = self._exact(d[near])
        return least

    def _exact(self, d: NDArray[np.float64]) -> NDArray[np.float64]:
        """Exact clearance of directions (n, 3) in the box's axes."""
        least = np.full(len(d), np.inf)
        if len(self.corners):
            chord = np.min(np.sum((d[:, None] - self.corners) ** 2, axis=-1), axis=-1)
            least = 2.0 * np.arcsin(np.minimum(0.5 * np.sqrt(chord), 1.0))
        if len(self.poles):
            abreast = (d @ self.since.T > 0.0) & (d @ self.until.T > 0.0)
            sine = np.min(np.where(abreast, np.abs(d @ self.poles.T), np.inf), axis=-1)
            least = np.where(sine <= 1.0, np.minimum(least, np.arcsin(np.minimum(sine, 1.0))), least)
        if np.isfinite(self.length):
            for axis in range(3):
                least = np.minimum(least, _angle_to_rim(d, self.at, self.half, axis, self.length))
        return np.where(_hits(self.at, d, self.half, self.length), 0.0, least)


Zone = ConeZone | BoxZone


def servo_margin(counts: ArrayLike) -> float:
    """Beam angle margin, rad, for axis errors in counts (2,), azimuth and elevation, 0 or above.

    >>> round(float(np.degrees(servo_margin([20.0, 20.0]))), 4)
    0.161
    """
    off = np.asarray(counts, dtype=float)
    if off.shape != (2,) or not np.all((off >= 0.0) & np.isfinite(off)):
        raise ValidityError(f"servo margin {off.tolist()} is not two numbers of counts, 0 or above")
    return float(np.linalg.norm(off * BEAM_PER_COUNT))


def clearances(
    zones: Sequence[Zone], origin: ArrayLike, direction: ArrayLike, *, exact_below: float = np.inf
) -> NDArray[np.float64]:
    """Clearance (..., zones), rad, of beams at the start of their paths.

    See `ConeZone` and `BoxZone`.

    zones        of which a cone has one direction, or one for each beam
    origin       (3,), m, ground: the scan point
    direction    (..., 3), unit, ground
    exact_below  rad: a box further off may give less, the clearance of the sphere about it
    """
    d = np.asarray(direction, dtype=float)
    shape = d.shape[:-1]
    columns = [z.clearance(d) if isinstance(z, ConeZone) else z.clearance(origin, d, exact_below) for z in zones]
    columns = [np.broadcast_to(one, shape) for one in columns]
    return np.stack(columns, axis=-1) if columns else np.zeros((*shape, 0))


def first_entry(
    station: MirrorStation,
    slews: MirrorSlew,
    zones: Sequence[Zone],
    *,
    margin: float = 0.0,
    compiled: bool | None = None,
) -> Entries:
    """First entry of one mirror's paths into a zone.

    No gaps between checks.

    station    one ranger
    slews      its moves, a batch (n,) or one
    zones      cones with one direction or one for each move; boxes
    margin     rad: largest deviation of the beam from its path (`servo_margin`)
    compiled   True for the kernel; None: for many moves

    A path is FREE only if its clearance stays above margin + TOUCH all the way. Raises ValidityError for a batch of
    stations or moves of more than one axis.

    Source: derived above; the method is conservative advancement, as in [MIRTICH96].
    """
    if station.shape != () or len(slews.shape) > 1:
        raise ValidityError(f"stations {station.shape} with moves {slews.shape}: expected one ranger and moves (n,)")
    if slews.shape == ():
        only = first_entry(station, slews[None], zones, margin=margin, compiled=compiled)
        return Entries(only.status[0], only.time[0], only.zone[0], only.looks[0])
    if zones and (slews.shape[0] >= COMPILED_FROM if compiled is None else compiled):
        return _compiled_entries(station, slews, zones, margin)
    n, total = slews.shape[0], slews.total
    views = [z if isinstance(z, ConeZone) else Outline.of(z, station.scan_point) for z in zones]
    drift = [v.rate(total) if isinstance(v, ConeZone) else np.zeros(n) for v in views]
    status, looks = np.zeros(n, dtype=np.int8), np.zeros(n, dtype=np.int64)
    entry, zone = np.full(n, np.nan), np.full(n, -1)
    at, instant = np.arange(n if zones else 0), np.zeros(n if zones else 0)
    while len(at):
        remaining = slews[at]
        # as `geometry.mirror.pointing.ray`: eq. 2.47 turned round
        direction = beam(station, remaining.position(instant)) @ station.mirror_from_ground
        share = instant / np.where(total[at] > 0.0, total[at], 1.0)
        rate = remaining.beam_rate(instant)
        gap, step = np.full(len(at), np.inf), np.full(len(at), np.inf)
        nearest = np.zeros(len(at), dtype=int)
        for i, view in enumerate(views):
            if isinstance(view, ConeZone):
                one = view[at].clearance(direction, share) - margin
            else:
                one = view.clearance(direction, margin + BOXES_NEAR) - margin
            turning = rate + drift[i][at]
            step = np.minimum(step, np.where(turning > 0.0, one / np.where(turning > 0.0, turning, 1.0), np.inf))
            nearest, gap = np.where(one < gap, i, nearest), np.minimum(one, gap)  # NaN stays, and counts as inside
        looks[at] += 1
        inside = ~(gap > TOUCH)
        status[at[inside]] = np.where(instant[inside] > 0.0, EntryStatus.ENTERS, EntryStatus.STARTS_INSIDE)
        entry[at[inside]], zone[at[inside]] = instant[inside], nearest[inside]
        instant = instant + step
        going = ~inside & (instant < total[at])
        at, instant = at[going], instant[going]
    return Entries(status, entry, zone, looks)


def _compiled_entries(station: MirrorStation, slews: MirrorSlew, zones: Sequence[Zone], margin: float) -> Entries:
    """Compute `first_entry` of many moves by the kernel."""
    from catseye.geometry.clearance.keep_out_kernel import first_entries

    n, total = slews.shape[0], slews.total
    cones = [z for z in zones if isinstance(z, ConeZone)]
    views = [Outline.of(z, station.scan_point) for z in zones if isinstance(z, BoxZone)]
    order = sorted(range(len(zones)), key=lambda i: isinstance(zones[i], BoxZone))
    axes = np.zeros((2, len(cones), n, 3))
    for i, cone in enumerate(cones):
        axes[0, i], axes[1, i] = cone.direction, cone.direction if cone.later is None else cone.later
    half = np.array([np.broadcast_to(c.half_angle, (n,)) for c in cones]).reshape(len(cones), n)
    drift = np.array([c.rate(total) for c in cones]).reshape(len(cones), n)
    out = Entries(np.zeros(n, np.int8), np.full(n, np.nan), np.full(n, -1), np.zeros(n, np.int64))
    moves = (slews.start, slews.end, slews.ramp, slews.duration, slews.top_speed)
    first_entries(
        tuple(np.ascontiguousarray(v) for v in moves),
        (np.array(station.zeros), np.array(BEAM_PER_COUNT), np.array(station.mirror_from_ground)),
        (axes[0], axes[1], half, drift),
        (*_packed(views), np.array(order)),
        (margin, TOUCH, margin + BOXES_NEAR),
        (out.status, out.time, out.zone, out.looks),
    )
    return out


def _packed(views: list[Outline]) -> tuple[NDArray, ...]:
    """Outlines as arrays for the kernel, padded with zeros."""
    b = len(views)
    corners, edges, counts = np.zeros((b, 24, 3)), np.zeros((b, 3, 12, 3)), np.zeros((b, 2), dtype=np.int64)
    for i, v in enumerate(views):
        counts[i] = len(v.corners), len(v.poles)
        corners[i, : len(v.corners)] = v.corners
        edges[i, :, : len(v.poles)] = v.poles, v.since, v.until
    return (
        np.array([v.at for v in views]).reshape(-1, 3),
        np.array([v.half for v in views]).reshape(-1, 3),
        np.array([v.to_box for v in views]).reshape(-1, 3, 3),
        np.array([(v.length, v.near, v.radius) for v in views]).reshape(-1, 3),
        corners,
        edges,
        counts,
        np.array([v.middle for v in views]).reshape(-1, 3),
    )


def _angle(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle (...) between unit vectors by their chord: good to 1e-15, near pi to 1e-8."""
    apart = a - b
    chord = np.sqrt(np.einsum("...i,...i->...", apart, apart))
    return 2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))


def _upright(turn: float) -> NDArray[np.float64]:
    """Rotation (3, 3) to axes turned about z."""
    c, s = np.cos(turn), np.sin(turn)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def _hits(at: NDArray, d: NDArray, half: NDArray, length: float) -> NDArray[np.bool_]:
    """True where half-lines from `at` along d (..., 3) hit the box within their length.

    Touching counts.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = (-half - at) / d, (half - at) / d
    enter, leave = np.fmin(low, high), np.fmax(low, high)
    misses = (d == 0.0) & (np.abs(at) > half)
    still = (d == 0.0) & ~misses
    enter, leave = np.where(still, -np.inf, enter), np.where(still, np.inf, leave)
    first, last = np.max(enter, axis=-1), np.min(leave, axis=-1)
    return ~np.any(misses, axis=-1) & (first <= last) & (last >= 0.0) & (first <= length)


def _edges(at: NDArray, half: NDArray, length: float) -> tuple[NDArray, NDArray]:
    """Unit directions (k, 3) from `at` to both ends of each edge.

    Of its part within the length.
    """
    directions = []
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        for si in (-1.0, 1.0):
            for sj in (-1.0, 1.0):
                a = -at
                a[i], a[j] = a[i] + si * half[i], a[j] + sj * half[j]
                room = length**2 - a[i] ** 2 - a[j] ** 2
                reach = np.sqrt(room) if room > 0.0 else -np.inf
                ends = np.stack([a, a])
                ends[0, axis], ends[1, axis] = max(a[axis] - half[axis], -reach), min(a[axis] + half[axis], reach)
                if room > 0.0 and ends[0, axis] <= ends[1, axis] and np.all(np.any(ends != 0.0, axis=-1)):
                    directions.append(ends / np.linalg.norm(ends, axis=-1, keepdims=True))
    pairs = np.array(directions).reshape(-1, 2, 3)
    return pairs[:, 0], pairs[:, 1]


def _angle_to_rim(d: NDArray, at: NDArray, half: NDArray, axis: int, length: float) -> NDArray[np.float64]:
    """Angle (...) from d (..., 3) to the circle of the near face; inf if none.

    The face is across an axis, and the circle is one length away.

    The nearest point of the circle lies towards d; where it is off the face, an edge is nearer.
    """
    side = np.sign(at[axis])
    height = abs(at[axis]) - half[axis]  # of the scan point above that face
    if not 0.0 < height < length:
        return np.full(d.shape[:-1], np.inf)
    radius = np.arccos(height / length)
    down = -side * d[..., axis]
    lateral = [k for k in range(3) if k != axis]
    across = np.hypot(d[..., lateral[0]], d[..., lateral[1]])
    reach = length * np.sin(radius) / np.where(across > 0.0, across, 1.0)
    on = np.ones(d.shape[:-1], dtype=bool)
    for k in lateral:
        on &= np.abs(at[k] + reach * d[..., k]) <= half[k]
    return np.where(on, np.abs(np.arctan2(across, down) - radius), np.inf)
