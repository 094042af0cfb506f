"""Recipe for movements between two epochs from changes of range, with approximate coordinates and constraints.

Source: [PARKER04] sections 3.2.4 and 3.2.5.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from catseye.constants import MILLIMETRE, PPM
from catseye.errors import InputError
from catseye.estimation.deformation.differential import DETERMINED, GroupMovements, constrained
from catseye.names import counted
from catseye.reduction.deformation.constraints import (
    MovementBlock,
    free_block,
    joined,
    movement_blocks,
    split_observable,
)
from catseye.reduction.network.words import listed, quantity
from catseye.verdict import Verdict

if TYPE_CHECKING:
    from catseye.records.network.movement_constraints import MovementConstraints
    from catseye.records.network.range_changes import RangeChanges

MOST = 600  # points solved together: time grows with their cube, 20 s for 300
SHARE = 1e-4  # of an undetermined movement's largest part: a point with more takes part in it


@dataclass(frozen=True)
class ConstraintTest:
    """Test of one constraint against the same points free, the others as they are.

    name, kind           of the constraint
    points               names
    statistic            chi-square; nan where nothing checks it
    degrees_of_freedom   movements that the ranges determine and the constraint excludes
    p                    probability of such a statistic where the constraint holds
    rejected             True at the level of all tests together
    """

    name: str
    kind: str
    points: tuple[str, ...]
    statistic: float
    degrees_of_freedom: int
    p: float
    rejected: bool


@dataclass(frozen=True, eq=False)
class MeasuredMovements:
    """Movements of n points from changes of their ranges from s stations.

    changes        the input
    blocks         constraints and free points
    determined     (n,) True where the ranges and constraints determine the movement
    solution       of the determined points, in their order; None if there are none
    tests          of the constraints
    standardised   (n, s) residual over its standard uncertainty; nan where nothing checks the change
    air_ppm        standard uncertainty of the change of the air's index, common to all lines, ppm; 0: none
    level          significance level of the tests of each kind together
    """

    changes: "RangeChanges"
    blocks: tuple[MovementBlock, ...]
    determined: np.ndarray
    solution: GroupMovements | None
    tests: tuple[ConstraintTest, ...]
    standardised: np.ndarray
    air_ppm: float
    level: float

    @cached_property
    def displacement(self) -> np.ndarray:
        """Movements (n, 3) m, after less before; nan where undetermined."""
        d = np.full((len(self.determined), 3), np.nan)
        if self.solution is not None:
            d[self.determined] = self.solution.displacement
        return d

    @cached_property
    def covariance(self) -> np.ndarray:
        """Covariance (3n, 3n) m^2 of all movements; nan where undetermined."""
        n = len(self.determined)
        q = np.full((3 * n, 3 * n), np.nan)
        if self.solution is not None:
            at = np.flatnonzero(np.repeat(self.determined, 3))
            q[np.ix_(at, at)] = self.solution.covariance
        return q

    @cached_property
    def covariances(self) -> np.ndarray:
        """Covariances (n, 3, 3) m^2 of single movements."""
        n = len(self.determined)
        return np.array([self.covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(n)]).reshape(n, 3, 3)

    @cached_property
    def u(self) -> np.ndarray:
        """Standard uncertainties (n, 3) m."""
        return np.sqrt(np.maximum(np.einsum("nii->ni", self.covariances), 0.0))

    @cached_property
    def residual(self) -> np.ndarray:
        """Changes (n, s) m, measured less computed."""
        r = np.full(self.changes.change.shape, np.nan)
        if self.solution is not None:
            r[self.determined] = self.solution.residual
        return r

    @cached_property
    def p(self) -> np.ndarray:
        """Probability (n,) of such a movement of a point at rest; nan where it is held or undetermined."""
        result = np.full(len(self.determined), np.nan)
        for k in np.flatnonzero(self.determined):
            values, vectors = np.linalg.eigh(self.covariances[k])
            free = values > 1e-12 * max(values[-1], 1e-300)
            if values[-1] > 0.0:
                part = (self.displacement[k] @ vectors)[free]
                result[k] = special.chdtrc(int(free.sum()), float(np.sum(part**2 / values[free])))
        return result

    @cached_property
    def words(self) -> tuple[str, ...]:
        """Verdicts on the points: moved, at rest, held or undetermined."""
        tests = max(int(np.isfinite(self.p).sum()), 1)
        held = {int(row) for block in self.blocks if block.kind == "still" for row in block.rows}
        return tuple(
            "undetermined"
            if not good
            else "held"
            if k in held
            else "moved"
            if self.p[k] * tests < self.level
            else "at rest"
            for k, good in enumerate(self.determined)
        )

    @cached_property
    def constraint_names(self) -> tuple[str, ...]:
        """Constraint of each point; empty for a free one."""
        names = [""] * len(self.determined)
        for block in self.blocks:
            for row in block.rows if block.kind != "free" else ():
                names[int(row)] = f"{block.kind} {block.name}"
        return tuple(names)

    @property
    def degrees_of_freedom(self) -> int:
        """Changes less parameters."""
        return 0 if self.solution is None else int(self.solution.degrees_of_freedom)

    @property
    def p_fit(self) -> float:
        """Probability of residuals as large by chance; nan where nothing is redundant."""
        freedom = self.degrees_of_freedom
        return float(special.chdtrc(freedom, float(self.solution.pvv))) if self.solution and freedom else float("nan")

    @cached_property
    def suspects(self) -> np.ndarray:
        """Rows (k, 2) of changes that contradict the others: point and station, worst first."""
        w = np.nan_to_num(np.abs(self.standardised))
        tests = max(int(np.isfinite(self.standardised).sum()), 1)
        rows = np.argwhere(2.0 * special.ndtr(-w) * tests < self.level)
        return rows[np.argsort(-w[tuple(rows.T)])]

    @property
    def air(self) -> tuple[float, float]:
        """Estimated change of the air's index common to all lines, ppm, and its standard uncertainty."""
        if self.solution is None or not self.air_ppm:
            return float("nan"), float("nan")
        value, variance = self.solution.common[0], self.solution.common_covariance[0, 0]
        return float(self.air_ppm * value), float(self.air_ppm * np.sqrt(variance))

    @cached_property
    def verdict(self) -> Verdict:
        """Verdict on the movements."""
        lost = [name for name, good in zip(self.changes.points, self.determined, strict=True) if not good]
        if self.solution is None or self.solution.status.item() != DETERMINED:
            why = "no movement is determined" if self.solution is None else str(self.solution.status.item())
            return Verdict("failed", f"{why}: measure from further stations, or constrain the points")
        if lost:
            return Verdict("doubtful", f"the ranges do not determine the movement of {listed(lost)}")
        rejected = [test for test in self.tests if test.rejected]
        if rejected:
            worst = min(rejected, key=lambda test: test.p)
            return Verdict("doubtful", f"the ranges contradict {worst.kind} {worst.name}: p = {worst.p:.2g}")
        if len(self.suspects):
            point, station = self.suspects[0]
            line = f"{self.changes.stations[station]} to {self.changes.points[point]}"
            ratio = abs(self.standardised[point, station])
            return Verdict("doubtful", f"the change of {line} contradicts the others: w = {ratio:.1f}")
        if not self.degrees_of_freedom:
            return Verdict("doubtful", "nothing checks the changes: there are no more than movements to determine")
        if self.p_fit < self.level:
            return Verdict("doubtful", f"the changes do not agree within their claims: p = {self.p_fit:.2g}")
        untested = [f"{test.kind} {test.name}" for test in self.tests if not test.degrees_of_freedom]
        if untested:
            return Verdict("doubtful", f"nothing checks {listed(untested)}")
        return Verdict("good", "the changes of range agree with each other and with every constraint")


