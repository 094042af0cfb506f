"""Many points of two epochs, each compared by itself with a frame of few: for networks too large for one joint test."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.deformation.common_points import far_points, listed
from catseye.estimation.deformation.congruence import (
    DATUMS,
    HELD,
    KNOWN,
    UNSEEN,
    CongruenceTest,
    Differences,
    differences,
    seen_motions,
)
from catseye.estimation.deformation.deformation import Deformation, moved_points
from catseye.estimation.deformation.deletion import DeletionSearch
from catseye.estimation.deformation.epoch_model import EpochModel
from catseye.estimation.network.model import NetworkSolution
from catseye.estimation.shapes.place_covariances import turned_covariance
from catseye.estimation.shapes.rigid_body import motion_columns

TOO_MANY = "{n} points of the frame are too many for one joint test (limit {limit}); name fewer (frame=)"


def frame_points(
    first: NetworkSolution,
    second: NetworkSolution,
    model: EpochModel,
    frame: Sequence[str] | None,
    *,
    datum: str,
    limit: int,
) -> np.ndarray:
    """Rows of the points that the others are compared with.

    frame   those named; None: those that define both datums, as many as the limit, evenly chosen; or of all points,
            where these only just hold the datum, such as a few coordinates that are held as a mere convention
    datum   what the datums may differ by
    limit   points of one joint test

    Raises EstimationError for a stranger, and for more than the limit.
    """
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
    if frame is not None:
        if len(inside) > limit:
            raise EstimationError(TOO_MANY.format(n=len(inside), limit=limit))
        return inside
    inside = _evenly(inside, limit)
    return inside if len(inside) and _checked(model, inside, datum) else _evenly(np.arange(len(chosen)), limit)


def _evenly(rows: np.ndarray, most: int) -> np.ndarray:
    """Rows, as many of them as that, evenly chosen."""
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int))]


def _checked(model: EpochModel, inside: np.ndarray, datum: str) -> bool:
    """True if nothing floats beside these points, since they are held, or the rest shows which one of them moved."""
    between = differences(model.epochs(inside), datum, np.ones(len(inside), dtype=bool))
    if not between.used.any():
        return not between.motions.shape[1]
    search = DeletionSearch(between, KNOWN)
    return search.degrees > 0 and all(search.spares([i]) for i, rows in enumerate(search.rows) if len(rows))


@dataclass(frozen=True, eq=False)
class _Others:
    """Movements of k other points, each by itself; covariances with variance factor 1, nan where not compared."""

    displacement: np.ndarray
    covariance: np.ndarray
    statistic: np.ndarray
    rank: np.ndarray
    held: np.ndarray


def beside_frame(
    model: EpochModel, inside: np.ndarray, options: dict[str, Any]
) -> tuple[Deformation, tuple[np.ndarray, np.ndarray]]:
    """The frame's own congruence, then each other point against the frame's stable ones by itself.

    model     of all points
    inside    rows of the frame
    options   as `moved_points`; half of the level is spent on the frame and half on the others, all of it on these
              where every point of the frame is held

    With d_F the frame's differences, M the datum's motions: d_i is predicted as M_i m + Q_iF P d_F, the best linear
    prediction, m and P of the fit of the frame alone. Exact for one point whatever its correlations.
    """
    level, factor, epochs = options["level"], options["variance_factor"], model.epochs(inside)
    every = differences(epochs, options["datum"], np.ones(len(inside), dtype=bool))
    tested = bool(every.used.any()) and every.fit().degrees_of_freedom > 0
    share = 0.5 * level if tested else level
    if tested:
        far = far_points(epochs, level=share, scaled=6 in DATUMS[options["datum"]])
        frame = moved_points(epochs, **{**options, "level": share}, far=far)
    else:
        frame = _untested(every, options)
    between = differences(epochs, options["datum"], frame.stable)
    others = np.setdiff1d(np.arange(len(model.names)), inside)
    best, plain = _predicted(model, between, frame.stable, (inside, others))
    p = np.where(best.rank > 0, factor.p(best.statistic, best.rank), np.nan)
    count = max(int(np.isfinite(p).sum()), 1)
    moved = p * count < share
    needed = {int(r): factor.noncentrality(int(r), share / count, options["power"]) for r in set(best.rank) if r}
    worst = _largest(best.covariance) * factor.value
    at = np.concatenate([inside, others]).argsort()

    def joined(first: np.ndarray, rest: np.ndarray) -> np.ndarray:
        return np.concatenate([first, rest])[at]

    text = f"frame {frame.status}; of the {len(others)} other points "
    text += f"moved: {listed([model.names[i] for i in others[moved]])}" if moved.any() else "none moved"
    deformation = replace(
        frame,
        names=model.names,
        displacement=joined(frame.displacement, best.displacement),
        covariance=joined(frame.covariance, best.covariance * factor.value),
        statistic=joined(frame.statistic, best.statistic / factor.value),
        p=joined(frame.p, p),
        p_adjusted=joined(frame.p_adjusted, np.minimum(1.0, p * count)),
        moved=joined(frame.moved, moved),
        held=joined(frame.held, best.held),
        stable=joined(frame.stable, ~moved),
        detectable=joined(frame.detectable, np.sqrt([needed.get(int(r), np.nan) for r in best.rank] * worst)),
        level=level,
        status=text,
    )
    own = between.blocks(*between.plain(frame.stable))
    return deformation, (joined(own[0], plain.displacement), joined(own[1], plain.covariance))


def _untested(between: Differences, options: dict[str, Any]) -> Deformation:
    """A frame that is held, or only just holds the datum: nothing in it can be seen to move."""
    n = len(between.names)
    d, q = between.blocks(*between.plain(np.ones(n, dtype=bool)))
    held = between.held.reshape(n, 3).any(axis=1) & ~between.used.reshape(n, 3).any(axis=1)
    nothing, no = np.full(n, np.nan), np.zeros(n, dtype=bool)
    none = CongruenceTest(0.0, 0, np.nan)
    return Deformation(
        names=between.names,
        displacement=d,
        covariance=q * options["variance_factor"].value,
        statistic=nothing,
        p=nothing,
        p_adjusted=nothing,
        moved=no,
        held=np.asarray(held),
        stable=~no,
        before=none,
        after=none,
        detectable=nothing,
        level=options["level"],
        power=options["power"],
        datum=options["datum"],
        steps=(),
        conclusive=True,
        status="held" if held.all() else "taken as stable",
    )


def _largest(covariance: np.ndarray) -> np.ndarray:
    """(k,) the largest eigenvalue of each (k, 3, 3), of what is known of it."""
    known = np.where(np.isfinite(covariance), covariance, 0.0)
    return np.linalg.eigvalsh(known)[:, -1] if len(known) else np.zeros(0)


def _predicted(
    model: EpochModel, between: Differences, stable: np.ndarray, rows: tuple[np.ndarray, np.ndarray]
) -> tuple[_Others, _Others]:
    """Best prediction and plain difference of the other points beside the stable points of the frame.

    between      of the frame, aligned on its stable points
    stable       (f,) bool
    rows         of the frame and of the others in the model
    """
    inside, others = rows
    used = between.used & np.repeat(stable, 3)
    compared = model.compared.reshape(-1, 3)[others]
    motions = motion_columns(model.x[others], between.pivot) @ between.combination
    shown, unseen = seen_motions(between.motions[used])
    lost = np.where(compared.ravel()[:, None], motions @ unseen, 0.0)
    axes = compared.any(axis=0) & ~model.compared.reshape(-1, 3)[inside].any(axis=0)
    if axes.any() or np.abs(lost).max(initial=0.0) > UNSEEN**0.5 * np.abs(motions).max(initial=0.0):
        raise EstimationError(f"the {int(stable.sum())} stable points of the frame do not hold the datum; add more")
    step = model.y[others] @ between.turned.T + between.shifted - model.x[others]
    across = _across(model, others, inside, between.turned)[:, used]
    own, q, d = model.of_points(others, between.turned), between.q[np.ix_(used, used)], between.d[used]

    def by(gain: np.ndarray) -> _Others:
        g, c = (a.reshape(len(others), 3, int(used.sum())) for a in (gain, across))
        mixed = c @ g.transpose(0, 2, 1)
        spread = own - mixed - mixed.transpose(0, 2, 1) + g @ q @ g.transpose(0, 2, 1)
        return _tested(step - g @ d, spread, compared, _spread(model, others))

    if not used.any():
        nothing = np.zeros((3 * len(others), 0))
        return by(nothing), by(nothing)
    fit = replace(between, used=used).fit()
    seen = motions @ shown
    return by(seen @ fit.gain + across @ fit.weight), by(seen @ np.linalg.pinv(between.motions[used] @ shown))


def _spread(model: EpochModel, points: np.ndarray) -> np.ndarray:
    """(k, 3) m^2, sum of both epochs' variances of each coordinate."""
    at = [columns.reshape(-1, 3)[points] for columns in model.columns]
    return np.sum([np.diagonal(q.blocks(c[:, 0]), axis1=1, axis2=2) for q, c in zip(model.q, at, strict=True)], axis=0)


