"""Given coordinates that grossly disagree with the ranges between them: exchanged points, crude guesses.

Least squares recovers from coordinates that are metres off at 100 m; from a tenth of the distances on, or from points
that are exchanged, it may end in another minimum. A few such points are placed anew from the others; where most
disagree, all that may move are placed anew from the observations alone, and laid on the given coordinates.
"""

import numpy as np

from catseye.estimation.network.approximate.bodies import rigid_motion
from catseye.estimation.network.approximate.figures import level_turn, place_all
from catseye.estimation.network.approximate.search import PlacingSearch
from catseye.estimation.network.approximate.sightings import LEVEL, RANGE, Sightings

GROSS = 0.05  # misfit over range: of 50 networks 6 m off at 100 m all converge, of those 10 m off a tenth do not
OUTLYING = 3.0  # times the median: points further off their given places do not decide where a figure belongs
ALIKE = 2.0  # times the usual misfit: a mirror image that contradicts its lengths no more than this fits too


def disagreeing(rows: Sightings, xyz: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Which points (n,) bool, of those that may move (n,) bool, most of their lengths contradict grossly."""
    r = _lengths_between(rows, xyz)
    ends, misfit = np.concatenate([r.origin, r.target]), np.tile(_misfit(r, xyz), 2)
    order = np.lexsort((misfit, ends))
    points, first, count = np.unique(ends[order], return_index=True, return_counts=True)
    poor = np.zeros(len(xyz), dtype=bool)
    poor[points] = misfit[order][first + (count - 1) // 2] > GROSS  # of two lengths both must
    return poor & free


def placed_anew(search: PlacingSearch, free: np.ndarray, datum: np.ndarray) -> tuple[PlacingSearch, np.ndarray]:
    """A search with better coordinates where given ones grossly disagree with lengths, and which (n,) those are.

    search   with the given coordinates, not yet gone on; it is left as it is
    free     (n,) bool: points that may move
    datum    (n,) bool: points that define the datum; a few that disagree stay, so that the adjustment can name them

    The given ones are kept unless the lengths agree better, in the mean, without them.
    """
    given = search.xyz
    rows, known = _lengths_between(search.rows, given), np.isfinite(given).all(axis=1)
    poor = disagreeing(rows, given, free)
    dropped = poor & ~datum if poor.sum() <= free.sum() / 2 else free & known
    trial = _without(search, dropped)
    anew = dropped & np.isfinite(trial.xyz).all(axis=1)
    trial.xyz = np.where(known[:, None] & ~anew[:, None], given, trial.xyz)
    if _misfit(rows, trial.xyz).mean() < _misfit(rows, given).mean():
        return trial, anew & poor
    return search, np.zeros(len(given), dtype=bool)


def _lengths_between(rows: Sightings, xyz: np.ndarray) -> Sightings:
    """Ranges and horizontal distances between placed points."""
    placed = np.isfinite(xyz).all(axis=1)
    lengths = (rows.code == RANGE) | (rows.code == LEVEL)
    return rows.only(lengths & placed[rows.origin] & placed[rows.target])


def _misfit(lengths: Sightings, xyz: np.ndarray) -> np.ndarray:
    """|observed - computed| / observed (m,)."""
    along = xyz[lengths.target] - xyz[lengths.origin] + lengths.shift
    along[lengths.code == LEVEL, 2] = 0.0
    return np.abs(lengths.observed - np.linalg.norm(along, axis=1)) / np.abs(lengths.observed)


def _without(search: PlacingSearch, dropped: np.ndarray) -> PlacingSearch:
    """A search that has gone on from the given coordinates without those of some points (n,) bool.

    What it had to lay down by convention is laid on the given coordinates; a point whose mirror image fits too is put
    on the side where it is given.
    """
    given = search.xyz
    orientations = {which: search.orientations[which] for which in search.given}
    trial = PlacingSearch(search.rows, np.where(dropped[:, None], np.nan, given), orientations, search.bodies)
    place_all(trial)
    if trial.conventional:
        trial.xyz = _laid_on(trial, given)
        trial.conventional.clear()
    anew = dropped & np.isfinite(given).all(axis=1) & np.isfinite(trial.xyz).all(axis=1)
    if not anew.any():
        return trial
    usual = float(np.median(_misfit(_lengths_between(trial.rows, trial.xyz), trial.xyz)))
    for p in np.flatnonzero(anew).tolist():
        trial.xyz[p] = _on_side(trial, p, given[p], limit=GROSS if p in trial.sides else ALIKE * usual)
    return trial


def _laid_on(trial: PlacingSearch, given: np.ndarray) -> np.ndarray:
    """Coordinates (n, 3) of a figure moved, and mirrored if ranges are all it has, to where most points are given."""
    both = np.isfinite(trial.xyz).all(axis=1) & np.isfinite(given).all(axis=1)
    sure = both.copy()
    sure[list(trial.sides)] = False  # points on an assumed side would pull the figure over
    both = sure if sure.sum() >= 4 else both
    ranges_alone = bool(np.all(trial.rows.code == RANGE))
    best, least = trial.xyz, np.inf
    for mirror in (1.0, -1.0)[: 1 + ranges_alone]:
        local, kept = trial.xyz * (1.0, 1.0, mirror), both
        for _ in range(5):
            motion = (rigid_motion if ranges_alone else _level_motion)(local[kept], given[kept])
            if motion is None:
                break
            xyz = motion[1] + local @ motion[0].T
            apart = np.linalg.norm(xyz - given, axis=1)
            median = float(np.median(apart[both]))
            kept = both & (apart <= OUTLYING * median)
            if median < least:
                best, least = xyz, median
    return best


def _level_motion(local: np.ndarray, ground: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """R about the vertical and T with ground = T + R local; None for fewer than two points."""
    turn = level_turn(*(p[:, 0] + 1j * p[:, 1] for p in (local, ground))) if len(local) >= 2 else None
    if turn is None:
        return None
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return matrix, ground.mean(axis=0) - matrix @ local.mean(axis=0)


def _on_side(trial: PlacingSearch, p: int, given: np.ndarray, *, limit: float) -> np.ndarray:
    """A point, or its image in the plane of those that range it, where that is nearer to where it is given and fits."""
    lengths = _lengths_between(trial.rows.only(trial.touching(p)), trial.xyz)
    anchors = trial.xyz[np.where(lengths.origin == p, lengths.target, lengths.origin)]
    here = trial.xyz[p]
    if len(anchors) < 3:
        return here
    mean = anchors.mean(axis=0)
    normal = np.linalg.svd(anchors - mean)[2][2]
    image = here - 2.0 * ((here - mean) @ normal) * normal
    if np.linalg.norm(image - given) >= np.linalg.norm(here - given):
        return here
    there = trial.xyz.copy()
    there[p] = image
    return here if np.median(_misfit(lengths, there)) > limit else image
