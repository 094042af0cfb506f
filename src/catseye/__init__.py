"""Catseye: laser metrology for large telescopes and structures, from raw samples to coordinates with uncertainty.

    >>> import catseye
    >>> float(round(catseye.air(temperature_c=20, pressure_hpa=933, humidity_percent=50).group_index, 9))
    1.000254297

Its functions are those of `catseye.api`, loaded when they are first asked for; its errors those of `catseye.errors`.
"""

from typing import TYPE_CHECKING, Any

from catseye.errors import CatseyeError, EstimationError, FrameError, InputError, ValidityError
from catseye.version import __version__

if TYPE_CHECKING:
    from catseye.api import air, examples, explain, load, reduce, replay, save, show, simulate, sound


__all__ = [
    "CatseyeError",
    "EstimationError",
    "FrameError",
    "InputError",
    "ValidityError",
    "__version__",
    "air",
    "examples",
    "explain",
    "load",
    "reduce",
    "replay",
    "save",
    "show",
    "simulate",
    "sound",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'catseye' has no attribute {name!r}")
    from catseye import api

    value = globals()[name] = getattr(api, name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
