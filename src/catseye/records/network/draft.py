"""Network under construction: points and rows by name, checked with one-line errors."""

import difflib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from catseye.constants import TWO_PI
from catseye.errors import InputError
from catseye.estimation.network.model import (
    NetworkParameter,
    NetworkPoints,
    ObservationNetwork,
    absent_coordinates,
)
from catseye.estimation.network.names import PointIndex, name_key, spelled
from catseye.estimation.observations.kinds import ObservationGroup, Reported
from catseye.records.files.refusal import refusal, shown
from catseye.records.network.kinds import ANGLES, TOUCHES, Row, blocks_of, group_of
from catseye.records.network.plausible import beyond_circle

POSITIVE = ("slope_distance", "horizontal_distance", "fixed_distance")
SYMMETRY = 1e-12  # of the largest element: error of writing and reading a matrix

# Columns of the x of the points that it names, and of the first parameter after all points -> a group.
Maker = Callable[[np.ndarray, int], Reported]


@dataclass(eq=False)
class NetworkDraft:
    """Network as its file gives it, until `network` builds it.

    file         file name, for messages
    axes         (3, 3) signed permutation: coordinates here = axes @ coordinates of the file
    axis_names   names of the axes in the file
    implied      True if points named only in observations are free (as in STAR*NET), else they are refused
    planned      True if observed values may be missing, nan, before the measurement
    """

    file: str
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))
    axis_names: tuple[str, str, str] = ("x", "y", "z")
    implied: bool = False
    planned: bool = False
    description: str = ""
    names: PointIndex = field(default_factory=PointIndex)
    xyz: list[np.ndarray] = field(default_factory=list)
    fixed: list[np.ndarray] = field(default_factory=list)
    datum: list[np.ndarray] = field(default_factory=list)
    parameters: list[NetworkParameter] = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)
    clusters: list[tuple[range, np.ndarray]] = field(default_factory=list)
    more: list[tuple[Sequence[str], str, Maker]] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)

    def refuse(self, place: str, problem: str) -> InputError:
        """Error for one place in the file."""
        return refusal(self.file, f"{place}, {problem}")

    def point(
        self,
        name: str,
        xyz: Sequence[float] | np.ndarray = (np.nan,) * 3,
        *,
        fixed: Sequence[bool] | np.ndarray = (False,) * 3,
        datum: Sequence[bool] | np.ndarray = (False,) * 3,
        place: str,
    ) -> None:
        """Add a point.

        name     not used before
        xyz      (3,) m in the file's axes, nan where unknown
        fixed    (3,) held at xyz
        datum    (3,) part of the inner constraints
        place    place in the file

        Raises InputError for an empty or repeated name, an infinite coordinate, a held one that is unknown.
        """
        written, name = name, spelled(name)
        if not name:
            raise self.refuse(place, "point without a name (expected some text)")
        if name in self.names:
            raise self.refuse(place, f"point {shown(written)} occurs twice (expected unique names)")
        if written != name:
            self.names.aliases[written] = name
        for axis, value, is_fixed, in_datum in zip(self.axis_names, xyz, fixed, datum, strict=True):
            if np.isinf(value):
                raise self.refuse(place, f"point {shown(name)}, {axis} = {value} (expected a finite number)")
            if (is_fixed or in_datum) and np.isnan(value):
                role = "fixed" if is_fixed else "datum"
                raise self.refuse(place, f"point {shown(name)}, {axis} is {role} and unknown (expected its value)")
        turn = np.abs(self.axes) > 0.5
        self.names[name] = len(self.xyz)
        self.xyz.append(np.array([np.sum(a[a != 0.0] * np.asarray(xyz, float)[a != 0.0]) for a in self.axes]))
        self.fixed.append(turn @ np.asarray(fixed, bool))
        self.datum.append(turn @ (np.asarray(datum, bool) & ~np.asarray(fixed, bool)))

    def parameter(self, name: str, start: float = 0.0, sigma: float = np.inf, unit: str = "1") -> int:
        """Add a parameter besides the points; its index among them."""
        self.parameters.append(NetworkParameter(name, start, sigma, unit))
        return len(self.parameters) - 1

    def observe(self, row: Row) -> None:
        """Add a row; InputError for invalid values, distances or sigmas."""
        wrong = ""
        if not math.isfinite(row.value) and not (self.planned and math.isnan(row.value)):
            wrong = f" = {row.value} (expected a finite number)"
        elif row.value <= 0.0 and row.kind in POSITIVE:
            wrong = f" = {row.value:.10g} m (expected above 0)"
        elif not 0.0 < row.u < math.inf:
            reason = "no measurement is exact" if row.u == 0.0 else "a standard uncertainty"
            wrong = f" has the sigma {row.u:.6g} (expected above 0: {reason})"
        elif any(len(set(ends)) < len(ends) for ends in _together(row)):
            wrong = " joins a point with itself (expected points that differ)"
        if not wrong and row.kind in ANGLES and math.isfinite(row.value):
            wrong = self._angle_problem(row)
        if wrong:
            raise self.refuse(row.place, f"{row.kind} {' to '.join(shown(end) for end in row.ends[:2])}{wrong}")
        self.rows.append(row)

    def _angle_problem(self, row: Row) -> str:
        """Error text for an angle beyond the circle, or ""; unlikely angles become doubts."""
        text, impossible = beyond_circle(row.value, row.unit or "rad")
        if not text:
            return ""
        if impossible:
            return f" is beyond the circle: {text} (expected at most a turn)"
        names = " to ".join(shown(end) for end in row.ends)
        self.doubts.append(f"{row.place}, {row.kind} {names} is beyond the circle: {text}")
        return ""

    def correlate(self, start: int, covariance: np.ndarray, place: str) -> None:
        """Set a joint covariance (m, m), m and rad, for rows from `start` on; InputError if invalid."""
        m = len(self.rows) - start
        if covariance.shape != (m, m):
            size = " x ".join(map(str, covariance.shape))
            raise self.refuse(place, f"covariance is {size}, of {m} observations (expected {m} x {m})")
        if (
            not np.isfinite(covariance).all()
            or np.abs(covariance - covariance.T).max() > SYMMETRY * np.abs(covariance).max()
        ):
            raise self.refuse(place, "covariance is not symmetric and finite (expected a covariance matrix)")
        variance = np.diag(covariance)
        try:
            if not np.all(variance > 0.0):
                raise np.linalg.LinAlgError
            np.linalg.cholesky(covariance / np.sqrt(np.outer(variance, variance)))
        except np.linalg.LinAlgError:
            raise self.refuse(place, "covariance is not positive definite (expected a covariance matrix)") from None
        for i, u in enumerate(np.sqrt(variance), start):
            self.rows[i] = replace(self.rows[i], u=float(u))
        if np.count_nonzero(covariance) > m:
            self.clusters.append((range(start, len(self.rows)), covariance))

    def also(self, points: Sequence[str], place: str, make: Maker) -> None:
        """Add a group built once all points are known: a body, a surface."""
        if len(set(map(name_key, points))) < len(points):
            raise self.refuse(place, "names a point twice (expected points that differ)")
        self.more.append((points, place, make))

    def network(self) -> ObservationNetwork:
        """Network with its absent coordinates; InputError for an unknown point."""
        self._resolve()
        if not self.names:
            raise refusal(self.file, "has no points (expected at least one)")
        xyz, fixed = np.array(self.xyz).reshape(-1, 3), np.array(self.fixed).reshape(-1, 3)
        datum = np.array(self.datum).reshape(-1, 3)
        absent = absent_coordinates(xyz, fixed | datum, self._touched(len(xyz)))
        points = NetworkPoints(tuple(self.names), xyz, fixed, datum, absent)
        self._start_orientations(xyz)
        groups, places, claims = self._groups()
        return ObservationNetwork(
            points,
            tuple(self.parameters),
            groups,
            places,
            axes=self.axes,
            axis_names=self.axis_names,
            source=self.file,
            description=self.description.strip(),
            claims=claims,
            notes=self.names.notes(),
            doubts=tuple(self.doubts),
        )

    def _resolve(self) -> None:
        """Raise InputError for unknown points, or add them where names imply points."""
        named = [(row.ends, row.place, row.kind) for row in self.rows]
        named += [(tuple(points), place, "table") for points, place, _ in self.more]
        for ends, place, kind in named:
            for name in ends:
                if name in self.names:
                    continue
                if self.implied:
                    self.point(name, place=place)
                    continue
                close = difflib.get_close_matches(name, self.names, n=1)
                hint = f"perhaps {shown(close[0])}" if close else "a point of this file"
                raise self.refuse(place, f"{kind} names the point {shown(name)} (expected {hint})")

    def _touched(self, n: int) -> np.ndarray:
        touched = np.zeros((n, 3), dtype=bool)
        for row in self.rows:
            for name in row.ends:
                axes = row.component or TOUCHES.get(row.kind, "xyz")
                touched[self.names[name], ["xyz".index(axis) for axis in axes]] = True
        for points, _, _ in self.more:  # bodies and surfaces
            touched[[self.names[name] for name in points]] = True
        return touched

    def _start_orientations(self, xyz: np.ndarray) -> None:
        """Azimuth of each direction set's zero from the file's coordinates, where given."""
        turned: dict[int, complex] = {}
        for row in self.rows:
            if row.kind == "direction" and self.parameters[row.parameters["orientation"]].sigma == np.inf:
                along = xyz[self.names[row.ends[1]]] - xyz[self.names[row.ends[0]]]
                zero = np.arctan2(along[0], along[1]) - row.value
                if np.isfinite(zero):
                    at = row.parameters["orientation"]
                    turned[at] = turned.get(at, 0.0) + complex(np.cos(zero), np.sin(zero))
        for at, mean in turned.items():
            self.parameters[at] = replace(self.parameters[at], start=float(np.angle(mean)) % TWO_PI)

    def _groups(
        self,
    ) -> tuple[tuple[ObservationGroup, ...], tuple[tuple[str, ...], ...], tuple[np.ndarray | None, ...]]:
        """Groups, places of their rows, and claims.

        Independent rows of a kind form one group, as does a correlated set.
        """
        first = 3 * len(self.names)
        in_cluster = {i for rows, _ in self.clusters for i in rows}
        kinds: dict[str, list[Row]] = {}
        for i, row in enumerate(self.rows):
            if i not in in_cluster:
                kinds.setdefault(row.kind, []).append(row)
        sets = [(rows, np.array([row.u**2 for row in rows])) for rows in kinds.values()]
        correlated = [([self.rows[i] for i in rows], covariance) for rows, covariance in self.clusters]
        sets += blocks_of(correlated)
        groups: list[ObservationGroup] = []
        places: list[tuple[str, ...]] = []
        claims: list[np.ndarray | None] = []
        counts: dict[str, int] = {}
        for rows, covariance in sets:
            name = rows[0].kind if len({row.kind for row in rows}) == 1 else "joint"
            counts[name] = counts.get(name, 0) + 1
            label = name.replace("_", " ") + (f" {counts[name]}" if counts[name] > 1 else "")
            groups.append(group_of(label, rows, covariance, names=self.names, first=first))
            places.append(tuple(row.place for row in rows))
            claims.append(np.array([row.claim for row in rows]) if any(row.claim[1] for row in rows) else None)
        for points, place, make in self.more:
            group = make(np.array([3 * self.names[name] for name in points], dtype=int), first)
            groups.append(group)
            places.append((place,) * len(group.observed))
            claims.append(None)
        return tuple(groups), tuple(places), tuple(claims)


def _together(row: Row) -> list[tuple[str, ...]]:
    """Points of a row that must differ: all, or the ends of each of two distances."""
    ends = tuple(map(name_key, row.ends))
    return [ends[:2], ends[2:]] if row.kind == "distance_difference" else [ends]
