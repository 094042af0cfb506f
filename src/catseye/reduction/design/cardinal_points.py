"""Cardinal points of a telescope: the targets whose ranges determine a structural model's coefficients best.

[PARKER04] section 2.6 chooses them by the model. A range from the ground to a target sees the target's displacement
along the line. Unknown besides the free coefficients x (with their prior) are what the model leaves in each posture, z,
new in each and common to its targets, and each target's place, one for all postures. All are normal, and all enter
linearly, so that the ranges to a set S of targets tell about x exactly

    I(S) = 1/2 [ log det J(S) - log det J(S)_zz - log det J_xx(0) ]

with the information J(S) = J(0) + sum of M_j over S of x and z together, the sheet's places eliminated in each M_j.
Points are taken one by one, each the one that adds most, then exchanged while an exchange adds.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE, PPM
from catseye.errors import InputError
from catseye.geometry.antenna.deformation import COMPONENTS, TelescopePosture
from catseye.records.site.folder import SiteFolder
from catseye.records.site.solids import Solids
from catseye.reduction.design.scene import DesignScene, scene_of_site
from catseye.reduction.structure.antenna import Antenna
from catseye.reduction.structure.displacement import BodyPoint
from catseye.reduction.structure.model_fit import functions_of
from catseye.verdict import Verdict

AZIMUTHS_DEG, ELEVATIONS_DEG = (0.0, 120.0, 240.0), (15.0, 45.0, 75.0)
DETERMINED = 0.5  # of the prior's u: a coefficient that keeps more is not determined
EXCHANGES = 200  # at most
MOST = 300  # candidates: each has a matrix of some 300 rows
GAINED = 1e-9  # nats: an exchange that adds less is rounding
NATS = float(np.log(2.0))  # in a bit


@dataclass(frozen=True)
class ChoiceSettings:
    """Uncertainties of a choice.

    u_range   m, of a range, and u_scale of its length
    u_shift, u_turn   m, rad: prior of a coefficient without a covariance in the model
    """

    u_range: float = 1e-4
    u_scale: float = 0.5 * PPM
    u_shift: float = 5.0 * MILLIMETRE
    u_turn: float = 20.0 * ARCSECOND


@dataclass(frozen=True, eq=False)
class Candidates:
    """Information of each candidate about coefficients and what the model leaves.

    names       n
    labels      k free coefficients: frame, component, function
    start       (k + z, k + z), information before any range
    each        (n, k + z, k + z), information that the ranges to a candidate add
    lines       (n,) number of its lines in all postures
    """

    names: tuple[str, ...]
    labels: tuple[str, ...]
    start: np.ndarray
    each: np.ndarray
    lines: np.ndarray

    def gain(self, chosen: Sequence[int]) -> float:
        """Information I(S) that the ranges to some candidates give about the coefficients, nats."""
        return _information(self.start + self.each[list(chosen)].sum(axis=0), len(self.labels)) - self._before

    @property
    def _before(self) -> float:
        return _information(self.start, len(self.labels))

    def u(self, chosen: Sequence[int]) -> np.ndarray:
        """Standard uncertainties (k,) of the coefficients, m or rad, after the ranges to some candidates."""
        total = self.start + self.each[list(chosen)].sum(axis=0)
        size = np.sqrt(np.diag(total))
        inverse = np.linalg.inv(total / np.outer(size, size)) / np.outer(size, size)
        return np.asarray(np.sqrt(np.diag(inverse)[: len(self.labels)]))


def _information(total: np.ndarray, k: int) -> float:
    """Half the logarithm of the determinant of the information of the first k unknowns, the others eliminated."""
    return 0.5 * float(np.linalg.slogdet(total)[1] - np.linalg.slogdet(total[k:, k:])[1])


@dataclass(frozen=True, eq=False)
class PointChoice:
    """Cardinal points in the order of their choice.

    candidates   of which they are chosen
    order        rows of the chosen ones
    gains        (c,) nats, of the first, the first two, ...
    alone        (n,) nats, of each candidate by itself
    of_all       nats, of all candidates
    exchanges    number of exchanges
    hidden       names of targets without a line in any posture
    """

    candidates: Candidates
    order: tuple[int, ...]
    gains: np.ndarray
    alone: np.ndarray
    of_all: float
    exchanges: int
    hidden: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cardinal points."""
        return tuple(self.candidates.names[i] for i in self.order)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Coefficients whose u stays above half of the prior's."""
        before, after = self.candidates.u([]), self.candidates.u(self.order)
        return tuple(
            label
            for label, prior, posterior in zip(self.candidates.labels, before, after, strict=True)
            if posterior > DETERMINED * prior
        )

    @property
    def verdict(self) -> Verdict:
        """Verdict: whether every coefficient is determined."""
        share = f"{self.gains[-1] / self.of_all:.0%} of the information of all {len(self.candidates.names)} points"
        if self.undetermined:
            some = ", ".join(self.undetermined[:3]) + (", ..." if len(self.undetermined) > 3 else "")
            return Verdict(
                "doubtful", f"{len(self.undetermined)} coefficients keep more than half of their prior's u: {some}"
            )
        return Verdict("good", f"every coefficient is determined, with {share}")

    @property
    def notes(self) -> tuple[str, ...]:
        """Targets that no ranger sees, for the reader."""
        if not self.hidden:
            return ()
        some = ", ".join(self.hidden[:4]) + (", ..." if len(self.hidden) > 4 else "")
        return (f"{len(self.hidden)} targets are seen by no ranger on the ground in any posture ({some}).",)


