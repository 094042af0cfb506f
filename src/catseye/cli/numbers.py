"""Rows of numbers in one word of a command line, such as 1,2,3."""

import math
from collections.abc import Callable

import typer


def numbers_of(text: str, count: int, form: str) -> list[float]:
    """Finite numbers between commas; BadParameter where there are others.

    form   of the word, for messages, such as "x,y,z in metres"
    """
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(math.isfinite(v) for v in numbers):
        raise typer.BadParameter(f"{text!r} is not {form}.")
    return numbers


def row_of(count: int, form: str) -> Callable[[str | None], list[float] | None]:
    """Callback of an option that turns its word into numbers."""

    def row(text: str | None) -> list[float] | None:
        return None if text is None else numbers_of(text, count, form)

    return row
