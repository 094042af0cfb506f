"""A network on its way from a file: points and rows by name, refused in one line where they make no sense."""

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
SYMMETRY = 1e-12  # of the largest element: what writing and reading a matrix may cost

# Columns of the x of the points that it names, and of the first parameter after all points -> a group.
Maker = Callable[[np.ndarray, int], Reported]


@dataclass(eq=False)
class NetworkDraft:
    """A network as its file gives it, until `network` makes it whole.

    file         its name, for refusals
    axes         (3, 3) signed permutation: coordinates here = axes @ coordinates of the file
    axis_names   what the file calls its axes
    implied      points that only observations name are free ones (STAR*NET's way), else they are refused
    planned      observed values may be missing, nan: the network is yet to be measured
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
        """The error of one place in the file."""
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
        """Adds a point.

        name     not used before
        xyz      (3,) m in the file's axes, nan where unknown
        fixed    (3,) held at xyz
        datum    (3,) takes part in the inner constraints
        place    where it stands in the file

        Raises InputError for an empty or double name, an infinite coordinate, a held one that is unknown.
        """
        written, name = name, spelled(name)
        if not name:
            raise self.refuse(place, "point without a name (expected some text)")
        if name in self.names:
            raise self.refuse(place, f"point {shown(written)} is there twice (expected each name once)")
        if written != name:
            self.names.aliases[written] = name
        for axis, value, held, in_datum in zip(self.axis_names, xyz, fixed, datum, strict=True):
            if np.isinf(value):
                raise self.refuse(place, f"point {shown(name)}, {axis} = {value} (expected a finite number)")
            if (held or in_datum) and np.isnan(value):
                role = "fixed" if held else "datum"
                raise self.refuse(place, f"point {shown(name)}, {axis} is {role} and unknown (expected its value)")
        turn = np.abs(self.axes) > 0.5
        self.names[name] = len(self.xyz)
        self.xyz.append(np.array([np.sum(a[a != 0.0] * np.asarray(xyz, float)[a != 0.0]) for a in self.axes]))
        self.fixed.append(turn @ np.asarray(fixed, bool))
        self.datum.append(turn @ (np.asarray(datum, bool) & ~np.asarray(fixed, bool)))

    def parameter(self, name: str, start: float = 0.0, sigma: float = np.inf, unit: str = "1") -> int:
        """Adds a parameter beside the points; its index among them."""
        self.parameters.append(NetworkParameter(name, start, sigma, unit))
        return len(self.parameters) - 1

    def observe(self, row: Row) -> None:
        """Adds a row; InputError for a value that is not finite, a distance or a sigma that is not positive."""
        wrong = ""
        if not math.isfinite(row.value) and not (self.planned and math.isnan(row.value)):
            wrong = f" = {row.value} (expected a finite number)"
        elif row.value <= 0.0 and row.kind in POSITIVE:
            wrong = f" = {row.value:.10g} m (expected above 0)"
        elif not 0.0 < row.u < math.inf:
            shame = "nothing is measured without error" if row.u == 0.0 else "a standard uncertainty"
            wrong = f" has the sigma {row.u:.6g} (expected above 0: {shame})"
        elif any(len(set(ends)) < len(ends) for ends in _together(row)):
            wrong = " joins a point with itself (expected points that differ)"
        if not wrong and row.kind in ANGLES and math.isfinite(row.value):
            wrong = self._beyond(row)
        if wrong:
            raise self.refuse(row.place, f"{row.kind} {' to '.join(shown(end) for end in row.ends[:2])}{wrong}")
        self.rows.append(row)

    def _beyond(self, row: Row) -> str:
        """Why an angle beyond the circle is refused, or nothing; one that is only unlikely becomes a doubt."""
        text, impossible = beyond_circle(row.value, row.unit or "rad")
        if not text:
            return ""
        if impossible:
            return f" is beyond the circle: {text} (expected at most a turn)"
        names = " to ".join(shown(end) for end in row.ends)
        self.doubts.append(f"{row.place}, {row.kind} {names} is beyond the circle: {text}")
        return ""

    def correlate(self, start: int, covariance: np.ndarray, place: str) -> None:
        """Gives the rows from `start` on a joint covariance (m, m) in m and rad; InputError where it is none."""
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
        """Adds a group that is made when all points are known: a body, a surface."""
        if len(set(map(name_key, points))) < len(points):
            raise self.refuse(place, "names a point twice (expected points that differ)")
        self.more.append((points, place, make))

    def network(self) -> ObservationNetwork:
        """The network, with the coordinates that do not exist; InputError for a point that the file does not have."""
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
        """Every point that is named must be there, or becomes one where names imply points."""
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
        """Azimuth of each direction set's zero, from the coordinates that the file gives, if they do."""
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
        """Groups, the places of their rows, their claims: independent rows of a kind are one, a correlated set is."""
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
