"""`simulate_runs` and `replay_journals`: many simulated sites, and many journals again, side by side."""

import hashlib
import json
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from catseye.aliases import Progress
from catseye.api.journal import journal_place
from catseye.api.live.limits import within
from catseye.api.live.serving import MOTION, coordinator_orders, mjd_start, read_site_of, twin_options
from catseye.api.living import MOST_MINUTES, NIGHT, replay, simulate
from catseye.api.reading import DATABASES, place_of
from catseye.api.result import quantities, save
from catseye.api.scale.many import ManyResult
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError, InputError

if TYPE_CHECKING:
    from astropy.table import QTable

    from catseye.gateways.writers.passage import Passage
    from catseye.records.site.folder import SiteFolder
    from catseye.service.many.scatter import ScatterRow
    from catseye.service.many.unit import Unit

LEDGER = "ledger"  # folder of the output that is no run
MOST_RUNS = 100_000
LAST_SEED = 2**31
PROCESS = 250 * 2**20  # bytes of a process with its libraries
RANGER = 8 * 2**20  # bytes of a simulated ranger: cubes, buffers, its share of the solution
STATE = 14  # parameters of the solution a ranger: position, fixed point, zero, leakage, lines
COPIES = 6.0  # of the solution's covariance at once
JOURNAL = 4.0  # bytes of a replay's process for each of the journal's, at most ...
MOST_JOURNAL = 2**30  # ... and in all: it is read piece by piece


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedRuns(ManyResult):
    """Many simulated runs of a site, and their scatter against what they claim.

    scatter   of points and beam in the last epochs, in units of the claimed u
    """

    scatter: "tuple[ScatterRow, ...]" = ()

    def passages(self) -> "Sequence[Passage]":
        """Counts, times, the scatter, and each run that failed or is not good."""
        from catseye.gateways.writers.passage import Passage
        from catseye.service.many.scatter import scatter_text

        first, *others = super().passages()
        scatter = [Passage(f"Scatter of {row.quantity}", scatter_text(row)) for row in self.scatter]
        return [first, *scatter, *others]

    def tables(self) -> "dict[str, QTable]":
        """`runs`, a row a run, and `scatter`, a row a quantity."""
        rows = self.scatter
        columns = {
            "quantity": ([row.quantity for row in rows], ""),
            "runs": ([row.runs for row in rows], ""),
            "terms": ([row.terms for row in rows], ""),
            "ratio": ([row.ratio for row in rows], ""),
            "low": ([row.band[0] for row in rows], ""),
            "high": ([row.band[1] for row in rows], ""),
            "mean": ([row.mean for row in rows], ""),
        }
        return {**super().tables(), "scatter": quantities(columns)}


