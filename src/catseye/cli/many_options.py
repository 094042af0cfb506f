"""Options of commands that do many units of work, and the end of such a command."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from catseye.cli.results import tell
from catseye.cli.terminal import ProgressLine, complain

if TYPE_CHECKING:
    from catseye.api.scale.many import ManyResult

Processes = Annotated[
    int | None,
    typer.Option(
        "--processes",
        metavar="N",
        min=1,
        help="Processes of one thread each; if not given as many as free cores and memory allow.",
    ),
]
Cluster = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="local|ADDRESS",
        help="Workers of dask.distributed instead: local, or a scheduler's tcp://HOST:PORT or file.",
    ),
]
Resume = Annotated[
    bool, typer.Option("--resume", help="Continue an earlier run: finished work on the same inputs is kept.")
]


class Several(NamedTuple):
    """Options of a command that takes one input or several, for several; see `option_groups.grouped`."""

    processes: Processes = None
    cluster: Cluster = None
    resume: Resume = False


NOTHING_SAID = Several()


def refuse_several(several: Several, nouns: str) -> None:
    """Refuse options for several inputs where there is one.

    nouns   what the inputs are: "nights"
    """
    for name, default in NOTHING_SAID._asdict().items():
        if getattr(several, name) != default:
            raise typer.BadParameter(f"is for several {nouns}.", param_hint=f"'--{name}'")


@contextmanager
def progress_of_many(noun: str, *, quiet: bool, resumable: bool) -> Iterator[ProgressLine]:
    """Progress line of many units, which says on Ctrl-C how far it came.

    noun        of a unit: "night"
    resumable   a ledger is written, so that --resume continues
    """
    from catseye.interruption import undo_on_interruption

    line = ProgressLine(quiet)

    def farewell() -> None:
        done, total = line.counts
        again = "; the same command with --resume continues from there" if resumable else ""
        with suppress(OSError):
            clear = b"\r\x1b[K" if os.isatty(2) else b""
            os.write(2, clear + f"catseye: {done} of {total} {noun}s were done{again}\n".encode())

    with undo_on_interruption(farewell):
        try:
            yield line
        finally:
            line.clear()


def tell_many(
    many: "ManyResult", written: str | None, *, json: bool, quiet: bool = False, strict: bool = False
) -> None:
    """Say many outcomes, then leave with 1 where one of them failed, or where `strict` asks for it.

    written   where the files are; None: nothing was written
    """
    failures = many.failures
    tell(many, json=json, quiet=quiet, strict=strict and not failures, written=[("Written to", written)])
    if failures:
        first = failures[0]
        complain(f"{len(failures)} of {len(many.outcomes)} {many.noun}s failed: {first.name}: {first.why}")
        raise typer.Exit(1)
