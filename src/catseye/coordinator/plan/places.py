"""Predicted positions of targets during a round, and planned shots."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.constants import MILLIMETRE
from catseye.coordinator.parts import PlannedShot, SiteState
from catseye.coordinator.visibility.surroundings import later
from catseye.coordinator.visibility.vantage import SeenRetroreflector, Vantage, nominal_posture
from catseye.geometry.antenna.frames import ground_from_reflector_at
from catseye.geometry.frames.frame import Transform
from catseye.records.night.live import TICK_SECONDS, TICKS_PER_DAY, LivePosture
from catseye.records.site.folder import REFERENCE, SiteFolder

RECORD_TOLERANCE = 0.005  # m: a target this near to its record needs no new coordinates; half a beam's radius


@dataclass(frozen=True)
class ChosenTarget:
    """A target for a ranger to shoot.

    Time from the round's start to its buffer, s, reason, and intermediate stops, counts.
    """

    target: str
    at: float
    reason: str
    via: tuple[tuple[float, float], ...] = ()


class Places:
    """Positions of rangers and targets during one round.

    site, vantages, retros   the records
    state                    with `place` for predictions
    ticks                    (n,) instants of the round
    """

    def __init__(
        self,
        site: SiteFolder,
        vantages: Mapping[str, Vantage],
        retros: Mapping[str, SeenRetroreflector],
        state: SiteState,
        ticks: NDArray[np.int64],
    ):
        self.site, self.vantages, self.retros, self.state, self.ticks = site, vantages, retros, state, ticks
        self._predicted: dict[str, tuple[Array, Array]] = {}
        self._shifts: dict[str, Array] = {}
        self._arm_from_dish: Transform | None = None
        self._rotation, self._vertex = self._frames(ticks)

    @staticmethod
    def nominal(site: SiteFolder) -> LivePosture:
        """Posture of a site's record."""
        return nominal_posture(site)

    def looks(self, vantage: Vantage, names: tuple[str, ...]) -> tuple[Array, Array]:
        """Counts (m, n, 2) at the instants, and unit vectors (m, 3), ground.

        NaN beyond the stops.
        """
        points = np.array([self._in_frame(vantage, name) for name in names])
        looks = vantage.look(points)
        for i, name in enumerate(names):
            if name == REFERENCE:
                looks[i] = vantage.reference
        middle = len(self.ticks) // 2
        rays = points[:, middle] - vantage.station.scan_point
        length = np.linalg.norm(rays, axis=-1, keepdims=True)
        units = rays / np.where(length > 0.0, length, 1.0)
        return looks, units if vantage.frame == "ground" else units @ self._rotation[middle].T

    def shift(self, vantage: Vantage) -> Array:
        """Predicted shift (3,) m of the ranger from its record.

        In its frame, in the middle of the round.
        """
        if vantage.frame == "ground":
            return np.zeros(3)
        if vantage.name not in self._shifts:
            one = slice(len(self.ticks) // 2, len(self.ticks) // 2 + 1)
            at = self._place(vantage.name, self.ticks[one])
            position = self._in_reflector(at, self._rotation[one], self._vertex[one])
            self._shifts[vantage.name] = position[0] - vantage.station.scan_point
        return self._shifts[vantage.name]

    def shots(self, vantage: Vantage, chosen: "list[ChosenTarget]", duration: float) -> tuple[PlannedShot, ...]:
        """Planned shots of one ranger."""
        begin = np.array([later(int(self.ticks[0]), target.at) for target in chosen], dtype=np.int64)
        times = np.stack([begin.astype(float), begin + duration / TICK_SECONDS], axis=1)
        nodes = np.array([self._in_frame(vantage, target.target) for target in chosen]).reshape(-1, len(self.ticks), 3)
        points = np.einsum("cbn,cnk->cbk", lagrange(self.ticks, times), nodes)
        return tuple(
            PlannedShot(
                ranger=vantage.name,
                target=target.target,
                begin_ticks=int(begin[i]),
                duration=duration,
                at_begin=points[i, 0],
                at_end=points[i, 1],
                fixed=self._fixed(vantage, target.target, points[i]),
                reason=target.reason,
                via=target.via,
            )
            for i, target in enumerate(chosen)
        )

    def _fixed(self, vantage: Vantage, name: str, points: Array) -> bool:
        if name == REFERENCE:
            return True
        retro = self.retros[name]
        away = np.linalg.norm(points - retro.point, axis=-1)
        return bool(retro.frame == vantage.frame and np.max(away) <= RECORD_TOLERANCE)

    def _in_frame(self, vantage: Vantage, name: str) -> Array:
        """Positions (n, 3) m at the instants, in the ranger's frame."""
        if name == REFERENCE:
            return np.broadcast_to(vantage.station.scan_point, (len(self.ticks), 3))
        retro = self.retros[name]
        if (
            retro.part == "dish" and vantage.frame == "reflector"
        ):  # millimetres are negligible for a beam, and there are many of them
            return np.broadcast_to(self._on_arm(retro.point), (len(self.ticks), 3)) - self.shift(vantage)
        if name not in self._predicted:
            at = self._place(name, self.ticks)
            self._predicted[name] = at, self._in_reflector(at, self._rotation, self._vertex)
        ground, reflector = self._predicted[name]
        return ground if vantage.frame == "ground" else reflector - self.shift(vantage)

    def _on_arm(self, point: Array) -> Array:
        """Dish point (3,) m in the frame of the arm's rangers, in the middle of the round.

        Itself on a rigid telescope; a structural model turns and shifts the arm against the dish by centimetres.
        """
        if self._arm_from_dish is None:
            return point
        return self._arm_from_dish.points(point)

    def _place(self, name: str, ticks: ArrayLike) -> Array:
        return np.asarray(self.state.place(name, np.asarray(ticks, dtype=float) / TICKS_PER_DAY), dtype=float)

    def _frames(self, ticks: ArrayLike) -> tuple[Array, Array]:
        """Axes (k, 3, 3) and vertex (k, 3), m, of the reflector frame of the arm's rangers, ground frame.

        The posture's rates are assumed constant. With a structural model the frame rides and turns with the arm.
        """
        posture, reflector = self.state.posture, self.site.site.frames.reflector
        since = (np.asarray(ticks, dtype=float) - posture.ticks) * TICK_SECONDS
        azimuth = posture.azimuth + posture.azimuth_rate * since
        elevation = posture.elevation + posture.elevation_rate * since
        if self.state.bent_frame is not None:
            arm, dish = (self.state.bent_frame(part, azimuth, elevation) for part in ("arm", "dish"))
            middle = len(since) // 2
            self._arm_from_dish = (arm.inverse() @ dish)[middle].single
            return np.asarray(arm.rotation), np.asarray(arm.translation)
        ground_from_reflector = ground_from_reflector_at(
            azimuth,
            elevation,
            elevation_axis_height=reflector.elevation_axis_height_mm * MILLIMETRE,
            reflector_to_elevation=np.array(reflector.reflector_to_elevation_mm) * MILLIMETRE,
        )
        return np.asarray(ground_from_reflector.rotation), np.asarray(ground_from_reflector.translation)

    @staticmethod
    def _in_reflector(points: Array, rotation: Array, vertex: Array) -> Array:
        """Ground points (k, 3) in the reflector frame at their times."""
        return np.asarray(np.einsum("kji,kj->ki", rotation, points - vertex))


def lagrange(nodes: ArrayLike, times: ArrayLike) -> Array:
    """Lagrange weights (..., n) from nodes (n,) to times (...).

    Five nodes 2.5 s apart follow a telescope that slews at 0.01 rad/s within a micrometre at 100 m.

    >>> lagrange([0.0, 1.0, 2.0], [0.5]).tolist()
    [[0.375, 0.75, -0.125]]
    """
    x = np.asarray(nodes, dtype=float)
    t = np.asarray(times, dtype=float)[..., None, None] - x[0]
    x = x - x[0]
    n = len(x)
    off_diagonal = ~np.eye(n, dtype=bool)
    top = np.where(off_diagonal, t - x[None, :], 1.0)
    bottom = np.where(off_diagonal, x[:, None] - x[None, :], 1.0)
    return np.asarray(np.prod(top, axis=-1) / np.prod(bottom, axis=-1))