def measured_movements(
    changes: "RangeChanges",
    constraints: "MovementConstraints | None" = None,
    *,
    air_ppm: float = 0.0,
    level: float = 0.05,
) -> MeasuredMovements:
    """Movements of points from changes of their ranges.

    constraints   which points move together, in a plane, along a line, or not at all
    air_ppm       standard uncertainty of the change of the air's index between the epochs, common to all lines, ppm
    level         of the tests

    A point whose movement the ranges and its constraint do not determine has none, and its constraint's other points
    neither; the others are computed without them.

    Raises InputError for constraints that do not fit the points, and for more than 600 points.
    Source: [PARKER04] 3.2.4 and 3.2.5; `catseye.estimation.deformation.differential`.
    """
    if len(changes.points) > MOST:
        raise InputError(f"{len(changes.points)} points (expected {MOST} at most together: take them in parts)")
    blocks = movement_blocks(changes.points, changes.x, constraints)
    determined = _determined(changes, blocks, air_ppm)
    solvable = [block for block in blocks if determined[block.rows].all()]
    solution, tests = None, [_untestable(block, changes) for block in blocks if block.kind != "free"]
    standardised = np.full(changes.change.shape, np.nan)
    excluded = 0.0 if constraints is None else constraints.u_excluded_mm * MILLIMETRE
    if sum(block.basis.shape[1] for block in solvable):
        rows = np.flatnonzero(determined)
        basis = joined(solvable, len(determined))[np.repeat(determined, 3)]
        solution = _solved(changes, rows, basis, air_ppm, u_violation=excluded)
        if solution.status.item() == DETERMINED:
            standardised[rows] = _standardised(changes, rows, solution, air_ppm)
            tests = _tests(changes, blocks, determined, solution=solution, air_ppm=air_ppm, level=level)
    return MeasuredMovements(
        changes=changes,
        blocks=tuple(blocks),
        determined=determined,
        solution=solution,
        tests=tuple(tests),
        standardised=standardised,
        air_ppm=air_ppm,
        level=level,
    )


