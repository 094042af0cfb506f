"""Networks of every dimension and datum as our TOML, and a plain least squares of them in numpy.

Nothing here knows the package: observations are computed and differentiated (by central differences) from their
definitions, coordinates that do not exist have no column, and what floats is held by inner constraints on the datum.
"""

from dataclasses import dataclass, field

import numpy as np

U = {"slope_distance": 2e-3, "horizontal_distance": 2e-3, "height_difference": 1e-3}
U_ANGLE = 2e-5  # rad, about 4 arc seconds
DIMENSIONS = ("1", "2", "3", "mixed")
DATUMS = ("held", "datum", "free")
STEP = 1e-4  # m or rad of a central difference: its error is below 1e-9 of a derivative at these distances


@dataclass
class Scene:
    """A network of k points.

    there    (k, 3) bool: coordinates that exist
    held     (k, 3) bool: held in the file
    datum    (k, 3) bool: in the inner constraints, as adjusted
    given    (k, 3) m, coordinates of the file, nan for none
    rows     (kind, from, to, value, u) with angles in rad; `sets` holds the direction set of each row, -1 for others
    """

    truth: np.ndarray
    there: np.ndarray
    held: np.ndarray
    datum: np.ndarray
    given: np.ndarray
    rows: list[tuple[str, int, int, float, float]] = field(default_factory=list)

    @property
    def names(self) -> list[str]:
        return [f"P{i}" for i in range(len(self.truth))]

    def toml(self, marks: str) -> str:
        """The file; `marks` is what its marked coordinates are called, fixed or datum."""
        marked = self.held if marks == "fixed" else self.datum
        lines = ['format = "catseye-network-1"']
        for name, xyz, some in zip(self.names, self.given, marked, strict=True):
            lines += ["[[point]]", f'name = "{name}"']
            lines += [f"{a}_m = {v!r}" for a, v in zip("xyz", xyz.tolist(), strict=True) if np.isfinite(v)]
            text = "".join(a for a, m in zip("xyz", some, strict=True) if m)
            lines += [f'{marks} = "{text}"'] if text else []
        for kind, a, b, value, u in self.rows:
            length = kind in U
            lines += ["[[observation]]", f'kind = "{kind}"', f'from = "P{a}"', f'to = "P{b}"']
            lines += [
                f"value_{'m' if length else 'rad'} = {value!r}",
                f"u_{'mm' if length else 'rad'} = {1e3 * u if length else u!r}",
            ]
        return "\n".join(lines) + "\n"


def predicted(kind: str, along: np.ndarray, orientation: float) -> float:
    east, north, up = along
    level = float(np.hypot(east, north))
    return {
        "slope_distance": lambda: float(np.sqrt(east**2 + north**2 + up**2)),
        "horizontal_distance": lambda: level,
        "height_difference": lambda: float(up),
        "zenith_angle": lambda: float(np.arctan2(level, up)),
        "direction": lambda: float(np.arctan2(east, north) - orientation),
    }[kind]()


def scene(seed: int, dimension: str, datum: str, points: int = 6) -> Scene:
    """A network whose observations check each other, with honest noise.

    dimension   "1", "2", "3" or "mixed": plane points, levelled ones, and such as have all three
    datum       "held" (in the file), "datum" (marked so), or "free" (marked held, and to be adjusted free)
    """
    rng = np.random.default_rng([seed, DIMENSIONS.index(dimension), DATUMS.index(datum)])
    turn = 2 * np.pi * np.arange(points) / points + rng.uniform(-0.2, 0.2, points)
    truth = np.stack([80 * np.sin(turn), 80 * np.cos(turn), rng.uniform(-15, 15, points)], axis=1)
    truth[:, :2] += rng.uniform(-8, 8, (points, 2)) + 500.0
    there = np.ones((points, 3), dtype=bool)
    kinds = {
        "1": ("height_difference",),
        "2": ("horizontal_distance", "direction"),
        "3": ("slope_distance", "zenith_angle", "direction"),
    }
    if dimension == "1":
        there[:, :2] = False
    if dimension == "2":
        there[:, 2] = False
    if dimension == "mixed":
        there[:2, 2] = False  # seen in plan alone
        there[-2:, :2] = False  # levelled alone
    pairs = [(i, j) for i in range(points) for j in range(points) if i != j]
    made = Scene(truth, there, *np.zeros((2, points, 3), dtype=bool), np.full((points, 3), np.nan))
    orientations = rng.uniform(0, 2 * np.pi, points)
    for i, j in pairs:
        plan, up = there[[i, j], :2].all(), there[[i, j], 2].all()
        mixed = ("horizontal_distance", "direction") * bool(plan) + ("height_difference",) * bool(up and i < j)
        for kind in kinds.get(dimension, mixed):
            if kind == "height_difference" and i > j:
                continue
            u = U.get(kind, U_ANGLE)
            value = predicted(kind, truth[j] - truth[i], orientations[i]) + u * rng.standard_normal()
            made.rows.append((kind, i, j, float(value), u))
    marked = there & np.isin(np.arange(points), (1, 2, 3, points - 1))[:, None]
    made.given = np.where(there, truth + rng.normal(0.0, 0.02, truth.shape), np.nan)
    made.given = np.where(marked, truth, made.given)
    made.held = marked if datum != "datum" else made.held
    made.datum = marked if datum != "held" else made.datum
    return made


