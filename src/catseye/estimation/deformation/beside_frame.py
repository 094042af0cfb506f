"""Comparison of single points with a frame of few, for networks too large for one joint test."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.deformation.common_points import far_points, listed
from catseye.estimation.deformation.congruence import (
    DATUMS,
    FIXED,
    KNOWN,
    UNSEEN,
    CongruenceTest,
    Differences,
    differences,
    observable_motions,
)
from catseye.estimation.deformation.deformation import Deformation, moved_points
from catseye.estimation.deformation.deletion import DeletionSearch
from catseye.estimation.deformation.epoch_model import EpochModel
from catseye.estimation.network.model import NetworkSolution
from catseye.estimation.shapes.place_covariances import rotated_covariance
from catseye.estimation.shapes.rigid_body import motion_columns

TOO_MANY = "{n} frame points are too many for one joint test (limit {limit}); name fewer (frame=)"


def frame_points(
    first: NetworkSolution,
    second: NetworkSolution,
    model: EpochModel,
    frame: Sequence[str] | None,
    *,
    datum: str,
    limit: int,
) -> np.ndarray:
    """Rows of the frame points, with which the others are compared.

    frame   names; None: the points that define both datums, up to the limit, evenly chosen; or of all points, if these
            have no redundancy, such as a few coordinates fixed by convention
    datum   allowed differences of the datums
    limit   points of one joint test

    Raises EstimationError for an unknown name, and for more than the limit.
    """
    if frame is None:
        marked = [s.network.points.fixed | s.network.points.datum for s in (first, second)]
        at = [np.array([s.index[name] for name in model.names]) for s in (first, second)]
        chosen = marked[0][at[0]].any(axis=1) & marked[1][at[1]].any(axis=1)
    else:
        unknown = [name for name in frame if name not in model.names]
        if unknown:
            raise EstimationError(f"{listed(unknown)} of the frame: not among the points compared")
        chosen = np.isin(model.names, list(frame))
    chosen[model.carried_indices // 3] = True
    inside = np.flatnonzero(chosen)
    if frame is not None:
        if len(inside) > limit:
            raise EstimationError(TOO_MANY.format(n=len(inside), limit=limit))
        return inside
    inside = _evenly(inside, limit)
    return inside if len(inside) and _checked(model, inside, datum) else _evenly(np.arange(len(chosen)), limit)


def _evenly(rows: np.ndarray, most: int) -> np.ndarray:
    """Evenly chosen rows, at most so many."""
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int))]


def _checked(model: EpochModel, inside: np.ndarray, datum: str) -> bool:
    """True if these points are fixed, or each of them is checked by the others."""
    between = differences(model.epochs(inside), datum, np.ones(len(inside), dtype=bool))
    if not between.used.any():
        return not between.motions.shape[1]
    search = DeletionSearch(between, KNOWN)
    return search.degrees > 0 and all(search.spares([i]) for i, rows in enumerate(search.rows) if len(rows))


@dataclass(frozen=True, eq=False)
class _Movements:
    """Movements of k single points.

    Covariances with variance factor 1, nan where not compared.
    """

    displacement: np.ndarray
    covariance: np.ndarray
    statistic: np.ndarray
    rank: np.ndarray
    fixed: np.ndarray


def beside_frame(
    model: EpochModel, inside: np.ndarray, options: dict[str, Any]
) -> tuple[Deformation, tuple[np.ndarray, np.ndarray]]:
    """Congruence of the frame, then single tests of other points against its stable points.

    model     of all points
    inside    rows of the frame
    options   as `moved_points`; half of the level is used for the frame and half for the others; all for the
              others if every frame point is fixed

    With d_F the frame's differences, M the datum's motions: d_i is predicted as M_i m + Q_iF P d_F, the best linear
    prediction, m and P of the fit of the frame alone. Exact for one point whatever its correlations.
    """
    level, factor, epochs = options["level"], options["variance_factor"], model.epochs(inside)
    all_differences = differences(epochs, options["datum"], np.ones(len(inside), dtype=bool))
    tested = bool(all_differences.used.any()) and all_differences.fit().degrees_of_freedom > 0
    share = 0.5 * level if tested else level
    if tested:
        far = far_points(epochs, level=share, scaled=6 in DATUMS[options["datum"]])
        frame = moved_points(epochs, **{**options, "level": share}, far=far)
    else:
        frame = _untested(all_differences, options)
    between = differences(epochs, options["datum"], frame.stable)
    other_points = np.setdiff1d(np.arange(len(model.names)), inside)
    best, plain = _predicted(model, between, frame.stable, (inside, other_points))
    p = np.where(best.rank > 0, factor.p(best.statistic, best.rank), np.nan)
    count = max(int(np.isfinite(p).sum()), 1)
    moved = p * count < share
    needed = {int(r): factor.noncentrality(int(r), share / count, options["power"]) for r in set(best.rank) if r}
    worst = _largest(best.covariance) * factor.value
    at = np.concatenate([inside, other_points]).argsort()

    def joined(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return np.concatenate([first, second])[at]

    text = f"frame {frame.status}; of the {len(other_points)} other points "
    text += f"moved: {listed([model.names[i] for i in other_points[moved]])}" if moved.any() else "none moved"
    deformation = replace(
        frame,
        names=model.names,
        displacement=joined(frame.displacement, best.displacement),
        covariance=joined(frame.covariance, best.covariance * factor.value),
        statistic=joined(frame.statistic, best.statistic / factor.value),
        p=joined(frame.p, p),
        p_adjusted=joined(frame.p_adjusted, np.minimum(1.0, p * count)),
        moved=joined(frame.moved, moved),
        held=joined(frame.held, best.fixed),
        stable=joined(frame.stable, ~moved),
        detectable=joined(frame.detectable, np.sqrt([needed.get(int(r), np.nan) for r in best.rank] * worst)),
        level=level,
        status=text,
    )
    frame_movements = between.blocks(*between.plain(frame.stable))
    return deformation, (joined(frame_movements[0], plain.displacement), joined(frame_movements[1], plain.covariance))


def _untested(between: Differences, options: dict[str, Any]) -> Deformation:
    """Result of a frame that is fixed or has no redundancy: no movement can be tested."""
    n = len(between.names)
    d, q = between.blocks(*between.plain(np.ones(n, dtype=bool)))
    fixed = between.fixed.reshape(n, 3).any(axis=1) & ~between.used.reshape(n, 3).any(axis=1)
    undefined, unmoved = np.full(n, np.nan), np.zeros(n, dtype=bool)
    no_test = CongruenceTest(0.0, 0, np.nan)
    return Deformation(
        names=between.names,
        displacement=d,
        covariance=q * options["variance_factor"].value,
        statistic=undefined,
        p=undefined,
        p_adjusted=undefined,
        moved=unmoved,
        held=np.asarray(fixed),
        stable=~unmoved,
        before=no_test,
        after=no_test,
        detectable=undefined,
        level=options["level"],
        power=options["power"],
        datum=options["datum"],
        steps=(),
        conclusive=True,
        status="fixed" if fixed.all() else "assumed stable",
    )


def _largest(covariance: np.ndarray) -> np.ndarray:
    """Largest eigenvalue (k,) of each (k, 3, 3), over the finite elements."""
    finite = np.where(np.isfinite(covariance), covariance, 0.0)
    return np.linalg.eigvalsh(finite)[:, -1] if len(finite) else np.zeros(0)


def _predicted(
    model: EpochModel, between: Differences, stable: np.ndarray, rows: tuple[np.ndarray, np.ndarray]
) -> tuple[_Movements, _Movements]:
    """Best prediction and plain difference of other points relative to the frame's stable points.

    between      of the frame, aligned on its stable points
    stable       (f,) bool
    rows         of the frame and of the other points in the model
    """
    inside, other_points = rows
    used = between.used & np.repeat(stable, 3)
    compared = model.compared.reshape(-1, 3)[other_points]
    motions = motion_columns(model.x[other_points], between.pivot) @ between.combination
    observable, unobservable = observable_motions(between.motions[used])
    ambiguous = np.where(compared.ravel()[:, None], motions @ unobservable, 0.0)
    axes = compared.any(axis=0) & ~model.compared.reshape(-1, 3)[inside].any(axis=0)
    if axes.any() or np.abs(ambiguous).max(initial=0.0) > UNSEEN**0.5 * np.abs(motions).max(initial=0.0):
        raise EstimationError(
            f"the {int(stable.sum())} stable points of the frame do not determine the datum; add more"
        )
    step = model.y[other_points] @ between.turned.T + between.shifted - model.x[other_points]
    across = _across(model, other_points, inside, between.turned)[:, used]
    variances, q, d = model.of_points(other_points, between.turned), between.q[np.ix_(used, used)], between.d[used]

    def movements_of(gain: np.ndarray) -> _Movements:
        g, c = (a.reshape(len(other_points), 3, int(used.sum())) for a in (gain, across))
        mixed = c @ g.transpose(0, 2, 1)
        spread = variances - mixed - mixed.transpose(0, 2, 1) + g @ q @ g.transpose(0, 2, 1)
        return _tested(step - g @ d, spread, compared, _spread(model, other_points))

    if not used.any():
        no_gain = np.zeros((3 * len(other_points), 0))
        return movements_of(no_gain), movements_of(no_gain)
    fit = replace(between, used=used).fit()
    visible = motions @ observable
    return movements_of(visible @ fit.gain + across @ fit.weight), movements_of(
        visible @ np.linalg.pinv(between.motions[used] @ observable)
    )


def _spread(model: EpochModel, points: np.ndarray) -> np.ndarray:
    """Sum (k, 3) m^2 of both epochs' variances of each coordinate."""
    at = [columns.reshape(-1, 3)[points] for columns in model.columns]
    return np.sum([np.diagonal(q.blocks(c[:, 0]), axis1=1, axis2=2) for q, c in zip(model.q, at, strict=True)], axis=0)


