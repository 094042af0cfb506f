"""Values of parameters of free text: lists of names, priorities, positions, boxes."""

import re
from collections.abc import Collection, Iterable, Mapping
from fnmatch import fnmatchcase

import numpy as np
from pydantic import ValidationError

from catseye.aliases import Array
from catseye.constants import MILLIMETRE
from catseye.coordinator.control.registry import number_text
from catseye.errors import InputError
from catseye.records.site.keep_out import KeepOutBox
from catseye.records.site.target import TargetRow
from catseye.reduction.live.changes import Position

LOWEST_PRIORITY, HIGHEST_PRIORITY = 1e-3, 1e3
LONGEST_MOVE_MM = 1000.0  # of a target from its record: its line of sight is checked there
NONE, ALL = "none", "all"


def matching(patterns: Iterable[str], names: Collection[str], what: str) -> dict[str, frozenset[str]]:
    """Names that fit each pattern, capitals and small letters alike.

    Raises InputError: a pattern that none fits.

    >>> {p: sorted(n) for p, n in matching(["zg1*"], ["ZG11", "ZG12", "ZG21"], "targets").items()}
    {'ZG1*': ['ZG11', 'ZG12']}
    """
    result = {}
    for pattern in patterns:
        fitting = frozenset(name for name in names if fnmatchcase(name.upper(), pattern.upper()))
        if not fitting:
            raise InputError(
                f"{pattern[:20]!a} fits none of {len(names)} {what} (expected a name, or a pattern with *)"
            )
        result[pattern.upper()] = fitting
    return result


def scan_list(text: str, names: Collection[str]) -> frozenset[str] | None:
    """Targets of a scan list; None for all."""
    if text.lower() == ALL:
        return None
    words = text.split()
    if not words:
        raise InputError("scan_list is empty (expected names, or all)")
    return frozenset().union(*matching(words, names, "targets").values())


def priorities(text: str, names: Collection[str]) -> dict[str, float]:
    """Factors by target: the last that fits counts; blanks around = are allowed.

    Raises InputError: no factor, an illegal one, or a pattern that none fits.

    >>> priorities("ZG*=2 ZG11 = 0.5", ["ZG11", "ZG12"])
    {'ZG11': 0.5, 'ZG12': 2.0}
    """
    factors: dict[str, float] = {}
    for word in [] if text.lower() == NONE else joined_pairs(text).split():
        pattern, equals, number = word.partition("=")
        if not (pattern and equals and number):
            raise InputError(f"priorities {word[:30]!a} (expected name=factor, such as TR*=2, with blanks between)")
        factor = _number("priorities", number)
        if not LOWEST_PRIORITY <= factor <= HIGHEST_PRIORITY:
            raise InputError(
                f"priorities {word[:30]!a}: {factor:g} (expected {LOWEST_PRIORITY:g} to {HIGHEST_PRIORITY:g})"
            )
        for fitting in matching([pattern], names, "targets").values():
            factors |= dict.fromkeys(fitting, factor)
    return dict(sorted(factors.items()))


def joined_pairs(text: str) -> str:
    """Text without blanks around =.

    >>> joined_pairs("TR* = 2  ZEG*=0.5")
    'TR*=2 ZEG*=0.5'
    """
    return " ".join(re.sub(r"\s*=\s*", "=", text).split())


def positions_mm(text: str, targets: dict[str, TargetRow]) -> dict[str, Position]:
    """Positions by target, mm, in the frames of the records.

    Raises InputError: not a single target beside the dish, or more than 1 m from its record.
    """
    positions: dict[str, Position] = {}
    for words in _parts(text):
        if len(words) != 4:
            raise InputError(f"target_positions {' '.join(words)[:40]!a} (expected name x y z, with ; between targets)")
        name = words[0].upper()
        target = targets.get(name)
        if target is None:
            raise InputError(f"target_positions {words[0][:20]!a} has no record of its own at this site")
        if target.shapes_dish:
            raise InputError(f"target_positions {name} shapes the dish (expected a target beside the dish)")
        x, y, z = (_number("target_positions", word) for word in words[1:])
        away = float(np.linalg.norm(np.array([x, y, z]) - np.array(target.position_mm)))
        if not away <= LONGEST_MOVE_MM:
            raise InputError(
                f"target_positions {name} is {away:.0f} mm from its record (limit {LONGEST_MOVE_MM:g}: its line of "
                "sight is known there; else change the record)"
            )
        positions[name] = (x, y, z)
    return dict(sorted(positions.items()))


def positions_text(positions: dict[str, Position]) -> str:
    """Text of positions, as `positions_mm` reads it."""
    return "; ".join(" ".join([name, *map(number_text, xyz)]) for name, xyz in positions.items()) or NONE


def boxes(text: str, taken: Collection[str], stands: Mapping[str, Array]) -> tuple[KeepOutBox, ...]:
    """Boxes by two corners, m, in the ground frame.

    taken    names of other boxes
    stands   place (3,) m of each ranger on the ground: no box may hold one

    Raises InputError: not a box.
    """
    made: list[KeepOutBox] = []
    for words in _parts(text):
        if len(words) != 7:
            raise InputError(f"keep_out_more {' '.join(words)[:40]!a} (expected name x1 y1 z1 x2 y2 z2)")
        name = words[0]
        if name in [*taken, *(box.name for box in made)]:
            raise InputError(f"keep_out_more: there is a box {name[:20]!a} already (expected another name)")
        corners = np.array([_number("keep_out_more", word) for word in words[1:]]).reshape(2, 3)
        low, high = corners.min(axis=0), corners.max(axis=0)
        for ranger, place in stands.items():
            if bool(np.all((low <= place) & (place <= high))):
                raise InputError(f"keep_out_more: box {name} holds {ranger}, which could fire nowhere")
        corners_mm = {"low_mm": (low / MILLIMETRE).tolist(), "high_mm": (high / MILLIMETRE).tolist()}
        try:
            made.append(KeepOutBox.model_validate({"name": name, "why": "set by a client while running", **corners_mm}))
        except ValidationError as problem:
            raise InputError(f"keep_out_more {name[:20]!a}: {problem.errors()[0]['msg'][:200]}") from problem
    return tuple(made)


def _parts(text: str) -> list[list[str]]:
    return [] if text.lower() == NONE else [words for part in text.split(";") if (words := part.split())]


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InputError(f"{name}: {text[:20]!a} is not a number")
    return value
