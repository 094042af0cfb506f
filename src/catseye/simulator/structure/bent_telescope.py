"""Telescope bent by a structural model, for truth: a second evaluation, not the reduction's.

The file's rule (docs/formats/structural-model.md): a frame's points are carried by its motion, in the frame's own
nominal axes, then into the parent's. Here with scipy's rotations and splines; the reduction has its own of both.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from catseye.aliases import Array
from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.errors import InputError, ValidityError
from catseye.records.site.structural_model import Basis, FrameRecord, GroupRecord, MotionRecord, StructuralModel

BODIES = {"alidade": ("alidade",), "dish": ("reflector",), "arm": ("feed_arm", "reflector")}  # first frame there is


class BodyShift(NamedTuple):
    """Motion of a body away from the rigid telescope at k times: x' = turn @ x + shift, ground axes.

    Turn (k, 3, 3), shift (k, 3), m.
    """

    turn: Array
    shift: Array

    def points(self, x: Array) -> Array:
        """Places (k, 3), m, of a point (3,) of the rigid telescope."""
        return np.asarray(self.turn @ x + self.shift)


@dataclass(frozen=True, eq=False)
class BentTelescope:
    """Telescope that a structural model bends; its temperature is the file's."""

    model: StructuralModel

    def body_frame(self, body: str) -> str:
        """Frame of the model that carries "alidade", "dish" or "arm"."""
        names = {frame.name for frame in self.model.frame}
        return next(name for name in BODIES[body] if name in names)

    def shift(self, body: str, azimuth: Array, elevation: Array, name: str = "") -> BodyShift:
        """Motion of a body, or of a point on it that its group moves, at postures (k,), rad.

        Raises ValidityError outside the model's elevations.
        """
        low, high = (v * DEGREE for v in self.model.elevation_deg)
        if np.any(elevation < low - 1e-9) or np.any(elevation > high + 1e-9):
            worst = float(elevation[np.argmax(np.maximum(low - elevation, elevation - high))]) / DEGREE
            raise ValidityError(
                f"elevation {worst:.6g} deg is outside {low / DEGREE:g} to {high / DEGREE:g} deg, where the structural "
                "model holds"
            )
        group = self._group(name)
        frame = self.body_frame(body) if group is None else group.frame
        rigid, bent = (self._ground(frame, azimuth, elevation, moved=moved) for moved in (False, True))
        if group is not None:
            inner = self._own(group, name, azimuth, elevation)
            bent = BodyShift(bent.turn, bent.shift + np.einsum("kij,kj->ki", bent.turn, inner))
        turn = bent.turn @ np.swapaxes(rigid.turn, -1, -2)
        return BodyShift(turn, bent.shift - np.einsum("kij,kj->ki", turn, rigid.shift))

    def refuse_narrow(self, low_deg: float, high_deg: float) -> None:
        """Raise InputError unless the model holds at all elevations of a range."""
        low, high = self.model.elevation_deg
        if low > low_deg or high < high_deg:
            raise InputError(
                f"structural model: it holds from elevation {low:g} to {high:g} deg (expected {low_deg:g} to "
                f"{high_deg:g} for a telescope that moves)"
            )

    def _group(self, name: str) -> GroupRecord | None:
        for group in self.model.group:
            if (group.motion or group.shifts) and any(point.name == name for point in group.point):
                return group
        return None

    def _own(self, group: GroupRecord, name: str, azimuth: Array, elevation: Array) -> Array:
        """Shift (k, 3), m, of a group's point in its frame."""
        point = next(p for p in group.point if p.name == name)
        if group.shifts is not None:
            rows = [getattr(point, f"shift_{axis}_mm") for axis in "xyz"]
            return np.column_stack([self._value(group.shifts, r, azimuth, elevation) for r in rows]) * MILLIMETRE
        assert group.motion is not None
        turn, shift = self._motion(group.motion, azimuth, elevation)
        place = np.array(point.position_mm) * MILLIMETRE
        return np.einsum("kij,j->ki", turn, place) + shift - place

    def _ground(self, name: str, azimuth: Array, elevation: Array, *, moved: bool) -> BodyShift:
        """Ground from a frame, as turn and shift."""
        frames: dict[str, FrameRecord] = {frame.name: frame for frame in self.model.frame}
        turn, shift = np.broadcast_to(np.eye(3), (len(azimuth), 3, 3)), np.zeros((len(azimuth), 3))
        while name in frames:
            frame = frames[name]
            steps = [self._motion(frame.motion, azimuth, elevation)] if moved and frame.motion is not None else []
            steps.append(_nominal(frame, azimuth, elevation))
            for outer_turn, outer_shift in steps:
                shift = np.einsum("kij,kj->ki", outer_turn, shift) + outer_shift
                turn = outer_turn @ turn
            name = frame.parent
        return BodyShift(turn, shift)

    def _motion(self, motion: MotionRecord, azimuth: Array, elevation: Array) -> tuple[Array, Array]:
        """Turn (k, 3, 3) and shift (k, 3), m, of a frame in its own axes."""
        parts = {
            kind: np.column_stack(
                [self._value(motion, getattr(motion, f"{kind}_{axis}_{unit}"), azimuth, elevation) for axis in "xyz"]
            )
            for kind, unit in (("shift", "mm"), ("turn", "arcsec"))
        }
        turn = Rotation.from_rotvec(parts["turn"] * ARCSECOND).as_matrix()
        pivot = np.array(motion.pivot_mm) * MILLIMETRE
        return turn, pivot + parts["shift"] * MILLIMETRE - turn @ pivot

    def _value(self, basis: Basis, values: object, azimuth: Array, elevation: Array) -> Array:
        """Component (k,) at postures, in the file's unit."""
        if values is None:
            return np.zeros(len(azimuth))
        warm = self.model.usual_temperature_c
        table = np.array(values, dtype=float)
        if basis.terms is not None:
            t = np.full(len(azimuth), warm - self.model.reference_temperature_c)
            return np.sum(
                [c * _term(term, azimuth, elevation, t) for term, c in zip(basis.terms, table, strict=True)], axis=0
            )
        by_elevation = _joined(np.array(basis.elevation_deg), table, elevation / DEGREE)
        if basis.temperature_c is None:
            return by_elevation
        return _joined(np.array(basis.temperature_c), by_elevation.T, np.array([warm]))[0]