def _tested(displacement: np.ndarray, covariance: np.ndarray, compared: np.ndarray, spread: np.ndarray) -> _Others:
    """Statistics of points (k, 3) each by itself, over the coordinates that are compared and not held."""
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    free = compared & (variance > HELD * spread)
    both = compared[:, :, None] & compared[:, None, :]
    rank = free.sum(axis=1)
    statistic = np.full(len(rank), np.nan)
    for pattern in np.unique(free, axis=0) if len(free) else []:
        axes, mine = np.flatnonzero(pattern), np.flatnonzero(np.all(free == pattern, axis=1))
        if len(axes):
            d, q = displacement[np.ix_(mine, axes)], covariance[np.ix_(mine, axes, axes)]
            statistic[mine] = np.einsum("ni,ni->n", d, np.linalg.solve(q, d[..., None])[..., 0])
    return _Others(
        np.where(compared, displacement, np.nan),
        np.where(both, covariance, np.nan),
        statistic,
        rank,
        compared.any(axis=1) & (rank == 0),
    )


def _across(model: EpochModel, others: np.ndarray, inside: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Covariance (3k, 3f) of the differences of other points and of those inside, the second epoch turned."""
    rows = (3 * others[:, None] + np.arange(3)).ravel()
    q1, q2, ahead, back = model.parts(rows, (3 * inside[:, None] + np.arange(3)).ravel())
    q2, ahead = turned_covariance(q2, turn, columns=True), turned_covariance(ahead, turn, columns=True)
    return q1 - ahead + turned_covariance(q2 - back, turn, columns=False)
