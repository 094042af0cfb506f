"""The command of temperatures measured by sound."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import AirModel, Json, Quiet, app
from catseye.cli.results import Strict, judge
from catseye.cli.terminal import say, wrapped
from catseye.cli.vocabularies import THERMOMETRY_MODELS, one_of
from catseye.errors import InputError


@app.command(
    epilog="\b\nExample: catseye acoustic examples/acoustic/evening-1.wav --sheet examples/acoustic/evening.toml\n"
    "Layouts of FILE and SHEET: docs/formats/acoustic.md"
)
def acoustic(  # noqa: PLR0913 - its options are its command line
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Recordings .wav or .csv, or travel times .csv.")
    ],
    sheet: Annotated[
        Path | None,
        typer.Option("--sheet", metavar="SHEET.toml", help="Path, signal, weather; FILE.toml if not given."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Directory to write: report, tables, figures.")
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option("--write", metavar="path_temperatures.csv", help="Table of path temperatures for a campaign."),
    ] = None,
    model: Annotated[
        str,
        typer.Option(
            "--model",
            metavar=THERMOMETRY_MODELS,
            callback=one_of(THERMOMETRY_MODELS),
            help="Formula for the speed of sound.",
        ),
    ] = "real_gas",
    air_model: AirModel = "ciddor_hill1999",
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Temperature of the air along a path from the travel time of sound."""
    from catseye.gateways.air.acoustic_objects import acoustic_object, acoustic_verdict, words
    from catseye.gateways.air.tables import MARK, path_temperatures_csv
    from catseye.gateways.writers.output import atomic_directory, atomic_file, refuse_output
    from catseye.reduction.air.acoustic_recording import reduce_acoustic

    _refuse_outputs(files, sheet, out, write)
    if out is not None:
        for file in files:
            refuse_output(out, file)
    paths = reduce_acoustic(files, sheet, model=model, air_model=air_model)
    with ExitStack() as stack:  # both or none: what cannot be written is refused first
        if write is not None:
            stack.enter_context(atomic_file(write, "--write", MARK)).append(path_temperatures_csv(paths))
        if out is not None:
            from catseye.gateways.air.acoustic_report import write_acoustic

            with atomic_directory(out, files[0]) as directory:
                write_acoustic(paths, directory)
    if json:
        from catseye.gateways.writers.objects import json_line

        say(json_line(acoustic_object(paths)))
    elif not quiet:
        say(wrapped("Verdict", acoustic_verdict(paths).text))
        for path in paths:
            for title, text in words(path):
                say(wrapped(title, text))
        for place in (out, write):
            if place is not None:
                say(wrapped("Written to", str(place)))
    judge(acoustic_verdict(paths), strict=strict)


def _refuse_outputs(files: list[Path], sheet: Path | None, out: Path | None, write: Path | None) -> None:
    """Nothing that is read may be written, and nothing foreign put where a directory is replaced as a whole."""
    inputs = {path.resolve() for path in (*files, *([sheet] if sheet else (f.with_suffix(".toml") for f in files)))}
    if write is not None and write.resolve() in inputs:
        raise InputError(f"--write {write}: is an input (expected another name)")
    if write is None:
        return
    if not write.resolve().parent.is_dir():
        raise InputError(f"--write {write}: its directory does not exist (expected one that does)")
    if out is not None and (write.resolve() == out.resolve() or out.resolve() in write.resolve().parents):
        raise InputError(f"--write {write}: lies in --out {out}, which holds that table (expected a place outside it)")