def _air(changes: "RangeChanges", rows: np.ndarray, air_ppm: float) -> np.ndarray | None:
    """Effect (n, s, 1) m on each change of one standard uncertainty of the air; None without."""
    return air_ppm * PPM * changes.distance[rows][:, :, None] if air_ppm else None


def _solved(
    changes: "RangeChanges", rows: np.ndarray, basis: np.ndarray, air_ppm: float, u_violation: float = 0.0
) -> GroupMovements:
    """Movements of some points in a basis."""
    return constrained(
        changes.x_stations,
        changes.x[rows],
        changes.change[rows],
        sigma=np.where(np.isfinite(changes.u_change[rows]), changes.u_change[rows], np.inf),
        basis=basis,
        u_stations=changes.u_stations,
        u_points=changes.u[rows],
        u_violation=u_violation,
        common=_air(changes, rows, air_ppm),
    )


def _whitened(
    changes: "RangeChanges", rows: np.ndarray, basis: np.ndarray, moved: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives (m, q) of the measured changes over their u, and the places (n, s) of these."""
    arm = changes.x[rows][:, None] - changes.x_stations + (0.0 if moved is None else moved[:, None])
    unit = arm / np.linalg.norm(arm, axis=2, keepdims=True)
    measured = np.isfinite(changes.change[rows])
    design = np.einsum("nsi,niq->nsq", unit, basis.reshape(len(rows), 3, -1))
    return design[measured] / changes.u_change[rows][measured][:, None], measured


def _without_air(changes: "RangeChanges", rows: np.ndarray, design: np.ndarray, air_ppm: float) -> np.ndarray:
    """Derivatives decorrelated from the air: those of the normal matrix with the air eliminated.

    With c the air's whitened column, (1 + cc')^-1/2 = 1 - cc' (1 - 1 / sqrt(1 + c'c)) / c'c.
    """
    air = _air(changes, rows, air_ppm)
    if air is None:
        return design
    measured = np.isfinite(changes.change[rows])
    c = air[measured][:, 0] / changes.u_change[rows][measured]
    square = float(c @ c)
    return np.asarray(design - np.outer(c, c @ design) * ((1.0 - 1.0 / np.sqrt(1.0 + square)) / square))


def _determined(changes: "RangeChanges", blocks: list[MovementBlock], air_ppm: float) -> np.ndarray:
    """Mask (n,) of points with a determined movement; a block is determined as a whole."""
    n = len(changes.points)
    determined = np.ones(n, dtype=bool)
    while determined.any():
        rows = np.flatnonzero(determined)
        solvable = [block for block in blocks if determined[block.rows].all()]
        basis = joined(solvable, n)[np.repeat(determined, 3)]
        design = _without_air(changes, rows, _whitened(changes, rows, basis)[0], air_ppm)
        null = split_observable(design, basis)[1]
        if not null.shape[1]:
            break
        size = np.linalg.norm(null.reshape(len(rows), 3, -1), axis=1)
        undetermined = rows[(size > SHARE * size.max(axis=0)).any(axis=1)]
        for block in solvable:
            if np.isin(block.rows, undetermined).any():
                determined[block.rows] = False
    return determined


def _standardised(changes: "RangeChanges", rows: np.ndarray, solution: GroupMovements, air_ppm: float) -> np.ndarray:
    """Residuals (n, s) over their standard uncertainties; nan where unchecked."""
    design, measured = _whitened(changes, rows, solution.basis, solution.displacement)
    air = _air(changes, rows, air_ppm)
    prior = np.zeros((0, design.shape[1]))
    if air is not None:
        design = np.column_stack([design, air[measured][:, 0] / changes.u_change[rows][measured]])
        prior = np.eye(design.shape[1])[-1:]
    q = np.linalg.qr(np.vstack([design, prior]))[0][: len(design)]
    share = 1.0 - np.sum(q * q, axis=1)
    w = np.full(measured.shape, np.nan)
    v = solution.residual[measured] / changes.u_change[rows][measured]
    w[measured] = np.where(share > 1e-6, v / np.sqrt(np.maximum(share, 1e-300)), np.nan)
    return w


def _untestable(block: MovementBlock, changes: "RangeChanges") -> ConstraintTest:
    nan, points = float("nan"), tuple(changes.points[int(k)] for k in block.rows)
    return ConstraintTest(
        name=block.name, kind=block.kind, points=points, statistic=nan, degrees_of_freedom=0, p=nan, rejected=False
    )


def _tests(
    changes: "RangeChanges",
    blocks: list[MovementBlock],
    determined: np.ndarray,
    *,
    solution: GroupMovements,
    air_ppm: float,
    level: float,
) -> list[ConstraintTest]:
    """Tests of all constraints, each against its own points free; those that nothing checks are in the list, too."""
    rows, n = np.flatnonzero(determined), len(determined)
    ties = [block for block in blocks if block.kind != "free"]
    tests = []
    for tie in ties:
        if not determined[tie.rows].all():
            tests.append(_untestable(tie, changes))
            continue
        other_blocks = [block for block in blocks if block is not tie and determined[block.rows].all()]
        blocks_free = [*other_blocks, *(free_block(changes.points[int(k)], int(k)) for k in tie.rows)]
        basis = joined(blocks_free, n)[np.repeat(determined, 3)]
        design = _without_air(changes, rows, _whitened(changes, rows, basis, solution.displacement)[0], air_ppm)
        observable = split_observable(design, basis)[0]
        freedom = observable.shape[1] - solution.basis.shape[1]
        if freedom <= 0:
            tests.append(_untestable(tie, changes))
            continue
        free = _solved(changes, rows, observable, air_ppm)
        statistic = max(float(solution.pvv - free.pvv), 0.0)
        p = float(special.chdtrc(freedom, statistic))
        tests.append(
            ConstraintTest(
                name=tie.name,
                kind=tie.kind,
                points=tuple(changes.points[int(k)] for k in tie.rows),
                statistic=statistic,
                degrees_of_freedom=freedom,
                p=p,
                rejected=p * len(ties) < level,
            )
        )
    return tests


def verdict_words(measured: MeasuredMovements) -> str:
    """Points that moved, at rest, held and undetermined, in words."""
    words = measured.words
    parts = []
    for word in ("moved", "at rest", "held", "undetermined"):
        names = [name for name, item in zip(measured.changes.points, words, strict=True) if item == word]
        if names:
            parts.append(f"{word}: {listed(names)}")
    far = np.linalg.norm(measured.displacement, axis=1)
    text = f"{counted(len(words), 'point')}; {'; '.join(parts)}"
    if np.isfinite(far).any():
        k = int(np.nanargmax(far))
        text += f". The farthest is {measured.changes.points[k]}, by {quantity(float(far[k]), 'm')}"
    return text