def _term(term: str, azimuth: Array, elevation: Array, t: Array) -> Array:
    """Product of named functions (k,): sin2E, cosA, E^2, t."""
    product = np.ones(len(azimuth))
    for factor in term.replace(" ", "").split("*"):
        if factor.startswith(("sin", "cos")):
            angle = azimuth if factor.endswith("A") else elevation
            product = product * getattr(np, factor[:3])(float(factor[3:-1] or 1) * angle)
        elif factor != "1":
            name, _, power = factor.partition("^")
            product = product * (elevation if name == "E" else t) ** float(power or 1)
    return product


def _joined(knots: Array, values: Array, at: Array) -> Array:
    """Values of a cubic spline through knots, of a constant through one."""
    return np.repeat(values, len(at), axis=0) if len(knots) == 1 else CubicSpline(knots, values)(at)


def _nominal(frame: FrameRecord, azimuth: Array, elevation: Array) -> tuple[Array, Array]:
    """Turn (k, 3, 3) and shift (k, 3), m, into the parent's axes of the rigid telescope."""
    turn = np.broadcast_to(np.eye(3), (len(azimuth), 3, 3))
    if frame.name == "alidade":
        turn = Rotation.from_euler("z", -azimuth[:, None]).as_matrix()  # clockwise from north
    elif frame.name == "elevation":
        turn = Rotation.from_euler("x", elevation[:, None] - 0.5 * np.pi).as_matrix()  # parallel at the zenith
    return turn, np.broadcast_to(np.array(frame.origin_mm) * MILLIMETRE, (len(azimuth), 3))
