"""Time series of a journal in bounded answers: bins with mean, least and largest; dropped channels."""

import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import text

from catseye.errors import InputError
from catseye.records.night.live import TICKS_PER_DAY
from catseye.service.watch.entries import Object, number, numbers, words
from catseye.service.watch.history import History
from catseye.service.watch.index import limits
from catseye.service.watch.site_map import SiteMap

MOST_BINS = 20_000
MOST_NAMES = 64  # of one request
MOST_EPOCHS = 1000  # read for one series: more are taken at even distances
GAP_S = 60.0  # s without a value over which a line is broken
Columns = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None]  # MJD, value, u
SHOT_VALUES = {
    "range": ("range_m", "u_range_m", "range", "m"),
    "correction": ("misfit_m", "u_range_m", "range less prediction", "m"),
    "amplitude": ("amplitude_v", None, "amplitude", "V"),
}
STATION_VALUES = {
    "temperature": ("temperature_c", "temperature", "°C"),
    "pressure": ("pressure_hpa", "pressure", "hPa"),
    "humidity": ("humidity_percent", "relative humidity", "%"),
}
POSTURE_VALUES = {"azimuth": ("azimuth_rad", "azimuth"), "elevation": ("elevation_rad", "elevation")}
EPOCH_VALUES = {
    "refractivity": ("refractivity_ppm", "mean refractivity", "ppm"),
    "variance_factor": ("variance_factor", "variance factor", ""),
}
GOOD = ("used", "reference")


def series_object(
    history: History, names: Sequence[str], since: float | None, until: float | None, most: int
) -> Object:
    """Series by name, at most `most` values each.

    Raises InputError for an unknown name or a bound outside 2 to 20 000.
    """
    if not 2 <= most <= MOST_BINS:
        raise InputError(f"most = {most} (expected 2 to {MOST_BINS})")
    if not 1 <= len(names) <= MOST_NAMES:
        raise InputError(f"{len(names)} names (expected 1 to {MOST_NAMES})")
    rows = []
    for name in names:
        label, unit, columns = _columns(history, name, since, until, most)
        rows.append({"name": name, "label": label, "unit": unit} | binned(*columns, most))
    return {"names": rows, "gaps": GAP_S}


def binned(mjd: NDArray[np.float64], value: NDArray[np.float64], u: NDArray[np.float64] | None, most: int) -> Object:
    """Values in order of time; more than `most` as bins of equal time with mean, least and largest."""
    finite = np.isfinite(value)
    mjd, value = mjd[finite], value[finite]
    u = None if u is None else u[finite]
    order = np.argsort(mjd, kind="stable")
    mjd, value = mjd[order], value[order]
    u = None if u is None else u[order]
    if len(mjd) <= most:
        spread = None if u is None else numbers(u.tolist())
        return {"mjd": mjd.tolist(), "value": value.tolist(), "u": spread, "low": None, "high": None}
    width = (mjd[-1] - mjd[0]) / most
    bins = np.minimum(((mjd - mjd[0]) / width).astype(int), most - 1) if width > 0.0 else np.zeros(len(mjd), dtype=int)
    first = np.flatnonzero(np.diff(bins, prepend=-1))
    count = np.diff([*first, len(bins)])

    def mean(column: NDArray[np.float64]) -> list[float | None]:
        return numbers((np.add.reduceat(column, first) / count).tolist())

    centre = mjd[0] + mean_of(mjd - mjd[0], first, count)
    return {
        "mjd": centre.tolist(),
        "value": mean(value),
        "u": None if u is None else mean(u),
        "low": np.minimum.reduceat(value, first).tolist(),
        "high": np.maximum.reduceat(value, first).tolist(),
    }


def mean_of(column: NDArray[np.float64], first: NDArray[Any], count: NDArray[Any]) -> NDArray[np.float64]:
    """Mean of each stretch of a column."""
    return np.asarray(np.add.reduceat(column, first) / count)


