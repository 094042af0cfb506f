"""`cycles`: lengths and whole cycles from phases at several modulation frequencies."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.detection.cycle_lengths import CycleLengths


@dataclass(frozen=True, eq=False, repr=False)
class CyclesResult(Result):
    """Lengths of n shots from several frequencies each.

    length, u_length   (n,) m in air; nan where unknown
    slip_probability   (n,) of wrong whole cycles
    status             (n,) found, ambiguous, misfit or unknown
    lengths            everything else: cycles, candidates, frequencies
    hashes             SHA-256 of the table, by its name
    read               the table
    """

    length: np.ndarray
    u_length: np.ndarray
    slip_probability: np.ndarray
    status: tuple[str, ...]
    lengths: "CycleLengths"
    hashes: Mapping[str, str]
    read: Path

    def passages(self) -> "Sequence[Passage]":
        """Frequencies with the lengths they separate, and the least sure shot."""
        from catseye.gateways.detection.cycle_objects import cycle_passages

        return cycle_passages(self.lengths)

    def rows(self) -> Iterator[str]:
        """Each shot as a line of text."""
        from catseye.gateways.detection.cycle_objects import cycle_rows

        return cycle_rows(self.lengths)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye cycles --json`."""
        from catseye.gateways.detection.cycle_objects import cycle_object

        return cycle_object(self.lengths)

    def tables(self) -> "dict[str, QTable]":
        """`lengths`: a row a shot."""
        from catseye.gateways.detection.tables import LENGTHS

        return {"lengths": quantities(LENGTHS.quantities(self.lengths.shots, [c.name for c in LENGTHS.columns]))}

    def figures(self) -> "dict[str, Figure]":
        """Every length of the least sure shot, and the probability of wrong cycles of all."""
        from catseye.gateways.detection.cycle_objects import cycle_figure

        return {"cycles": cycle_figure(self.lengths)}

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye cycles --out`."""
        from catseye.gateways.detection.files import write_cycles

        write_cycles(self.lengths, directory, self.hashes, progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the table of phases, by its name."""
        return dict(self.hashes)

    def sources(self) -> tuple[Path, ...]:
        """The table, which `save` must not write over."""
        return (self.read,)


@with_units
def cycles(
    table: "str | os.PathLike[str]",
    *,
    shortest: Annotated[Any, In("m", one=True)] = 5.0,
    longest: Annotated[Any, In("m", one=True)] = 200.0,
    group_index: Annotated[Any, In("", one=True)] = 1.0,
) -> CyclesResult:
    """Whole cycles and lengths from phases at several modulations.

    table               of phases: shot, modulation_hz, phase_rad, u_phase_rad (docs/formats/cycles.md)
    shortest, longest   possible lengths, m, between which nothing else is known
    group_index         of the air; 1 gives optical lengths

    Raises InputError for a bad table; ArgumentError where the frequencies confuse lengths between the limits.

    >>> answer = cycles("cycles/three-frequencies.csv", group_index=1.000253)
    >>> answer.verdict.word, round(float(answer.length[0]), 3)
    ('good', 23.457)
    """
    from catseye.records.night.phase_table import read_phases
    from catseye.reduction.detection.cycle_lengths import cycle_lengths

    where = place_of(table)
    rows, hashes = read_phases(where)
    recipe = cycle_lengths(rows, shortest=shortest, longest=longest, group_index=group_index)
    return CyclesResult(
        verdict=recipe.verdict,
        length=np.array([s.length for s in recipe.shots]),
        u_length=np.array([s.u_length for s in recipe.shots]),
        slip_probability=np.array([s.slip_probability for s in recipe.shots]),
        status=tuple(s.status for s in recipe.shots),
        lengths=recipe,
        hashes=hashes,
        read=where,
    )
