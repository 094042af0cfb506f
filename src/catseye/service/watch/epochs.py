"""One epoch of a journal: points, beams, residuals, air, rejected shots, surface; two epochs compared."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import text

from catseye.coordinator.journal.entries import EPOCH_RANGES
from catseye.coordinator.samplers.rings import triangles_of
from catseye.errors import InputError
from catseye.reduction.epoch.reason import status_of
from catseye.service.watch.entries import COVARIANCE, Object, epoch_summary, number, numbers, words
from catseye.service.watch.history import History
from catseye.service.watch.index import first_seq
from catseye.service.watch.site_map import SiteMap
from catseye.service.watch.solutions import answer_of

if TYPE_CHECKING:
    from catseye.records.site.folder import SiteFolder
    from catseye.reduction.surface.shape import SurfaceShape

MOST_STRAY = 300  # rejected shots outside the epoch's own span of numbers that are looked up singly
RANGES_BEHIND = text("SELECT seq, name, text FROM documents WHERE run = :run AND seq > :seq ORDER BY seq LIMIT 4")
SHOTS_BETWEEN = text(
    "SELECT number, ranger, target, ticks, status, range_m, u_range_m, misfit_m FROM shots "
    "WHERE run = :run AND seq >= :low AND number <= :last ORDER BY seq LIMIT 20000"
)
ONE_SHOT = text(
    "SELECT number, ranger, target, ticks, status, range_m, u_range_m, misfit_m FROM shots "
    "WHERE run = :run AND seq >= :low ORDER BY seq LIMIT 1"
)


class EpochRecord:
    """One solved epoch with its shots.

    Raises InputError for an epoch that the journal does not have.
    """

    def __init__(self, history: History, count: int, *, run: int | None = None, at: float | None = None):
        self._history = history
        self._key, self.solution = history.solutions.solution(count, run=run, at=at)
        self.run, self.seq = self._key.run, self._key.seq
        self.number = count

    @property
    def answer(self) -> Mapping[str, Any]:
        """Stored answer of the solution."""
        return self.solution.answer

    @cached_property
    def covariance(self) -> NDArray[np.float64] | None:
        """Covariance (3n, 3n) m^2 of its points, read when it is needed; None where none is stored."""
        return self._history.solutions.covariance(self._key)

    def ranges(self) -> dict[str, list[Any]]:
        """Columns of the adjusted ranges, see `range_columns`; empty in journals that do not store them."""
        for part in self._history.index.parts(self.run):
            with part.reading() as connection:
                rows = connection.execute(RANGES_BEHIND, {"run": self.run, "seq": self.seq}).all()
            for _, name, content in rows:
                if name == EPOCH_RANGES:
                    return dict(answer_of(content))
                if name == "epoch-begun":
                    return {}
        return {}

    def shots(self) -> dict[int, Sequence[Any]]:
        """Rows of the epoch's shots, used and rejected, by number: ranger, target, ticks, status, range, u, misfit."""
        used = [int(n) for n in self.answer.get("used") or ()]
        rejected = [int(n) for n in self.answer.get("rejected") or {}]
        wanted = set(used) | set(rejected)
        rows: dict[int, Sequence[Any]] = {}
        if not wanted:
            return rows
        low, high = (min(used), max(used)) if used else (min(rejected), max(rejected))
        strays = sorted(n for n in rejected if not low <= n <= high)[-MOST_STRAY:]
        for part in self._history.index.parts(self.run):
            with part.reading() as connection:
                start = first_seq(connection, "shots", self.run, low, "number")
                between = {"run": self.run, "low": start, "last": high}
                rows |= {row[0]: row[1:] for row in connection.execute(SHOTS_BETWEEN, between) if row[0] in wanted}
                for stray in strays:
                    start = first_seq(connection, "shots", self.run, stray, "number")
                    row = connection.execute(ONE_SHOT, {"run": self.run, "low": start}).first()
                    if row is not None and row[0] == stray:
                        rows[stray] = row[1:]
        return rows

    def places(self) -> tuple[list[str], NDArray[np.float64]]:
        """Names and places (n, 3) m of its points."""
        names = [str(name) for name in self.answer.get("names") or ()]
        return names, np.array(self.answer.get("x") or np.empty((0, 3)), dtype=float).reshape(-1, 3)

    def points(self) -> tuple[list[str], NDArray[np.float64], NDArray[np.float64]]:
        """Names, places (n, 3) m, and covariance (n, 6) m^2 of each point by itself."""
        names, places = self.places()
        return names, places, triangles_of(self.covariance, len(names))


