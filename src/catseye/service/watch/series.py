"""Time series of a journal in bounded answers: bins with mean, least and largest; dropped channels."""

import re
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import text

from catseye.errors import InputError
from catseye.records.night.live import TICKS_PER_DAY
from catseye.service.watch.entries import Object, number, numbers, words
from catseye.service.watch.history import MINUTE_TICKS, History
from catseye.service.watch.index import limits
from catseye.service.watch.site_map import SiteMap

MOST_BINS = 20_000
MOST_NAMES = 64  # of one request
MOST_EPOCHS, MOST_ANSWERS = 400, 150  # summaries, and whole answers, of one series: of more, some at even distances
GAP_S = 60.0  # s without a value over which a line is broken
Column = NDArray[np.float64]
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


class Columns(NamedTuple):
    """Series: MJD, value, u; of bins also least and largest."""

    mjd: Column
    value: Column
    u: Column | None
    low: Column | None = None
    high: Column | None = None


def series_object(
    history: History, names: Sequence[str], since: float | None, until: float | None, most: int
) -> Object:
    """Series by name, at most `most` values each.

    Raises InputError for an unknown name or a bound outside 2 to 20 000.
    """
    require_series(names, most)
    rows = []
    for name in names:
        label, unit, columns = _columns(history, name, since, until, most)
        rows.append({"name": name, "label": label, "unit": unit} | binned(columns, most))
    return {"names": rows, "gaps": GAP_S}


def require_series(names: Sequence[str], most: int) -> None:
    """Raise InputError for too many names, or a bound outside 2 to 20 000."""
    if not 2 <= most <= MOST_BINS:
        raise InputError(f"most = {most} (expected 2 to {MOST_BINS})")
    if not 1 <= len(names) <= MOST_NAMES:
        raise InputError(f"{len(names)} names (expected 1 to {MOST_NAMES})")


def binned(columns: "Columns", most: int) -> Object:
    """Values in order of time; more than `most` as bins of equal time with mean, least and largest."""
    finite = np.isfinite(columns.value)
    order = np.flatnonzero(finite)[np.argsort(columns.mjd[finite], kind="stable")]
    mjd, value, u, low, high = (None if column is None else column[order] for column in columns)
    assert mjd is not None
    assert value is not None
    if len(mjd) > most and low is None:
        width = (mjd[-1] - mjd[0]) / most
        bins = (mjd - mjd[0]) / width if width > 0.0 else np.zeros(len(mjd))
        first = np.flatnonzero(np.diff(np.minimum(bins.astype(int), most - 1), prepend=-1))
        low, high = np.minimum.reduceat(value, first), np.maximum.reduceat(value, first)
        mjd, value = mjd[0] + _means(mjd - mjd[0], first), _means(value, first)
        u = None if u is None else _means(u, first)
    cells = {"mjd": mjd, "value": value, "u": u, "low": low, "high": high}
    return {key: None if column is None else numbers(column.tolist()) for key, column in cells.items()}


def _means(column: NDArray[np.float64], first: NDArray[Any]) -> NDArray[np.float64]:
    """Mean of each stretch of a column; stretches begin at `first`."""
    return np.asarray(np.add.reduceat(column, first) / np.diff([*first, len(column)]))


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
            return f"{label} {line}", unit, _of_shots(history, (column, u), (ranger, target), since, until, most)
    if kind in STATION_VALUES and of:
        column, label, unit = STATION_VALUES[kind]
        return f"{label} {of}", unit, _of_table(history, "weather", column, since, until, {"station": of}, most)
    if name in POSTURE_VALUES:
        column, label = POSTURE_VALUES[name]
        return label, "rad", _of_table(history, "postures", column, since, until, {}, most)
    if name in EPOCH_VALUES:
        key, label, unit = EPOCH_VALUES[name]
        rows = history.spread_epochs(since, until, min(most, MOST_EPOCHS))
        return label, unit, columns_of((row["mjd"], row[key], None) for row in rows)
    if kind == "zero" and of:
        answers = history.spread_answers(since, until, min(most, MOST_ANSWERS))
        zeros = ((mjd, (answer.get("zeros") or {}).get(of)) for mjd, answer in answers)
        return f"zero {of}", "m", columns_of((mjd, *v[:2]) for mjd, v in zeros if v)
    point = re.fullmatch(r"point:(.+):([xyz])", name)
    if point:
        axis, count = "xyz".index(point[2]), min(most, MOST_ANSWERS)
        places = history.point_rows(point[1], since, until, count)
        return f"{point[1]} {point[2]}", "m", columns_of((row[0], row[1][axis], row[2][axis]) for row in places)
    raise InputError(f"{name[:60]!r} is not a series (expected a name of series/names)")


