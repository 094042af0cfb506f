"""Point names in one normal form, so that different spellings give one point.

Unicode in composed form (NFC), without leading and trailing blanks, inner blanks reduced to one; an integer written
with decimals, 1.0, is the name 1. A point keeps its first spelling in that form, but with its decimals; other spellings
find it.
"""

import re
import unicodedata
from collections.abc import Iterable

INTEGER = re.compile(r"([+-]?[0-9]+)\.0+")  # integers as written by spreadsheets and data frames


def spelled(name: str) -> str:
    """Name as displayed: composed, without superfluous blanks.

    >>> spelled("  P   5 "), spelled("Su\\u0308d") == "S\\u00fcd"
    ('P 5', True)
    """
    if name.isascii() and " " not in name and name.isprintable():
        return name  # the usual case
    return " ".join(unicodedata.normalize("NFC", name).split())


def name_key(name: str) -> str:
    """Key for the comparison of names.

    >>> name_key("1.0"), name_key("1.10"), name_key("P  5")
    ('1', '1.10', 'P 5')
    """
    text = spelled(name)
    integer = INTEGER.fullmatch(text)
    return integer[1] if integer else text


class PointIndex(dict[str, int]):
    """Index of each point by its name, in any spelling.

    aliases   requested names in another spelling -> the point's name
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
        stored = self._by_key[name_key(name)]
        self.aliases[name] = stored
        return super().__getitem__(stored)

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or (isinstance(name, str) and name_key(name) in self._by_key)

    def notes(self) -> tuple[str, ...]:
        """Note about names in several spellings; none if all agree."""
        if not self.aliases:
            return ()
        some = [f"{alias!r} is {name!r}" for alias, name in list(self.aliases.items())[:3]]
        more = f" and {len(self.aliases) - 3} more" if len(self.aliases) > 3 else ""
        return (f"names are compared in one normal form (NFC, single blanks, 1.0 as 1): {', '.join(some)}{more}",)