def epoch_object(record: EpochRecord, site: SiteMap) -> Object:
    """JSON object of an epoch."""
    answer, shots, ranges = record.answer, record.shots(), record.ranges()
    names, places, covariance = record.points()
    rejected = [
        {
            "shot": int(shot),
            "ranger": words(shots[int(shot)][0]) if int(shot) in shots else None,
            "target": words(shots[int(shot)][1]) if int(shot) in shots else None,
            "status": str(status_of(reason) or "unknown"),
            "reason": reason,
        }
        for shot, reason in (answer.get("rejected") or {}).items()
    ]
    return epoch_summary(record.solution) | {
        "run": record.run,
        "points": point_columns(names, places, covariance, answer.get("shots"), site),
        "beams": beams(answer.get("used") or (), shots, ranges),
        "structure": site.structure(number(answer.get("azimuth")), number(answer.get("elevation"))),
        "air": _estimates("name", answer.get("air")),
        "zeros": _estimates("ranger", answer.get("zeros")),
        "jitter_mm": answer.get("jitter_mm") or {},
        "doubts": answer.get("doubts") or [],
        "notes": answer.get("notes") or [],
        "biases": answer.get("biases") or {},
        "rejected": rejected,
        "pose": answer.get("pose"),
    }


def point_columns(
    names: Sequence[str],
    places: NDArray[np.float64],
    covariance: NDArray[np.float64],
    counts: Sequence[int] | None,
    site: SiteMap,
) -> Object:
    """Columns of an epoch's points."""
    table, spread = jsoned(places), jsoned(covariance)
    return {
        "name": list(names),
        "body": [site.body(name) for name in names],
        **{axis: [row[k] for row in table] for k, axis in enumerate("xyz")},
        "covariance": {key: [row[k] for row in spread] for k, key in enumerate(COVARIANCE)},
        "shots": [*counts] if counts else [None] * len(names),
    }


def beams(used: Sequence[int], shots: Mapping[int, Sequence[Any]], ranges: Mapping[str, Sequence[Any]]) -> Object:
    """Lines of the shots used, with the test statistic of each."""
    w = dict(zip(ranges.get("shot", ()), ranges.get("w", ()), strict=False))
    rows = [(*map(words, shots[n][:2]), int(n), number(w.get(n))) for n in used if n in shots]
    return {key: [row[k] for row in rows] for k, key in enumerate(("ranger", "target", "shot", "w"))}


def residuals_object(record: EpochRecord, site: SiteMap) -> Object:
    """Residual of each shot of an epoch, by the adjustment.

    A journal of an earlier version did not store them: then it is the shot's own range less the prediction before
    the epoch, and `by` says "prediction".
    """
    shots, ranges = record.shots(), record.ranges()
    rejected = {int(n): reason for n, reason in (record.answer.get("rejected") or {}).items()}
    names, places = record.places()
    at = dict(zip(names, places, strict=True))
    rows = []
    if ranges:
        table = zip(*(ranges[key] for key in ("shot", "residual", "u_range", "w", "used")), strict=True)
        values = {shot: (number(r), number(u), number(w), used) for shot, r, u, w, used in table}
        left_out = {n: (None, None, None, False) for n in rejected if n not in values}
    else:
        values = {n: (number(row[6]), number(row[5]), None, n not in rejected) for n, row in shots.items()}
        left_out = {}
    for shot, (residual, u, w, used) in sorted((values | left_out).items()):
        row = shots.get(shot)
        if row is None or words(row[1]) == "ZRG":
            continue
        ranger, target = words(row[0]), words(row[1])
        reason = rejected.get(shot)
        status = words(row[3]) if used and reason is None else str(status_of(reason or "") or row[3])
        elevation = _elevation(at.get(ranger), at.get(target))
        rows.append((shot, ranger, target, row[2] / 1e8, elevation, residual, u, w, status))
    keys = ("shot", "ranger", "target", "mjd", "elevation", "residual", "u", "w", "status")
    columns = {key: [row[k] for row in rows] for k, key in enumerate(keys)}
    return columns | {"by": "adjustment" if ranges else "prediction"}


