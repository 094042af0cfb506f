"""Aim of triplet mounts at the feed arm: two rotations of each, and how its plate then stands to the rangers.

A mount is locked by the rifle scope before the unit is in it. Its base is taken as the record has the unit: both angles
are 0 where the normal is the record's, the outer axis is the unit's y unless another is given, and then the trunnions
are square to it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.errors import ValidityError
from catseye.geometry.antenna.triplet_mount import aim_angles, base_from_unit, misaim
from catseye.reduction.triplet.mounted import SiteTriplets
from catseye.reduction.triplet.use import MountedTriplet
from catseye.verdict import Verdict

FAR_OFF = np.radians(1.0)  # of a record's normal from A: three times what an aim is good to
MOST_INCIDENCE = np.radians(45.0)  # on a prism: beyond it the return fades
SQUARE = 0.05  # sine between outer axis and normal's plane, below which the outer axis is the normal itself


@dataclass(frozen=True, eq=False)
class AimedMounts:
    """Aim of n mounts at A for k rangers; metres, radians, reflector frame.

    site          triplets and rangers
    aim           (3,) A
    distance      (n,) from the pivots to A
    swing, tip    (n,) rotations about the outer axis and the trunnions, from the record's normal
    normal, axis  (n, 3) of the aimed units: plate's normal on the prism side, left to right prism
    misaim        (n, 2) of A from the aimed normal at the ball, towards the right prism and up: what the scope's place
                  beside the ball leaves
    record        (n,) angle of the record's normal from the direction ball to A
    incidence     (n, k) of the rangers on the aimed plate
    centroid      (3,) of the scan points
    """

    site: SiteTriplets
    aim: Array
    distance: Array
    swing: Array
    tip: Array
    normal: Array
    axis: Array
    misaim: Array
    record: Array
    incidence: Array
    centroid: Array

    @property
    def off_centroid(self) -> float:
        """Distance of A from the centroid of the scan points, m."""
        return float(np.linalg.norm(self.aim - self.centroid))

    @property
    def verdict(self) -> Verdict:
        """Verdict: incidences on the aimed plates, and records whose normal looks elsewhere."""
        worst = np.unravel_index(int(np.argmax(self.incidence)), self.incidence.shape)
        if self.incidence[worst] > MOST_INCIDENCE:
            pair = f"{self.site.rangers[worst[1]]} would meet {self.site.units[worst[0]].name}"
            return Verdict("doubtful", f"{pair} at {np.degrees(self.incidence[worst]):.1f} deg (limit 45 deg)")
        odd = [unit.name for unit, off in zip(self.site.units, self.record, strict=True) if off > FAR_OFF]
        if odd:
            return Verdict("doubtful", f"the records of {', '.join(odd)} look more than 1 deg beside A")
        return Verdict("good", f"incidences up to {np.degrees(self.incidence.max()):.1f} deg on aimed plates")


def aimed_mounts(
    site: SiteTriplets,
    aim: ArrayLike | None = None,
    *,
    outer: ArrayLike | None = None,
    scope: ArrayLike = (0.0, 0.0),
    pivot: ArrayLike = (0.0, 0.0, 0.0),
) -> AimedMounts:
    """Two rotations of each mount that aim its sight at a point.

    site    triplets and rangers
    aim     (3,) m, A in the frame of the units; None: the site's
    outer   (3,) direction of the outer axis, in that frame; None: each unit's y
    scope   (2,) m, where the line of sight crosses the unit's x and y, from the pivot
    pivot   (3,) m, where the mount's axes meet, from the ball in the unit's axes

    Raises ValidityError for an outer axis along a normal, and a point nearer to an axis than the sight.

    Source: [GOLDMAN00] section 1.3, item 5, appendix C; closed form of `triplet_mount`.
    """
    point = site.aim if aim is None else np.asarray(aim, dtype=float)
    parts = [
        _aimed(unit, point, outer, np.asarray(scope, dtype=float), np.asarray(pivot, dtype=float))
        for unit in site.units
    ]
    swing, tip, normal, axis, misaims, distance = (np.array(part) for part in zip(*parts, strict=True))
    balls = np.stack([unit.ball for unit in site.units])
    towards = point - balls
    towards = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    record = _between(np.stack([unit.normal for unit in site.units]), towards)
    sights = site.scan[None] - balls[:, None]
    return AimedMounts(
        site=site,
        aim=point,
        distance=distance,
        swing=swing,
        tip=tip,
        normal=normal,
        axis=axis,
        misaim=misaims,
        record=record,
        incidence=_between(normal[:, None], sights / np.linalg.norm(sights, axis=-1, keepdims=True)),
        centroid=site.scan.mean(axis=0),
    )


def _aimed(unit: MountedTriplet, aim: Array, outer: ArrayLike | None, scope: Array, pivot: Array) -> tuple[Array, ...]:
    """Swing, tip, normal, axis, what is left of the aim, and the distance of A, of one mount."""
    y = unit.across if outer is None else np.asarray(outer, dtype=float)
    size = float(np.linalg.norm(y))
    if not size > 0.0:
        raise ValidityError("outer = 0,0,0 has no direction (expected a vector along the outer axis)")
    y = y / size
    z = unit.normal - (unit.normal @ y) * y
    if np.linalg.norm(z) < SQUARE:
        raise ValidityError(f"{unit.name}: the outer axis lies along the plate's normal (expected it across)")
    z = z / np.linalg.norm(z)
    base = np.stack([np.cross(y, z), y, z], axis=1)  # frame from base
    at = np.stack([unit.axis, unit.across, unit.normal], axis=1) @ pivot + unit.ball
    towards = base.T @ (aim - at)
    swing, tip = aim_angles(towards, scope)
    turned = base @ base_from_unit(swing, tip)
    offset = misaim(swing, tip, towards=towards, ball=-pivot)
    return swing, tip, turned[:, 2], turned[:, 0], offset, np.asarray(np.linalg.norm(towards))


def _between(a: Array, b: Array) -> Array:
    """Angle between unit vectors, rad, good at small angles."""
    return 2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