def usual_postures(antenna: Antenna) -> TelescopePosture:
    """Nine postures over azimuth and elevation, at three temperatures of the model's range."""
    low, high = antenna.record.temperature_c
    warm = [low + share * (high - low) for share in (0.25, 0.5, 0.75)]
    rows = [(a, e, warm[(i + j) % 3]) for i, a in enumerate(AZIMUTHS_DEG) for j, e in enumerate(ELEVATIONS_DEG)]
    azimuth, elevation, temperature = np.array(rows).T
    return TelescopePosture(azimuth * DEGREE, elevation * DEGREE, temperature)


def candidates_of(
    antenna: Antenna,
    site: SiteFolder,
    points: Sequence[BodyPoint],
    posture: TelescopePosture,
    *,
    free: Mapping[str, Sequence[str]],
    settings: ChoiceSettings,
) -> tuple[Candidates, tuple[str, ...]]:
    """Candidates with their information, and names of targets without a line.

    antenna    the model
    site       whose rangers on the ground measure
    points     targets that may be chosen
    posture    (p,), in which each of them is measured where it is seen
    free       frame or group: components to be determined
    settings   uncertainties

    Raises InputError where no target is seen, for too many, and for an unknown frame or component.
    """
    if len(points) > MOST:
        raise InputError(f"{len(points)} targets are too many to choose from (expected at most {MOST}: name some)")
    layout = [(name, c) for name, components in free.items() for c in COMPONENTS if c in components]
    for name, components in free.items():
        if name not in antenna.motions:
            raise InputError(f"{name!r} has no motion in the structural model (it has {', '.join(antenna.motions)})")
        for component in set(components) - set(COMPONENTS):
            raise InputError(f"{name}: {component!r} is not a component (expected {', '.join(COMPONENTS)})")
    a, e, t = np.broadcast_arrays(*np.atleast_1d(posture.azimuth, posture.elevation, posture.temperature_c))
    postures = [TelescopePosture(*row) for row in zip(a, e, t, strict=True)]
    dish = any(p.name in site.targets and site.targets[p.name].shapes_dish for p in points)
    scene = scene_of_site(site, Solids(), postures=[(float(x), float(y)) for x, y in zip(a, e, strict=True)], dish=dish)
    lines = [_lines(scene, site, k) for k in range(len(postures))]
    start, labels = _start(antenna, layout, len(postures), settings)
    names, added, counts, hidden = [], [], [], []
    for point in points:
        observed = [at.get(point.name, []) for at in lines]
        count = sum(map(len, observed))
        if count:
            names.append(point.name)
            added.append(_added(antenna, point, postures, observed, layout, settings))
            counts.append(count)
        else:
            hidden.append(point.name)
    if not names:
        raise InputError("no target is seen by a ranger on the ground in these postures (expected other postures)")
    return Candidates(tuple(names), labels, start, np.array(added), np.array(counts)), tuple(hidden)


def _lines(scene: DesignScene, site: SiteFolder, posture: int) -> dict[str, list[np.ndarray]]:
    """Places (3,) m of the ground's rangers that see each target in a posture."""
    places = scene.on_ground(posture)
    observed: dict[str, list[np.ndarray]] = {}
    for ranger, row in scene.network(posture).pairs:
        at = int(scene.rangers[ranger])
        if scene.points[at].name in site.monuments:
            observed.setdefault(scene.points[int(row)].name, []).append(places[at])
    return observed