def air_object(record: EpochRecord, site: SiteMap, weather: Sequence[Object]) -> Object:
    """Air along each path of an epoch, and what the adjustment says of the weather stations.

    `u` is what a path's index fluctuates by the site's records.
    """
    shots, ranges, answer = record.shots(), record.ranges(), record.answer
    last: dict[tuple[str, str], tuple[float | None, float | None]] = {}
    for shot, index in zip(*(ranges.get(key, ()) for key in ("shot", "refractivity_ppm")), strict=True):
        row = shots.get(shot)
        if row is not None:
            last[words(row[0]), words(row[1])] = number(row[4]), number(index)
    air = answer.get("air") or {}
    stations = []
    readings = {row["station"]: row for row in weather}
    for station in site.site.site.weather_station:
        offset = air.get(station.name) or (None, None)
        bias = (answer.get("biases") or {}).get(station.name)
        place = {"elevation": station.elevation_m, "x": station.x_m, "y": station.y_m}
        read = readings.get(station.name)
        stations.append(
            {"name": station.name, **place, "offset_c": offset[0], "u_offset_c": offset[1], "bias": bias, "read": read}
        )
    profile = {name: {"value": v[0], "u": v[1]} for name, v in air.items() if name not in readings and len(v) == 2}
    spread = site.site.site.ranging.path_index_fluctuation_ppm
    return {
        "epoch": record.number,
        "mjd": record.solution.ticks / 1e8,
        "refractivity_ppm": number(answer.get("refractivity_ppm")),
        "paths": {
            "ranger": [ranger for ranger, _ in last],
            "target": [target for _, target in last],
            "length": [length for length, _ in last.values()],
            "refractivity_ppm": [index for _, index in last.values()],
            "u": [spread] * len(last),
            "temperature_c": [None] * len(last),
        },
        "profile": profile or None,
        "stations": stations,
    }


def comparison_object(first: EpochRecord, second: EpochRecord, site: SiteMap) -> Object:
    """Movement of the points that two epochs share, ground frame at the posture of the first.

    Points of the telescope are carried there by its axes' readings, as a rigid body. Each epoch's covariance counts in
    full; epochs of a run share their state, so that this claims too much rather than too little.
    """
    from catseye.reduction.live.moved import at_posture

    one, two = first.points(), second.points()
    after, before = ((float(e.answer["azimuth"]), float(e.answer["elevation"])) for e in (first, second))
    places, triangles = at_posture(site.site, two[0], *two[1:], before=before, after=after)
    at = {name: k for k, name in enumerate(one[0])}
    shared = [(at[name], k) for k, name in enumerate(two[0]) if name in at]
    if not shared:
        raise InputError(f"epochs {first.number} and {second.number} share no point (expected one at least)")
    a, b = (np.array(rows) for rows in zip(*shared, strict=True))
    names = [one[0][k] for k in a.tolist()]
    return moved_object(names, places[b] - one[1][a], one[2][a] + triangles[b]) | {
        "body": [site.body(name) for name in names],
        "first": epoch_summary(first.solution),
        "second": epoch_summary(second.solution),
    }


def moved_object(names: Sequence[str], moved: NDArray[np.float64], triangles: NDArray[np.float64]) -> Object:
    """Movements (n, 3) m with covariance (n, 6) m^2, and which of them are significant."""
    from catseye.reduction.live.moved import significant_moves

    moves = significant_moves(moved, triangles)
    table, spread = jsoned(moved), jsoned(triangles)
    return {
        "name": list(names),
        **{f"d{axis}": [row[k] for row in table] for k, axis in enumerate("xyz")},
        "covariance": {key: [row[k] for row in spread] for k, key in enumerate(COVARIANCE)},
        "w": numbers(moves.w.tolist()),
        "significant": moves.significant.tolist(),
        "level": moves.level,
        "verdict": moves.verdict.word,
        "verdict_text": moves.verdict.why,
    }


