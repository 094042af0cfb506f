"""Zones that a ranger's beam must avoid between two times.

They are the Sun's cone and boxes, in the ranger's frame. A move is checked for the whole rectangle of counts between
its ends (`sweep`): for the Sun and for the sphere about each box, then for spheres about pieces of it. If one of these
is touched, the box itself is checked along the profiles of the axes.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.constants import DEGREE
from catseye.coordinator.visibility.sweep import chords, nearest
from catseye.coordinator.visibility.vantage import Vantage, reflector_at, seconds_between
from catseye.errors import InputError
from catseye.geometry.clearance.keep_out import BoxZone
from catseye.geometry.frames.frame import Transform
from catseye.geometry.mirror.slew import trapezoid
from catseye.records.night.live import TICK_SECONDS, TICKS_PER_DAY, LivePosture
from catseye.records.site.folder import SiteFolder
from catseye.records.site.keep_out import KeepOut
from catseye.reduction.site.earth_rotation import FramePlace, place_of, sun_at
from catseye.reduction.steering.guard import Guard, guard_of

NODES = 5  # instants for the positions of a ranger on the telescope
FREE, SUN, PERHAPS, BOX = 0, 1, 2, 3  # PERHAPS: possibly a box; BOX: certainly
PIECE = 5.0  # m: no piece of a box is longer


@dataclass(frozen=True, eq=False)
class Spheres:
    """Spheres as seen from a ranger.

    Directions (k, 3) of their middles, in its frame, and angles (k,), rad, to keep clear.
    """

    middles: Array
    limits: Array

    def grown(self, angle: float) -> "Spheres":
        """The same, widened by an angle, rad."""
        return Spheres(self.middles, self.limits + angle)

    def inside(self, vantage: Vantage, low: Array, high: Array) -> NDArray[np.bool_]:
        """True (..., k) if a beam in rectangles of counts (..., 2) may enter."""
        return np.asarray(nearest(vantage.station, low, high, directions=self.middles) <= self.limits)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Zones of one ranger in a span of time.

    vantage        the ranger
    suns           (k, 3) directions, own frame; none if the Sun is set
    sun_limit      rad: no beam nearer
    boxes          spheres about boxes, box by box, one for each of k positions of the ranger
    pieces         of each box, spheres about its pieces
    guards         for boxes only, one per position
    names          of the boxes
    """

    vantage: Vantage
    suns: Array
    sun_limit: float
    boxes: "Spheres"
    pieces: tuple["Spheres", ...]
    guards: tuple[Guard, ...]
    names: tuple[str, ...]

    def from_sun(self, low: ArrayLike, high: ArrayLike) -> Array:
        """Angle (...), rad, between the Sun's cone and a beam.

        The beam stays within rectangles of counts (..., 2).
        """
        if len(self.suns) == 0:
            return np.full(np.shape(low)[:-1], np.inf)
        return np.asarray(
            np.min(nearest(self.vantage.station, low, high, directions=self.suns), axis=-1) - self.sun_limit
        )

    def near_boxes(self, low: ArrayLike, high: ArrayLike) -> NDArray[np.bool_]:
        """True (...) if a beam in rectangles of counts (..., 2) may near a box."""
        a, b = np.broadcast_arrays(np.asarray(low, dtype=float), np.asarray(high, dtype=float))
        near_any = np.zeros(a.shape[:-1], dtype=bool)
        if self.pieces:
            stands = len(self.boxes.middles) // len(self.pieces)
            near = np.asarray(
                self.boxes.inside(self.vantage, a, b).reshape(*a.shape[:-1], len(self.pieces), stands).any(axis=-1)
            )
            for k, pieces in enumerate(self.pieces):
                unresolved = near[..., k] & ~near_any
                if unresolved.any():
                    near_any[unresolved] = pieces.inside(self.vantage, a[unresolved], b[unresolved]).any(axis=-1)
        return near_any

    def codes(self, low: ArrayLike, high: ArrayLike) -> NDArray[np.int8]:
        """FREE, SUN or PERHAPS (a box), (...), for rectangles of counts (..., 2)."""
        code = np.where(self.near_boxes(low, high), PERHAPS, FREE)
        return np.asarray(np.where(self.from_sun(low, high) <= 0.0, SUN, code), dtype=np.int8)

    def box_entered(self, start: ArrayLike, end: ArrayLike) -> str | None:
        """Box entered by a slew (2,) to (2,) counts; else None.

        Both axes start together.
        """
        move = trapezoid(start, end, self.vantage.pace)
        for guard in self.guards:
            entry = guard.entries(0.0, move)
            if int(entry.status):
                return self.names[int(entry.zone) - 1]
        return None

    def box_in(self, low: ArrayLike, high: ArrayLike, step: float = 100.0) -> str | None:
        """Box that a beam in a rectangle of counts (2,) may enter; else None.

        In whatever order the axes move.
        """
        a, b = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        grid = [np.linspace(a[k], b[k], int(np.ceil((b[k] - a[k]) / step)) + 1) for k in (0, 1)]
        cell = np.array([np.ptp(g) / max(len(g) - 1, 1) for g in grid]) * 0.5
        looks = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 2)
        far = float(np.hypot(*(cell * (1.0, 2.0)))) * 2.0 * np.pi * 1e-5  # half a cell's diagonal on the sky, at most
        for guard in self.guards:
            clearance = np.min(guard.clearance(0.0, looks, exact_below=0.05)[:, 1:], axis=0, initial=np.inf)
            if np.any(clearance <= far):
                return self.names[int(np.argmin(clearance))]
        return None


