"""`phase`: phase, amplitude and distortion of one buffer of samples."""

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
    from catseye.reduction.detection.buffer_phase import BufferPhase


@dataclass(frozen=True, eq=False, repr=False)
class PhaseResult(Result):
    """Phase of a buffer by three methods, with its harmonics.

    phase, u_phase           rad, by synchronous detection, at the first sample
    amplitude, u_amplitude   V
    buffer                   everything else: methods, harmonics, spectrum
    hashes                   SHA-256 of what was read, by name
    read                     what was read; None for an array
    """

    phase: float
    u_phase: float
    amplitude: float
    u_amplitude: float
    buffer: "BufferPhase"
    hashes: Mapping[str, str]
    read: Path | None

    def passages(self) -> "Sequence[Passage]":
        """Samples, phase with amplitude, and harmonics."""
        from catseye.gateways.detection.buffer_objects import buffer_passages

        return buffer_passages(self.buffer)

    def rows(self) -> Iterator[str]:
        """Methods side by side and harmonics as lines of text."""
        from catseye.gateways.detection.buffer_objects import buffer_rows

        return buffer_rows(self.buffer)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye phase --json`."""
        from catseye.gateways.detection.buffer_objects import buffer_object

        return buffer_object(self.buffer)

    def tables(self) -> "dict[str, QTable]":
        """`methods`: a row a method; `harmonics`: a row an order."""
        from catseye.gateways.detection.tables import HARMONICS, METHODS

        recipe = self.buffer
        return {
            "methods": quantities(METHODS.quantities(recipe.methods, [c.name for c in METHODS.columns])),
            "harmonics": quantities(HARMONICS.quantities(recipe.harmonics, [c.name for c in HARMONICS.columns])),
        }

    def figures(self) -> "dict[str, Figure]":
        """Cycle with fit, residual, spectrum and harmonics."""
        from catseye.gateways.detection.buffer_figures import buffer_figure

        return {"buffer": buffer_figure(self.buffer)}

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye phase --out`."""
        from catseye.gateways.detection.files import write_buffer

        write_buffer(self.buffer, directory, self.hashes, progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return dict(self.hashes)

    def sources(self) -> tuple[Path, ...]:
        """Files that were read, which `save` must not write over."""
        return () if self.read is None else (self.read,)


@with_units
def phase(
    buffer: Annotated[Any, In("V", text=True)],
    *,
    row: Annotated[Any, In("", whole=True)] = None,
    shot: Annotated[Any, In("", whole=True)] = None,
    sample_rate_hz: Annotated[Any, In("Hz", one=True)] = None,
    intermediate_hz: Annotated[Any, In("Hz", one=True)] = None,
    cycles: Annotated[Any, In("", whole=True)] = None,
    full_scale_volt: Annotated[Any, In("V", one=True)] = 10.0,
    bits: Annotated[Any, In("", whole=True)] = 16,
) -> PhaseResult:
    """Phase of one buffer by synchronous detection, crossings and spectrum.

    buffer            .npy, table or list of samples, or a campaign (docs/formats/buffer.md); or an array
    row               of a .npy of two dimensions, from 0
    shot              of a campaign, which says rate and converter itself
    sample_rate_hz    samples a second, a multiple of the signal's frequency; None: 64 a cycle
    intermediate_hz   frequency of the signal, Hz; None: 1000
    cycles            taken from the first on; None: all
    full_scale_volt   of the converter, V, from which on samples are clipped
    bits              of the converter, 8 to 24; whole numbers are its codes

    Raises InputError for samples that cannot be read; ArgumentError where rate, frequency and cycles do not fit them.

    >>> answer = phase("buffers/clipped.csv")
    >>> round(answer.amplitude, 1), answer.verdict.word
    (3.8, 'doubtful')
    """
    from catseye.records.night.buffer import buffer_of, read_buffer
    from catseye.reduction.detection.buffer_phase import buffer_phase

    where = None
    if isinstance(buffer, np.ndarray):
        recorded = buffer_of(buffer, row=row)
    else:
        where = place_of(buffer)
        recorded = read_buffer(where, row=row, shot=shot)
    recipe = buffer_phase(
        recorded,
        sample_rate_hz=sample_rate_hz,
        intermediate_hz=intermediate_hz,
        cycles=cycles,
        full_scale_volt=full_scale_volt,
        bits=bits,
    )
    first = recipe.methods[0]
    return PhaseResult(
        verdict=recipe.verdict,
        phase=first.phase,
        u_phase=first.u_phase,
        amplitude=first.amplitude,
        u_amplitude=first.u_amplitude,
        buffer=recipe,
        hashes=recorded.hashes,
        read=where,
    )
