"""Detection and replacement of given coordinates that grossly disagree with the ranges.

Least squares recovers from coordinates that are metres off at 100 m; from a tenth of the distances on, or for exchanged
points, it may end in another minimum. A few such points are placed again from the others; if most disagree, all movable
points are placed again from the observations alone, and fitted to the given coordinates.
"""

import numpy as np

from catseye.estimation.network.approximate.bodies import rigid_motion
from catseye.estimation.network.approximate.figures import level_turn, place_all
from catseye.estimation.network.approximate.search import PlacingSearch
from catseye.estimation.network.approximate.sightings import LEVEL, RANGE, Sightings

GROSS = 0.05  # misfit over range: of 50 networks 6 m off at 100 m all converge, of those 10 m off a tenth do not
OUTLYING = 3.0  # times the median: points further off their given places are excluded from the fit
ALIKE = 2.0  # times the median misfit: a mirror image within this limit fits too


def disagreeing(rows: Sightings, xyz: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Mask (n,) of movable points whose lengths mostly contradict their coordinates grossly."""
    r = _lengths_between(rows, xyz)
    ends, misfit = np.concatenate([r.origin, r.target]), np.tile(_misfit(r, xyz), 2)
    order = np.lexsort((misfit, ends))
    points, first, count = np.unique(ends[order], return_index=True, return_counts=True)
    poor = np.zeros(len(xyz), dtype=bool)
    poor[points] = misfit[order][first + (count - 1) // 2] > GROSS  # both of two lengths
    return poor & free


def replace_disagreeing(search: PlacingSearch, free: np.ndarray, datum: np.ndarray) -> tuple[PlacingSearch, np.ndarray]:
    """Search with replaced coordinates of grossly disagreeing points, and their mask (n,).

    search   with the given coordinates, not yet advanced; it is not changed
    free     (n,) bool: points that may move
    datum    (n,) bool: points that define the datum; a few that disagree are kept, so that the adjustment can name them

    The given ones are kept unless the lengths agree better on average without them.
    """
    given = search.xyz
    rows, complete = _lengths_between(search.rows, given), np.isfinite(given).all(axis=1)
    poor = disagreeing(rows, given, free)
    dropped = poor & ~datum if poor.sum() <= free.sum() / 2 else free & complete
    trial = _without(search, dropped)
    replaced = dropped & np.isfinite(trial.xyz).all(axis=1)
    trial.xyz = np.where(complete[:, None] & ~replaced[:, None], given, trial.xyz)
    if _misfit(rows, trial.xyz).mean() < _misfit(rows, given).mean():
        return trial, replaced & poor
    return search, np.zeros(len(given), dtype=bool)


def _lengths_between(rows: Sightings, xyz: np.ndarray) -> Sightings:
    """Ranges and horizontal distances between placed points."""
    placed = np.isfinite(xyz).all(axis=1)
    lengths = (rows.code == RANGE) | (rows.code == LEVEL)
    return rows.only(lengths & placed[rows.origin] & placed[rows.target])


def _misfit(lengths: Sightings, xyz: np.ndarray) -> np.ndarray:
    """Relative misfit (m,): |observed - computed| / observed."""
    along = xyz[lengths.target] - xyz[lengths.origin] + lengths.shift
    along[lengths.code == LEVEL, 2] = 0.0
    return np.abs(lengths.observed - np.linalg.norm(along, axis=1)) / np.abs(lengths.observed)


def _without(search: PlacingSearch, dropped: np.ndarray) -> PlacingSearch:
    """Search advanced from the given coordinates without those of some points (n,) bool.

    A figure placed by convention is fitted to the given coordinates; a point whose mirror image fits too is placed on
    its given side.
    """
    given = search.xyz
    orientations = {which: search.orientations[which] for which in search.given}
    trial = PlacingSearch(search.rows, np.where(dropped[:, None], np.nan, given), orientations, search.bodies)
    place_all(trial)
    if trial.conventional:
        trial.xyz = _laid_on(trial, given)
        trial.conventional.clear()
    replaced = dropped & np.isfinite(given).all(axis=1) & np.isfinite(trial.xyz).all(axis=1)
    if not replaced.any():
        return trial
    usual = float(np.median(_misfit(_lengths_between(trial.rows, trial.xyz), trial.xyz)))
    for p in np.flatnonzero(replaced).tolist():
        trial.xyz[p] = _on_side(trial, p, given[p], limit=GROSS if p in trial.sides else ALIKE * usual)
    return trial


def _laid_on(trial: PlacingSearch, given: np.ndarray) -> np.ndarray:
    """Coordinates (n, 3) of a figure moved (mirrored for ranges alone) to fit most given points."""
    common = np.isfinite(trial.xyz).all(axis=1) & np.isfinite(given).all(axis=1)
    decided = common.copy()
    decided[list(trial.sides)] = False  # points on an assumed side could mirror the figure
    common = decided if decided.sum() >= 4 else common
    ranges_alone = bool(np.all(trial.rows.code == RANGE))
    best, least = trial.xyz, np.inf
    for mirror in (1.0, -1.0)[: 1 + ranges_alone]:
        local, inliers = trial.xyz * (1.0, 1.0, mirror), common
        for _ in range(5):
            motion = (rigid_motion if ranges_alone else _level_motion)(local[inliers], given[inliers])
            if motion is None:
                break
            xyz = motion[1] + local @ motion[0].T
            apart = np.linalg.norm(xyz - given, axis=1)
            median = float(np.median(apart[common]))
            inliers = common & (apart <= OUTLYING * median)
            if median < least:
                best, least = xyz, median
    return best


def _level_motion(local: np.ndarray, ground: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """R about the vertical and T with ground = T + R local.

    None for fewer than two points.
    """
    turn = level_turn(*(p[:, 0] + 1j * p[:, 1] for p in (local, ground))) if len(local) >= 2 else None
    if turn is None:
        return None
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return matrix, ground.mean(axis=0) - matrix @ local.mean(axis=0)


def _on_side(trial: PlacingSearch, p: int, given: np.ndarray, *, limit: float) -> np.ndarray:
    """Point, or its mirror image if that is closer to the given place and fits."""
    lengths = _lengths_between(trial.rows.only(trial.touching(p)), trial.xyz)
    anchors = trial.xyz[np.where(lengths.origin == p, lengths.target, lengths.origin)]
    current = trial.xyz[p]
    if len(anchors) < 3:
        return current
    mean = anchors.mean(axis=0)
    normal = np.linalg.svd(anchors - mean)[2][2]
    image = current - 2.0 * ((current - mean) @ normal) * normal
    if np.linalg.norm(image - given) >= np.linalg.norm(current - given):
        return current
    trial_xyz = trial.xyz.copy()
    trial_xyz[p] = image
    return current if np.median(_misfit(lengths, trial_xyz)) > limit else image
