"""Structural model from a finite element result: rigid part to the frames, residual to the points.

A linear finite element model of the tipping structure gives the displacement of each node under gravity. In the body's
axes gravity is (0, cos E, -sin E), so that displacements are the sum of one by cos E and one by sin E, given as load
cases of their own, or estimated from several elevations. In each frame from the body upwards the displacements of its
targets, less what the frames below do to them, are a shift and turn (unweighted least squares) and a residual each.
Small displacements add; the product of a turn and a displacement, 10 µm for 50 arc seconds and 40 mm, is neglected, as
a linear finite element model neglects it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.errors import InputError
from catseye.geometry.antenna.deformation import PostureTerms, TelescopePosture
from catseye.geometry.frames.rotation import skew
from catseye.records.site.nodal_result import NodalResult, NodePlaces
from catseye.records.site.structural_model import KEYS, Basis, GroupRecord, MotionRecord, StructuralModel, flattened
from catseye.reduction.structure.antenna import UNITS, Antenna
from catseye.verdict import Verdict

GRAVITY = ("cosE", "sinE")
SMALLEST_SHIFT_MM, SMALLEST_TURN_ARCSEC = 1e-3, 1e-2  # least u of a coefficient: a prior needs one
LINEAR = 0.05  # of the largest displacement: greater misfits of the elevations contradict cos E and sin E
FLAT = 1e-3  # of the largest singular value: points nearer to one line do not show a turn
RIGID = 1e-6  # m: smaller residuals are no shapes of their own


@dataclass(frozen=True)
class NodeMatch:
    """Node that stands for a target.

    target     name
    node       number
    distance   m, of the node from the target at rest
    """

    target: str
    node: int
    distance: float


@dataclass(frozen=True, eq=False)
class ImportedModel:
    """Structural model with a finite element result in it.

    record     the new model
    matches    nodes of the targets
    terms      functions of posture of the result
    frames     frames whose motion is new
    rigid      (m, k, 3) m, displacement of each match by the frames' motions, for each term, body's axes
    residual   (m, k, 3) m, what no frame's motion has
    misfit     m, largest of the elevations' cases about the terms; NaN where the cases are the terms
    unmatched  targets of these frames without a node, which move with their frame
    """

    record: StructuralModel
    matches: tuple[NodeMatch, ...]
    terms: tuple[str, ...]
    frames: tuple[str, ...]
    rigid: np.ndarray
    residual: np.ndarray
    misfit: float
    unmatched: tuple[str, ...]

    @property
    def largest(self) -> float:
        """Largest displacement of a target in a term, m."""
        return float(np.max(np.linalg.norm(self.rigid + self.residual, axis=2)))

    @property
    def notes(self) -> tuple[str, ...]:
        """Targets without a node, for the reader."""
        if not self.unmatched:
            return ()
        some = ", ".join(self.unmatched[:4]) + (", ..." if len(self.unmatched) > 4 else "")
        return (f"{len(self.unmatched)} targets have no node and move with their frame alone ({some}).",)

    @property
    def verdict(self) -> Verdict:
        """Verdict: whether the elevations follow the terms."""
        if self.misfit > LINEAR * self.largest:
            share = f"{self.misfit / MILLIMETRE:.2f} mm of {self.largest / MILLIMETRE:.2f} mm"
            return Verdict("doubtful", f"the elevations depart from {', '.join(self.terms)} by {share}")
        return Verdict("good", f"{len(self.matches)} targets have a node, in {len(self.frames)} frames")


def matched(
    antenna: Antenna, places: NodePlaces, *, frame: str, turn: np.ndarray, origin: np.ndarray, within: float
) -> tuple[tuple[NodeMatch, ...], tuple[str, ...]]:
    """Nodes of the targets on a frame and what it carries, and targets without one.

    antenna   the model
    places    of the nodes
    frame     body of the finite element model
    turn      (3, 3) from the finite element model's axes to the frame's
    origin    (3,) m, the finite element model's origin in the frame
    within    m, from a target at rest to its node

    A node that the table names counts; else the nearest. Raises InputError for a node named for a target that is not
    there or is farther off than `within`, or that is nearest to two targets.
    """
    at_rest = rest_places(antenna, frame)
    nodes = places.place @ turn.T + origin
    named = {target: i for i, target in enumerate(places.targets) if target}
    for target, i in named.items():
        if target not in at_rest:
            raise InputError(
                f"{places.file}: node {places.nodes[i]} names {target!r}, which is no target on {frame!r} or what it "
                "carries in the structural model"
            )
    matches, missing = [], []
    for target, rest in at_rest.items():
        distance = np.linalg.norm(nodes - rest, axis=1)
        i = named.get(target, int(np.argmin(distance)))
        if distance[i] > within and target in named:
            raise InputError(
                f"{places.file}: node {places.nodes[i]} lies {distance[i]:.3f} m from {target} at rest (expected "
                f"within {within:g} m: other axes, origin or unit?)"
            )
        if distance[i] > within:
            missing.append(target)
        else:
            matches.append(NodeMatch(target, places.nodes[i], float(distance[i])))
    chosen = [match.node for match in matches]
    for match in matches:
        if chosen.count(match.node) > 1:
            twins = ", ".join(item.target for item in matches if item.node == match.node)
            raise InputError(f"{places.file}: node {match.node} is nearest to {twins} (expected a node each)")
    return tuple(matches), tuple(missing)


def rest_places(antenna: Antenna, frame: str) -> dict[str, np.ndarray]:
    """Places (3,) m at rest of the targets on a frame and what it carries, in its axes."""
    antenna.chain(frame)
    anywhere = TelescopePosture(0.0, 45.0 * DEGREE, 0.0)
    inward = antenna.ground_from(frame, anywhere, deformed=False).inverse()
    places: dict[str, np.ndarray] = {}
    for group in antenna.groups.values():
        if frame in antenna.chain(group.frame):
            to_frame = inward @ antenna.ground_from(group.frame, anywhere, deformed=False)
            places |= dict(zip(group.names, to_frame.points(group.position), strict=True))
    return places


def by_terms(
    result: NodalResult, cases: Mapping[str, str], terms: Sequence[str]
) -> tuple[tuple[str, ...], np.ndarray, float]:
    """Terms, displacements (k, n, 3) m for each, and the largest misfit of the elevations, m.

    result   of the load cases
    cases    case: its term, or its elevation in degrees
    terms    to be estimated where the cases are elevations

    Raises InputError for a case without a meaning, for terms and elevations mixed, too few elevations.
    """
    unknown = set(cases) - set(result.cases)
    if unknown:
        raise InputError(f"{result.file}: case {min(unknown)!r} is not there (it has {', '.join(result.cases)})")
    angles, names = [], []
    for k, case in enumerate(result.cases):
        meaning = cases.get(case)
        if meaning is None and not np.isfinite(result.elevation_deg[k]):
            raise InputError(
                f"{result.file}: case {case} has no meaning (expected {case}=cosE or another term, or {case}=30, its "
                "elevation in degrees)"
            )
        try:
            angles.append(float(result.elevation_deg[k] if meaning is None else meaning))
        except ValueError:
            names.append(str(meaning))
    if names and angles:
        raise InputError(f"{result.file}: some cases are terms, others elevations (expected one kind)")
    if names:
        PostureTerms(tuple(names), 0.0)
        if len(set(names)) < len(names):
            raise InputError(f"{result.file}: two cases have the term {names[0]!r} (expected each once)")
        return tuple(names), result.displacement, float("nan")
    basis = PostureTerms(tuple(terms), 0.0).rows(TelescopePosture(0.0, np.radians(angles), 0.0))
    if len(angles) < len(terms) or np.linalg.matrix_rank(basis, tol=1e-3) < len(terms):
        raise InputError(f"{result.file}: {len(angles)} elevations do not determine {', '.join(terms)} (expected more)")
    flat = result.displacement.reshape(len(angles), -1)
    values = np.linalg.lstsq(basis, flat, rcond=None)[0]
    misfit = float(np.max(np.abs(basis @ values - flat)))
    return tuple(terms), values.reshape(len(terms), -1, 3), misfit if len(angles) > len(terms) else float("nan")


def imported(
    antenna: Antenna,
    matches: Sequence[NodeMatch],
    missing: Sequence[str],
    *,
    frame: str,
    terms: tuple[str, ...],
    displacement: Mapping[int, np.ndarray],
    u_share: float,
    misfit: float = float("nan"),
) -> ImportedModel:
    """Structural model with displacements of its targets in it.

    antenna        the model to begin with; its terms of t and A stay
    matches        nodes of the targets
    missing        targets without one
    frame          body of the finite element model
    terms          k functions of posture
    displacement   node: (k, 3) m, axes of the frame
    u_share        standard uncertainty of a displacement as a share of it: a prior for a fit
    misfit         of the elevations, m

    Raises InputError where a frame has too few nodes for its motion, or moves by a table.
    """
    if not matches:
        raise InputError(f"no target has a node near it on {frame!r} (expected other axes, origin, unit, or limit)")
    total = {match.target: displacement[match.node] for match in matches}
    places = rest_places(antenna, frame)
    carrier = {name: group.frame for group in antenna.groups.values() for name in group.names}
    frames = [name for name in antenna.parents if any(carrier[target] == name for target in total)]
    frames.sort(key=lambda name: len(antenna.chain(name)))
    below: dict[str, np.ndarray] = {target: np.zeros((len(terms), 3)) for target in total}
    motions: dict[str, MotionRecord] = {}
    for name in frames:
        targets = [target for target in total if carrier[target] == name]
        pivot = _pivot_in(antenna, name, frame)
        design = np.concatenate([np.hstack([np.eye(3), -skew(places[t] - pivot)]) for t in targets])
        spread = np.array([places[t] for t in targets]) - np.mean([places[t] for t in targets], axis=0)
        extent = np.linalg.svd(spread, compute_uv=False)
        if len(targets) < 3 or extent[1] < FLAT * extent[0]:
            raise InputError(
                f"frame {name!r} has nodes at {', '.join(targets)} (expected three targets that are not on one line)"
            )
        values = np.concatenate([(total[t] - below[t]).T for t in targets])  # (3n, k)
        six = np.linalg.lstsq(design, values, rcond=None)[0]
        motions[name] = _motion(antenna, name, terms, six, u_share)
        for target in total:
            if name in antenna.chain(carrier[target]):
                arm = np.hstack([np.eye(3), -skew(places[target] - pivot)])
                below[target] = below[target] + (arm @ six).T
    order = [match.target for match in matches]
    residual = np.array([total[target] - below[target] for target in order])
    groups = [
        _group(group, {t: residual[order.index(t)] for t in order}, terms, u_share) for group in antenna.record.group
    ]
    moved = [
        entry.model_copy(update={"motion": motions[entry.name]}) if entry.name in motions else entry
        for entry in antenna.record.frame
    ]
    copy = antenna.record.model_copy(update={"frame": tuple(moved), "group": tuple(groups)})
    return ImportedModel(
        record=StructuralModel.model_validate(copy.model_dump()),
        matches=tuple(matches),
        terms=terms,
        frames=tuple(frames),
        rigid=np.array([below[target] for target in order]),
        residual=residual,
        misfit=misfit,
        unmatched=tuple(missing),
    )


def _pivot_in(antenna: Antenna, name: str, frame: str) -> np.ndarray:
    """Pivot (3,) m of a frame's motion, in the axes of the body."""
    anywhere = TelescopePosture(0.0, 45.0 * DEGREE, 0.0)
    inward = antenna.ground_from(frame, anywhere, deformed=False).inverse()
    return np.asarray((inward @ antenna.ground_from(name, anywhere, deformed=False)).points(antenna.pivot(name)))


