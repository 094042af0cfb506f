"""`reduce_nights`, and what all functions for many units answer with."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError
from catseye.names import NOTES_AIR_MODEL

if TYPE_CHECKING:
    from astropy.table import QTable

    from catseye.gateways.writers.passage import Passage
    from catseye.service.many.unit import UnitOutcome


@dataclass(frozen=True, eq=False, repr=False)
class ManyResult(Result):
    """Outcomes of many units of work, in the order in which they were asked for.

    outcomes   of each unit: name, state ("done", "resumed", "failed"), why, value, seconds
    noun       that names a unit: "night", "run"
    """

    outcomes: "tuple[UnitOutcome, ...]"
    noun: str = "unit"

    @property
    def failures(self) -> "tuple[UnitOutcome, ...]":
        """Outcomes of the units that failed."""
        return tuple(outcome for outcome in self.outcomes if outcome.state == "failed")

    @property
    def table(self) -> "QTable":
        """A row a unit: name, state, why, seconds, verdict, and each single value that the units give."""
        return self.to_table()

    def passages(self) -> "Sequence[Passage]":
        """Counts, times, and each unit that failed or is not good, with its reason."""
        from catseye.service.many.summary import many_passages

        return many_passages(self.outcomes, self.noun)

    def to_object(self) -> Any:
        """JSON list of the command, an object a unit."""
        return [
            {"name": outcome.name, "state": outcome.state, "why": outcome.why, **(outcome.value or {})}
            for outcome in self.outcomes
        ]

    def tables(self) -> "dict[str, QTable]":
        """`nights`, `runs` and so on: a row a unit; a failed one has NaN and empty cells."""
        from catseye.service.many.summary import outcome_verdict

        columns: dict[str, tuple[Any, str]] = {
            "name": ([outcome.name for outcome in self.outcomes], ""),
            "state": ([outcome.state for outcome in self.outcomes], ""),
            "why": ([outcome.why for outcome in self.outcomes], ""),
            "seconds": ([outcome.seconds for outcome in self.outcomes], "s"),
            "verdict": ([outcome_verdict(outcome).word for outcome in self.outcomes], ""),
        }
        values = [outcome.value or {} for outcome in self.outcomes]
        for name in dict.fromkeys(name for value in values for name in value):
            column = [value.get(name) for value in values]
            if name not in columns and all(entry is None or isinstance(entry, str | int | float) for entry in column):
                columns[name] = (_column(column), "")
        return {f"{self.noun}s": quantities(columns)}


@with_units
def reduce_nights(
    nights: "Sequence[str | os.PathLike[str]]",
    directory: "str | os.PathLike[str]",
    *,
    air_model: str = NOTES_AIR_MODEL,
    processes: Annotated[Any, In("", whole=True)] = None,
    cluster: str | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> ManyResult:
    """Many nights reduced side by side, each into a folder of its own.

    nights      directories of campaigns, or bundled names; no two of one name
    directory   new, empty, or of an earlier call: DIRECTORY/NAME is what `save(reduce(night), ...)` writes,
                DIRECTORY/ledger what is done
    air_model   formula for the index of air; the working notes' without
    processes   of one thread each; None: as many as cores are free and memory allows
    cluster     "local" or a dask scheduler's address or file; None: processes of this machine
    resume      take what an earlier call did of the same files with the same options; do what is missing
    progress    called with (what, done, of how many)

    A night that cannot be reduced is a failed outcome with its reason and does not stop the others. x, u and
    covariance do not depend on the number of processes nor on where they run, to the last bit; `digest` of each
    outcome says so. Raises ArgumentError for two nights of one name, InputError for a directory that is an input or
    holds what catseye did not write, StoppedError where the disk is full or the cluster is lost.
    """
    from catseye.service.many.nights import LEDGER, night_units, refuse_directory
    from catseye.service.many.run import run_many
    from catseye.service.many.summary import many_verdict

    if not nights:
        raise ArgumentError("nights: none (expected at least one)", "nights")
    sources, where = [place_of(night) for night in nights], Path(directory)
    refuse_directory(where, sources)
    where = where.resolve()
    units = night_units(sources, where, air_model=air_model)
    where.mkdir(exist_ok=True)
    outcomes = run_many(
        units,
        ledger=where / LEDGER,
        resume=resume,
        processes=processes,
        cluster=cluster,
        progress=progress,
        task="reducing nights",
    )
    return ManyResult(verdict=many_verdict(outcomes, "night"), outcomes=tuple(outcomes), noun="night")


def _column(values: Sequence[Any]) -> list[Any]:
    """Column of a table: text, or numbers with NaN where there is none."""
    if any(isinstance(value, str) for value in values):
        return ["" if value is None else str(value) for value in values]
    return [float("nan") if value is None else value for value in values]