def columns_of(rows: Iterable[Sequence[Any]]) -> Columns:
    """Columns of rows of MJD, value, u, and of bins least and largest; None becomes NaN."""
    table = np.array([[np.nan if v is None else v for v in row] for row in rows], dtype=float)
    table = table.reshape(-1, table.shape[1] if table.ndim == 2 else 3)
    u = None if np.isnan(table[:, 2]).all() else table[:, 2]
    return Columns(table[:, 0], table[:, 1], u, *((table[:, 3], table[:, 4]) if table.shape[1] == 5 else (None, None)))


def _of_shots(
    history: History,
    values: tuple[str, str | None],
    line: tuple[str, str],
    since: float | None,
    until: float | None,
    most: int,
) -> Columns:
    """A value of the good shots of a line, by the index of (run, ranger, ticks); in bins by the database if many."""
    (column, u), (ranger, target), (low, high) = values, line, limits(since, until)
    where = (
        "FROM shots WHERE run = :run AND ranger = :ranger AND ticks >= :since AND ticks <= :until"
        + (" AND target = :target" if target else " AND target <> 'ZRG'")
        + f" AND status IN ('used', 'reference') AND {column} IS NOT NULL"
    )
    asked: Object = {"ranger": ranger, "since": low, "until": high} | ({"target": target} if target else {})
    places = [
        (run.run, part) for run in history.index.runs_between(since, until) for part in history.index.parts(run.run)
    ]
    ends = [_extent(part, where, asked | {"run": run}) for run, part in places]
    count, first, last = _joined(ends)
    rows: list[Any] = []
    width = (last - first) // most + 1
    for run, part in places:
        with part.reading() as connection:
            if count <= most:
                query = f"SELECT ticks, {column}, {u or 'NULL'} {where} ORDER BY ticks"
                rows += connection.execute(text(query), asked | {"run": run})
                continue
            u_mean = f"AVG({u or 'CAST(NULL AS FLOAT)'})"
            bins = f"SELECT AVG(ticks), AVG({column}), {u_mean}, MIN({column}), MAX({column})"
            query = f"{bins} {where} GROUP BY (ticks - :first) / :width ORDER BY 1"
            rows += connection.execute(text(query), asked | {"run": run, "first": first, "width": width})
    return columns_of((float(ticks) / TICKS_PER_DAY, *map(_real, values)) for ticks, *values in rows)


def _extent(part: Any, where: str, asked: Object) -> tuple[int, int | None, int | None]:
    """Number of rows and their first and last ticks."""
    with part.reading() as connection:
        count, first, last = connection.execute(text(f"SELECT COUNT(*), MIN(ticks), MAX(ticks) {where}"), asked).one()
    return int(count), first, last


def _joined(ends: Sequence[tuple[int, int | None, int | None]]) -> tuple[int, int, int]:
    """Number of rows of all, first and last ticks."""
    firsts = [first for _, first, _ in ends if first is not None]
    lasts = [last for _, _, last in ends if last is not None]
    return sum(count for count, _, _ in ends), min(firsts, default=0), max(lasts, default=0)


