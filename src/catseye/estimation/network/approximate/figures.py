"""Local figures for points that cannot be placed singly: level networks, and figures from ranges."""

from collections import Counter, defaultdict

import numpy as np

from catseye.estimation.network.approximate.bodies import rigid_motion
from catseye.estimation.network.approximate.search import LENIENT, STRICT, PlacingSearch
from catseye.estimation.network.approximate.sightings import BEARING, COORDINATE, DIFFERENCE, RANGE, ZENITH, Sightings
from catseye.estimation.network.approximate.ties import FLOOR
from catseye.estimation.network.unfolding.factors import classical_scaling
from catseye.estimation.network.unfolding.unfold import FigureOutcome, Unfolding, unfold
from catseye.estimation.shapes.rigid_body import closed_form


def place_all(search: PlacingSearch) -> None:
    """Place all points possible: from placed points, by local figures, last the better of two positions."""
    search.spread()
    while len(search.unplaced) and (_attach_level(search) or _attach_ranges(search)):
        search.spread()
    while search.sweep(LENIENT, 1.5):
        search.spread()


def _attach_level(search: PlacingSearch) -> bool:
    """Place points by level local networks about a station.

    True if any was placed.

    The directions of the station's set with all other observations give local coordinates; two placed points among them
    (or one, and an azimuth) attach them. Without two given points, the largest is placed as it is.
    """
    r = search.rows
    local_rows = np.ones(len(r), dtype=bool)
    local_rows[(r.code == COORDINATE) | ((r.code == DIFFERENCE) & (r.which < 2))] = False
    local_rows[(r.code == BEARING) & np.isin(r.which, list(search.given))] = False
    rows = r.only(local_rows)
    turned = rows.only(rows.code == BEARING)
    sets = Counter(zip(turned.which.tolist(), turned.origin.tolist(), strict=True))
    unplaced, covered = set(search.unplaced.tolist()), set[int]()
    frames = []
    for which, station in (key for key, _ in sets.most_common()):
        members = {station, *turned.target[turned.which == which].tolist()}
        if not (members & unplaced) - covered:
            continue
        frame = PlacingSearch(rows, np.full(search.xyz.shape, np.nan), {which: 0.0}, search.bodies)
        frame.xyz[station] = 0.0
        frame.spread()
        covered |= members & set(np.flatnonzero(np.isfinite(frame.xyz[:, :2]).all(axis=1)).tolist())
        if np.isfinite(frame.xyz[:, :2]).all(axis=1).sum() > 1:
            frames.append(frame)
    frames.sort(key=lambda f: -int(np.isfinite(f.xyz).sum()))
    return any(_helmert(search, frame) for frame in frames)


def _helmert(search: PlacingSearch, frame: PlacingSearch) -> bool:
    """Fit a level local network to the placed points about the vertical.

    True if any was placed.
    """
    level = np.isfinite(frame.xyz[:, :2]).all(axis=1)
    placed = np.isfinite(search.xyz[:, :2]).all(axis=1)
    common = np.flatnonzero(level & placed)
    placed_plan, frame_plan = (xyz[common, 0] + 1j * xyz[common, 1] for xyz in (search.xyz, frame.xyz))
    turn = level_turn(frame_plan, placed_plan) if len(common) >= 2 else None
    turn = _turn_of_azimuths(search, frame, level) if turn is None else turn
    if turn is None and (placed.sum() > len(common) or len(common) > 1):
        return False
    if not len(common) and placed.any():
        return False
    spot = (frame.xyz[:, 0] + 1j * frame.xyz[:, 1]) * np.exp(1j * (turn or 0.0))
    spot = spot + (placed_plan.mean() - spot[common].mean() if len(common) else 0.0)
    rise = search.xyz[:, 2] - frame.xyz[:, 2]
    tied, free = np.isfinite(rise), not np.isfinite(search.xyz[:, 2]).any()
    up = frame.xyz[:, 2] + (np.median(rise[tied]) if tied.any() else 0.0 if free else np.nan)
    waiting = set(search.unplaced.tolist())
    filled = search.fill(np.stack([spot.real, spot.imag, up], axis=1))
    if filled and (turn is None or not len(common) or free):
        search.conventional |= waiting
    return filled


