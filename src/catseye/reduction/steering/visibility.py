"""Visibility of retroreflectors from rangers in a posture, with reasons.

Each kind of retroreflector has its acceptance (`optics.retroreflector.kinds`). A cube corner is used as long as
`least_share` of its face returns light (`optics.retroreflector.prism.clear_share`); the light that the polished faces
of an uncoated prism transmit beyond 20 deg on the side of an edge (`optics.retroreflector.solid_prism`) is not counted
there.

"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.geometry.antenna.frames import (
    ELEVATION_AXIS_HEIGHT,
    alidade_from_elevation,
    ground_from_alidade,
    ground_from_reflector,
)
from catseye.geometry.clearance.visibility import first_obstruction, incidence, ranges
from catseye.geometry.frames.frame import Transform
from catseye.optics.retroreflector.kinds.kind import RetroreflectorKind
from catseye.records.site.folder import SiteFolder
from catseye.records.site.solids import Solids
from catseye.reduction.site.places import places_of

CLEAR_START = 0.6  # m: the ranger's own head and mount
CLEAR_END = 0.15  # m: the retroreflector's own seat, and a cat's-eye's other half
BEAM_RADIUS = 0.0125  # m: the GBT's beam at 120 to 230 m, 1/e^2, and a little


class Sight(IntEnum):
    """Visibility of a target from a ranger, or the first reason against it."""

    SEEN = 0
    TOO_NEAR = 1
    TOO_FAR = 2
    INCIDENCE = 3
    OBSTRUCTED = 4
    BEYOND_STOPS = 5


@dataclass(frozen=True)
class RangeLimits:
    """Usable ranges, m; the far one is twice the GBT's need."""

    near: float = 2.0
    far: float = 500.0


@dataclass(frozen=True, eq=False)
class Retroreflectors:
    """Retroreflectors in the ground frame.

    names    (t)
    kinds    (t)
    points   (t, 3) m
    axes     (t, 3) outward axes; NaN without one: then incidence is not judged
    """

    names: tuple[str, ...]
    kinds: tuple[RetroreflectorKind, ...]
    points: Array
    axes: Array

    @classmethod
    def with_axes(
        cls,
        names: tuple[str, ...],
        kinds: tuple[RetroreflectorKind, ...],
        points: Array,
        axes: Sequence[Array | None],
    ) -> "Retroreflectors":
        """Retroreflectors of a site, each with its axis (3,), or None for a kind without one.

        Raises InputError for a kind with an axis that lacks it.
        """
        checked = [kind.axis_of(name, axis) for name, kind, axis in zip(names, kinds, axes, strict=True)]
        return cls(names, kinds, points, np.array([np.full(3, np.nan) if axis is None else axis for axis in checked]))


@dataclass(frozen=True, eq=False)
class Visibility:
    """Visibility for r rangers and t retroreflectors.

    rangers, targets   names
    code               (r, t) of Sight
    range              (r, t) m
    incidence          (r, t) rad, NaN without an axis
    limit              (t,) rad
    obstacle           (r, t) index into `solids`, -1 where clear
    obstacle_at        (r, t) m from the ranger
    solids             names
    limits             of ranges
    """

    rangers: tuple[str, ...]
    targets: tuple[str, ...]
    code: NDArray[np.int64]
    range: Array
    incidence: Array
    limit: Array
    obstacle: NDArray[np.int64]
    obstacle_at: Array
    solids: tuple[str, ...]
    limits: RangeLimits

    @property
    def seen(self) -> NDArray[np.bool_]:
        """True (r, t) where a ranger sees a target."""
        return self.code == Sight.SEEN

    def reason(self, ranger: int, target: int) -> str:
        """Reason for a ranger's seeing a target or not, one line."""
        code, distance = Sight(int(self.code[ranger, target])), self.range[ranger, target]
        if code is Sight.TOO_NEAR:
            return f"too near: {distance:.1f} m under {self.limits.near:g}"
        if code is Sight.TOO_FAR:
            return f"too far: {distance:.1f} m above {self.limits.far:g}"
        if code is Sight.INCIDENCE:
            angle = np.degrees(self.incidence[ranger, target])
            return f"incidence {angle:.0f} deg above {np.degrees(self.limit[target]):.0f}"
        if code is Sight.OBSTRUCTED:
            name = self.solids[self.obstacle[ranger, target]]
            return f"obstructed by {name!r} at {self.obstacle_at[ranger, target]:.1f} m"
        return "beyond the azimuth stops" if code is Sight.BEYOND_STOPS else "seen"