def _stays(term: str) -> bool:
    """True for a term that a result of gravity says nothing of: with temperature or azimuth."""
    return any(factor.startswith("t") or factor.endswith("A") for factor in term.replace(" ", "").split("*"))


def _joined_terms(old: Sequence[str], new: tuple[str, ...], where: str) -> tuple[tuple[str, ...], list[int]]:
    """New terms and those that stay, and the positions of the latter among the old."""
    at = [k for k, term in enumerate(old) if _stays(term)]
    twice = [old[k] for k in at if old[k] in new]
    if twice:
        raise InputError(f"{where}: the term {twice[0]!r} of the model stays (expected other terms of the result)")
    return (*new, *(old[k] for k in at)), at


def _motion(antenna: Antenna, name: str, new: tuple[str, ...], six: np.ndarray, u_share: float) -> MotionRecord:
    """Motion of a frame: the result's terms with their u, and the terms that stay."""
    record = next(entry.motion for entry in antenna.record.frame if entry.name == name)
    if record is None or record.terms is None:
        have = "no motion" if record is None else "a table"
        raise InputError(f"frame {name!r} has {have} (expected a motion by terms, for its pivot and its u)")
    terms, at = _joined_terms(record.terms, new, f"frame {name!r}")
    before = np.array([flattened(getattr(record, key) or (0.0,) * len(record.terms)) for key in KEYS])
    values = np.concatenate([six / UNITS[:, None], before[:, at]], axis=1)
    shift, turn = (u_share * np.linalg.norm(part, axis=0) for part in (six[:3] / MILLIMETRE, six[3:] / ARCSECOND))
    u = np.vstack([np.maximum(shift, SMALLEST_SHIFT_MM)] * 3 + [np.maximum(turn, SMALLEST_TURN_ARCSEC)] * 3)
    size, added = len(terms), len(new) + np.arange(len(at))
    covariance = np.diag(np.hstack([u**2, np.zeros((6, len(at)))]).ravel())
    if record.covariance is not None:
        old = np.array(record.covariance).reshape(6, len(record.terms), 6, len(record.terms))
        shaped = covariance.reshape(6, size, 6, size)
        every, staying = np.arange(6), np.array(at, dtype=int)
        shaped[np.ix_(every, added, every, added)] = old[np.ix_(every, staying, every, staying)]
    return record.model_copy(
        update={
            "terms": terms,
            "covariance": tuple(tuple(row) for row in covariance.tolist()),
            **{key: tuple(row) for key, row in zip(KEYS, values.tolist(), strict=True)},
        }
    )


