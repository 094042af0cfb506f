"""The command of triplet units measured in the laboratory."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.networks import Out
from catseye.cli.terminal import ProgressLine, say, wrapped

if TYPE_CHECKING:
    from catseye.reduction.triplet.result import TripletReduction

    Units = list[tuple[Path, TripletReduction]]


@app.command(
    epilog="\b\nExample: catseye triplet examples/triplets/TR99.toml\n"
    "         catseye triplet examples/triplets/*.toml --out triplet-sheets\n"
    "         catseye triplet --blank sheet.html"
)
def triplet(
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="FILE.toml ...", help="Sheets of measured units: docs/formats/triplet.md."),
    ] = None,
    blank: Annotated[
        Path | None, typer.Option("--blank", metavar="SHEET.html", help="Write the blank form, to print and fill in.")
    ] = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Triplet units from their laboratory sheets: H_corr with uncertainty, accepted or not."""
    if not files and blank is None:
        raise typer.BadParameter("at least one is needed, or --blank.", param_hint="'FILE.toml ...'")
    if not files and (out is not None or json):
        raise typer.BadParameter("are needed with --out and --json.", param_hint="'FILE.toml ...'")
    units = _reduced(files or [], out, quiet)
    if blank is not None:
        _write_blank(blank)
    if json:
        _say_objects(units)
    elif not quiet:
        _tell(units, out, blank)


def _reduced(files: list[Path], out: Path | None, quiet: bool) -> "Units":
    """Every sheet read and reduced, in order; with an `out`, written whole or not at all."""
    if not files:
        return []
    from catseye.gateways.triplet.files import refuse_namesakes, write_triplets
    from catseye.gateways.writers.output import refuse_output, whole_directory
    from catseye.records.files.reading import Folder
    from catseye.records.laboratory.triplet_measurement import TripletMeasurement
    from catseye.reduction.triplet.unit import reduce_triplet

    if out is not None:
        refuse_namesakes(files)
        for path in files:
            refuse_output(out, path)
    progress = ProgressLine(quiet)
    units: Units = []
    hashes: dict[Path, str] = {}
    try:
        for done, path in enumerate(files):
            progress("reducing", done, len(files))
            folder = Folder(path.parent)
            units.append((path, reduce_triplet(folder.record(path.name, TripletMeasurement))))
            hashes[path] = folder.hashes[path.name]
        if out is not None:
            with whole_directory(out, files[0]) as directory:
                write_triplets(dict(units), directory, hashes, progress=progress)
    finally:
        progress.clear()
    return units


def _write_blank(path: Path) -> None:
    from catseye.gateways.triplet.form import MARK, blank_form
    from catseye.gateways.writers.output import whole_file

    with whole_file(path, "--blank", MARK) as pieces:
        pieces.append(blank_form())


def _say_objects(units: "Units") -> None:
    """One object, or a list of them for several files."""
    from catseye.gateways.triplet.objects import triplet_object
    from catseye.gateways.writers.objects import json_line

    objects = [triplet_object(reduction, path.name) for path, reduction in units]
    say(json_line(objects[0] if len(objects) == 1 else objects))


def _tell(units: "Units", out: Path | None, blank: Path | None) -> None:
    """The whole sheet of one unit; of several, what each comes to."""
    from catseye.gateways.triplet.sheet import text_sheet, verdict

    if len(units) == 1:
        ((path, reduction),) = units
        say(text_sheet(reduction, path.name).rstrip())
    for path, reduction in units if len(units) > 1 else ():
        say(f"{path.name}: triplet {reduction.measurement.triplet}")
        for title, text in verdict(reduction):
            say(wrapped(title, text))
    if out is not None:
        say(wrapped("Written to", f"{out}/: NAME.txt, NAME.html, NAME.json for each sheet, triplets.csv"))
    if blank is not None:
        say(wrapped("Written to", f"{blank}: the blank form"))
