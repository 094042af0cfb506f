"""How far a replay moved a journal's answers, for programs and for people."""

from collections.abc import Mapping
from typing import Any

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.coordinator.journal.movement import Furthest, Movement, Moving

TITLES: Mapping[Moving, str] = {
    Moving.POINTS: "Points",
    Moving.RANGES: "Ranges",
    Moving.THERMOMETERS: "Thermometers",
    Moving.ZEROS: "Zeros",
    Moving.BEAM: "Beam",
    Moving.FOCUS: "Focus",
}
UNITS: Mapping[Moving, tuple[str, str, float]] = {  # in a key, for people, in the unit of a movement
    **dict.fromkeys(Moving, ("mm", " mm", MILLIMETRE)),
    Moving.THERMOMETERS: ("c", " °C", 1.0),
    Moving.BEAM: ("arcsec", "″", ARCSECOND),
}


def movement_object(found: Mapping[Moving, Movement]) -> dict[str, Any]:
    """What moved, by kind, as a plain object for JSON."""
    return {moving.value: _object(moving, movement) for moving, movement in found.items()}


def _object(moving: Moving, movement: Movement) -> dict[str, Any]:
    key, _, unit = UNITS[moving]
    far = movement.largest_u
    return {
        "compared": movement.count,
        f"rms_{key}": movement.rms / unit,
        f"largest_{key}": movement.largest.size / unit,
        "largest": _place(movement.largest),
        "with_u": movement.normalised,
        "rms_u": movement.rms_u,
        "largest_u": None if far is None else far.size,
        "largest_in_u": None if far is None else _place(far),
    }


def _place(far: Furthest) -> dict[str, Any]:
    return {"name": far.name, "epoch": far.epoch}


def movement_words(found: Mapping[Moving, Movement]) -> list[tuple[str, str]]:
    """Title and text of what moved, in its unit and in u, for people; what did not move is left out."""
    return [(TITLES[moving], _words(moving, movement)) for moving, movement in found.items() if movement.largest.size]


def _words(moving: Moving, movement: Movement) -> str:
    _, symbol, unit = UNITS[moving]
    far = movement.largest
    text = (
        f"moved by {shown(movement.rms / unit)}{symbol} rms, at most {shown(far.size / unit)}{symbol} "
        f"({_at(far)}), of {movement.count} compared"
    )
    if movement.largest_u is None:
        return f"{text}; no u is stored."
    far = movement.largest_u
    return f"{text}; in stored u {shown(movement.rms_u)} rms, at most {shown(far.size)} ({_at(far)})."


def _at(far: Furthest) -> str:
    return f"{far.name}, behind the last epoch" if far.epoch is None else f"{far.name}, epoch {far.epoch}"


def shown(value: float) -> str:
    """A size with three decimals, or with a power of ten where those would say nothing.

    >>> shown(0.0), shown(1.25), shown(1.5e-11)
    ('0', '1.250', '1.5e-11')
    """
    if value == 0.0:
        return "0"
    return f"{value:.3f}" if abs(value) >= 1e-3 else f"{value:.1e}"
