"""Bodies, frames and surfaces in a network file: ties between several points.

    [[body]]     name, point = [{name, xyz_mm, u_mm or covariance_mm2}]: they move as one body; a pose
    [[shape]]    name, point = [{name, xyz_mm, and u_mm: a prior, or free = true, or nothing: known}] in its own axes
    [[frame]]    name, shape, point = [{name, at: the shape's point, u_mm}]: a shape in one posture; a pose
    [[tilt]]     frame, axis = [x, y, z] in it, value_arcsec, u_arcsec, zero: a parameter's name
    [[plane]]    name, points, u_mm, value_mm (else 0); normal, centre_m
    [[line]]     name, points, u_mm; along, centre_m
    [[sphere]]   name, centre: a point's name, points, u_mm, value_mm, radius_mm, u_radius_mm or radius = "free"

A pose is origin_m and rotation_deg (a rotation vector in ground axes, or in rad or gon), ground from body;
both or none: then it is computed from the coordinates of the file. It is free, or has priors u_origin_mm and
u_rotation_arcsec, or is held with pose = "fixed". Surfaces are free, or held with surface = "fixed"; a missing normal,
along or centre is computed from the points' coordinates.
"""

from collections.abc import Callable, Mapping

import numpy as np

from catseye.estimation.observations.kinds import (
    FramePoints,
    ObservedTilts,
    PointsOnLine,
    PointsOnPlane,
    PointsOnSphere,
    RigidBodies,
)
from catseye.geometry.frames.rotation import from_vector
from catseye.records.files.refusal import shown
from catseye.records.files.toml_fields import ANGLE, LENGTH, Fields
from catseye.records.network.draft import NetworkDraft

U_FRAME_POINT = 1e-7  # m, as a fixed distance's
FLAT = 1e-6  # of the largest extent: smaller point sets determine no rotation


