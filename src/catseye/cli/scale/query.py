"""The command that asks an archive of nights."""

from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.option_groups import grouped
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine
from catseye.cli.vocabularies import PRISM_FRAMES, one_of


class _Question(NamedTuple):
    """The question; each field is the option of its name."""

    point: Annotated[str | None, typer.Option("--point", metavar="NAME", help="Coordinates of a point by night.")] = (
        None
    )
    frame: Annotated[
        str,
        typer.Option("--frame", metavar=PRISM_FRAMES, callback=one_of(PRISM_FRAMES), help="Frame of the point."),
    ] = "ground"
    ranger: Annotated[str | None, typer.Option("--ranger", metavar="NAME", help="Zero of a ranger and its drift.")] = (
        None
    )
    surface: Annotated[bool, typer.Option("--surface", help="Surface of the dish by night.")] = False
    site: Annotated[
        Path, typer.Option("--site", metavar="SITE", help="Records with the dish's design, for --surface.")
    ] = Path("gbt")
    pose: Annotated[str | None, typer.Option("--pose", metavar="BODY", help="Pose of a body by night: dish.")] = None
    certificates: Annotated[
        str | None, typer.Option("--certificates", metavar="NIGHT", help="Certificates that a night used.")
    ] = None
    sql: Annotated[str | None, typer.Option("--sql", metavar="SELECT", help="One SELECT over the tables.")] = None
    again: Annotated[
        str | None, typer.Option("--again", metavar="NIGHT", help="Difference of a night reduced again.")
    ] = None
    calibrations: Annotated[
        Path | None, typer.Option("--calibrations", metavar="SITE", help="Current records, for --again.")
    ] = None
    since: Annotated[
        str | None, typer.Option("--from", metavar="TIME", help="First time, UTC or MJD.  [default: the start]")
    ] = None
    until: Annotated[
        str | None,
        typer.Option("--until", metavar="TIME", help="First excluded time, UTC or MJD.  [default: the end]"),
    ] = None


@app.command(
    epilog="\b\nExample: catseye query years --point ZY101\n"
    "Example: catseye query years --ranger ZY110 --out zy110\n"
    'Example: catseye query years --sql "SELECT night, verdict FROM nights ORDER BY mjd"\n'
    "Without a question: its nights"
)
@grouped
def query(
    *,
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="Archive, as catseye archive writes it.")],
    which: _Question,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Directory of tables and figures: new, empty, or an earlier one."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Series, drifts, certificates of an archive, SQL, or a night again."""
    from catseye.api.result import require_writable, save
    from catseye.api.scale.query import query as asked

    if out is not None:
        require_writable(out, directory)
    progress = ProgressLine(quiet)
    try:
        result = asked(directory, **which._asdict(), progress=progress)
        if out is not None:
            save(result, out, progress=progress)
    finally:
        progress.clear()
    rows = () if json or quiet else ("", *result.lines())
    tell(result, json=json, quiet=quiet, strict=strict, rows=rows, written=[("Written to", out)])
