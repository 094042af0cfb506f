"""Ends of commands: print a result for people or programs, and set the exit status."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from catseye.cli.terminal import complain, say, wrapped

if TYPE_CHECKING:
    from catseye.api.result import Result
    from catseye.verdict import Verdict

Strict = Annotated[bool, typer.Option("--strict", help="Exit with 1, after writing, where the verdict is not good.")]


def tell(
    result: "Result",
    *,
    json: bool,
    quiet: bool = False,
    strict: bool = False,
    sentences: bool = True,
    rows: Iterable[str] = (),
    under: str = "",
    written: Sequence[tuple[str, object]] = (),
) -> None:
    """Say a result: its JSON, or verdict, sentences and rows; then leave with 1 where `strict` asks for it.

    sentences   False where the rows say all of them
    rows      lines for people only, which follow the sentences
    under     or follow the passage of this title
    written   title and what was written under it; None: nothing was
    """
    if json:
        say(result.to_json())
    elif not quiet:
        say(wrapped("Verdict", result.verdict.text))
        for passage in result.passages() if sentences else ():
            say(wrapped(passage.title, passage.text))
            if under and passage.title == under:
                say("\n".join(rows))
        if not under:
            say("\n".join(rows))
        for title, what in written:
            if what is not None:
                say(wrapped(title, str(what)))
    judge(result.verdict, strict=strict)


def judge(verdict: "Verdict", *, strict: bool) -> None:
    """Leave with exit status 1 and the verdict on stderr, where `strict` and the verdict is not good."""
    if strict and verdict.word != "good":
        complain(verdict.text)
        raise typer.Exit(1)
