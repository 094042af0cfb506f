"""Time series and dropped channels of the last hour, where no journal is watched."""

from collections.abc import Sequence

import numpy as np

from catseye.coordinator.firing import GOOD
from catseye.errors import InputError
from catseye.records.night.live import TICKS_PER_DAY
from catseye.service.watch.entries import POSTURE, Object
from catseye.service.watch.recent import RecentPast
from catseye.service.watch.series import (
    EPOCH_VALUES,
    GAP_S,
    POSTURE_VALUES,
    SHOT_VALUES,
    STATION_VALUES,
    Columns,
    binned,
    columns_of,
    require_series,
)
from catseye.service.watch.site_map import SiteMap

SHOT_KEYS = {"range": "range", "correction": "misfit"}


def recent_series(
    past: RecentPast, names: Sequence[str], since: float | None, until: float | None, most: int
) -> Object:
    """Series by name of the last hour.

    Raises InputError for a name that needs a journal.
    """
    require_series(names, most)
    rows = []
    for name in names:
        label, unit, columns = _columns(past, name)
        chosen = np.ones(len(columns.mjd), dtype=bool) if since is None else columns.mjd >= since
        chosen &= True if until is None else columns.mjd <= until
        part = Columns(*(None if column is None else column[chosen] for column in columns))  # type: ignore[arg-type]
        rows.append({"name": name, "label": label, "unit": unit} | binned(part, most))
    return {"names": rows, "gaps": GAP_S}


def _columns(past: RecentPast, name: str) -> tuple[str, str, Columns]:
    kind, _, of = name.partition(":")
    ranger, _, target = of.partition(":")
    if kind in SHOT_KEYS and target:
        key, (label, unit) = SHOT_KEYS[kind], SHOT_VALUES[kind][2:]
        shots = (s for s in past.shots() if (s["ranger"], s["target"]) == (ranger, target) and s["status"] in GOOD)
        return f"{label} {ranger} {target}", unit, columns_of((s["mjd"], s[key], s["u_range"]) for s in shots)
    if kind in STATION_VALUES and of:
        key, label, unit = STATION_VALUES[kind]
        reads = (r for r in list(past.readings) if r["station"] == of)
        return f"{label} {of}", unit, columns_of((r["mjd"], r[key], None) for r in reads)
    if name in POSTURE_VALUES:
        at = POSTURE.index(name)
        return POSTURE_VALUES[name][1], "rad", columns_of((row[0], row[at], None) for row in past.postures())
    if name in EPOCH_VALUES:
        key, label, unit = EPOCH_VALUES[name]
        return label, unit, columns_of((e["mjd"], e[key], None) for e in list(past.epochs))
    raise InputError(f"{name[:60]!r} is not a series in memory (expected a name of series/names, or a journal)")


def recent_names(past: RecentPast) -> Object:
    """Names of the series of the last hour, with labels and units."""
    lines = sorted({(s["ranger"], s["target"]) for s in past.shots() if s["status"] == "used"})
    names = [f"{kind}:{ranger}:{target}" for ranger, target in lines for kind in SHOT_KEYS]
    stations = sorted({read["station"] for read in list(past.readings)})
    names += [f"{kind}:{station}" for station in stations for kind in STATION_VALUES]
    rows = []
    for name in (*names, *POSTURE_VALUES, *EPOCH_VALUES):
        kind, _, of = name.partition(":")
        label, unit = _words(kind)
        rows.append({"name": name, "label": f"{label} {of.replace(':', ' ')}".strip(), "unit": unit})
    return {"names": rows}


def _words(kind: str) -> tuple[str, str]:
    """Label and unit of a kind of series."""
    if kind in SHOT_VALUES:
        return SHOT_VALUES[kind][2:]
    if kind in STATION_VALUES:
        return STATION_VALUES[kind][1:]
    return (POSTURE_VALUES[kind][1], "rad") if kind in POSTURE_VALUES else EPOCH_VALUES[kind][1:]


def recent_dropped(past: RecentPast, site: SiteMap, since: float | None, until: float | None, bins: int) -> Object:
    """Good and failed shots of each ranger in the last hour, in bins of equal time."""
    if not 1 <= bins <= 1000:
        raise InputError(f"bins = {bins} (expected 1 to 1000)")
    shots = [s for s in past.shots() if _within(s["mjd"], since, until)]
    rangers = list(site.site.rangers)
    good, every = (np.zeros((len(rangers), bins), dtype=int) for _ in range(2))
    first = shots[0]["mjd"] if since is None and shots else since or past.since / TICKS_PER_DAY
    last = shots[-1]["mjd"] if until is None and shots else until or first
    width = max(1.0 / TICKS_PER_DAY, (last - first) / bins * (1.0 + 1e-9))
    for shot in shots:
        place = int((shot["mjd"] - first) / width)
        if shot["ranger"] in rangers and 0 <= place < bins:
            row = rangers.index(shot["ranger"])
            good[row, place] += shot["status"] in GOOD
            every[row, place] += 1
    return {
        "rangers": rangers,
        "bins": [first + k * width for k in range(bins)],
        "width": width,
        "good": good.tolist(),
        "failed": (every - good).tolist(),
    }


def _within(mjd: float, since: float | None, until: float | None) -> bool:
    return (since is None or mjd >= since) and (until is None or mjd <= until)
