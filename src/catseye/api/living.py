"""`simulate` and `replay`: a whole site in virtual time beside its truth, and a journal's answers again."""

import asyncio
import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from catseye.aliases import Progress
from catseye.api.journal import journal_place, run_of
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.errors import InputError

if TYPE_CHECKING:
    from astropy.table import QTable

    from catseye.coordinator.journal.reader import JournalReader
    from catseye.gateways.writers.passage import Passage
    from catseye.records.site.folder import SiteFolder
    from catseye.service.replay import ReplayOutcome
    from catseye.service.simulation import Simulation

NIGHT = 60_635.125  # MJD: 22 h at Green Bank, no Sun and no Moon that matter


@dataclass(frozen=True, eq=False, repr=False)
class SimulationResult(Result):
    """A site simulated: what its coordinator measured beside the twin's truth.

    seconds      of the site's time, from the first round on
    epochs       one a solution, as `--json` has them: time, points, shots, how far from the truth
    simulation   everything else
    """

    seconds: float
    epochs: list[dict[str, Any]]
    simulation: "Simulation"

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
    motion: str = "track 145.3 45",
    conditions: str = "night",
    faults: Sequence[str] = (),
    start_mjd: Annotated[Any, In("mjd", one=True)] = NIGHT,
    journal: "str | os.PathLike[str] | None" = None,
    round_s: Annotated[Any, In("s", one=True)] = 10.0,
    drop: Sequence[str] = (),
) -> SimulationResult:
    """A whole site in virtual time: twin, rangers, coordinator, its epochs held against the truth.

    site         a site's folder, its bundled name, or what `load` gave
    minutes      of measuring
    seed         of every draw of the twin: the same seed is the same night
    motion       "fixed AZ EL", "track AZ EL", "slew AZ0 EL0 AZ1 EL1", "scan AZ EL WIDTH RATE" (degrees), "table FILE"
    conditions   the twin's weather: "night" and so on, as `catseye simulate --conditions`
    faults       "KIND WHOM [START [END [SIZE]]]", as docs/living.md has them
    start_mjd    UTC at the twin's start
    journal      where all that happens is kept: a new SQLite file, or postgresql://...
    round_s      length of a round, s
    drop         rangers to leave out

    Raises InputError for a site, motion, fault or journal that cannot be used.
    """
    from catseye.gateways.examples import example
    from catseye.records.site.folder import SiteFolder, read_site
    from catseye.service.coordinator import Orders
    from catseye.service.objects import epoch_object, simulation_verdict
    from catseye.service.running import FastLoop
    from catseye.service.screen import SilentView
    from catseye.service.simulation import Simulation
    from catseye.service.world import TwinWords

    if not 0.0 < minutes <= 1e4:
        raise InputError(f"minutes = {minutes:g} (expected above 0 to 10000)")
    records = site if isinstance(site, SiteFolder) else read_site(place_of(site))
    world = TwinWords(start_mjd, seed=seed, motion=motion, conditions=conditions, faults=tuple(faults))
    orders = Orders(
        drop=tuple(name.upper() for name in drop),
        round_s=round_s,
        journal=None if journal is None else str(journal),
        port=0,
    )
    name = str(example("gbt") if site == "gbt" else records.directory)
    simulation = Simulation(records, name, world, orders, minutes, SilentView(), port_base=0, warm=True)
    _in_thread(simulation, FastLoop)
    return SimulationResult(
        simulation_verdict(simulation.book),
        simulation.seconds,
        [epoch_object(row, simulation.book.comparisons.get(row["number"])) for row in simulation.book.epochs],
        simulation,
    )


def _in_thread(simulation: "Simulation", loop_factory: Any) -> None:
    """Run it to its end in a thread of its own: a notebook's own loop is already running here."""

    def work() -> None:
        with asyncio.Runner(loop_factory=loop_factory) as runner:
            runner.run(simulation.run_fast())

    with ThreadPoolExecutor(1, "catseye-simulate") as pool:
        pool.submit(work).result()


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