@with_units
def simulate_runs(
    site: "str | os.PathLike[str]" = "gbt",
    *,
    runs: Annotated[Any, In("", whole=True)] = 1,
    directory: "str | os.PathLike[str] | None" = None,
    minutes: Annotated[Any, In("min", one=True)] = 1.0,
    seed: Annotated[Any, In("", whole=True)] = 1,
    motion: str = MOTION,
    conditions: str = "night",
    faults: Sequence[str] = (),
    start_mjd: Annotated[Any, In("mjd", one=True, text=True)] = NIGHT,
    cold: bool = False,
    journal: str | None = None,
    keep_buffers: bool = True,
    round_s: Annotated[Any, In("s", one=True)] = 10.0,
    filter_: str = "random_walk",
    drop: Sequence[str] = (),
    processes: Annotated[Any, In("", whole=True)] = None,
    cluster: str | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> SimulatedRuns:
    """Many runs of a site in virtual time, with seeds from `seed` on, and their scatter against what they claim.

    site         a site's folder, or its bundled name
    runs         number of runs; run k has the seed `seed` + k, and is to the last bit what `simulate` gives with it
    directory    new, empty, or of an earlier call: DIRECTORY/seed-K is what `save(simulate(...), ...)` writes,
                 DIRECTORY/ledger what is done; None: nothing is written
    journal      name of an SQLite file in the folder of each run, its journal; None for none
    processes    of one thread each; None: as many as cores are free and memory allows
    cluster      "local" or a dask scheduler's address or file; None: processes of this machine
    resume       take from the ledger what an earlier call did with the same options; do what is missing
    progress     called with (what, done, of how many)
    minutes, motion, conditions, faults, start_mjd, cold, keep_buffers, round_s, filter_, drop   as of `simulate`

    A run that fails is a failed outcome with its reason and does not stop the others. Raises ArgumentError for invalid
    arguments, InputError for a site, a fault or a directory that cannot be used, StoppedError where the disk is full
    or the cluster is lost.
    """
    from catseye.service.many.run import run_many
    from catseye.service.many.scatter import scatter_of, scatter_verdict
    from catseye.service.many.summary import many_verdict

    _refuse_numbers(runs, seed, minutes)
    if journal is not None and (directory is None or Path(journal).name != journal or journal.startswith(".")):
        raise ArgumentError(
            f"journal = {journal!r} (expected a file's name without a folder, and directory: each run has its own)",
            "journal",
            "directory",
        )
    place = place_of(site)
    options: dict[str, Any] = {
        "minutes": minutes,
        "motion": motion,
        "conditions": conditions,
        "faults": list(faults),
        "start_mjd": mjd_start(start_mjd, NIGHT),
        "cold": cold,
        "keep_buffers": keep_buffers,
        "round_s": round_s,
        "filter_": filter_,
        "drop": list(drop),
    }
    records = _usable(place, options)
    where = _directory(directory, resume, place)
    key = _key("simulate", json.dumps([str(place), options, journal], sort_keys=True))
    inputs = (place, *([Path(motion.split(maxsplit=1)[1])] if motion.startswith("table ") else []))
    units = [
        _unit(
            f"seed-{seed + k}",
            _simulated,
            (str(place), seed + k, options, journal),
            where,
            key=key,
            memory=_memory_of(records),
            inputs=inputs,
        )
        for k in range(runs)
    ]
    outcomes = run_many(
        units,
        ledger=None if where is None else where / LEDGER,
        resume=resume,
        processes=processes,
        cluster=cluster,
        progress=progress,
        task="simulating runs",
    )
    rows = scatter_of([outcome.value for outcome in outcomes if outcome.value is not None])
    verdict = scatter_verdict(rows, many_verdict(outcomes, "run"))
    return SimulatedRuns(verdict=verdict, outcomes=tuple(outcomes), noun="run", scatter=rows)


@with_units
def replay_journals(
    journals: "Sequence[str | os.PathLike[str]]",
    directory: "str | os.PathLike[str] | None" = None,
    *,
    run: Annotated[Any, In("", whole=True, text=True)] = None,
    calibrations: "str | os.PathLike[str] | None" = None,
    processes: Annotated[Any, In("", whole=True)] = None,
    cluster: str | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> ManyResult:
    """Many journals' runs again, side by side: the same to the last bit, or how far each point moves.

    journals       files, or postgresql://USER@HOST/DATABASE; no two of one name and folder name
    directory      new, empty, or of an earlier call: DIRECTORY/NAME is what `save(replay(journal), ...)` writes,
                   DIRECTORY/ledger what is done; None: nothing is written
    run            number, or the beginning of its uuid, in each; the last of each without
    calibrations   folder of other records to reduce with
    processes      of one thread each; None: as many as cores are free and memory allows
    cluster        "local" or a dask scheduler's address or file; None: processes of this machine
    resume         take from the ledger what an earlier call did with the same files; a database's run is done again
    progress       called with (what, done, of how many)

    A journal that cannot be replayed is a failed outcome with its reason and does not stop the others. Raises
    ArgumentError for two journals of one name, InputError for a directory that cannot be used, StoppedError where the
    disk is full or the cluster is lost.
    """
    from catseye.service.many.run import run_many
    from catseye.service.many.summary import many_verdict

    if not journals:
        raise ArgumentError("journal: none (expected at least one)", "journal")
    places = [journal_place(journal) for journal in journals]
    other = None if calibrations is None else place_of(calibrations)
    files = [Path(place) for place in places if not place.startswith(DATABASES)]
    where = _directory(directory, resume, *files, *([] if other is None else [other]))
    key = _key("replay", json.dumps([run, None if other is None else str(other)]))
    units: dict[str, Unit] = {}
    for place, name in zip(places, _journal_names(places), strict=True):
        if name in units or name == LEDGER:
            raise ArgumentError(
                f"journal {place}: its name {name!r} is taken (expected different names, or one at a time)", "journal"
            )
        stored = not place.startswith(DATABASES)
        units[name] = _unit(
            name,
            _replayed,
            (place, run, None if other is None else str(other)),
            where,
            key=key if stored else _key(key, os.urandom(16).hex()),
            memory=_memory_of_journal(place),
            inputs=(*([Path(place)] if stored else []), *([] if other is None else [other])),
        )
    outcomes = run_many(
        list(units.values()),
        ledger=None if where is None else where / LEDGER,
        resume=resume,
        processes=processes,
        cluster=cluster,
        progress=progress,
        task="replaying journals",
    )
    return ManyResult(verdict=many_verdict(outcomes, "journal"), outcomes=tuple(outcomes), noun="journal")


def _unit(name: str, work: Any, arguments: tuple[Any, ...], where: Path | None, **others: Any) -> "Unit":
    """Unit whose folder of the output, if there is one, is its last argument."""
    from catseye.gateways.writers.output import refuse_output
    from catseye.service.many.unit import Unit

    out = None if where is None else where / name
    if out is not None and out.parent.is_dir():
        refuse_output(out, *others["inputs"])
    return Unit(name=name, work=work, arguments=(*arguments, None if out is None else str(out)), output=out, **others)


def _simulated(site: str, seed: int, options: dict[str, Any], journal: str | None, out: str | None) -> dict[str, Any]:
    """Value of one simulated run, whose files are written whole first."""
    from catseye.gateways.writers.output import atomic_directory
    from catseye.gateways.writers.written import add_output
    from catseye.reduction.live.live import LiveSettings
    from catseye.service.many.scatter import last_epoch

    if out is None:
        result = simulate(site, seed=seed, **options)
    else:
        with atomic_directory(Path(out), Path(site)) as fresh:
            place = None if journal is None else fresh / journal
            result = simulate(site, seed=seed, journal=place, **options)
            result.write(fresh)
            if journal is not None:
                add_output(fresh, journal)
    answer = result.to_object()
    numbers = {key: answer[key] for key in ("seconds", "shots", "used", "rejected", "epochs", "found")}
    return {
        "verdict": answer["verdict"],
        "seed": seed,
        "shots": answer["shots"],
        "used": answer["used"],
        "epochs": len(answer["epochs"]),
        **last_epoch(answer["epochs"], LiveSettings().reference_after),
        "digest": _digest(numbers),
        "out": out,
    }


def _replayed(journal: str, run: int | str | None, calibrations: str | None, out: str | None) -> dict[str, Any]:
    """Value of one journal's run again, whose files are written whole first."""
    result = replay(journal, run=run, calibrations=calibrations)
    if out is not None:
        save(result, out)
    answer = result.to_object()
    moved = [point["largest_mm"] for point in answer["points"].values()]
    keys = ("verdict", "run", "uuid", "site", "epochs", "epochs_same", "shots", "shots_same", "same", "identical")
    return {
        **{key: answer[key] for key in keys},
        "cause": answer["cause"] or "",
        "largest_mm": max(moved, default=0.0),
        "digest": _digest({key: value for key, value in answer.items() if key not in ("versions", "calibrations")}),
        "out": out,
    }


def _usable(place: Path, options: dict[str, Any]) -> "SiteFolder":
    """Records of the site, after what all runs share was tried.

    Raises InputError for a site, a motion, a fault or a ranger that cannot be used.
    """
    from catseye.service.world import TwinWords

    records = read_site_of(place)
    twin = twin_options(1, options["motion"], options["conditions"], options["faults"])
    TwinWords(options["start_mjd"], **twin).twin(records)
    coordinator_orders(drop=options["drop"], round_s=options["round_s"], filter_=options["filter_"])
    if strange := sorted(set(options["drop"]) - set(records.rangers)):
        raise InputError(f"drop {strange[0]}: unknown ranger (expected one of {', '.join(records.rangers)})")
    return records


def _refuse_numbers(runs: int, seed: int, minutes: float) -> None:
    within("runs", runs, 1, MOST_RUNS)
    within("seed", seed, 0, LAST_SEED)
    within("seed + runs", seed + runs - 1, 0, LAST_SEED)
    within("minutes", minutes, 0.0, MOST_MINUTES)
    if minutes == 0.0:
        raise ArgumentError("minutes = 0 never ends (expected above 0)", "minutes")


def _directory(directory: "str | os.PathLike[str] | None", resume: bool, *sources: Path) -> Path | None:
    """Folder of the output, made; None without one.

    Raises ArgumentError for `resume` without it, InputError where it is an input or another's.
    """
    from catseye.service.many.nights import refuse_directory

    if directory is None:
        if resume:
            raise ArgumentError("resume: nothing is stored (expected directory, too)", "resume", "directory")
        return None
    where = Path(directory)
    refuse_directory(where, sources)
    where = where.resolve()
    where.mkdir(exist_ok=True)
    return where


def _memory_of(site: "SiteFolder") -> int:
    """Memory that a simulation takes, bytes, by its number of rangers."""
    count = len(site.rangers)
    return int(PROCESS + RANGER * count + COPIES * 8.0 * (STATE * count) ** 2)


def _memory_of_journal(place: str) -> int:
    """Memory that a replay takes, bytes, by the size of the journal's file."""
    try:
        return int(PROCESS + min(JOURNAL * os.stat(place).st_size, MOST_JOURNAL))
    except OSError:
        return PROCESS + MOST_JOURNAL


def _journal_names(places: Sequence[str]) -> list[str]:
    """Names of journals: of a file without the ending, or of a database; with its folder's where two have the same.

    >>> _journal_names(["nights/site-1.db", "postgresql://zy@host/site"])
    ['site-1', 'site']
    >>> _journal_names(["runs/seed-1/n.db", "runs/seed-2/n.db"])
    ['seed-1-n', 'seed-2-n']
    """
    paths = [Path(place.partition("?")[0]) for place in places]
    counts = Counter(path.stem for path in paths)
    return [path.stem if counts[path.stem] == 1 else f"{path.parent.name}-{path.stem}" for path in paths]


def _key(*texts: str) -> str:
    from catseye.version import __version__

    return hashlib.sha256("\n".join((*texts, __version__)).encode()).hexdigest()


def _digest(answer: Any) -> str:
    """SHA-256 of an answer's JSON, floats to the last bit."""
    from catseye.gateways.writers.objects import json_line

    return hashlib.sha256(json_line(answer).encode()).hexdigest()