def _no_surface(record: EpochRecord, why: str) -> Object:
    """Surface of an epoch whose prisms determine none."""
    return {
        "epoch": record.number,
        "points": {key: [] for key in ("name", "x", "y", "deviation", "half_path", "u")},
        "actuators": None,
        "aperture": None,
        "zernike": [],
        "rms": None,
        "focal_length": None,
        "verdict": "failed",
        "verdict_text": why,
    }


def surface_object(record: EpochRecord, site: SiteMap) -> Object:
    """Shape of the dish from the prisms of one epoch, as `catseye surface` has it.

    Without points where the prisms are too few or determine no shape; the verdict says so.
    """
    from catseye.errors import EstimationError
    from catseye.optics.zernike import number as term_number
    from catseye.reduction.surface.epoch_surface import dish_rows, epoch_surface

    names, places = record.places()
    records = site.site
    covariance = record.covariance
    if covariance is None or not dish_rows(names, records):
        return _no_surface(record, "no prism of the dish has a covariance")
    posture = (record.answer["azimuth"], record.answer["elevation"])
    try:
        result = epoch_surface(
            names, places, covariance, site=records, posture=posture, source=f"epoch {record.number}"
        )
    except EstimationError as problem:
        return _no_surface(record, f"no shape of the dish: {problem}")
    shape = result.shapes[0]
    fit, terms = shape.fit, shape.expansion
    u = np.sqrt(np.maximum(np.diag(fit.deviation_covariance), 0.0))
    deviations = {
        "name": list(shape.prisms.names),
        **{axis: numbers(fit.local[:, k].tolist()) for k, axis in enumerate("xy")},
        "deviation": numbers(fit.deviation.tolist()),
        "half_path": numbers(fit.half_path.tolist()),
        "u": numbers(u.tolist()),
    }
    u_terms = np.sqrt(np.maximum(np.diag(terms.covariance), 0.0))
    zernike = [
        {"n": term.n, "m": term.m, "number": term_number(term, shape.settings.numbering), "name": term.name}
        | {"value": number(value), "u": number(spread)}
        for term, value, spread in zip(terms.terms, terms.value.tolist(), u_terms.tolist(), strict=True)
    ]
    centre, radius = (shape.aperture.centre.tolist(), shape.aperture.radius)
    return {
        "epoch": record.number,
        "points": deviations,
        "actuators": _actuators(shape, records),
        "aperture": {"x": centre[0], "y": centre[1], "radius": radius},
        "zernike": zernike,
        "rms": number(float(np.sqrt(np.mean(fit.deviation**2)))),
        "focal_length": number(float(fit.focal_length)),
        "verdict": result.verdict.word,
        "verdict_text": result.verdict.why,
    }


def _actuators(shape: "SurfaceShape", records: "SiteFolder") -> Object | None:
    """Corrections of the actuators under the measured prisms, m; None where they cannot be determined.

    Those between are as `catseye surface` has them with `actuators`: from few prisms they say little.
    """
    from catseye.errors import EstimationError
    from catseye.reduction.surface.actuators import actuators_of, corrections

    names, places = actuators_of(records)
    rows = [k for k, name in enumerate(names) if name in shape.prisms.names]
    try:
        result = corrections(shape, tuple(names[k] for k in rows), places[rows])
    except EstimationError:
        return None
    columns = {axis: numbers(result.places[:, k].tolist()) for k, axis in enumerate("xy")}
    return {"name": list(result.names)} | columns | {"value": numbers(result.correction.tolist())}


def jsoned(table: NDArray[np.float64]) -> list[list[float | None]]:
    """Rows of a table, None for what is not finite."""
    rows: list[list[float | None]] = table.tolist()
    if not np.isfinite(table).all():
        rows = [numbers(row) for row in rows]
    return rows


def _estimates(key: str, values: Any) -> Object:
    """Columns of estimates with u, by name."""
    rows = [(name, *numbers((*v, None, None)[:2])) for name, v in (values or {}).items()]
    return {name: [row[k] for row in rows] for k, name in enumerate((key, "value", "u"))}


def _elevation(a: NDArray[np.float64] | None, b: NDArray[np.float64] | None) -> float | None:
    """Elevation of a line from its ends, rad."""
    if a is None or b is None:
        return None
    east, north, up = (b - a).tolist()
    return number(float(np.arctan2(up, np.hypot(east, north))))