Zones = tuple[Spheres, tuple[Spheres, ...], tuple[Guard, ...]]
NO_SPHERES = Spheres(np.zeros((0, 3)), np.zeros(0))


class KeepClear:
    """Sun and boxes of a site.

    keep_out   boxes, cone, margins; the default without boxes if None
    place      of the ground frame's origin; the site's, with its usual air, if None
    """

    def __init__(self, site: SiteFolder, keep_out: KeepOut | None = None, place: FramePlace | None = None):
        self.site = site
        self.place = place or place_of(site.site.site)
        self.adopt(keep_out or KeepOut())

    def adopt(self, keep_out: KeepOut) -> None:
        """Use other boxes, another cone and other margins from now on."""
        self.keep_out = keep_out
        self.boxes = self.keep_out.boxes()
        self._whole = _table([(b.centre, 0.5 * float(np.linalg.norm(b.size))) for b in self.boxes])
        self._parts = [_table(_pieces(b)) for b in self.boxes]
        self._guards: dict[str, Guard] = {}
        self._standing: dict[tuple[str, float], Zones] = {}

    def guard(self, vantage: Vantage) -> Guard:
        """Guard of a ranger against boxes only, in its own frame."""
        if vantage.name not in self._guards:
            self._guards[vantage.name] = guard_of(
                vantage.name,
                vantage.station,
                vantage.mirror,
                keep_out=self.keep_out,
                place=None,
                pace=vantage.pace,
            )
        return self._guards[vantage.name]

    def sun(self, ticks: ArrayLike) -> Array:
        """Direction (..., 3) of the Sun, ground frame, also if set."""
        return sun_at(np.asarray(ticks, dtype=float) / TICKS_PER_DAY, self.place).direction

    def counts_at(self, directions: Array) -> bool:
        """True if a Sun at directions (k, 3), ground, must be avoided."""
        return bool(np.max(directions[..., 2]) >= np.sin(self.keep_out.sun.horizon_deg * DEGREE))

    def around(
        self,
        vantage: Vantage,
        since_ticks: int,
        until_ticks: int,
        *,
        posture: LivePosture | None,
        suns: Array | None = None,
        wider: float = 0.0,
    ) -> Surroundings:
        """Zones of a ranger between two times.

        posture   of the telescope, needed for a ranger on the feed arm; its rates are assumed constant
        suns      (NODES, 3) of `instants`, if already computed
        wider     rad, added to every zone

        Raises InputError for a ranger on the feed arm without a posture.
        """
        ticks = instants(since_ticks, until_ticks)
        directions = self.sun(ticks) if suns is None else suns
        guard = self.guard(vantage)
        if vantage.frame == "reflector" and posture is None:
            raise InputError(f"{vantage.name} is on the telescope, whose posture is unknown (expected one first)")
        if vantage.frame == "ground" or posture is None:
            frames = [Transform("ground", vantage.frame, np.eye(3), np.zeros(3))]
            turned = directions
        else:
            step = _node_step(posture, seconds_between(since_ticks, until_ticks))
            ticks, directions = ticks[::step], directions[::step]
            frames = [reflector_at(self.site, posture, seconds_between(posture.ticks, t)) for t in ticks.tolist()]
            turned = np.einsum("kji,kj->ki", np.stack([f.rotation for f in frames]), directions)
        margin = guard.margin + wider + chords(turned)
        cone = self.keep_out.sun.half_angle_deg * DEGREE + margin
        boxes, pieces, guards = self._spheres(vantage, guard, frames, wider)
        up = self.counts_at(directions)
        return Surroundings(
            vantage=vantage,
            suns=turned if up else turned[:0],
            sun_limit=cone,
            boxes=boxes,
            pieces=pieces,
            guards=guards,
            names=tuple(b.name for b in self.boxes),
        )

    def _spheres(self, vantage: Vantage, guard: Guard, frames: list[Transform], wider: float) -> Zones:
        """Spheres of boxes and pieces from a ranger's positions, and guards."""
        if not self.boxes:
            return NO_SPHERES, (), ()
        key = vantage.name, wider
        if vantage.frame == "ground" and key in self._standing:
            return self._standing[key]
        spheres_of_boxes, step = _spheres_from(vantage, frames, *self._whole)
        parts = [_spheres_from(vantage, frames, *part) for part in self._parts]
        # A ranger on the telescope is between its nodes, too: half a step widens every box.
        extra = wider + max(step, *(part_step for _, part_step in parts))
        guards = tuple(
            replace(
                guard,
                station=guard.station if vantage.frame == "ground" else vantage.on_ground(f),
                off_beam=guard.off_beam + extra,
            )
            for f in frames
        )
        off = guard.margin + extra
        zones = spheres_of_boxes.grown(off), tuple(spheres.grown(off) for spheres, _ in parts), guards
        if vantage.frame == "ground":
            self._standing[key] = zones
        return zones


