"""Two adjusted epochs of a network compared: what moved, under the stochastic model that their connection calls for."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.deformation.congruence import (
    KNOWN,
    Differences,
    VarianceFactor,
    differences,
    pooled_variance_factor,
)
from catseye.estimation.deformation.deformation import Deformation, moved_points
from catseye.estimation.deformation.epoch_model import DatumConnection, EpochModel, listed
from catseye.estimation.least_squares.adjustment import CONVERGED
from catseye.estimation.network.model import NetworkSolution
from catseye.estimation.shapes.rigid_body import motion_columns, turned_covariance

LARGEST = 700  # common points of one joint test, whose work grows with their number cubed
TOO_MANY = (
    "{n} common points are too many for one joint test (limit {limit}); name the stable ones that the others are to be "
    "compared with (frame=), at most {limit}, or fewer points (points=)"
)


@dataclass(frozen=True, eq=False)
class PointMovements:
    """What moved between two epochs; arrays over the n points of `deformation`, in x east, y north, z up.

    first, second           as adjusted
    deformation             displacements relative to the stable points, each the best estimate if these did not move,
                            with covariance, statistic, p, who moved, tests, detectable displacements, level and power
    difference              (n, 3) m, plain: second less first in the datum of the held, else of the stable points; nan
                            where the stable points do not hold it
    difference_covariance   (n, 3, 3) m^2
    carried                 points that the second epoch holds at the first's result
    rounding                (largest departure of the held coordinates from that result, its standard uncertainty), m
    frame                   the points that all others were compared with one by one; () where one joint test was made
    apart                   name -> m: not the same point? how much their distances to the others changed; left out
    variance_factor         that the covariances are multiplied by
    homogeneity             p of equal variance factors in both epochs; nan without redundancy
    words                   what was assumed and found, a line each
    """

    first: NetworkSolution
    second: NetworkSolution
    deformation: Deformation
    difference: np.ndarray
    difference_covariance: np.ndarray
    carried: tuple[str, ...]
    rounding: tuple[float, float]
    frame: tuple[str, ...]
    apart: dict[str, float]
    variance_factor: VarianceFactor
    homogeneity: float
    words: tuple[str, ...]

    @property
    def u(self) -> np.ndarray:
        """(n, 3) m, standard uncertainties of deformation.displacement."""
        return np.sqrt(np.maximum(np.diagonal(self.deformation.covariance, axis1=1, axis2=2), 0.0))

    @property
    def u_difference(self) -> np.ndarray:
        """(n, 3) m, standard uncertainties of the plain difference."""
        return np.sqrt(np.maximum(np.diagonal(self.difference_covariance, axis1=1, axis2=2), 0.0))


@dataclass(frozen=True)
class ComparisonOptions:
    """How `compare` tests two epochs.

    level, power, rule         as `moved_points`; with a frame half the level is spent on it and half on the others
    rounding                   m, the last digit of coordinates carried from the first epoch; their departure from its
                               result is an error of u = rounding / sqrt(12) each. 0: carried with all digits
    same_point                 m: where the distances to other points change by more in the median, it is another point
    scale_by_variance_factor   False: a priori covariances. True: times the pooled variance factor, F tests
    """

    level: float = 0.05
    power: float = 0.8
    rule: str = "global"
    rounding: float = 1e-5
    same_point: float = 0.1
    scale_by_variance_factor: bool = False


USUAL = ComparisonOptions()


def compare(
    first: NetworkSolution,
    second: NetworkSolution,
    *,
    points: Sequence[str] | None = None,
    frame: Sequence[str] | None = None,
    datum: str | None = None,
    options: ComparisonOptions = USUAL,
) -> PointMovements:
    """What moved between two adjusted epochs of a network, with the covariance that their connection calls for.

    first, second              adjusted by `adjust_network`, in the same axes
    points                     names to compare, taken as the same points however far they moved; None: all common ones
                               but those that `same_point` sets apart. Points that carry the datum always take part
    frame                      stable points that each other point is compared with by itself, for large networks; None:
                               those that define the datum, where there are more than 700 common points
    datum                      what the datums may differ by, a key of `DATUMS`; None: found from the observations
    options                    level and rule of the tests, rounding of carried coordinates

    Raises EstimationError where there is no answer to compare, or where the epochs do not fit together.

    Source: [PELZER71], [CASPARY87] (congruence); [FOERSTNER16] chapter 4 (propagation; see `epoch_model`).
    """
    _check_alike(first, second)
    held = DatumConnection.of(first, second, datum, options.rounding)
    names, apart = _common(first, second, points, held, options.same_point)
    model = EpochModel.of(first, second, names, held)
    factor, homogeneity = _factor(first, second)
    factor = factor if options.scale_by_variance_factor else KNOWN
    tested: dict[str, Any] = {
        "datum": held.datum,
        "level": options.level,
        "power": options.power,
        "rule": options.rule,
        "variance_factor": factor,
    }
    blocks = frame is not None or len(names) > LARGEST
    if blocks:
        inside = _frame(first, second, model, frame)
        deformation, (difference, covariance) = _beside_frame(model, inside, tested)
    else:
        inside = np.zeros(0, dtype=int)
        epochs = model.epochs(np.arange(len(names)))
        deformation = moved_points(epochs, **tested)
        plain = differences(epochs, held.datum, deformation.stable)
        difference, covariance = _blocks_of(*_plain_differences(plain, deformation.stable))
    done = PointMovements(
        first=first,
        second=second,
        deformation=deformation,
        difference=difference,
        difference_covariance=covariance * factor.value,
        carried=tuple(dict.fromkeys(name for name, _ in held.carried)),
        rounding=(held.departure, held.u),
        frame=tuple(names[i] for i in inside),
        apart=apart,
        variance_factor=factor,
        homogeneity=homogeneity,
        words=(),
    )
    return replace(done, words=tuple(_words(done, options.rounding, options.same_point, held.same)))


def _check_alike(first: NetworkSolution, second: NetworkSolution) -> None:
    a, b = first.network, second.network
    for which, solution in (("first", first), ("second", second)):
        if not solution.status.startswith(CONVERGED):
            raise EstimationError(f"the {which} epoch has no answer to compare: {solution.status}")
    if not np.array_equal(a.axes, b.axes) or a.axis_names != b.axis_names:
        raise EstimationError(
            f"the epochs have different axes: {', '.join(a.axis_names)} with {np.asarray(a.axes).tolist()} and "
            f"{', '.join(b.axis_names)} with {np.asarray(b.axes).tolist()}; write both in the same axes"
        )


def _factor(first: NetworkSolution, second: NetworkSolution) -> tuple[VarianceFactor, float]:
    given = [(s.variance_factor, s.degrees_of_freedom) for s in (first, second)]
    if not all(f > 0.0 and v > 0.0 for v, f in given):
        return KNOWN, float("nan")
    return pooled_variance_factor(given[0], given[1])


def _common(
    first: NetworkSolution,
    second: NetworkSolution,
    points: Sequence[str] | None,
    held: DatumConnection,
    same_point: float,
) -> tuple[tuple[str, ...], dict[str, float]]:
    """Names to compare, those that carry the datum among them, and those set apart with how far they are off."""
    common = [name for name in first.network.points.names if name in second.index]
    must = dict.fromkeys([*held.same, *(name for name, _ in held.carried)])
    if points is not None:
        for name in points:
            if name not in second.index or name not in first.index:
                raise EstimationError(f"point {name!r} is not in both epochs; compare common points")
        return tuple(dict.fromkeys([*points, *must])), {}
    if not common:
        raise EstimationError("the epochs have no point in common; give the same point the same name in both")
    change = _distance_changes(*(np.array([s.x[s.index[name]] for name in common]) for s in (first, second)))
    apart = {n: float(c) for n, c in zip(common, change, strict=True) if c > same_point and n not in must}
    names = tuple(name for name in common if name not in apart)
    if not names:
        raise EstimationError(
            f"no common point is where it was: {listed(common)} moved by more than {same_point:g} m relative to the "
            "others; are these the same points? If so name them (points=)"
        )
    return names, apart


def _distance_changes(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n,) m, median change of the distances from each point to others: no motion of all together changes it."""
    n = len(x)
    to = np.unique(np.linspace(0, n - 1, min(n, LARGEST)).astype(int))
    result = np.zeros(n)
    for i in range(n if n > 1 else 0):
        others = to[to != i]
        ranges = [np.linalg.norm(p[others] - p[i], axis=1) for p in (x, y)]
        result[i] = np.median(np.abs(ranges[1] - ranges[0]))
    return result