def level_turn(source: np.ndarray, target: np.ndarray) -> float | None:
    """Angle, counter-clockwise, that best rotates points x + i y (k,) onto others.

    None if all coincide.
    """
    if not np.ptp(np.abs(source - source[0])) > 0.0:
        return None
    return float(np.angle(np.sum((target - target.mean()) * np.conj(source - source.mean()))))


def _turn_of_azimuths(search: PlacingSearch, frame: PlacingSearch, level: np.ndarray) -> float | None:
    """Rotation from oriented directions between points of a frame (n,) bool.

    None without any.
    """
    r = search.rows
    r = r.only((r.code == BEARING) & np.isin(r.which, list(search.given)) & level[r.origin] & level[r.target])
    if not len(r):
        return None
    along = frame.xyz[r.target] - frame.xyz[r.origin] + r.shift
    azimuth = r.observed + [search.orientations[w] for w in r.which.tolist()]
    return -float(np.angle(np.mean(np.exp(1j * (azimuth - np.arctan2(along[:, 0], along[:, 1]))))))


def _attach_ranges(search: PlacingSearch) -> bool:
    """Place points by figures unfolded from ranges alone.

    True if any was placed.

    Points with all mutual ranges give a figure by classical scaling, stations and targets by unfolding; points tied to
    it by other ranges follow. Three placed points, not collinear, attach it; a fourth off their plane, or zenith angles
    and height differences, select the mirror image. With fewer given points, the figure is placed as it is on those.
    """
    r = search.rows
    rows = r.only((r.code == RANGE) & ~r.shift.any(axis=1))
    if not len(rows):
        return False
    placed = np.isfinite(search.xyz).all(axis=1)
    part = _parts_tied(rows, len(placed))
    for which in dict.fromkeys(part[~placed].tolist()):
        group = np.flatnonzero(part == which)
        frame = PlacingSearch(rows, np.full(search.xyz.shape, np.nan), {}, [])
        why, too_few = _figure(frame, group)
        why = why or _laid_down(search, frame)
        if not why:
            return True
        if len(group) > 1 and not (placed[group].any() and too_few):
            search.unfolding |= dict.fromkeys(group.tolist(), f"; {why}")
    return False


