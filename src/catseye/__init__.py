"""Laser metrology for large telescopes and structures, from raw samples to coordinates.

    >>> import catseye
    >>> round(float(catseye.air(temperature_c=20, pressure_hpa=933, humidity_percent=50).group_index), 9)
    1.000253319

Functions are those of `catseye.api`, loaded on first use; errors are those of `catseye.errors`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from catseye.errors import ArgumentError, CatseyeError, EstimationError, FrameError, InputError, ValidityError
from catseye.version import __version__

if TYPE_CHECKING:
    from catseye.api.figures import (
        plot_aberration,
        plot_air,
        plot_beam,
        plot_coating,
        plot_polarization,
        plot_return,
        plot_servo,
        plot_sky,
    )
    from catseye.api.journal import backup_journal, check_journal, export
    from catseye.api.laboratory import baseline, calibrate, triplet
    from catseye.api.living import replay, simulate
    from catseye.api.network import adjust, compare, locate, plan
    from catseye.api.night import explain, night, reduce
    from catseye.api.optics import beam, glass, link, safety
    from catseye.api.reading import examples, load
    from catseye.api.result import save, show
    from catseye.api.steering import point, track
    from catseye.api.telescope import pose, surface
    from catseye.api.weather import air, refractometer, sound

FACE = {  # file of catseye.api -> its exported names
    "laboratory": ("baseline", "calibrate", "triplet"),
    "figures": (
        "plot_aberration",
        "plot_air",
        "plot_beam",
        "plot_coating",
        "plot_polarization",
        "plot_return",
        "plot_servo",
        "plot_sky",
    ),
    "journal": ("backup_journal", "check_journal", "export"),
    "living": ("replay", "simulate"),
    "network": ("adjust", "compare", "locate", "plan"),
    "night": ("explain", "night", "reduce"),
    "optics": ("beam", "glass", "link", "safety"),
    "reading": ("examples", "load"),
    "result": ("save", "show"),
    "steering": ("point", "track"),
    "telescope": ("pose", "surface"),
    "weather": ("air", "refractometer", "sound"),
}

__all__ = [
    "ArgumentError",
    "CatseyeError",
    "EstimationError",
    "FrameError",
    "InputError",
    "ValidityError",
    "__version__",
    "adjust",
    "air",
    "backup_journal",
    "baseline",
    "beam",
    "calibrate",
    "check_journal",
    "compare",
    "examples",
    "explain",
    "export",
    "glass",
    "link",
    "load",
    "locate",
    "night",
    "plan",
    "plot_aberration",
    "plot_air",
    "plot_beam",
    "plot_coating",
    "plot_polarization",
    "plot_return",
    "plot_servo",
    "plot_sky",
    "point",
    "pose",
    "reduce",
    "refractometer",
    "replay",
    "safety",
    "save",
    "show",
    "simulate",
    "sound",
    "surface",
    "track",
    "triplet",
]


if not TYPE_CHECKING:  # else mypy would accept every name

    def __getattr__(name: str) -> Any:
        for file, names in FACE.items():
            if name in names:
                value = globals()[name] = getattr(import_module(f"catseye.api.{file}"), name)
                return value
        raise AttributeError(f"module 'catseye' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