def visibility(
    rangers: Mapping[str, Array],
    targets: Retroreflectors,
    solids: Solids,
    *,
    frames: Mapping[str, Transform],
    limits: RangeLimits | None = None,
    reachable: NDArray[np.bool_] | None = None,
    beam_radius: float = BEAM_RADIUS,
) -> Visibility:
    """Visibility of every pair of ranger and retroreflector.

    Seen, or the first reason against it.

    rangers       name: scan point (3,) m, ground
    targets       t of them
    solids        possible obstructions
    frames        name: ground from that frame, for each frame of a solid, see `frames_at`
    limits        of ranges
    reachable     (r, t) bool: within the azimuth stops; None: unknown
    beam_radius   m, by which solids are grown

    Reasons are judged in the order range, incidence, obstruction, stops.

    Source: geometry of rays; see `geometry.clearance.solids`.
    """
    limits = limits or RangeLimits()
    stand = np.array(list(rangers.values()), dtype=float).reshape(-1, 3)
    distance = ranges(stand, targets.points)
    angle = incidence(stand, targets.points, targets.axes)
    limits_of = {name: kind.acceptance.limit for name, kind in {kind.name: kind for kind in targets.kinds}.items()}
    limit = np.array([limits_of[kind.name] for kind in targets.kinds])
    which, at, names = _obstructions(stand, targets.points, solids, frames, beam_radius)
    code = np.full(distance.shape, Sight.SEEN, dtype=np.int64)
    with np.errstate(invalid="ignore"):
        oblique = angle > limit
    past_stops = np.zeros(distance.shape, dtype=bool) if reachable is None else ~np.asarray(reachable, dtype=bool)
    for reason, failing in (
        (Sight.BEYOND_STOPS, past_stops),
        (Sight.OBSTRUCTED, which >= 0),
        (Sight.INCIDENCE, oblique),
        (Sight.TOO_FAR, distance > limits.far),
        (Sight.TOO_NEAR, distance < limits.near),
    ):
        code[failing] = reason
    return Visibility(
        rangers=tuple(rangers),
        targets=targets.names,
        code=code,
        range=distance,
        incidence=angle,
        limit=limit,
        obstacle=which,
        obstacle_at=at,
        solids=names,
        limits=limits,
    )


def frames_at(azimuth: float, elevation: float, reflector: Transform | None = None) -> dict[str, Transform]:
    """Transform to ground from each frame of the solids, at a posture.

    azimuth      rad, clockwise from north; elevation rad
    reflector    ground from reflector if measured, else nominal

    Source: [PARKER04] eqs. 2.40-2.44.
    """
    alidade = ground_from_alidade(azimuth)
    return {
        "ground": Transform("ground", "ground", np.eye(3), np.zeros(3)),
        "alidade": alidade,
        "elevation": alidade @ alidade_from_elevation(elevation, elevation_axis_height=ELEVATION_AXIS_HEIGHT),
        "reflector": reflector or ground_from_reflector(azimuth, elevation),
    }


def retroreflectors_of(campaign: SiteFolder) -> Retroreflectors:
    """Retroreflectors of a campaign or a site, at nominal places.

    In its posture.

    Source: `places_of`.
    """
    table = [(place, place.kind) for place in places_of(campaign).values()]
    targets = [(place, kind) for place, kind in table if kind is not None]
    return Retroreflectors.with_axes(
        tuple(place.name for place, _ in targets),
        tuple(kind for _, kind in targets),
        np.array([place.start for place, _ in targets]),
        tuple(place.axis for place, _ in targets),
    )


def _obstructions(
    stand: Array, points: Array, solids: Solids, frames: Mapping[str, Transform], beam_radius: float
) -> tuple[NDArray[np.int64], Array, tuple[str, ...]]:
    """First solid in each path, its place, and the names of all solids."""
    names: list[str] = []
    best = np.full((len(stand), len(points)), np.inf)
    which = np.full(best.shape, -1, dtype=np.int64)
    for frame in dict.fromkeys(solid.frame for solid in solids.all):
        in_frame = [solid for solid in solids.all if solid.frame == frame]
        to_frame = frames[frame].inverse()
        enlarged = [solid.solid().grown(beam_radius) for solid in in_frame]
        index, at = first_obstruction(
            to_frame.points(stand), to_frame.points(points), enlarged, clear_start=CLEAR_START, clear_end=CLEAR_END
        )
        nearer = at < best
        best, which = np.where(nearer, at, best), np.where(nearer, index + len(names), which)
        names += [solid.name for solid in in_frame]
    return which, best, tuple(names)
