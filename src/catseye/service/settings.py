"""Settings of a live reduction as JSON for journals, and back."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from catseye.coordinator.journal.entries import plain
from catseye.errors import InputError
from catseye.reduction.live.live import LiveSettings

KEY = "live"
FILTERS = ("random_walk", "constant_velocity")


def settings_object(settings: LiveSettings) -> dict[str, Any]:
    """Settings of a reduction for a run's record.

    >>> settings_object(LiveSettings())["live"]["filter"]
    'random_walk'
    """
    return {KEY: plain(settings, "settings")}


def live_settings(stored: Mapping[str, Any], place: str) -> LiveSettings:
    """Settings stored in a run, defaults for the others.

    place   of the run, for messages

    Raises InputError: settings that are unknown to this version, or none.

    >>> live_settings(settings_object(LiveSettings(u_flexure_mm=7.0)), "run 1").u_flexure_mm
    7.0
    """
    live = stored.get(KEY)
    if not isinstance(live, Mapping):
        raise InputError(f"{place}: reduction settings are missing (expected {KEY!r} in its settings)")
    settings = _filled(LiveSettings(), live, place, KEY)
    if settings.filter not in FILTERS:
        raise InputError(f"{place}: live.filter = {settings.filter!r} (expected one of {', '.join(FILTERS)})")
    return settings


def _filled(usual: Any, stored: Mapping[str, Any], place: str, where: str) -> Any:
    """A copy of a default dataclass with stored values."""
    defaults = {item.name: getattr(usual, item.name) for item in fields(usual)}
    strange = sorted(set(stored) - set(defaults))
    if strange:
        raise InputError(f"{place}: {where}.{strange[0]} is unknown (expected a journal of this version or older)")
    return type(usual)(**{name: _value(defaults[name], stored[name], place, f"{where}.{name}") for name in stored})


def _value(usual: Any, stored: Any, place: str, where: str) -> Any:
    if is_dataclass(usual) and isinstance(stored, Mapping):
        return _filled(usual, stored, place, where)
    if isinstance(usual, Mapping) and isinstance(stored, Mapping):
        return {str(name): float(value) for name, value in stored.items()}
    if isinstance(usual, float) and isinstance(stored, float | int) and not isinstance(stored, bool):
        return float(stored)
    if type(stored) is type(usual):
        return stored
    raise InputError(f"{place}: {where} = {stored!r} (expected a value like {usual!r})")
