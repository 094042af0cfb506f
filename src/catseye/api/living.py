"""`simulate` and `replay`: a whole site in virtual time beside its truth, and a journal's answers again."""

import asyncio
import math
import os
import signal
from collections.abc import Callable, Coroutine, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any

from catseye.aliases import Progress
from catseye.api.journal import journal_place, run_of
from catseye.api.live.limits import within
from catseye.api.live.serving import MOTION, OrderOptions, coordinator_orders, mjd_start, read_site_of, twin_options
from catseye.api.reading import place_of, with_structure
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError
from catseye.memory import uncollected

if TYPE_CHECKING:
    from astropy.table import QTable

    from catseye.coordinator.journal.reader import JournalReader
    from catseye.gateways.writers.passage import Passage
    from catseye.records.site.folder import SiteFolder
    from catseye.records.site.structural_model import StructuralModel
    from catseye.service.replay import ReplayOutcome
    from catseye.service.simulation import Simulation
    from catseye.service.world import TwinWords

NIGHT = 60_635.125  # MJD: 22 h at Green Bank, no Sun and no Moon that matter
UNTIL_READY = 5.0  # s that a twin takes to start: its faults' times count from about the first round on
MOST_MINUTES = 1e6


@dataclass(frozen=True, eq=False, repr=False)
class SimulationResult(Result):
    """A site simulated: what its coordinator measured beside the twin's truth.

    seconds      of the site's time, from the first round on
    epochs       one a solution, as `--json` has them: time, points, shots, how far from the truth
    simulation   everything else
    signal       number of the signal that ended it; 0 for none
    """

    seconds: float
    epochs: list[dict[str, Any]]
    simulation: "Simulation"
    signal: int = 0

    def passages(self) -> "Sequence[Passage]":
        """Shots, epochs, the truth, faults and troubles."""
        from catseye.gateways.writers.passage import Passage
        from catseye.service.objects import summary

        sim = self.simulation
        told = summary(sim.book, sim.world, sim.orders.journal, **sim.totals)
        return [Passage(title, text) for title, text in told]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye simulate --json`."""
        from catseye.service.objects import simulation_object

        sim = self.simulation
        return simulation_object(sim.book, sim.world, sim.orders.journal, **sim.totals)

    def tables(self) -> "dict[str, QTable]":
        """`epochs`: a row an epoch; rms from the truth and claimed u, where it was held against it."""
        columns = {
            "number": ([epoch["number"] for epoch in self.epochs], ""),
            "mjd": ([epoch["mjd"] for epoch in self.epochs], "d"),
            "shots": ([epoch["shots"] for epoch in self.epochs], ""),
            "rejected": ([epoch["rejected"] for epoch in self.epochs], ""),
            "rms": ([epoch.get("rms_mm", math.nan) for epoch in self.epochs], "mm"),
            "u": ([epoch.get("mean_u_mm", math.nan) for epoch in self.epochs], "mm"),
            "chi2_per_coordinate": ([epoch.get("chi2_per_coordinate", math.nan) for epoch in self.epochs], ""),
        }
        return {"epochs": quantities(columns)}


@with_units
def simulate(
    site: "str | os.PathLike[str] | SiteFolder" = "gbt",
    *,
    minutes: Annotated[Any, In("min", one=True)] = 1.0,
    seed: Annotated[Any, In("", whole=True)] = 1,
    motion: str = MOTION,
    conditions: str = "night",
    faults: Sequence[str] = (),
    structure: "str | os.PathLike[str] | StructuralModel | None" = None,
    start_mjd: Annotated[Any, In("mjd", one=True, text=True)] = NIGHT,
    cold: bool = False,
    journal: "str | os.PathLike[str] | None" = None,
    keep_buffers: bool = True,
    archive_samplers: "str | os.PathLike[str] | None" = None,
    archive_every_s: Annotated[Any, In("s", one=True)] = 60.0,
    round_s: Annotated[Any, In("s", one=True)] = 10.0,
    filter_: str = "random_walk",
    drop: Sequence[str] = (),
    port_base: Annotated[Any, In("", whole=True)] = 0,
    port: Annotated[Any, In("", whole=True)] = None,
    fast: bool = True,
    end_on_signals: bool = False,
    tell: "Callable[[str], None] | None" = None,
    screen: bool = False,
) -> SimulationResult:
    """A whole site simulated: twin, rangers, coordinator, its epochs compared with the truth.

    site             a site's folder, its bundled name, or what `load` returned
    minutes          of measuring; 0: until a signal, with `end_on_signals`
    seed             of every draw of the twin: the same seed is the same night
    motion           "fixed AZ EL", "track AZ EL", "slew AZ0 EL0 AZ1 EL1", "scan AZ EL WIDTH RATE" (degrees) or
                     "table FILE"
    conditions       the twin's weather: "night", "windy-day" or "dewy-night"
    faults           "KIND WHOM [START [END [SIZE]]]", as docs/living.md has them
    structure        structural model that bends the twin's telescope, known to the coordinator; the site's own
                     structural-model.toml without
    start_mjd        UTC at the twin's start, MJD or text
    cold             True for rangers just powered on: half a minute more
    journal          place of its journal: a new SQLite file, or postgresql://...; None for none
    keep_buffers     False to store no samples: no replay is exact then
    archive_samplers directory for FITS files of the coordinator's samplers, written while it runs; None for none
    archive_every_s  span of such a file, s, 5 to 3600
    round_s          length of a round, s, 2 to 600
    filter_          "random_walk" or "constant_velocity", from epoch to epoch
    drop             rangers to leave out
    port_base, port  of the twin and of the coordinator's clients; 0 or None for any free ports; none where `fast`
    fast             True for virtual time: as fast as it goes, the same each time. False for real time, with the twin
                     in another process, which reads the site itself
    end_on_signals   True to end at SIGINT or SIGTERM with what was measured until then; for programs, which call it
                     in their main thread
    tell             called with a line per epoch and warning
    screen           True for a screen on stderr instead

    Raises InputError for a site, fault or journal that cannot be used; ArgumentError for invalid arguments.
    """
    within("minutes", minutes, 0.0, MOST_MINUTES)
    if minutes == 0.0 and not end_on_signals:
        raise ArgumentError("minutes = 0 never ends (expected above 0, or end_on_signals)", "minutes", "end_on_signals")
    if not fast and not isinstance(site, str | os.PathLike):
        raise ArgumentError("site: the twin's process reads it (expected a folder, or fast)", "site", "fast")
    if not fast and structure is not None and not isinstance(structure, str | os.PathLike):
        raise ArgumentError("structure: the twin's process reads it (expected a file, or fast)", "structure", "fast")
    within("port_base", port_base, 0, 65_000)
    world = _world(mjd_start(start_mjd, NIGHT), twin_options(seed, motion, conditions, faults), fast)
    if isinstance(structure, str | os.PathLike):
        world = replace(world, structure=str(place_of(structure)))
    orders: OrderOptions = {
        "drop": drop,
        "round_s": round_s,
        "filter_": filter_,
        "journal": journal,
        "keep_buffers": keep_buffers,
        "archive_samplers": archive_samplers,
        "archive_every_s": archive_every_s,
        "port": 0 if port is None and (fast or port_base == 0) else port,
    }
    from catseye.service.display import view_of

    view = view_of(screen=screen, tell=tell)
    made: list[Simulation] = []

    def assembled() -> "Simulation":
        """The simulation; what it needs is imported and read here."""
        from catseye.service.simulation import Simulation

        given = coordinator_orders(**orders)
        records = with_structure(read_site_of(site) if isinstance(site, str | os.PathLike) else site, structure)
        made.append(Simulation(site=records, world=world, orders=given, minutes=minutes, view=view, warm=not cold))
        return made[0]

    async def work() -> None:
        from catseye.service.twin_process import TwinProcess, twin_arguments

        view.open(str(site) if isinstance(site, str | os.PathLike) else site.site.campaign.name)
        view.tell("starting the twin")
        if fast:
            await assembled().run_fast()
            return
        arguments = [*twin_arguments(str(site), world, port_base), *(["--cold"] if cold else [])]
        async with TwinProcess(arguments, progress=view.progress) as twin:
            twin.report(warned=lambda line: view.tell(f"twin: {line}"))
            with uncollected():
                simulation = await asyncio.to_thread(assembled)
            await simulation.run(twin)

    try:
        number = _run(work, fast, end_on_signals)
    finally:
        view.end()
    if number and not made:  # before there was anything to end in order: the signal acts as anywhere else
        signal.raise_signal(number)
    return _simulated(made[0] if made else assembled(), number)


def _simulated(simulation: "Simulation", number: int) -> SimulationResult:
    """Result of a simulation that has ended.

    number   of the signal that ended it; 0 for none
    """
    from catseye.service.objects import epoch_object, simulation_verdict

    return SimulationResult(
        verdict=simulation_verdict(simulation.book),
        seconds=simulation.seconds,
        epochs=[epoch_object(row, simulation.book.comparisons.get(row["number"])) for row in simulation.book.epochs],
        simulation=simulation,
        signal=number,
    )


def _world(begins: float, options: dict[str, Any], fast: bool) -> "TwinWords":
    """Options of the twin; in real time its faults count from about the first round on."""
    from catseye.service.world import TwinWords

    return TwinWords(begins, **options) if fast else TwinWords.starting_now(begins, **options).late(UNTIL_READY)


def _run(work: "Callable[[], Coroutine[Any, Any, None]]", fast: bool, end_on_signals: bool) -> int:
    """Number of the signal that ended the work; 0 for its own end.

    fast   True for a loop in virtual time

    Without signals it runs in a thread: a notebook's own loop is already running here.
    """
    from catseye.service.running import FastLoop, LiveRun

    loop_factory = FastLoop if fast else None
    if end_on_signals:
        run: LiveRun[None] = LiveRun(work, loop_factory=loop_factory)
        run.result()
        return run.signal

    def in_thread() -> None:
        with asyncio.Runner(loop_factory=loop_factory) as runner:
            runner.run(work())

    with ThreadPoolExecutor(1, "catseye-simulate") as pool:
        pool.submit(in_thread).result()
    return 0


@dataclass(frozen=True, eq=False, repr=False)
class ReplayResult(Result):
    """A journal's run reduced again.

    same        whether every number, reason code and status is the same to the last bit
    identical   whether the texts are, too
    shots       fed, and `same_shots` of them the same
    epochs      solved, and `same_epochs` of them the same
    outcome     everything else: how far each point moved, and by what
    """

    same: bool
    identical: bool
    shots: int
    same_shots: int
    epochs: int
    same_epochs: int
    outcome: "ReplayOutcome"

    def passages(self) -> "Sequence[Passage]":
        """The run, its epochs, and the points that moved most."""
        from catseye.gateways.writers.passage import Passage
        from catseye.service.replay import replay_passages

        return [Passage(title, text) for title, text in replay_passages(self.outcome)]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye replay --json`."""
        from catseye.service.replay import replay_object

        return replay_object(self.outcome)

    def tables(self) -> "dict[str, QTable]":
        """`moved`: a row a point, new less stored; `largest_u` is of a coordinate, in its stored u."""
        moved = sorted(self.outcome.moved.items())
        columns = {
            "point": ([name for name, _ in moved], ""),
            **{axis: ([m.mean_mm[k] for _, m in moved], "mm") for k, axis in enumerate(("dx", "dy", "dz"))},
            "largest": ([m.largest_mm for _, m in moved], "mm"),
            "largest_u": ([m.largest_u for _, m in moved], ""),
            "epochs": ([m.epochs for _, m in moved], ""),
        }
        return {"moved": quantities(columns)}


@with_units
def replay(
    journal: "str | os.PathLike[str] | JournalReader",
    *,
    run: Annotated[Any, In("", whole=True, text=True)] = None,
    calibrations: "str | os.PathLike[str] | None" = None,
    progress: Progress | None = None,
) -> ReplayResult:
    """A journal's run again: the same to the last bit, or how far this version or other calibrations move each point.

    journal        file, postgresql://USER@HOST/DATABASE, or what `load` gave
    run            number, or the beginning of its uuid; the last without
    calibrations   folder of other records to reduce with

    Raises InputError: no such journal, run or folder; a run that holds no epoch.
    """
    from catseye.service.replay import replayed

    other = None if calibrations is None else place_of(calibrations)
    outcome = replayed(journal_place(journal), run_of(run), other, progress=progress or (lambda *_: None))
    return ReplayResult(
        verdict=outcome.verdict,
        same=outcome.same,
        identical=outcome.identical,
        shots=outcome.shots,
        same_shots=outcome.same_shots,
        epochs=outcome.epochs,
        same_epochs=outcome.same_epochs,
        outcome=outcome,
    )
