"""The command of one buffer."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.results import Strict, tell


@app.command(
    epilog="\b\nExample: catseye phase examples/buffers/clipped.csv --out clipped\n"
    "Example: catseye phase examples/night-01 --shot 120\n"
    "Layouts of BUFFER: catseye help formats/buffer"
)
def phase(  # noqa: PLR0913 - its options are its command line
    buffer: Annotated[
        Path, typer.Argument(metavar="BUFFER", help="A .npy file, a table or list of samples, or a campaign.")
    ],
    row: Annotated[int | None, typer.Option("--row", min=0, help="Row of a .npy of several buffers, from 0.")] = None,
    shot: Annotated[int | None, typer.Option("--shot", min=0, help="Number of a campaign's shot.")] = None,
    sample_rate_hz: Annotated[
        float | None, typer.Option("--sample-rate-hz", help="Samples a second; 64 a cycle if not given.")
    ] = None,
    intermediate_hz: Annotated[
        float | None, typer.Option("--intermediate-hz", help="Frequency of the signal, Hz; 1000 if not given.")
    ] = None,
    cycles: Annotated[
        int | None, typer.Option("--cycles", min=1, help="Cycles that are taken, from the first on; all if not given.")
    ] = None,
    full_scale_volt: Annotated[
        float, typer.Option("--full-scale-volt", help="Full scale of the converter, V; of a campaign its own.")
    ] = 10.0,
    bits: Annotated[int, typer.Option("--bits", help="Resolution of the converter, 8 to 24 bits.")] = 16,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Directory to write: figure, tables, JSON."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Phase, amplitude and harmonics of one buffer, by three methods side by side."""
    from catseye.api.detection.buffer import phase as phase_of
    from catseye.api.result import require_writable, save

    require_writable(out, buffer)
    result = phase_of(
        buffer,
        row=row,
        shot=shot,
        sample_rate_hz=sample_rate_hz,
        intermediate_hz=intermediate_hz,
        cycles=cycles,
        full_scale_volt=full_scale_volt,
        bits=bits,
    )
    if out is not None:
        save(result, out)
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.rows(), written=[("Written to", out)])
