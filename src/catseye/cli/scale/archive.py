"""The commands of an archive of nights: add to it, check it, and take a night out as it was."""

from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.many_options import Cluster, Processes, progress_of_many
from catseye.cli.option_groups import grouped
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import complain

ArchiveDirectory = Annotated[Path, typer.Argument(metavar="DIR", help="Directory of the archive.")]


class Upkeep(NamedTuple):
    """Options beside the sources; see `option_groups.grouped`."""

    check: Annotated[bool, typer.Option("--check", help="Compare every file with its SHA-256.")] = False
    compact: Annotated[
        bool, typer.Option("--compact", help="Join each year's tables into one file per kind, for faster series.")
    ] = False
    remove: Annotated[
        list[str] | None,
        typer.Option("--remove", metavar="NIGHT", help="Night to remove, or the beginning of its name; may repeat."),
    ] = None


NO_UPKEEP = Upkeep()


@app.command(
    epilog="\b\nExample: catseye archive years night-01\nExample: catseye archive years --check --compact\n"
    "A night that is there already stays as it is; format: catseye help formats/archive"
)
@grouped
def archive(
    directory: ArchiveDirectory,
    sources: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SOURCE ...]",
            help="Campaigns and journals to add; without any, the contents are listed.",
            show_default=False,
        ),
    ] = None,
    upkeep: Upkeep = NO_UPKEEP,
    processes: Processes = None,
    cluster: Cluster = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Years of nights in one place: results as tables, raw samples and inputs exactly, checksums, provenance."""
    from catseye.api.scale.archive import archive

    with progress_of_many("night", quiet=quiet, resumable=False) as progress:
        result = archive(
            directory,
            sources or (),
            check=upkeep.check,
            compact=upkeep.compact,
            remove=upkeep.remove or (),
            processes=processes,
            cluster=cluster,
            progress=progress,
        )
    tell(result, json=json, quiet=quiet, strict=strict and result.intact)
    if not result.intact:
        complain(result.verdict.text)
        raise typer.Exit(1)


@app.command(epilog="\b\nExample: catseye restore years night-01-c8ca6f97 night-01-again")
def restore(
    archive: Annotated[Path, typer.Argument(metavar="ARCHIVE", help="Directory of the archive.")],
    night: Annotated[str, typer.Argument(metavar="NIGHT", help="Identifier of the night, or its beginning.")],
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="Directory to make: new, or empty.")],
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A night of an archive as the campaign that it was, byte for byte."""
    from catseye.api.scale.archive import restore

    tell(restore(archive, night, directory), json=json, quiet=quiet)
