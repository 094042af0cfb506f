"""The settings of a living reduction as JSON, which a journal keeps, and back: a replay is made with the same."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from catseye.coordinator.journal.entries import plain
from catseye.errors import InputError
from catseye.reduction.live.live import LiveSettings

KEY = "live"
FILTERS = ("random_walk", "constant_velocity")


def settings_object(settings: LiveSettings) -> dict[str, Any]:
    """What a run of a journal says of its reduction.

    >>> settings_object(LiveSettings())["live"]["filter"]
    'random_walk'
    """
    return {KEY: plain(settings, "settings")}


def live_settings(stored: Mapping[str, Any], place: str) -> LiveSettings:
    """The settings that a run states; what it does not say is as usual.

    place   of the run, for refusals

    Raises InputError: settings that this version does not know, or none.

    >>> live_settings(settings_object(LiveSettings(u_flexure_mm=7.0)), "run 1").u_flexure_mm
    7.0
    """
    live = stored.get(KEY)
    if not isinstance(live, Mapping):
        raise InputError(f"{place}: does not say how it was reduced (expected {KEY!r} in its settings)")
    settings = _filled(LiveSettings(), live, place, KEY)
    if settings.filter not in FILTERS:
        raise InputError(f"{place}: live.filter = {settings.filter!r} (expected one of {', '.join(FILTERS)})")
    return settings


def _filled(usual: Any, given: Mapping[str, Any], place: str, where: str) -> Any:
    """A dataclass like the usual one, with what is told in place of its own."""
    known = {each.name: getattr(usual, each.name) for each in fields(usual)}
    strange = sorted(set(given) - set(known))
    if strange:
        raise InputError(f"{place}: {where}.{strange[0]} is not known (expected a journal of this version or older)")
    return type(usual)(**{name: _value(known[name], given[name], place, f"{where}.{name}") for name in given})


def _value(usual: Any, given: Any, place: str, where: str) -> Any:
    if is_dataclass(usual) and isinstance(given, Mapping):
        return _filled(usual, given, place, where)
    if isinstance(usual, Mapping) and isinstance(given, Mapping):
        return {str(name): float(value) for name, value in given.items()}
    if isinstance(usual, float) and isinstance(given, float | int) and not isinstance(given, bool):
        return float(given)
    if type(given) is type(usual):
        return given
    raise InputError(f"{place}: {where} = {given!r} (expected something like {usual!r})")