def _frame(
    first: NetworkSolution, second: NetworkSolution, model: EpochModel, frame: Sequence[str] | None
) -> np.ndarray:
    """Rows of the points that the others are compared with: those named, else those that define both datums."""
    if frame is None:
        marked = [s.network.points.fixed | s.network.points.datum for s in (first, second)]
        at = [np.array([s.index[name] for name in model.names]) for s in (first, second)]
        chosen = marked[0][at[0]].any(axis=1) & marked[1][at[1]].any(axis=1)
    else:
        strange = [name for name in frame if name not in model.names]
        if strange:
            raise EstimationError(f"{listed(strange)} of the frame: not among the points compared")
        chosen = np.isin(model.names, list(frame))
    chosen[model.carried // 3] = True
    inside = np.flatnonzero(chosen)
    if not 0 < len(inside) <= LARGEST:
        raise EstimationError(TOO_MANY.format(n=len(model.names) if frame is None else len(inside), limit=LARGEST))
    return inside


def _beside_frame(
    model: EpochModel, inside: np.ndarray, options: dict[str, Any]
) -> tuple[Deformation, tuple[np.ndarray, np.ndarray]]:
    """The frame's own congruence, then each other point against the frame's stable ones by itself.

    With d_F the frame's differences, M the datum's motions: d_i is foretold as M_i m + Q_iF P d_F, the best linear
    prediction, m and P of the fit of the frame alone. Exact for one point whatever its correlations.
    """
    level, factor = options["level"], options["variance_factor"]
    epochs = model.epochs(inside)
    congruence = moved_points(epochs, **{**options, "level": 0.5 * level})
    between = differences(epochs, options["datum"], congruence.stable)
    stable = replace(between, used=between.used & np.repeat(congruence.stable, 3))
    used = np.flatnonzero(stable.used)
    others = np.setdiff1d(np.arange(len(model.names)), inside)
    motions = motion_columns(model.x[others], between.pivot) @ between.combination
    step = model.y[others] @ between.turned.T + between.shifted - model.x[others]
    across = _across(model, others, inside, between.turned)
    own = model.of_points(others, between.turned)

    def foretold(gain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        g, c = gain.reshape(-1, 3, len(used)), across[:, used].reshape(-1, 3, len(used))
        mixed = c @ g.transpose(0, 2, 1)
        value = step - g @ between.d[used]
        return value, own - mixed - mixed.transpose(0, 2, 1) + g @ between.q[np.ix_(used, used)] @ g.transpose(0, 2, 1)

    if np.linalg.matrix_rank(between.motions[used]) < between.motions.shape[1]:
        raise EstimationError(
            f"the {int(congruence.stable.sum())} stable points of the frame do not hold the datum; add more"
        )
    fit = stable.fit()
    displacement, covariance = foretold(motions @ fit.gain + across[:, used] @ fit.weight)
    plain = foretold(motions @ np.linalg.pinv(between.motions[used]))
    statistic = np.einsum("ni,ni->n", displacement, np.linalg.solve(covariance, displacement[..., None])[..., 0])
    p = factor.p(statistic, 3)
    count = max(len(others), 1)
    moved = p * count < 0.5 * level
    worst = np.linalg.eigvalsh(covariance)[:, -1] * factor.value
    needed = factor.noncentrality(3, 0.5 * level / count, options["power"])
    at = np.concatenate([inside, others]).argsort()

    def joined(frame: np.ndarray, rest: np.ndarray) -> np.ndarray:
        return np.concatenate([frame, rest])[at]

    text = f"frame {congruence.status}; of the {len(others)} other points "
    text += f"moved: {listed([model.names[i] for i in others[moved]])}" if moved.any() else "none moved"
    deformation = replace(
        congruence,
        names=model.names,
        displacement=joined(congruence.displacement, displacement),
        covariance=joined(congruence.covariance, covariance * factor.value),
        statistic=joined(congruence.statistic, statistic / factor.value),
        p=joined(congruence.p, p),
        p_adjusted=joined(congruence.p_adjusted, np.minimum(1.0, p * count)),
        moved=joined(congruence.moved, moved),
        held=joined(congruence.held, np.zeros(len(others), dtype=bool)),
        stable=joined(congruence.stable, ~moved),
        detectable=joined(congruence.detectable, np.sqrt(needed * worst)),
        level=level,
        status=text,
    )
    frame_plain = _blocks_of(*_plain_differences(between, congruence.stable))
    return deformation, (joined(frame_plain[0], plain[0]), joined(frame_plain[1], plain[1]))


def _across(model: EpochModel, others: np.ndarray, inside: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Covariance (3k, 3f) of the differences of other points and of those inside, the second epoch turned."""
    rows = (3 * others[:, None] + np.arange(3)).ravel()
    q1, q2, ahead, back = model.parts(rows, (3 * inside[:, None] + np.arange(3)).ravel())
    q2, ahead = turned_covariance(q2, turn, columns=True), turned_covariance(ahead, turn, columns=True)
    return q1 - ahead + turned_covariance(q2 - back, turn, columns=False)


def _plain_differences(between: Differences, stable: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Plain differences in the datum of stable points; nan where too few of them are left to hold it."""
    held = between.motions[np.repeat(stable, 3) & between.used]
    if np.linalg.matrix_rank(held) < held.shape[1]:
        return np.full(len(between.d), np.nan), np.full(between.q.shape, np.nan)
    return between.seen_from(stable)


def _blocks_of(d: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    n = len(d) // 3
    return d.reshape(n, 3), q.reshape(n, 3, n, 3)[np.arange(n), :, np.arange(n)]


def _words(done: PointMovements, rounding: float, same_point: float, same: Sequence[str]) -> list[str]:
    """What was assumed and found, a line each."""
    a, b = done.first, done.second
    words = [f"datums may differ as {done.deformation.datum!r}"]
    if done.carried:
        words[0] = (
            f"the second epoch holds {listed(done.carried)} at the first's result: its errors are carried over, and "
            "a movement of these points would look like one of all others"
        )
    elif same:
        words[0] = f"{listed(same)} are held in both epochs: a movement of theirs would look like one of all others"
    if done.rounding[1]:
        words.append(
            f"held coordinates are up to {1e6 * done.rounding[0]:.2g} um off the first's result: taken as rounding to "
            f"{1e6 * rounding:g} um, u = {1e6 * done.rounding[1]:.2g} um each"
        )
    if done.apart:
        text = ", ".join(f"{name} ({by:.3g} m)" for name, by in done.apart.items())
        words.append(
            f"not the same point? {text}: distances to other points changed by more than {same_point:g} m; left out "
            "(points= compares them all the same)"
        )
    if done.frame:
        words.append(f"each point by itself against the stable ones of {listed(done.frame)}, not in one joint test")
    text = (
        f"variance factors {a.variance_factor:.3g} and {b.variance_factor:.3g}, equal with p = {done.homogeneity:.2g}"
    )
    estimated = np.isfinite(done.variance_factor.degrees_of_freedom)
    words.append(f"{text}; {'pooled' if estimated else 'covariances a priori'}")
    words += [f"the {which} epoch: {s.status}" for which, s in (("first", a), ("second", b)) if s.status != CONVERGED]
    return [*words, done.deformation.status]