def _columns(
    history: History, name: str, since: float | None, until: float | None, most: int
) -> tuple[str, str, Columns]:
    """Label, unit and columns of a series."""
    kind, _, of = name.partition(":")
    if kind in SHOT_VALUES and of:
        ranger, _, target = of.partition(":")
        if kind == "amplitude" or target:
            column, u, label, unit = SHOT_VALUES[kind]
            line = f"{ranger} {target}".strip()
            return f"{label} {line}", unit, _of_shots(history, (column, u), ranger, target, since, until)
    if kind in STATION_VALUES and of:
        column, label, unit = STATION_VALUES[kind]
        return f"{label} {of}", unit, _of_table(history, "weather", column, since, until, {"station": of})
    if name in POSTURE_VALUES:
        column, label = POSTURE_VALUES[name]
        return label, "rad", _of_table(history, "postures", column, since, until, {}, most)
    if name in EPOCH_VALUES:
        key, label, unit = EPOCH_VALUES[name]
        rows = history.spread_epochs(since, until, min(most, MOST_EPOCHS))
        return label, unit, _columns_of((row["mjd"], row[key], None) for row, _ in rows)
    if kind == "zero" and of:
        rows = history.spread_epochs(since, until, min(most, MOST_EPOCHS))
        zeros = ((row["mjd"], (answer().get("zeros") or {}).get(of)) for row, answer in rows)
        return f"zero {of}", "m", _columns_of((mjd, *v[:2]) for mjd, v in zeros if v)
    point = re.fullmatch(r"point:(.+):([xyz])", name)
    if point:
        axis, count = "xyz".index(point[2]), min(most, MOST_EPOCHS)
        places = history.point_rows(point[1], since, until, count)
        return f"{point[1]} {point[2]}", "m", _columns_of((row[0], row[1][axis], row[2][axis]) for row in places)
    raise InputError(f"{name[:60]!r} is not a series (expected a name of series/names)")


def _columns_of(rows: Iterable[Sequence[Any]]) -> Columns:
    """Columns of rows of MJD, value, u; None becomes NaN."""
    table = np.array([[np.nan if v is None else v for v in row] for row in rows], dtype=float).reshape(-1, 3)
    return table[:, 0], table[:, 1], None if np.isnan(table[:, 2]).all() else table[:, 2]


def _of_shots(
    history: History, values: tuple[str, str | None], ranger: str, target: str, since: float | None, until: float | None
) -> Columns:
    """A value of the good shots of a line, by the index of (run, ranger, ticks)."""
    column, u = values
    low, high = limits(since, until)
    condition = " AND target = :target" if target else " AND target <> 'ZRG'"
    query = text(
        f"SELECT ticks, {column}, {u or 'NULL'} FROM shots WHERE run = :run AND ranger = :ranger AND ticks >= :since "
        f"AND ticks <= :until{condition} AND status IN ('used', 'reference') ORDER BY ticks"
    )
    rows: list[Any] = []
    for run in history.index.runs_between(since, until):
        for part in history.index.parts(run.run):
            asked = {"run": run.run, "ranger": ranger, "since": low, "until": high}
            with part.reading() as connection:
                rows += connection.execute(query, asked | ({"target": target} if target else {}))
    return _columns_of((ticks / TICKS_PER_DAY, number(value), number(spread)) for ticks, value, spread in rows)


