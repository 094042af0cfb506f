"""Names of points in one normal form, so that two ways to write a name are one point.

Unicode in its composed form (NFC), blanks at the ends gone, those within counted as one; and a whole number that a
program wrote with decimals, 1.0, is the name 1. A point keeps the name by which it was first written, in that form but
with its decimals; a name that differs in nothing else finds it.
"""

import re
import unicodedata
from collections.abc import Iterable

WHOLE = re.compile(r"([+-]?[0-9]+)\.0+")  # what spreadsheets and data frames make of a whole number


def spelled(name: str) -> str:
    """A name as it is shown: composed, without needless blanks.

    >>> spelled("  P   5 "), spelled("Su\\u0308d") == "S\\u00fcd"
    ('P 5', True)
    """
    if name.isascii() and " " not in name and name.isprintable():
        return name  # by far the most
    return " ".join(unicodedata.normalize("NFC", name).split())


def name_key(name: str) -> str:
    """The key by which names are compared.

    >>> name_key("1.0"), name_key("1.10"), name_key("P  5")
    ('1', '1.10', 'P 5')
    """
    text = spelled(name)
    whole = WHOLE.fullmatch(text)
    return whole[1] if whole else text


class PointIndex(dict[str, int]):
    """Number of each point by its name, found however the name is written.

    aliases   names that were asked for and written otherwise -> the point's name
    """

    def __init__(self, names: Iterable[str] = ()) -> None:
        super().__init__()
        self.aliases: dict[str, str] = {}
        self._by_key: dict[str, str] = {}
        for i, name in enumerate(names):
            self[name] = i

    def __setitem__(self, name: str, number: int) -> None:
        self._by_key.setdefault(name_key(name), name)
        super().__setitem__(name, number)

    def __missing__(self, name: str) -> int:
        known = self._by_key[name_key(name)]
        self.aliases[name] = known
        return super().__getitem__(known)

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or (isinstance(name, str) and name_key(name) in self._by_key)

    def notes(self) -> tuple[str, ...]:
        """One line about names that were written in more than one way; none where all agree."""
        if not self.aliases:
            return ()
        some = [f"{alias!r} is {name!r}" for alias, name in list(self.aliases.items())[:3]]
        more = f" and {len(self.aliases) - 3} more" if len(self.aliases) > 3 else ""
        return (f"names are compared in one normal form (NFC, single blanks, 1.0 as 1): {', '.join(some)}{more}",)
