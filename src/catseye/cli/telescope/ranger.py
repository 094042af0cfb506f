"""Options that name a ranger: two records, or one of a site; and points of a command line."""

from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from catseye.cli.numbers import numbers_of

PLACE = "x,y,z in metres"


def points_of(texts: list[str] | None) -> list[list[float]]:
    """Points of an option that repeats."""
    return [numbers_of(text, 3, PLACE) for text in texts or []]


class RangerOptions(NamedTuple):
    """The ranger: two records, or one of a site by name."""

    monument: Annotated[
        Path | None, typer.Option("--monument", metavar="M.toml", help="Record of the monument; with --mirror.")
    ] = None
    mirror: Annotated[Path | None, typer.Option("--mirror", metavar="Z.toml", help="Record of the mirror on it.")] = (
        None
    )
    site: Annotated[
        Path | None, typer.Option("--site", metavar="SITE", help="Site of the ranger, instead; with --ranger.")
    ] = None
    ranger: Annotated[
        str | None, typer.Option("--ranger", metavar="NAME", help="Ranger of the site, on the ground or the feed arm.")
    ] = None