def _of_table(
    history: History,
    table: str,
    column: str,
    since: float | None,
    until: float | None,
    where: dict[str, str],
    most: int = MOST_BINS,
) -> Columns:
    """A column of a table over a span; of postures, thousands a night, only as many as are shown."""
    low, high = limits(since, until)
    condition = "".join(f" AND {key} = :{key}" for key in where)
    found: list[Any] = []
    stretches = list(history.index.stretches(table, since, until))
    total = sum(stretch.high - stretch.low for stretch in stretches)
    for stretch in reversed(stretches):
        span = {"run": stretch.run, "since": low, "until": high}
        step = max(1, total // (4 * most)) if not where else 1
        cells = _cells if step == 1 else _sampled
        with stretch.part.reading() as connection:
            query = f"SELECT seq, ticks, {column} FROM {table} WHERE run = :run AND ticks >= :since AND ticks <= :until"
            found += cells(connection, f"{query}{condition}", span | where, stretch.low, stretch.high, step)
    return _columns_of((ticks / TICKS_PER_DAY, number(value), None) for _, ticks, value in found)


def _cells(connection: Any, query: str, values: Object, low: int, high: int, _: int) -> list[Any]:
    """All rows of a stretch."""
    return list(
        connection.execute(
            text(f"{query} AND seq >= :low AND seq < :high ORDER BY seq"), values | {"low": low, "high": high}
        )
    )


def _sampled(connection: Any, query: str, values: Object, low: int, high: int, step: int) -> list[Any]:
    """Rows of a stretch at distances of `step` events."""
    one = text(f"{query} AND seq >= :low ORDER BY seq LIMIT 1")
    rows: list[Any] = []
    for seq in range(low, high, step):
        row = connection.execute(one, values | {"low": seq}).first()
        if row is not None and (not rows or row[0] > rows[-1][0]):
            rows.append(row)
    return rows


def series_names(history: History, site: SiteMap) -> Object:
    """Names of all series of the last run, with labels and units."""
    run = history.index.run()
    pairs: set[tuple[str, str]] = set()
    query = text(
        "SELECT DISTINCT ranger, target FROM (SELECT ranger, target FROM shots WHERE run = :run "
        "AND status = 'used' ORDER BY seq DESC LIMIT 20000) AS latest"
    )
    for part in history.index.parts(run.run)[-1:]:
        with part.reading() as connection:
            pairs |= {(words(a), words(b)) for a, b in connection.execute(query, {"run": run.run})}
    rows: list[Object] = []
    for ranger, target in sorted(pair for pair in pairs if pair[1] != "ZRG"):
        for kind in ("range", "correction"):
            label, unit = SHOT_VALUES[kind][2:]
            rows.append({"name": f"{kind}:{ranger}:{target}", "label": f"{label} {ranger} {target}", "unit": unit})
    for ranger in site.site.rangers:
        rows.append({"name": f"amplitude:{ranger}", "label": f"amplitude {ranger}", "unit": "V"})
        rows.append({"name": f"zero:{ranger}", "label": f"zero {ranger}", "unit": "m"})
    for station in site.site.site.weather_station:
        for kind, (_, label, unit) in STATION_VALUES.items():
            rows.append({"name": f"{kind}:{station.name}", "label": f"{label} {station.name}", "unit": unit})
    rows += [{"name": name, "label": label, "unit": "rad"} for name, (_, label) in POSTURE_VALUES.items()]
    rows += [{"name": name, "label": label, "unit": unit} for name, (_, label, unit) in EPOCH_VALUES.items()]
    last = next(iter(history.latest_epochs(None, None, 1)), None)
    if last is not None:
        names = history.solution(last["number"], run=last["run"])[2].answer.get("names") or ()
        rows += [{"name": f"point:{n}:{a}", "label": f"{n} {a}", "unit": "m"} for n in names for a in "xyz"]
    return {"names": rows}


def dropped_object(history: History, site: SiteMap, since: float | None, until: float | None, bins: int) -> Object:
    """Good and failed shots of each ranger in bins of equal time."""
    if not 1 <= bins <= 1000:
        raise InputError(f"bins = {bins} (expected 1 to 1000)")
    first, last = history.span()
    since, until = (first if since is None else since), (last if until is None else until)
    if since is None or until is None or not since < until:
        raise InputError(f"since = {since}, until = {until} (expected an earlier and a later MJD)")
    low, high = limits(since, until)
    width = max(1, -(-(high - low) // bins))
    query = text(
        "SELECT ranger, (ticks - :since) / :width AS bin, SUM(CASE WHEN status IN ('used', 'reference') THEN 1 ELSE 0 "
        "END), COUNT(*) FROM shots WHERE run = :run AND seq >= :low AND seq < :high AND ticks >= :since AND ticks "
        "< :until GROUP BY ranger, bin"
    )
    rangers = list(site.site.rangers)
    good, every = np.zeros((len(rangers), bins), dtype=int), np.zeros((len(rangers), bins), dtype=int)
    for stretch in history.index.stretches("shots", since, until):
        asked = {"run": stretch.run, "low": stretch.low, "high": stretch.high, "since": low, "until": high}
        with stretch.part.reading() as connection:
            for ranger, place, fine, count in connection.execute(query, asked | {"width": width}):
                if words(ranger) in rangers and 0 <= int(place) < bins:
                    row = rangers.index(words(ranger))
                    good[row, int(place)] += int(fine)
                    every[row, int(place)] += int(count)
    starts = [(low + k * width) / TICKS_PER_DAY for k in range(bins)]
    return {
        "rangers": rangers,
        "bins": starts,
        "width": width / TICKS_PER_DAY,
        "good": good.tolist(),
        "failed": (every - good).tolist(),
    }