class Bodies:
    """Sections of one file, read into its draft.

    draft   the network so far
    named   parameters by name
    """

    def __init__(self, draft: NetworkDraft, named: Mapping[str, int]) -> None:
        self.draft, self.named = draft, named
        self.shapes: dict[str, dict[str, tuple[int, np.ndarray]]] = {}
        self.frames: dict[str, tuple[list[int], np.ndarray]] = {}

    def body(self, fields: Fields) -> None:
        name = fields.text("name")
        parts = fields.tables("point")
        if not parts:
            raise fields.refuse("point is missing (expected tables of points)")
        local, blocks = [part.vector("xyz", LENGTH) for part in parts], []
        for part in parts:
            covariance = part.uncertainties(3)
            if covariance is None:
                raise part.refuse("u is missing (expected u_mm or covariance_mm2)")
            blocks.append(covariance)
        names = [part.text("name") for part in parts]
        for part in parts:
            part.refuse_unused()
        pose, start = self._pose(fields, name, np.array(local), names)
        observed, covariances = np.concatenate(local), np.array(blocks)
        self.draft.also(
            names,
            fields.place,
            lambda at, first: RigidBodies(
                name=f"body {name}",
                observed=observed,
                covariance=covariances,
                point=at,
                pose=first + np.array(pose),
                start=start,
            ),
        )

    def shape(self, fields: Fields) -> None:
        name = fields.text("name")
        if name in self.shapes:
            raise fields.refuse(f"shape {shown(name)} occurs twice (expected unique names)")
        points = self.shapes[name] = {}
        for part in fields.tables("point"):
            label, xyz = part.text("name"), part.vector("xyz", LENGTH)
            free = part.take("free", bool, "true or false", False)
            u = part.quantity("u", LENGTH, 0.0)
            if label in points or u < 0.0 or (free and u > 0.0):
                raise part.refuse(f"{shown(label)} (expected unique points, free or with u_mm above 0)")
            sigma = np.inf if free else u
            indices = [
                self.draft.parameter(f"{axis} of {label} in {name}", value, sigma, "m")
                for axis, value in zip("xyz", xyz, strict=True)
            ]
            points[label] = (indices[0], xyz)
            part.refuse_unused()

    def frame(self, fields: Fields) -> None:
        name, shape = fields.text("name"), fields.text("shape")
        if shape not in self.shapes:
            raise fields.refuse(f"shape = {shown(shape)} is missing (expected the name of a [[shape]])")
        if name in self.frames:
            raise fields.refuse(f"frame {shown(name)} occurs twice (expected unique names)")
        names, indices, local, variances = [], [], [], []
        for part in fields.tables("point"):
            names.append(part.text("name"))
            label = part.text("at", names[-1])
            if label not in self.shapes[shape]:
                raise part.refuse(f"at = {shown(label)} is not a point of the shape {shown(shape)} (expected one)")
            index, xyz = self.shapes[shape][label]
            u = part.quantity("u", LENGTH, U_FRAME_POINT)
            if u <= 0.0:
                raise part.refuse("u = 0 (expected above 0: 1e-7 m by default)")
            indices.append(index)
            local.append(xyz)
            variances += [u**2] * 3
            part.refuse_unused()
        pose, start = self._pose(fields, name, np.array(local).reshape(-1, 3), names)
        self.frames[name] = (pose, start)
        if names:
            self.draft.also(
                names,
                fields.place,
                lambda at, first: FramePoints(
                    name=f"frame {name}",
                    observed=np.zeros(len(variances)),
                    covariance=np.array(variances),
                    point=at,
                    pose=first + np.array(pose),
                    start=start,
                    frame_point=first + np.array(indices),
                ),
            )

    def tilt(self, fields: Fields) -> None:
        frame = fields.text("frame")
        if frame not in self.frames:
            raise fields.refuse(f"frame = {shown(frame)} is missing (expected the name of a [[frame]])")
        axis = fields.array("axis", (3,))
        value, u = fields.quantity("value", ANGLE), fields.quantity("u", ANGLE)
        zero = fields.text("zero", "")
        if not np.any(axis) or u <= 0.0:
            raise fields.refuse("axis is zero or u is (expected a direction, and u above 0)")
        if zero and zero not in self.named:
            raise fields.refuse(f"zero = {shown(zero)} is not a parameter (expected the name of a [[parameter]])")
        pose, start = self.frames[frame]
        self.draft.also(
            [],
            fields.place,
            lambda _, first: ObservedTilts(
                name=f"tilt {frame}",
                observed=np.array([value]),
                covariance=np.array([u**2]),
                axis=axis,
                turn=first + np.array(pose[3:]),
                start=start,
                zero=np.array([first + self.named[zero]]) if zero else None,
            ),
        )

    def plane(self, fields: Fields) -> None:
        names, u, value = self._surface_points(fields)
        normal, centre = self._direction(fields, "normal", names, smallest=True)
        surface = self._unknowns(fields, "plane", (("tilt 1", "rad"), ("tilt 2", "rad"), ("offset", "m")))
        name = f"plane {fields.text('name')}"
        m = len(names)
        self.draft.also(
            names,
            fields.place,
            lambda at, first: PointsOnPlane(
                name=name,
                observed=np.full(m, value),
                covariance=np.full(m, u**2),
                point=at,
                centre=centre,
                normal=normal,
                surface=np.where(surface < 0, -1, first + surface),
            ),
        )

    def line(self, fields: Fields) -> None:
        names, u, value = self._surface_points(fields)
        if value:
            raise fields.refuse("value is not 0 (expected none: a line has no side)")
        along, centre = self._direction(fields, "along", names, smallest=False)
        unknowns = (("tilt 1", "rad"), ("tilt 2", "rad"), ("shift 1", "m"), ("shift 2", "m"))
        line = self._unknowns(fields, "line", unknowns)
        name = f"line {fields.text('name')}"
        m = 2 * len(names)
        self.draft.also(
            names,
            fields.place,
            lambda at, first: PointsOnLine(
                name=name,
                observed=np.zeros(m),
                covariance=np.full(m, u**2),
                point=at,
                centre=centre,
                along=along,
                line=np.where(line < 0, -1, first + line),
            ),
        )

    def sphere(self, fields: Fields) -> None:
        names, u, value = self._surface_points(fields)
        name, centre = f"sphere {fields.text('name')}", fields.text("centre")
        free, sigma = fields.text("radius", "") == "free", fields.quantity("u_radius", LENGTH, 0.0)
        radius = fields.quantity("radius", LENGTH, 0.0 if free else None)
        if (fields.has("radius") and not free) or radius < 0.0 or sigma < 0.0 or (free and sigma):
            raise fields.refuse('radius (expected radius_mm above 0, perhaps with u_radius_mm, or radius = "free")')
        column = self.draft.parameter(f"radius of {name}", 0.0, np.inf if free else sigma, "m") if free or sigma else -1
        m = len(names)
        self.draft.also(
            [*names, centre],
            fields.place,
            lambda at, first: PointsOnSphere(
                name=name,
                observed=np.full(m, value),
                covariance=np.full(m, u**2),
                point=at[:-1],
                centre=np.full(m, at[-1]),
                radius=radius,
                radius_column=np.full(m, first + column) if column >= 0 else None,
            ),
        )

    def _surface_points(self, fields: Fields) -> tuple[list[str], float, float]:
        names = fields.take("points", list, "names of points")
        if not names or not all(isinstance(name, str) for name in names):
            raise fields.refuse(f"points = {shown(names)} (expected names of points)")
        u, value = fields.quantity("u", LENGTH), fields.quantity("value", LENGTH, 0.0)
        if u <= 0.0:
            raise fields.refuse("u = 0 (expected above 0: no measurement is exact)")
        return names, u, value

    def _unknowns(self, fields: Fields, kind: str, unknowns: tuple[tuple[str, str], ...]) -> np.ndarray:
        state = fields.text("surface", "free")
        if state not in ("free", "fixed"):
            raise fields.refuse(f"surface = {shown(state)} (expected free or fixed)")
        name = f"{kind} {fields.text('name')}"
        fixed = state == "fixed"
        return np.array([-1 if fixed else self.draft.parameter(f"{n} of {name}", unit=unit) for n, unit in unknowns])

    def _direction(
        self, fields: Fields, key: str, names: list[str], *, smallest: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Direction and centre from the file, or else from the coordinates of the points."""
        has_centre = fields.keyed("centre", LENGTH) is not None
        if fields.has(key) and has_centre:
            direction, centre = fields.array(key, (3,)), fields.vector("centre", LENGTH)
            if not np.any(direction):
                raise fields.refuse(f"{key} is zero (expected a direction)")
            return direction, centre
        xyz = self._coordinates_of(names)
        if len(xyz) < (3 if smallest else 2):
            raise fields.refuse(f"{key} or centre is missing, and too few points have coordinates (expected both)")
        centre = fields.vector("centre", LENGTH) if has_centre else xyz.mean(axis=0)
        axes = np.linalg.svd(xyz - xyz.mean(axis=0))[2]
        return fields.array(key, (3,)) if fields.has(key) else axes[2 if smallest else 0], centre

    def _coordinates_of(self, names: list[str]) -> np.ndarray:
        """Coordinates (k, 3) of those points that have them in the file."""
        xyz = np.array([self.draft.xyz[self.draft.names[name]] for name in names if name in self.draft.names])
        xyz = xyz.reshape(-1, 3)
        return xyz[np.isfinite(xyz).all(axis=1)]

    def _pose(self, fields: Fields, name: str, local: np.ndarray, names: list[str]) -> tuple[list[int], np.ndarray]:
        """Indices of the six parameters of a pose, and its start R0."""
        has_origin, has_rotation = (
            fields.keyed(stem, units) is not None for stem, units in (("origin", LENGTH), ("rotation", ANGLE))
        )
        if has_origin != has_rotation:
            raise fields.refuse("has one of origin and rotation (expected both, or none)")
        if has_origin:
            origin, start = fields.vector("origin", LENGTH), from_vector(fields.vector("rotation", ANGLE))
        else:
            if fields.keyed("u_origin", LENGTH) or fields.keyed("u_rotation", ANGLE):
                raise fields.refuse("has a prior of its pose and no pose (expected origin and rotation)")
            origin, start = self._found_pose(fields, local, names)
        state = fields.text("pose", "free")
        if state not in ("free", "fixed"):
            raise fields.refuse(f"pose = {shown(state)} (expected free or fixed)")
        sigmas = [
            fields.quantity(f"u_{stem}", units, np.inf) if fields.keyed(f"u_{stem}", units) else np.inf
            for stem, units in (("origin", LENGTH), ("rotation", ANGLE))
        ]
        if state == "fixed":
            sigmas = [0.0, 0.0]
        if min(sigmas) < 0.0:
            raise fields.refuse("u_origin or u_rotation is negative (expected 0 or above)")
        pose = [
            self.draft.parameter(f"{axis} of {name}", value, sigmas[0], "m")
            for axis, value in zip("xyz", origin, strict=True)
        ]
        pose += [self.draft.parameter(f"turn about {axis} of {name}", 0.0, sigmas[1], "rad") for axis in "xyz"]
        return pose, start

    def _found_pose(self, fields: Fields, body_frame: np.ndarray, names: list[str]) -> tuple[np.ndarray, np.ndarray]:
        """Origin and rotation that fit a body's points to their coordinates, by singular values."""
        rows = [i for i, n in enumerate(names) if n in self.draft.names and len(self._coordinates_of([n]))]
        ground, local = self._coordinates_of(names), body_frame[rows]
        if len(rows) >= 3:
            a, b = ground - ground.mean(axis=0), local - local.mean(axis=0)
            u, s, vt = np.linalg.svd(a.T @ b)
            if s[1] > FLAT * s[0]:
                start = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
                return ground.mean(axis=0) - start @ local.mean(axis=0), start
        raise fields.refuse(
            "origin and rotation are missing, and no three points off a line have coordinates (expected one)"
        )


SECTIONS: dict[str, Callable[[Bodies, Fields], None]] = {
    "body": Bodies.body,
    "shape": Bodies.shape,
    "frame": Bodies.frame,
    "tilt": Bodies.tilt,
    "plane": Bodies.plane,
    "line": Bodies.line,
    "sphere": Bodies.sphere,
}