def _start(
    antenna: Antenna, layout: Sequence[tuple[str, str]], postures: int, settings: ChoiceSettings
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Information of the priors of coefficients and of what each motion leaves in each posture, and labels."""
    u, labels = [], []
    for name, component in layout:
        motion, c = antenna.motions[name], COMPONENTS.index(component)
        k = len(motion.basis)
        usual = settings.u_turn if component.startswith("turn") else settings.u_shift
        local = np.sqrt(np.diag(motion.covariance)[c * k : (c + 1) * k])
        u += np.where(local > 0.0, local, usual).tolist()
        labels += [f"{name} {component} {function}" for function in functions_of(motion)]
    residual = np.tile(np.concatenate([motion.u for motion in antenna.motions.values()]), postures)
    return np.diag(np.concatenate([u, residual]) ** -2), tuple(labels)


def _added(
    antenna: Antenna,
    point: BodyPoint,
    postures: Sequence[TelescopePosture],
    seen: Sequence[Sequence[np.ndarray]],
    layout: Sequence[tuple[str, str]],
    settings: ChoiceSettings,
) -> np.ndarray:
    """Information that all ranges to a point add, its place in the frame eliminated."""
    motions = list(antenna.motions)
    size = sum(len(antenna.motions[name].basis) for name, _ in layout)
    rows, places, noise = [], [], []
    u_place, fresh = _u_of(antenna, point)
    for p, (at, stands) in enumerate(zip(postures, seen, strict=True)):
        if not stands:
            continue
        ground = antenna.ground_from(point.frame, at)
        slopes = antenna.derivatives(point.frame, point.position, at)
        lines = ground.points(point.position) - np.array(stands)
        length = np.linalg.norm(lines, axis=1)
        along = lines / length[:, None]
        by_motion = np.zeros((3, 6 * len(motions) * len(postures)))
        for m, name in enumerate(motions):
            if name in slopes:
                first = 6 * (p * len(motions) + m)
                by_motion[:, first : first + 6] = slopes[name]
        by_coefficient = [
            np.outer(slopes[name][:, COMPONENTS.index(c)], antenna.motions[name].basis.rows(at))
            if name in slopes
            else np.zeros((3, len(antenna.motions[name].basis)))
            for name, c in layout
        ]
        rows.append(along @ np.concatenate([*by_coefficient, by_motion], axis=1))
        places.append(along @ ground.rotation)
        variance = np.diag(settings.u_range**2 + (settings.u_scale * length) ** 2)
        noise.append(variance + fresh**2 * along @ along.T)
    design, at_rest = np.concatenate(rows), np.concatenate(places)
    assert design.shape[1] == size + 6 * len(motions) * len(postures)
    spread = u_place**2 * at_rest @ at_rest.T
    first = 0
    for block in noise:
        spread[first : first + len(block), first : first + len(block)] += block
        first += len(block)
    return np.asarray(design.T @ np.linalg.solve(spread, design))


def _u_of(antenna: Antenna, point: BodyPoint) -> tuple[float, float]:
    """Standard uncertainties, m, of a point's place in its frame and of its own shift in any one posture."""
    if not point.group:
        return MILLIMETRE, 0.0
    group = antenna.groups[point.group]
    row = group.names.index(point.name)
    return float(group.u[row]), float(np.sqrt(max(antenna.u_points(point.group)[row] ** 2 - group.u[row] ** 2, 0.0)))


def chosen_points(
    candidates: Candidates,
    count: int,
    *,
    hidden: Sequence[str] = (),
    progress: Callable[[str, int, int], None] | None = None,
) -> PointChoice:
    """Points that together tell most about the coefficients.

    candidates   with their information
    count        number of points
    hidden       names of targets that no ranger sees
    progress     called with (what, done, of how many)

    Raises InputError for more points than there are candidates.
    """
    n = len(candidates.names)
    if count > n:
        raise InputError(f"count = {count} of {n} targets that are seen (expected at most {n})")
    order: list[int] = []
    for step in range(count):
        if progress is not None:
            progress("choosing points", step, count)
        free = [i for i in range(n) if i not in order]
        order.append(max(free, key=lambda i: candidates.gain([*order, i])))
    exchanges = 0
    while exchanges < EXCHANGES:
        best, swap = candidates.gain(order), None
        for position in range(count):
            for i in set(range(n)) - set(order):
                trial = [*order[:position], i, *order[position + 1 :]]
                value = candidates.gain(trial)
                if value > best + GAINED:
                    best, swap = value, trial
        if swap is None:
            break
        order, exchanges = swap, exchanges + 1
    gains = np.array([candidates.gain(order[: k + 1]) for k in range(count)])
    return PointChoice(
        candidates=candidates,
        order=tuple(order),
        gains=gains,
        alone=np.array([candidates.gain([i]) for i in range(n)]),
        of_all=candidates.gain(range(n)),
        exchanges=exchanges,
        hidden=tuple(hidden),
    )