@dataclass
class PlainAnswer:
    """Coordinates (k, 3) and variances, nan where there are none; [pvv] and degrees of freedom."""

    x: np.ndarray
    covariance: np.ndarray
    pvv: float
    degrees: int


def least_squares(made: Scene, datum: str) -> PlainAnswer:
    """Gauss-Newton with every matrix dense, and inner constraints against whatever the observations leave floating."""
    k = len(made.truth)
    held = made.held if datum == "held" else np.zeros_like(made.held)
    free = np.flatnonzero((made.there & ~held).ravel())
    stations = sorted({a for kind, a, *_ in made.rows if kind == "direction"})
    x = np.where(made.there, made.given, 0.0)
    turns = dict.fromkeys(stations, 0.0)
    for kind, a, b, value, _ in made.rows:
        if kind == "direction":
            turns[a] = np.arctan2(*(x[b] - x[a])[:2]) - value
    state = np.concatenate([x.ravel(), [turns[s] for s in stations]])
    moving = np.concatenate([free, 3 * k + np.arange(len(stations))])
    reference = state.copy()
    on = np.zeros(len(state), dtype=bool)
    on[: 3 * k] = made.datum.ravel() & (datum != "held")

    def values(s: np.ndarray) -> np.ndarray:
        p = s[: 3 * k].reshape(-1, 3)
        turned = dict(zip(stations, s[3 * k :], strict=True))
        return np.array([predicted(kind, p[b] - p[a], turned.get(a, 0.0)) for kind, a, b, _, _ in made.rows])

    observed, u = (np.array([row[c] for row in made.rows]) for c in (3, 4))
    angle = np.array([row[0] not in U for row in made.rows])
    for _ in range(8):
        design = np.zeros((len(observed), len(moving)))
        for c, column in enumerate(moving):
            step = np.zeros(len(state))
            step[column] = STEP
            change = values(state + step) - values(state - step)
            design[:, c] = np.where(angle, (change + np.pi) % (2 * np.pi) - np.pi, change) / (2 * STEP)
        v = observed - values(state)
        v = np.where(angle, (v + np.pi) % (2 * np.pi) - np.pi, v)
        a, right = design / u[:, None], v / u
        scale = np.linalg.norm(a, axis=0)
        _, singular, back = np.linalg.svd(a / scale)
        null = back[np.sum(singular > 1e-7 * singular[0]) :].T / scale[:, None]
        constraint = (null * on[moving][:, None]).T
        d = len(constraint)
        constraint = np.linalg.qr(constraint.T)[0].T if d else constraint
        bordered = np.block([[a.T @ a, constraint.T], [constraint, np.zeros((d, d))]])
        to = constraint @ np.where(on, reference - state, 0.0)[moving]
        size = np.concatenate([scale, np.full(d, 1.0 / np.median(scale))]) if d else scale
        inverse = np.linalg.inv(bordered / np.outer(size, size)) / np.outer(size, size)
        state = state.copy()
        state[moving] += (inverse @ np.concatenate([a.T @ right, to]))[: len(moving)]
    full = np.zeros((len(state), len(state)))
    full[np.ix_(moving, moving)] = inverse[: len(moving), : len(moving)]
    gone = ~made.there.ravel()
    full = full[: 3 * k, : 3 * k]
    full[gone] = full[:, gone] = np.nan
    v = observed - values(state)
    v = np.where(angle, (v + np.pi) % (2 * np.pi) - np.pi, v)
    coordinates = np.where(made.there, state[: 3 * k].reshape(-1, 3), np.nan)
    return PlainAnswer(coordinates, full, float(np.sum((v / u) ** 2)), len(observed) - len(moving) + d)
