"""Variations of a design in words: what may move, how far, and how many there may be.

    rangers | targets | ranger NAME | target NAME      NAME may be a pattern, such as ZY10*
        from A to B                                    number of them, all together
        within L m                                     each at most so far from its place
        between A and B m                              level distance from the origin of the ground frame

In this order; a variation that says neither number nor place means "within 10 m". `rangers` are those on the ground.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Literal

from catseye.errors import InputError

Role = Literal["ranger", "target"]
USUAL_WITHIN = 10.0  # m
NUMBER = r"(\d+(?:\.\d*)?)"
GRAMMAR = re.compile(
    rf"(?P<kind>rangers|targets|ranger|target)(?:\s+(?P<name>(?!from\b|within\b|between\b)\S+))?"
    rf"(?:\s+from\s+(?P<low>\d+)\s+to\s+(?P<high>\d+))?"
    rf"(?:\s+within\s+(?P<within>{NUMBER})\s*m)?"
    rf"(?:\s+between\s+(?P<inner>{NUMBER})\s+and\s+(?P<outer>{NUMBER})\s*m)?"
)
EXPECTED = (
    "expected rangers, targets, ranger NAME or target NAME, then from A to B, within L m, between A and B m, "
    "each or none, such as 'ranger ZY107 within 20 m'"
)


@dataclass(frozen=True)
class Variation:
    """Variation of a design: its units, places and numbers.

    role      of the points
    pattern   of their names; "" for all: of rangers those on the ground
    number    least and most of them together; None: as there are
    within    m from its place; None: not limited so
    between   m, least and greatest level distance from the origin; None: not limited so
    text      as it was written
    """

    role: Role
    pattern: str
    number: tuple[int, int] | None
    within: float | None
    between: tuple[float, float] | None
    text: str

    @property
    def moves(self) -> bool:
        """True where places change, and not only the number."""
        return self.within is not None or self.between is not None

    def selects(self, name: str, role: Role, on_ground: bool) -> bool:
        """True for a point that the variation is about."""
        if role != self.role:
            return False
        if self.pattern:
            return fnmatchcase(name, self.pattern)
        return role == "target" or on_ground


def variations(texts: Sequence[str]) -> tuple[Variation, ...]:
    """Variations from their texts; InputError for one that is not understood.

    >>> variations(["ranger ZY107 within 20 m"])[0].within
    20.0
    """
    if not texts:
        raise InputError(f"nothing to vary ({EXPECTED})")
    return tuple(_variation(text) for text in texts)


def _variation(text: str) -> Variation:
    match = GRAMMAR.fullmatch(" ".join(str(text).split()))
    if match is None:
        raise InputError(f"vary {text!r} is not understood ({EXPECTED})")
    part = match.groupdict()
    single = part["kind"] in ("ranger", "target")
    if single and not part["name"]:
        raise InputError(f"vary {text!r} names no {part['kind']} ({EXPECTED})")
    if not single and part["name"]:
        raise InputError(f"vary {text!r}: {part['name']!r} after {part['kind']} (expected {part['kind'][:-1]} NAME)")
    number = None if part["low"] is None else (int(part["low"]), int(part["high"]))
    if number is not None and not 1 <= number[0] <= number[1]:
        raise InputError(f"vary {text!r}: from {number[0]} to {number[1]} (expected 1 or more, rising)")
    within = None if part["within"] is None else float(part["within"])
    if within is not None and not 0.0 < within <= 1e4:
        raise InputError(f"vary {text!r}: within {within:g} m (expected above 0, at most 10000)")
    between = None if part["inner"] is None else (float(part["inner"]), float(part["outer"]))
    if between is not None and not between[0] < between[1] <= 1e4:
        raise InputError(f"vary {text!r}: between {between[0]:g} and {between[1]:g} m (expected rising, at most 10000)")
    if number is None and within is None and between is None:
        within = USUAL_WITHIN
    role: Role = "ranger" if part["kind"].startswith("ranger") else "target"
    return Variation(
        role=role,
        pattern=part["name"] or "",
        number=number,
        within=within,
        between=between,
        text=" ".join(text.split()),
    )
