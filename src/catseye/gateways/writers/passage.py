"""Sentences of a report, shared by terminals, pages and JSON."""

from typing import NamedTuple


class Passage(NamedTuple):
    """A few sentences under a short title."""

    title: str
    text: str
