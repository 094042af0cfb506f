"""Antenna by a structural model: frames and points in any posture.

With their uncertainties.

Each frame f stands on its parent. A point x of it (in its own nominal axes) is first carried by the frame's motion,
then by the nominal transform into the parent's axes: x_parent = N_f(M_f(x)). N is the first order of the notes, M the
second; a measured correction or a vibration is added to the shift and turn inside M (the third).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.errors import InputError
from catseye.geometry.antenna.deformation import (
    KnotTable,
    PostureMotion,
    PostureTerms,
    TelescopePosture,
    Validity,
    carried,
    left_jacobian,
    motion_jacobian,
)
from catseye.geometry.antenna.frames import alidade_from_elevation_at, ground_from_alidade_at
from catseye.geometry.antenna.subreflector import turned
from catseye.geometry.frames.frame import Transforms
from catseye.records.site.structural_model import (
    KEYS,
    ROOT,
    Basis,
    FrameRecord,
    GroupRecord,
    MotionRecord,
    StructuralModel,
    flattened,
)

UNITS = np.repeat([MILLIMETRE, ARCSECOND], 3)  # of a motion's six components in the file
Added = Mapping[str, ArrayLike]  # frame or group: (..., 6) m and rad, on top of the model's


@dataclass(frozen=True, eq=False)
class RestPoints:
    """Points of a group at rest.

    names      n
    frame      of the coordinates
    group      of the points
    position   (n, 3) m
    u          (n,) m, of each coordinate
    """

    names: tuple[str, ...]
    frame: str
    group: str
    position: np.ndarray
    u: np.ndarray


@dataclass(frozen=True, eq=False)
class SubreflectorPosition:
    """Commanded position of the subreflector's drives.

    See `geometry.antenna.subreflector`.

    shift    (..., 3) m
    angles   (..., 3) rad, about x, then y, then z
    pivot    (3,) m, prime-focus frame
    """

    shift: np.ndarray
    angles: np.ndarray
    pivot: np.ndarray


@dataclass(frozen=True, eq=False)
class Antenna:
    """Structural model ready for use.

    record     the model as read
    parents    frame: its parent frame
    motions    frame or group: its motion; those without one are absent
    validity   postures for which the model is valid
    """

    record: StructuralModel
    parents: dict[str, str]
    motions: dict[str, PostureMotion]
    validity: Validity

    @cached_property
    def groups(self) -> dict[str, RestPoints]:
        """Points by the name of their group."""
        return {group.name: _points(group) for group in self.record.group}

    @cached_property
    def _frames(self) -> dict[str, FrameRecord]:
        return {frame.name: frame for frame in self.record.frame}

    def chain(self, frame: str) -> list[str]:
        """Frames from the alidade to this one.

        InputError where the model has none of that name.
        """
        if frame not in self.parents:
            raise InputError(f"frame {frame!r} is not in the structural model (it has {', '.join(self.parents)})")
        names = [frame]
        while self.parents[names[-1]] != ROOT:
            names.append(self.parents[names[-1]])
        return names[::-1]

    def nominal(
        self, frame: str, posture: TelescopePosture, subreflector: SubreflectorPosition | None = None
    ) -> Transforms:
        """Transform to the parent from the frame at rest.

        First order, and the subreflector as commanded.

        frame, posture   of the transform
        subreflector     its position, for the frame of that name

        Source: [PARKER04] eq. 2.40-2.43.
        """
        self.chain(frame)
        origin = np.array(self._frames[frame].origin_mm) * MILLIMETRE
        if frame == "alidade":
            turn = ground_from_alidade_at(posture.azimuth).rotation
        elif frame == "elevation":
            turn = alidade_from_elevation_at(posture.elevation, elevation_axis_height=0.0).rotation
        else:
            turn = np.eye(3)
        at_rest = Transforms(self.parents[frame], frame, turn, origin)
        if frame != "subreflector" or subreflector is None:
            return at_rest
        matrix = turned(subreflector.angles)
        arm = origin - subreflector.pivot
        place = subreflector.pivot + subreflector.shift + np.einsum("...ij,j->...i", matrix, arm)
        return Transforms(self.parents[frame], frame, matrix, place)

    def six(self, name: str, posture: TelescopePosture, added: Added | None = None) -> np.ndarray:
        """Shift and turn (..., 6), m and rad, of a frame or group.

        With additions; zero without a motion.
        """
        six = self.motions[name].six(posture) if name in self.motions else np.zeros((*posture.shape, 6))
        return six + np.asarray(added[name], dtype=float) if added and name in added else six

    def check_additions(self, added: Added | None) -> None:
        """Raise InputError for an addition to a frame or group without rigid motion.

        It would be lost silently.
        """
        point_groups = {group.name for group in self.record.group if group.shifts is None}
        for name in added or {}:
            if name not in self.parents and name not in point_groups:
                raise InputError(
                    f"{name!r} cannot be shifted and turned: it is no frame of the structural model nor a group that "
                    f"moves as a whole (these are {', '.join([*self.parents, *sorted(point_groups)])})"
                )

    def pivot(self, name: str) -> np.ndarray:
        """Pivot (3,), m, of a frame's or group's turns.

        Own nominal axes; its origin without a motion.
        """
        return self.motions[name].pivot if name in self.motions else np.zeros(3)

    def ground_from(
        self,
        frame: str,
        posture: TelescopePosture,
        *,
        added: Added | None = None,
        subreflector: SubreflectorPosition | None = None,
        deformed: bool = True,
    ) -> Transforms:
        """Transforms (...) of points of a frame into the ground frame.

        frame          "alidade", "reflector", "feed_arm" or another of the model
        posture        (...) of the telescope
        added          frame: (..., 6) m and rad, added to its shift and turn: a correction, a vibration
        subreflector   its commanded position
        deformed       False gives the first order only, and checks nothing

        Raises ValidityError outside the model's range, InputError for an unknown frame, also among the additions.
        """
        self.check_additions(added)
        if deformed:
            self.validity.refuse_outside(posture)
        transforms = Transforms(ROOT, ROOT, np.eye(3), np.zeros(3))
        for name in self.chain(frame):
            transforms = transforms @ self.nominal(name, posture, subreflector)
            if deformed:
                rotation, translation = carried(self.six(name, posture, added), self.pivot(name))
                transforms = transforms @ Transforms(name, name, rotation, translation)
        return transforms

    def points(
        self,
        group: str,
        posture: TelescopePosture,
        *,
        added: Added | None = None,
        subreflector: SubreflectorPosition | None = None,
    ) -> np.ndarray:
        """Points of a group in the ground frame (..., n, 3), m.

        group, posture, added, subreflector   as for `ground_from`; additions to the group's own motion are allowed as
                                              well

        Raises as `ground_from`.
        """
        points_at_rest = self.groups[_existing(group, self.groups)]
        transform = self.ground_from(points_at_rest.frame, posture, added=added, subreflector=subreflector)
        return transform[..., None].points(self.in_frame(group, posture, added=added))

    def in_frame(self, group: str, posture: TelescopePosture, *, added: Added | None = None) -> np.ndarray:
        """Points of a group in the axes of their frame (..., n, 3), m.

        Moved by the group's own motion.
        """
        points_at_rest = self.groups[_existing(group, self.groups)]
        record = next(g for g in self.record.group if g.name == group)
        if record.shifts is not None:
            rows = _basis(record.shifts, self.record.reference_temperature_c).rows(posture)
            return points_at_rest.position + np.einsum("...k,ndk->...nd", rows, _shifts(record))
        rotation, translation = carried(self.six(group, posture, added), self.pivot(group))
        return Transforms(group, group, rotation, translation)[..., None].points(points_at_rest.position)

    def u_points(self, group: str) -> np.ndarray:
        """Standard uncertainty (n,), m, of each coordinate in the frame.

        Of the sheet and of tables of points.
        """
        points_at_rest = self.groups[_existing(group, self.groups)]
        record = next(g for g in self.record.group if g.name == group)
        return np.hypot(points_at_rest.u, (record.u_shift_mm or 0.0) * MILLIMETRE)

    def derivatives(
        self,
        frame: str,
        points: ArrayLike,
        posture: TelescopePosture,
        *,
        added: Added | None = None,
        subreflector: SubreflectorPosition | None = None,
    ) -> dict[str, np.ndarray]:
        """Derivatives (..., 3, 6) of ground points by each parent frame's motion.

        By shift and turn.

        frame, posture, added, subreflector   as for `ground_from`
        points   (..., 3), m, in the frame, whose batch axes broadcast against the posture's
        """
        x = np.asarray(points, dtype=float)
        by_frame: dict[str, np.ndarray] = {}
        for name in self.chain(frame)[::-1]:
            six = self.six(name, posture, added)
            slopes = motion_jacobian(six, self.pivot(name), x)
            rotation, translation = carried(six, self.pivot(name))
            x = Transforms(name, name, rotation, translation).points(x)
            x = self.nominal(name, posture, subreflector).points(x)
            by_frame[name] = self._outward(name, posture, added, subreflector) @ slopes
        return by_frame

    def _outward(
        self, frame: str, posture: TelescopePosture, added: Added | None, subreflector: SubreflectorPosition | None
    ) -> np.ndarray:
        """Rotation (..., 3, 3) from a frame's nominal axes to the ground.

        The frame moves in these axes.
        """
        local, parent = self.nominal(frame, posture, subreflector).rotation, self.parents[frame]
        if parent == ROOT:
            return local
        return self.ground_from(parent, posture, added=added, subreflector=subreflector).rotation @ local

    def group_derivatives(
        self,
        group: str,
        posture: TelescopePosture,
        *,
        added: Added | None = None,
        subreflector: SubreflectorPosition | None = None,
    ) -> dict[str, np.ndarray]:
        """Derivatives (..., n, 3, 6) of a group's ground points by its frames' motions.

        By shifts and turns of frames and group.

        group, posture, added, subreflector   as for `points`; one posture, or (..., 1) of them, an axis for n
        """
        points_at_rest = self.groups[_existing(group, self.groups)]
        at = self.in_frame(group, posture, added=added)
        slopes = self.derivatives(points_at_rest.frame, at, posture, added=added, subreflector=subreflector)
        if group in self.motions:
            out = self.ground_from(points_at_rest.frame, posture, added=added, subreflector=subreflector).rotation
            slopes[group] = out @ motion_jacobian(
                self.six(group, posture, added), self.pivot(group), points_at_rest.position
            )
        return slopes

    def axis_derivatives(self, points: ArrayLike, posture: TelescopePosture) -> np.ndarray:
        """Derivatives (..., 3, 2), m/rad, of ground points by azimuth and elevation.

        For points above the elevation axis.

        points    (..., 3), m, ground frame
        posture   (...)

        Of the nominal turns: the deformations' own slopes, some 0.3 m/rad at most, are neglected beside 100 m/rad.
        """
        x = np.asarray(points, dtype=float)
        turn = ground_from_alidade_at(posture.azimuth).rotation
        height = np.array(self._frames["elevation"].origin_mm) * MILLIMETRE
        by_azimuth = -np.cross([0.0, 0.0, 1.0], x)
        by_elevation = np.cross(turn[..., :, 0], x - turn @ height)
        return np.stack(np.broadcast_arrays(by_azimuth, by_elevation), axis=-1)

    def turns(self, frame: str, posture: TelescopePosture, added: Added | None = None) -> dict[str, np.ndarray]:
        """Derivatives (..., 3, 6) of a frame's small turn about ground axes.

        By shifts and turns of its parent frames and itself.
        """
        by_frame: dict[str, np.ndarray] = {}
        for name in self.chain(frame)[::-1]:
            turn = self._outward(name, posture, added, None) @ left_jacobian(self.six(name, posture, added)[..., 3:])
            by_frame[name] = np.concatenate([np.zeros_like(turn), turn], axis=-1)
        return by_frame


def antenna_of(record: StructuralModel) -> Antenna:
    """Antenna of a structural model's record.

    record    from `read_structural_model`
    """
    motions = {
        entry.name: motion_of(entry.motion, record.reference_temperature_c)
        for entry in record.moving
        if entry.motion is not None
    }
    low, high = (v * DEGREE for v in record.elevation_deg)
    validity = Validity((low, high), record.temperature_c)
    return Antenna(record, {frame.name: frame.parent for frame in record.frame}, motions, validity)


def motion_of(record: MotionRecord, reference_c: float) -> PostureMotion:
    """Motion in metres and radians.

    record        mm and arc seconds
    reference_c   degrees C at which t is 0
    """
    k = record.size
    rows = [getattr(record, key) for key in KEYS]
    values = np.array([flattened(row) if row is not None else [0.0] * k for row in rows]) * UNITS[:, None]
    units = np.repeat(UNITS, k)
    covariance = np.zeros((0, 0)) if record.covariance is None else np.array(record.covariance) * np.outer(units, units)
    u = np.repeat([record.u_shift_mm, record.u_turn_arcsec], 3) * UNITS
    pivot = np.array(record.pivot_mm) * MILLIMETRE
    return PostureMotion(_basis(record, reference_c), values, pivot, u, covariance)


def _basis(record: Basis, reference_c: float) -> PostureTerms | KnotTable:
    if record.terms is not None:
        return PostureTerms(record.terms, reference_c)
    warm = record.temperature_c if record.temperature_c is not None else (reference_c,)
    return KnotTable(np.array(record.elevation_deg) * DEGREE, np.array(warm))


def _points(group: GroupRecord) -> RestPoints:
    return RestPoints(
        tuple(point.name for point in group.point),
        group.frame,
        group.name,
        np.array([point.position_mm for point in group.point]) * MILLIMETRE,
        np.array([point.u_position_mm for point in group.point]) * MILLIMETRE,
    )


def _shifts(group: GroupRecord) -> np.ndarray:
    """Coefficients (n, 3, k), m, of the points' own shifts."""
    size = group.shifts.size if group.shifts is not None else 0
    rows = [[getattr(point, key) for key in KEYS[:3]] for point in group.point]
    values = [[flattened(row) if row is not None else [0.0] * size for row in point] for point in rows]
    return np.array(values) * MILLIMETRE


def _existing(group: str, groups: Sequence[str] | Mapping[str, RestPoints]) -> str:
    if group not in groups:
        raise InputError(f"group {group!r} is not in the structural model (it has {', '.join(groups)})")
    return group