def _node_step(posture: LivePosture, seconds: float) -> int:
    """Step in the instants for a ranger on the telescope: 4, 2 or 1."""
    turn = max(abs(posture.azimuth_rate), abs(posture.elevation_rate)) * seconds
    return NODES - 1 if turn < DEGREE else (NODES - 1) // 2 if turn < 3.0 * DEGREE else 1


def _table(spheres: list[tuple[Array, float]]) -> tuple[Array, Array]:
    return np.array([c for c, _ in spheres]).reshape(-1, 3), np.array([r for _, r in spheres])


def _spheres_from(vantage: Vantage, frames: list[Transform], centres: Array, radii: Array) -> tuple[Spheres, float]:
    """Spheres of middles (b, 3) m, ground, from some positions.

    And half the largest step between positions.
    """
    stands = np.stack([f.points(vantage.station.scan_point) for f in frames])
    turns = np.stack([f.rotation for f in frames])
    rays = centres[:, None] - stands
    far = np.linalg.norm(rays, axis=-1)
    axes = np.einsum("bki,kij->bkj", rays, turns) / np.maximum(far, 1e-9)[..., None]
    outside = far > radii[:, None]
    sine = np.divide(np.broadcast_to(radii[:, None], far.shape), far, out=np.ones_like(far), where=outside)
    limits = np.where(outside, np.arcsin(sine), np.pi)
    apart = np.linalg.norm(np.diff(axes, axis=1), axis=-1)
    step = float(np.max(np.arcsin(np.minimum(0.5 * apart, 1.0)), initial=0.0))
    return Spheres(axes.reshape(-1, 3), limits.ravel()), step


def _pieces(box: BoxZone) -> list[tuple[Array, float]]:
    """Middles (3,) m, ground, and radii of spheres about a box's pieces."""
    number = np.ceil(box.size / PIECE).astype(int)
    size = box.size / number
    grid = [(np.arange(n) + 0.5) * d - 0.5 * extent for n, d, extent in zip(number, size, box.size, strict=True)]
    x, y, z = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 3).T
    c, s = np.cos(box.turn), np.sin(box.turn)
    middles = box.centre + np.stack([c * x - s * y, s * x + c * y, z], axis=-1)
    return [(middle, 0.5 * float(np.linalg.norm(size))) for middle in middles]


def instants(since_ticks: int, until_ticks: int) -> NDArray[np.int64]:
    """Ticks (NODES,), from the first to the last, evenly."""
    return np.rint(np.linspace(since_ticks, until_ticks, NODES)).astype(np.int64)


def later(ticks: int, seconds: float) -> int:
    """Tick some seconds after a tick."""
    return ticks + round(seconds / TICK_SECONDS)
