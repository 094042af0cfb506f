"""Points that can be ranged to or from, at approximate places.

In the ground frame.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.geometry.antenna.frames import ground_from_alidade, ground_from_reflector
from catseye.geometry.frames.frame import Transform
from catseye.geometry.mirror.mount import gamma, scan_point
from catseye.optics.retroreflector.kinds.kind import GlassForm, RetroreflectorKind
from catseye.records.site.folder import SiteFolder
from catseye.records.site.target import TargetRow
from catseye.records.site.triplet import TripletRecord
from catseye.reduction.site.bodies import bodies_of, high_of_ground

MISTYPED_MM = 0.02  # ten times the effect of rounding and the dimensions' uncertainty


@dataclass(frozen=True, eq=False)
class RangedPoint:
    """Point of the network that can be ranged to.

    name       of the point
    kind       of retroreflector; None for a ranger
    start      (3,) m, ground frame
    axis       (3,) outward, ground frame; None for a kind without one, and for a ranger
    height     m, of a prism
    constant   m, range constant Pc of its glass; 0 for hollow cubes
    u_constant m, its standard uncertainty from that of the glass's dimensions, shared by all shots on it
    group      points that share its normal's error: its own name, or its triplet's; "" for none
    typed      True if its start is a typed approximate position
    u_start    m, each coordinate of the start, as its record says; None: `ReductionSettings.u_position` counts
    body       "dish", "arm" or "alidade"; "" on the ground

    Raises InputError for a kind with an axis that lacks it.
    """

    name: str
    kind: RetroreflectorKind | None
    start: np.ndarray
    axis: np.ndarray | None = None
    height: float = 0.0
    constant: float = 0.0
    u_constant: float = 0.0
    group: str = ""
    typed: bool = True
    u_start: float | None = None
    body: str = ""

    def __post_init__(self) -> None:
        if self.kind is not None:
            self.kind.axis_of(self.name, self.axis)

    @property
    def glass(self) -> GlassForm:
        """Form of its glass; none for a ranger."""
        return GlassForm.NONE if self.kind is None else self.kind.glass

    @property
    def normal(self) -> np.ndarray | None:
        """Normal (3,) of an entry face under which the range depends on the incidence; None without one."""
        return self.axis if self.kind is not None and self.kind.is_oblique else None

    @cached_property
    def across(self) -> np.ndarray:
        """Two unit vectors (2, 3) across the normal: its tilt axes."""
        assert self.normal is not None
        return np.asarray(np.linalg.svd(self.normal[None])[2][1:])

    def u_typed(self, usual: float) -> float:
        """Standard uncertainty of each start coordinate, m.

        The record's, else the usual one.
        """
        return usual if self.u_start is None else self.u_start


def nominal_frame(campaign: SiteFolder) -> Transform:
    """Transform reflector to ground at the campaign's posture.

    For a rigid, perfectly placed telescope.
    """
    reflector = campaign.site.frames.reflector
    return ground_from_reflector(
        np.radians(campaign.site.campaign.azimuth_deg),
        np.radians(campaign.site.campaign.elevation_deg),
        elevation_axis_height=reflector.elevation_axis_height_mm * MILLIMETRE,
        reflector_to_elevation=np.array(reflector.reflector_to_elevation_mm) * MILLIMETRE,
    )


def places_of(campaign: SiteFolder) -> dict[str, RangedPoint]:
    """All points that can be ranged to, by name.

    At their approximate positions in the ground frame.

    Source: README of the campaign layout; [PARKER04] eqs. 2.3-2.7 for scan points, 2.44 for the reflector frame;
    [GOLDMAN00] figure 10 for the triplet: ball = mid-point + h_corr * normal, normal towards the prism side; the ball
    faces the other way.
    """
    n = campaign.site.ranging.bk7_to_air_group_index_ratio
    to_ground = {
        "reflector": nominal_frame(campaign),
        "alidade": ground_from_alidade(np.radians(campaign.site.campaign.azimuth_deg)),
        "ground": Transform("ground", "ground", np.eye(3), np.zeros(3)),
    }
    places: dict[str, RangedPoint] = {}
    for name, monument in campaign.monuments.items():
        mirror = campaign.mirror_of(name)
        places[name] = RangedPoint(
            name,
            None,
            scan_point(
                np.array([monument.x_mm, monument.y_mm, monument.z_mm]) * MILLIMETRE,
                gamma(monument.alpha1_rad, monument.alpha2_rad, monument.alpha3_rad),
                np.array([mirror.dx_mm, mirror.dy_mm, mirror.dz_mm]) * MILLIMETRE,
            ),
            typed=False,
        )
    for ranger in campaign.feedarm.ranger:
        where = to_ground["reflector"].points(np.array(ranger.nominal_scan_point_mm) * MILLIMETRE)
        places[ranger.name] = RangedPoint(ranger.name, None, where, u_start=_metres(ranger.u_position_mm))
    for target in campaign.targets.values():
        places[target.name] = _target(target, to_ground[target.frame], n)
    for triplet in campaign.triplets.values():
        for point in _triplet(triplet, to_ground[triplet.frame], n):
            places[point.name] = point
    bodies = bodies_of(campaign, {target.name: target.frame for target in campaign.targets.values()})
    bodies |= high_of_ground(campaign)
    return {name: replace(place, body=bodies.get(name, "")) for name, place in places.items()}


def _target(target: TargetRow, frame: Transform, n: float) -> RangedPoint:
    """A single target.

    n is the glass's group index over the air's.
    """
    where = frame.points(np.array(target.position_mm) * MILLIMETRE)
    return RangedPoint(
        name=target.name,
        kind=target.kind,
        start=where,
        axis=None if target.normal is None else unit(frame.directions(target.normal)),
        height=(target.height_mm or 0.0) * MILLIMETRE,
        constant=(target.pc_mm or 0.0) * MILLIMETRE,
        u_constant=target.kind.u_range_constant(n, target.u_height_mm or 0.0) * MILLIMETRE,
        group=target.name if target.kind.is_oblique else "",
        u_start=_metres(target.u_position_mm),
    )


def _triplet(triplet: TripletRecord, frame: Transform, n: float) -> Iterator[RangedPoint]:
    """Left prism, right prism and ball of a triplet.

    n is the glass's group index over the air's.
    """
    ball = frame.points(np.array(triplet.nominal_position_mm) * MILLIMETRE)
    normal, axis = unit(frame.directions(triplet.normal)), unit(frame.directions(triplet.axis))
    middle = ball - triplet.h_corr_mm * MILLIMETRE * normal
    half = 0.5 * triplet.d12_mm * MILLIMETRE * axis
    for side, where in ((triplet.left_prism, middle - half), (triplet.right_prism, middle + half)):
        yield RangedPoint(
            name=side.target,
            kind=side.kind,
            start=where,
            axis=normal,
            height=side.height_mm * MILLIMETRE,
            constant=side.pc_mm * MILLIMETRE,
            u_constant=side.kind.u_range_constant(n, side.u_height_mm) * MILLIMETRE,
            group=triplet.triplet,
            u_start=_metres(triplet.u_position_mm),
        )
    yield RangedPoint(
        name=triplet.ball.target,
        kind=triplet.ball.kind,
        start=ball,
        axis=-normal,
        constant=triplet.ball.pc_b_mm * MILLIMETRE,
        u_constant=triplet.ball.kind.u_range_constant(n, triplet.ball.u_r_mm) * MILLIMETRE,
        u_start=_metres(triplet.u_position_mm),
    )


def _metres(value_mm: float | None) -> float | None:
    return None if value_mm is None else value_mm * MILLIMETRE


def sheet_notes(campaign: SiteFolder) -> list[str]:
    """GlassForm constants that contradict their dimensions, one line each.

    Every shot on a target shares its constant, so that no residual shows a typing error in it.

    Source: [GOLDMAN00] eqs. 3.9, 3.10 and 3.14 with the site's index ratio.
    """
    n = campaign.site.ranging.bk7_to_air_group_index_ratio
    glasses: list[tuple[str, str, float, float]] = []
    for target in campaign.targets.values():
        if target.height_mm is not None and target.pc_mm is not None:
            glasses.append((target.name, "pc_mm", target.pc_mm, target.kind.range_constant(n, target.height_mm)))
    for triplet in campaign.triplets.values():
        ball = triplet.ball
        by_radii = ball.kind.range_constant(n, ball.r1_mm, ball.r2_mm)
        glasses.append((ball.target, "pc_b_mm", ball.pc_b_mm, by_radii))
        for side in (triplet.left_prism, triplet.right_prism):
            glasses.append((side.target, "pc_mm", side.pc_mm, side.kind.range_constant(n, side.height_mm)))
    return [
        f"{name}: {key} = {typed} does not follow from its dimensions, which give {right:.4f}: one of them is mistyped"
        for name, key, typed, right in glasses
        if abs(typed - right) > MISTYPED_MM
    ]


def unit(v: np.ndarray) -> np.ndarray:
    """Vector (3,) at length 1."""
    return v / np.linalg.norm(v)
