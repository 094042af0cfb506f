"""Limits of arguments that the jobs of a living site share."""

import math
from collections.abc import Sequence

from catseye.errors import ArgumentError

LAST_PORT = 65_535


def within(name: str, value: float | None, low: float, high: float, unit: str = "") -> None:
    """Raise ArgumentError for a number out of its range."""
    if value is not None and not (math.isfinite(value) and low <= value <= high):
        raise ArgumentError(f"{name} = {value:g} is not {low:g} to {high:g}{unit}", name)


def one_of(name: str, value: str, words: Sequence[str]) -> None:
    """Raise ArgumentError for an unknown word."""
    if value not in words:
        raise ArgumentError(f"{name} = {value!r} is not one of {', '.join(words)}", name)
