"""The command of beams."""

import math
from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.results import say_verdict
from catseye.cli.terminal import say


def _distance(value: float | None) -> float | None:
    if value is not None and not (math.isfinite(value) and 0.01 <= value <= 1e6):
        raise typer.BadParameter(f"{value} is not within 0.01 to 1e6 m.")
    return value


@app.command(
    epilog="\b\nExample: catseye beam examples/beams/head.toml --distance-m 120 --out beam\n"
    "Layout of FILE: docs/formats/beam.md"
)
def beam(
    file: Annotated[Path, typer.Argument(metavar="FILE.toml", help="The beam's elements, laser to detector.")],
    distance_m: Annotated[
        float | None,
        typer.Option("--distance-m", callback=_distance, help="To the reflector, m; as in FILE if not given."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A laser beam through lenses, mirrors and a retroreflector to the detector: sizes, clipping, power."""
    from catseye.gateways.optics.beam_figures import beam_object, lines, read_beam, write_beam
    from catseye.gateways.writers.objects import json_line
    from catseye.gateways.writers.output import refuse_output, whole_directory

    if out is not None:
        refuse_output(out, file)
    beam_path, hashes = read_beam(file, distance_m)
    if out is not None:
        with whole_directory(out, file) as directory:
            write_beam(beam_path, directory, hashes)
    if json:
        say(json_line(beam_object(beam_path)))
        return
    if quiet:
        return
    say_verdict(beam_object(beam_path))
    for line in lines(beam_path):
        say(line)
    if out is not None:
        say(f"written to {out}/: beam.csv, returned.csv, beam.json, beam.svg, provenance.json")
