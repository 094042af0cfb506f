"""What a report says in words: the same sentences on a terminal, on a page and in a program's answer."""

from typing import NamedTuple


class Passage(NamedTuple):
    """A few sentences under a word or two."""

    title: str
    text: str