def _real(value: Any) -> float | None:
    """A number of the database, which may be a decimal."""
    return None if value is None or isinstance(value, str | bytes) else number(float(value))


def _of_table(
    history: History,
    table: str,
    column: str,
    since: float | None,
    until: float | None,
    where: dict[str, str],
    most: int,
) -> Columns:
    """A column of a table over a span, at even distances if it has more rows than are wanted."""
    low, high = limits(since, until)
    condition = "".join(f" AND {key} = :{key}" for key in where)
    stretches = list(history.index.stretches(table, since, until))
    step = max(1, sum(stretch.high - stretch.low for stretch in stretches) // most)
    every = text(
        f"SELECT ticks, {column} FROM {table} WHERE run = :run AND seq >= :low AND seq < :high AND ticks >= :since "
        f"AND ticks <= :until{condition} ORDER BY seq"
    )
    some = text(
        "WITH RECURSIVE steps(low) AS (SELECT CAST(:low AS BIGINT) UNION ALL SELECT low + :step FROM steps WHERE "
        f"low + :step < :high) SELECT t.ticks, t.{column} FROM steps JOIN {table} AS t ON t.run = :run AND t.seq = "
        f"(SELECT seq FROM {table} WHERE run = :run AND seq >= steps.low AND seq < steps.low + :step ORDER BY seq "
        "LIMIT 1) WHERE t.ticks >= :since AND t.ticks <= :until ORDER BY t.seq"
    )
    rows: list[Any] = []
    for stretch in reversed(stretches):
        asked: Object = {"run": stretch.run, "low": stretch.low, "high": stretch.high, "since": low, "until": high}
        with stretch.part.reading() as connection:
            if where or step == 1:
                rows += connection.execute(every, asked | where)
            else:
                rows += connection.execute(some, asked | {"step": step})
    return columns_of((ticks / TICKS_PER_DAY, number(value), None) for ticks, value in rows)


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
        names = history.solutions.solution(last["number"], run=last["run"])[1].answer.get("names") or ()
        rows += [{"name": f"point:{n}:{a}", "label": f"{n} {a}", "unit": "m"} for n in names for a in "xyz"]
    return {"names": rows}


def dropped_object(history: History, site: SiteMap, since: float | None, until: float | None, bins: int) -> Object:
    """Good and failed shots of each ranger in bins of equal time, to the last event; none where `since` is later."""
    if not 1 <= bins <= 1000:
        raise InputError(f"bins = {bins} (expected 1 to 1000)")
    first, last = history.span()
    since = first if since is None else since
    if until is None:
        until = last
        if since is not None and last is not None and since >= last:  # a page that does not know the site's clock yet
            until = since + MINUTE_TICKS / TICKS_PER_DAY
    if since is None or until is None or not since < until:
        raise InputError(f"since = {since}, until = {until} (expected an earlier and a later MJD)")
    low, high = limits(since, until)
    width = max(1, -(-(high - low) // bins))
    if width >= 4 * MINUTE_TICKS:  # whole minutes, which are counted once and remembered
        width = -(-width // MINUTE_TICKS) * MINUTE_TICKS
        low = low // MINUTE_TICKS * MINUTE_TICKS
    rangers = list(site.site.rangers)
    good, every = (np.zeros((len(rangers), bins), dtype=int) for _ in range(2))
    counted = history.minutes() if width >= 4 * MINUTE_TICKS else history.counts(low, high, width)
    for (ranger, ticks), (fine, count) in counted.items():
        place = (ticks - low) // width
        if ranger in rangers and 0 <= place < bins:
            good[rangers.index(ranger), place] += fine
            every[rangers.index(ranger), place] += count
    return {
        "rangers": rangers,
        "bins": [(low + k * width) / TICKS_PER_DAY for k in range(bins)],
        "width": width / TICKS_PER_DAY,
        "good": good.tolist(),
        "failed": (every - good).tolist(),
    }
