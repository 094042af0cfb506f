"""`plan`: a network before it is measured."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.network_source import hashes_of, network_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import MILLIMETRE
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.api.network_source import NetworkSource
    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.reduction.network.plan import Chunk, PlannedNetwork


@dataclass(frozen=True, eq=False, repr=False)
class PlanResult(Result):
    """Plan of a network of n points.

    planned   the recipe's answer: weak directions, worth of observations, candidates, schedule, Monte Carlo
    path      that was read; None where a network or arrays were given
    ledger    of the Monte Carlo, no longer needed once this is saved
    """

    planned: "PlannedNetwork"
    path: Path | None
    ledger: Path | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the points, in the order of the file."""
        return self.planned.predicted.names

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainties (n, 3) m, predicted."""
        return self.planned.predicted.u

    @property
    def covariances(self) -> np.ndarray:
        """Covariances (n, 3, 3) m², predicted."""
        return self.planned.predicted.covariance

    @property
    def mean_u(self) -> float:
        """Root mean square, m, over the points that matter."""
        return self.planned.plan.mean_u

    def passages(self) -> "Sequence[Passage]":
        """Sentences on worth, weak points and further ranges."""
        from catseye.gateways.network.plan import plan_passages

        return plan_passages(self.planned)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye plan --json`."""
        from catseye.gateways.network.plan import plan_object

        return plan_object(self.planned)

    def tables(self) -> "dict[str, QTable]":
        """`points`: a row a point; `candidates`: further ranges, the best first."""
        axes = self.planned.predicted.network.axis_names
        points = {
            "point": (self.names, ""),
            **{f"u_{axis}": (self.u[:, k] / MILLIMETRE, "mm") for k, axis in enumerate(axes)},
            "longest_axis": (self.planned.plan.weakest / MILLIMETRE, "mm"),
            "detectable": (self.planned.detectable / MILLIMETRE, "mm"),
        }
        further = self.planned.plan.candidates
        columns = {
            "from": ([c.from_ for c in further], ""),
            "to": ([c.to for c in further], ""),
            "gain": ([1e6 * c.gain for c in further], "um"),
            "mean_u": ([1e3 * c.mean_u for c in further], "mm"),
        }
        return {"points": quantities(points), "candidates": quantities(columns)}

    def figures(self) -> "dict[str, Figure]":
        """Plan and elevation with the predicted ellipsoids."""
        from catseye.gateways.network.figures import network_figures

        drawn = network_figures(self.planned.predicted)
        return {name: drawn[name].figure for name in ("plan", "elevation") if name in drawn}

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.network.plan import plan_report

        return plan_report(self.planned, when, self.inputs())

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye plan --out`, and remove the ledger of the Monte Carlo."""
        from catseye.gateways.network.plan import write_plan

        write_plan(self.planned, directory, self.inputs(), progress=progress)
        if self.ledger is not None:
            from catseye.service.many.ledger import remove

            remove(self.ledger)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the network's file or tables."""
        return hashes_of(self.path)

    def sources(self) -> tuple[Path, ...]:
        """The network's file or folder."""
        return () if self.path is None else (self.path,)


@with_units
def plan(
    network: "NetworkSource",
    *,
    datum: str | None = None,
    interest: Sequence[str] | None = None,
    budget_s: Annotated[Any, In("s", one=True)] = None,
    shot_s: Annotated[Any, In("s", one=True)] = 5.0,
    most: Annotated[Any, In("", whole=True)] = 20,
    runs: Annotated[Any, In("", whole=True)] = 0,
    seed: Annotated[Any, In("", whole=True)] = 1,
    air_ppm: Annotated[Any, In("ppm", one=True)] = 0.0,
    station_ppm: Annotated[Any, In("ppm", one=True)] = 0.0,
    refraction: Annotated[Any, In("", one=True)] = 0.0,
    blunders_percent: Annotated[Any, In("percent", one=True)] = 0.0,
    sigma_mm: Annotated[Any, In("mm", one=True)] = None,
    sigma_ppm: Annotated[Any, In("ppm", one=True)] = None,
    processes: Annotated[Any, In("", whole=True)] = None,
    cluster: str | None = None,
    resume: bool = False,
    ledger: "str | os.PathLike[str] | None" = None,
    progress: Progress | None = None,
) -> PlanResult:
    """Predicted quality of a network, and best further ranges.

    network    as for `adjust`; observed values are not used, and may be missing: an empty cell, no column `distance`,
               no value in TOML. What of a sigma grows with the distance follows the planned one
    datum      as for `adjust`
    interest   points that matter; all that are not held without
    budget_s   time of every ranger for further ranges, s: gives a schedule
    shot_s     time of one range, s
    most       further ranges to list
    runs       times to measure the network on paper, with the generator of `seed` and
    air_ppm, station_ppm   scale errors of all ranges together and of each station's (1 sigma)
    refraction             spread of the coefficient k of refraction (1 sigma)
    blunders_percent       share of gross errors, which are then searched for and left out
    sigma_mm, sigma_ppm    as for `adjust`
    processes  for the runs, of one thread each; None: as many as cores are free, and none for runs of a few seconds
    cluster    "local" or a dask scheduler's address or file, for the runs; None: this machine
    resume     take from the ledger what an earlier call did of the same runs
    ledger     folder of what is done of the runs; `save` removes it. None: nothing stays
    progress   called with (what, done, of how many)

    The runs are the same on any number of processes, to the last bit. Raises InputError for a file that cannot be used,
    EstimationError where the network floats, and StoppedError where the disk is full or the cluster is lost.
    """
    from catseye.reduction.network.plan import MonteCarloOptions, PlanOptions, planned

    if resume and ledger is None:
        raise ArgumentError("resume needs ledger: the folder of an earlier call", "resume", "ledger")
    place = None if ledger is None else Path(ledger)
    read, path = network_of(network, sigma_mm, sigma_ppm, planned=True)
    monte_carlo = MonteCarloOptions(
        runs=runs,
        seed=seed,
        air_ppm=air_ppm,
        station_ppm=station_ppm,
        refraction=refraction,
        blunders=blunders_percent / 100.0,
    )
    options = PlanOptions(
        datum=datum, interest=interest, budget_s=budget_s, shot_s=shot_s, most=most, monte_carlo=monte_carlo
    )

    def run(chunks: "Sequence[Chunk]") -> list[dict[str, Any]]:
        from catseye.service.many.chunks import run_chunks

        return run_chunks(chunks, ledger=place, resume=resume, processes=processes, cluster=cluster, progress=progress)

    apart = processes is not None or cluster is not None
    found = planned(read, options, run=run, apart=apart, progress=progress)
    return PlanResult(verdict=found.verdict, planned=found, path=path, ledger=place)
