"""Difference of a replay from the journal's answers, as JSON and text."""

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
UNITS: Mapping[Moving, tuple[str, str, float]] = {  # key, symbol, size of the unit
    **dict.fromkeys(Moving, ("mm", " mm", MILLIMETRE)),
    Moving.THERMOMETERS: ("c", " °C", 1.0),
    Moving.BEAM: ("arcsec", "″", ARCSECOND),
}


def movement_object(moves: Mapping[Moving, Movement]) -> dict[str, Any]:
    """Movements by kind, as an object for JSON."""
    return {moving.value: _object(moving, movement) for moving, movement in moves.items()}


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


def movement_words(moves: Mapping[Moving, Movement]) -> list[tuple[str, str]]:
    """Title and text of each movement, in its unit and in u; kinds that did not move are omitted."""
    return [(TITLES[moving], _words(moving, movement)) for moving, movement in moves.items() if movement.largest.size]


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
    return f"{far.name}, after the last epoch" if far.epoch is None else f"{far.name}, epoch {far.epoch}"


def shown(value: float) -> str:
    """Size with three decimals, or with a power of ten if small.

    >>> shown(0.0), shown(1.25), shown(1.5e-11)
    ('0', '1.250', '1.5e-11')
    """
    if value == 0.0:
        return "0"
    return f"{value:.3f}" if abs(value) >= 1e-3 else f"{value:.1e}"