def _tested(displacement: np.ndarray, covariance: np.ndarray, compared: np.ndarray, spread: np.ndarray) -> _Movements:
    """Statistics of single points (k, 3), over the coordinates compared and not fixed."""
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    free = compared & (variance > FIXED * spread)
    pairs = compared[:, :, None] & compared[:, None, :]
    rank = free.sum(axis=1)
    statistic = np.full(len(rank), np.nan)
    for pattern in np.unique(free, axis=0) if len(free) else []:
        axes, members = np.flatnonzero(pattern), np.flatnonzero(np.all(free == pattern, axis=1))
        if len(axes):
            d, q = displacement[np.ix_(members, axes)], covariance[np.ix_(members, axes, axes)]
            statistic[members] = np.einsum("ni,ni->n", d, np.linalg.solve(q, d[..., None])[..., 0])
    return _Movements(
        np.where(compared, displacement, np.nan),
        np.where(pairs, covariance, np.nan),
        statistic,
        rank,
        compared.any(axis=1) & (rank == 0),
    )


def _across(model: EpochModel, other_points: np.ndarray, inside: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Covariance (3k, 3f) of the differences of other and frame points, the second epoch rotated."""
    rows = (3 * other_points[:, None] + np.arange(3)).ravel()
    q1, q2, ahead, back = model.parts(rows, (3 * inside[:, None] + np.arange(3)).ravel())
    q2, ahead = rotated_covariance(q2, turn, columns=True), rotated_covariance(ahead, turn, columns=True)
    return q1 - ahead + rotated_covariance(q2 - back, turn, columns=False)