def _group(group: GroupRecord, residual: Mapping[str, np.ndarray], new: tuple[str, ...], u_share: float) -> GroupRecord:
    """Group whose targets have their residual as shifts of their own."""
    mine = {point.name: residual[point.name] for point in group.point if point.name in residual}
    size = max((float(np.max(np.abs(values))) for values in mine.values()), default=0.0)
    if not mine or (size < RIGID and group.shifts is None):
        return group
    if group.motion is not None:
        raise InputError(f"group {group.name!r} moves as a whole (expected no motion, or no node at its points)")
    old = group.shifts.terms if group.shifts is not None else ()
    if old is None:
        raise InputError(f"group {group.name!r} moves by a table (expected shifts by terms)")
    terms, at = _joined_terms(old, new, f"group {group.name!r}")
    points = []
    for point in group.point:
        values = mine.get(point.name, np.zeros((len(new), 3))) / MILLIMETRE
        update = {}
        for c, key in enumerate(KEYS[:3]):
            before = flattened(getattr(point, key) or (0.0,) * len(old))
            update[key] = (*values[:, c].tolist(), *(before[k] for k in at))
        points.append(point.model_copy(update=update))
    rms = float(np.sqrt(np.mean(np.square(list(mine.values()))))) / MILLIMETRE
    u = max(group.u_shift_mm or 0.0, u_share * rms, SMALLEST_SHIFT_MM)
    return group.model_copy(update={"shifts": Basis(terms=terms), "u_shift_mm": u, "point": tuple(points)})
