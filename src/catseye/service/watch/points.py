"""One point and one ranger of a site through the time of its journal."""

from typing import Any

from sqlalchemy import text

from catseye.errors import InputError
from catseye.service.watch.calibrations import certificate_object
from catseye.service.watch.entries import COVARIANCE, SHOT, Object, columns, mjd_of, number, numbers, words
from catseye.service.watch.history import History, shot_object
from catseye.service.watch.index import limits
from catseye.service.watch.shots import ROW
from catseye.service.watch.site_map import SiteMap

LAST_SHOTS, LAST_COMMANDS = 50, 100
MOST_SEARCHED = 200_000  # events of the journal through which shots on a target, or commands, are searched
MOST_EPOCHS = 150  # of more, some at even distances
COMMANDS = text(
    "SELECT ticks, line, reply, ok FROM commands WHERE run = :run AND seq >= :low AND seq < :high "
    "AND ranger = :ranger AND line NOT LIKE 'VER%' ORDER BY seq DESC LIMIT :limit"
)


def point_object(history: History, site: SiteMap, name: str, since: float | None, until: float | None) -> Object:
    """A point's place at each epoch with covariance, and the last shots at it or from it.

    Raises InputError for an unknown name.
    """
    known = name in site.bodies or name.removesuffix("-F") in site.site.monuments
    rows = list(history.point_rows(name, since, until, MOST_EPOCHS))
    if not rows and not known:
        raise InputError(f"{name[:60]!r} is not a point of the site (expected a ranger or a target)")
    covariance = [numbers(row[3]) for row in rows]
    return {
        "name": name,
        "body": site.body(name),
        "mjd": [row[0] for row in rows],
        "epoch": [row[4] for row in rows],
        **{axis: [number(row[1][k]) for row in rows] for k, axis in enumerate("xyz")},
        "covariance": {key: [row[k] for row in covariance] for k, key in enumerate(COVARIANCE)},
        "shots": _last_shots(history, name, since, until),
    }


def _last_shots(history: History, name: str, since: float | None, until: float | None) -> Object:
    """Last shots at a target or from a ranger, oldest first."""
    (low, high), rows = limits(since, until), list[Any]()
    query = text(
        f"SELECT {ROW} FROM shots WHERE run = :run AND seq >= :low AND seq < :high AND ticks >= :since AND ticks <= "
        ":until AND (target = :name OR ranger = :name) ORDER BY seq DESC LIMIT :limit"
    )
    for stretch in history.index.stretches("shots", since, until):
        start = max(stretch.low, stretch.high - MOST_SEARCHED)
        asked: Object = {"run": stretch.run, "low": start, "high": stretch.high, "since": low, "until": high}
        with stretch.part.reading() as connection:
            rows += connection.execute(query, asked | {"name": name, "limit": LAST_SHOTS - len(rows)})
        if len(rows) >= LAST_SHOTS:
            break
    return columns(SHOT, [list(shot_object(row).values()) for row in reversed(rows)])


def ranger_object(history: History | None, site: SiteMap, name: str, state: Object, at: float) -> Object:
    """A ranger: state, records, certificates, last commands.

    history   of the journal; None without one

    Raises InputError for an unknown ranger.
    """
    records = site.site
    if name not in records.rangers:
        raise InputError(f"{name[:20]!r} is not a ranger here (expected one of {', '.join(records.rangers)})")
    row = next((each for each in state["rangers"] if each["name"] == name), {"name": name})
    place = next(each for each in site.rangers() if each["name"] == name)
    mirror = records.mirror_of(name)
    certificates = [certificate_object(records, mirror.zp, f"mirrors/{mirror.zp}.toml", mirror, at)]
    station: Object = {key: place[key] for key in "xyz"} | {"mirror": mirror.zp}
    if name in records.monuments:
        monument = records.monuments[name]
        certificates.append(certificate_object(records, name, f"monuments/{name}.toml", monument, at))
    zero = None
    commands: Object = {"mjd": [], "line": [], "reply": [], "ok": []}
    if history is not None:
        commands = last_commands(history, name, at)
        zero = last_zero(history, name, at)
    return row | {
        "kind": place["kind"],
        "station": station,
        "zero": zero,
        "servo": None,  # no journal holds the axes' following errors
        "certificates": certificates,
        "commands": commands,
    }


def last_zero(history: History, ranger: str, at: float) -> Object | None:
    """Zero of a ranger by the last epoch, m, and its u."""
    last = next(iter(history.latest_epochs(None, at, 1)), None)
    if last is None:
        return None
    zeros = history.solutions.solution(last["number"], run=last["run"])[1].answer.get("zeros") or {}
    value = zeros.get(ranger)
    return None if not value else {"epoch": last["number"], "value": number(value[0]), "u": number(value[1])}


def last_commands(history: History, ranger: str, at: float) -> Object:
    """Last commands sent to a ranger, without the questions that only keep the link alive; oldest first."""
    rows: list[Any] = []
    run = history.index.run(at=at)
    for stretch in history.index.stretches("commands", None, at, run=run.run):
        start = max(stretch.low, stretch.high - MOST_SEARCHED)
        asked = {"run": stretch.run, "low": start, "high": stretch.high, "ranger": ranger}
        with stretch.part.reading() as connection:
            rows += connection.execute(COMMANDS, asked | {"limit": LAST_COMMANDS - len(rows)})
        if len(rows) >= LAST_COMMANDS:
            break
    table = [
        (mjd_of(ticks), words(line), words(reply), None if ok is None else bool(ok))
        for ticks, line, reply, ok in reversed(rows)
    ]
    return columns(("mjd", "line", "reply", "ok"), table)