def _parts_tied(rows: Sightings, n: int) -> np.ndarray:
    """Index (n,) of the connected part (by ranges) of each point."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    table = coo_array((np.ones(len(rows)), (rows.origin, rows.target)), shape=(n, n))
    return connected_components(table, directed=False)[1]


def _figure(frame: PlacingSearch, group: np.ndarray) -> tuple[str, bool]:
    """Fill a frame from the ranges between a group of points.

    Returns the reason of failure, or "", and True if the ranges are too few.
    """
    rows = frame.rows.only(np.isin(frame.rows.origin, group))
    if not len(rows):
        return "no range to it", False
    distance = dict(zip(zip(rows.origin.tolist(), rows.target.tolist(), strict=True), rows.observed, strict=True))
    distance |= {(b, a): d for (a, b), d in distance.items()}
    clique = _clique(distance)
    if len(clique) >= 4:
        table = np.array([[distance.get((a, b), 0.0) for b in clique] for a in clique])
        xyz, values = classical_scaling(table)
        if values[2] > STRICT * values[0]:
            frame.xyz[clique] = xyz
            frame.spread()
            return "", False
    stations = np.unique(rows.origin)
    targets = np.setdiff1d(group, stations)
    ranges = np.array([[distance.get((a, b), np.nan) for b in targets.tolist()] for a in stations.tolist()])
    unfolding = _unfolded(ranges, float(np.median(rows.sigma)))
    if unfolding.outcome is not FigureOutcome.UNFOLDED:
        return unfolding.status, unfolding.outcome is FigureOutcome.TOO_FEW
    frame.xyz[stations], frame.xyz[targets] = unfolding.stations, unfolding.targets
    frame.sides |= set(np.concatenate([stations, targets])[unfolding.side_assumed].tolist())
    frame.spread()
    return "", False


def _unfolded(ranges: np.ndarray, sigma: float) -> Unfolding:
    """Unfolded figure; unknown zeros and scales may make ranges up to 100 times worse than sigma."""
    unfolding = unfold(ranges, sigma)
    for factor in (10.0, 100.0):
        if unfolding.outcome is not FigureOutcome.NO_FIT:
            break
        unfolding = unfold(ranges, factor * sigma)
    return unfolding


def _clique(distance: dict[tuple[int, int], float]) -> list[int]:
    """Points with all mutual distances, grown from the one with the most."""
    ties = defaultdict(set)
    for a, b in distance:
        ties[a].add(b)
    order = sorted(ties, key=lambda p: -len(ties[p]))
    best: list[int] = []
    for first in order[:20]:
        clique, open_ = [first], set(ties[first])
        while open_:
            clique.append(max(open_, key=lambda p: len(ties[p] & open_)))
            open_ &= ties[clique[-1]]
        best = max(best, clique, key=len)
    return best


def _laid_down(search: PlacingSearch, frame: PlacingSearch) -> str:
    """Fit a figure, rotated and mirrored, to the placed points.

    Returns the reason of failure, or "".
    """
    placed, in_frame = (np.isfinite(xyz).all(axis=1) for xyz in (search.xyz, frame.xyz))
    common = placed & in_frame
    tries = []
    for mirror in (1.0, -1.0):
        local = frame.xyz * (1.0, 1.0, mirror)
        motion = rigid_motion(local[common], search.xyz[common])
        if motion is None:
            return _by_convention(search, frame)
        xyz = motion[1] + local @ motion[0].T
        apart = float(np.sqrt(np.mean((xyz - search.xyz)[common] ** 2)))
        tries.append((apart, _misfit_of_heights(search.rows, xyz), xyz))
    for by in (0, 1):
        first, second = sorted(tries, key=lambda t: t[by])
        if second[by] > 3 * first[by] + 10 * FLOOR:
            return _taken(search, frame, first[2])
    return "a mirror image fits as well; give one more point off the plane of the others, or a zenith angle"


def _by_convention(search: PlacingSearch, frame: PlacingSearch) -> str:
    """Place a figure as it is, on one or two placed or collinear points, if they are all."""
    placed, in_frame = (np.isfinite(xyz).all(axis=1) for xyz in (search.xyz, frame.xyz))
    common, r = placed & in_frame, search.rows
    turned = (r.code != RANGE) & in_frame[r.origin] & in_frame[r.target]
    if placed.sum() > common.sum() or turned.any():
        return f"of {int(in_frame.sum())} points that ranges tie together {int(common.sum())} are placed, 3 are needed"
    turn = closed_form(frame.xyz[common], search.xyz[common])[0] if common.sum() > 1 else np.eye(3)
    shift = search.xyz[common].mean(axis=0) - turn @ frame.xyz[common].mean(axis=0) if common.any() else np.zeros(3)
    waiting = set(search.unplaced.tolist())
    why = _taken(search, frame, frame.xyz @ turn.T + shift)
    search.conventional |= set() if why else waiting
    return why


def _taken(search: PlacingSearch, frame: PlacingSearch, xyz: np.ndarray) -> str:
    """Accept a figure placed at xyz.

    Returns the reason of failure, or "".
    """
    search.sides |= frame.sides & set(search.unplaced.tolist())
    return "" if search.fill(xyz) else "the other ranges do not place it"


def _misfit_of_heights(r: Sightings, xyz: np.ndarray) -> float:
    """Median misfit, m, of zenith angles and height differences.

    0 without any.
    """
    up = (r.code == ZENITH) | ((r.code == DIFFERENCE) & (r.which == 2))
    r = r.only(up & np.isfinite(xyz[r.origin]).all(axis=1) & np.isfinite(xyz[r.target]).all(axis=1))
    if not len(r):
        return 0.0
    along = xyz[r.target] - xyz[r.origin] + r.shift
    rise = np.where(r.code == ZENITH, np.linalg.norm(along, axis=1) * np.cos(r.observed), r.observed)
    return float(np.median(np.abs(rise - along[:, 2])))
