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
    from catseye.api.air_paths import acoustic, refractometer
    from catseye.api.baseline import baseline
    from catseye.api.budget.points import budget
    from catseye.api.budget.shot import explain
    from catseye.api.exploring import report_of
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
    from catseye.api.laboratory import calibrate, certificate, save_triplet_form, triplet
    from catseye.api.living import replay, simulate
    from catseye.api.network import adjust, compare
    from catseye.api.night import night, reduce
    from catseye.api.optics import beam, glass, link, safety
    from catseye.api.panels import panels
    from catseye.api.planning import plan
    from catseye.api.pointing import fit_pointing, predict_pointing
    from catseye.api.pose import pose
    from catseye.api.positions import locate
    from catseye.api.reading import examples, load, topic, topics
    from catseye.api.result import save, show
    from catseye.api.scale.archive import archive, restore
    from catseye.api.scale.design import design
    from catseye.api.scale.many import reduce_nights
    from catseye.api.scale.many_runs import replay_journals, simulate_runs
    from catseye.api.scale.query import query
    from catseye.api.scale.trends import trends
    from catseye.api.steering import point, track
    from catseye.api.structure import structure
    from catseye.api.surface import surface
    from catseye.api.track_profile import track_pointing
    from catseye.api.weather import air, sound

FACE = {  # file of catseye.api -> its exported names
    "air_paths": ("acoustic", "refractometer"),
    "baseline": ("baseline",),
    "budget.points": ("budget",),
    "budget.shot": ("explain",),
    "exploring": ("report_of",),
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
    "laboratory": ("calibrate", "certificate", "save_triplet_form", "triplet"),
    "living": ("replay", "simulate"),
    "network": ("adjust", "compare"),
    "night": ("night", "reduce"),
    "optics": ("beam", "glass", "link", "safety"),
    "panels": ("panels",),
    "planning": ("plan",),
    "pointing": ("fit_pointing", "predict_pointing"),
    "pose": ("pose",),
    "positions": ("locate",),
    "reading": ("examples", "load", "topic", "topics"),
    "result": ("save", "show"),
    "scale.archive": ("archive", "restore"),
    "scale.design": ("design",),
    "scale.many": ("reduce_nights",),
    "scale.many_runs": ("replay_journals", "simulate_runs"),
    "scale.query": ("query",),
    "scale.trends": ("trends",),
    "steering": ("point", "track"),
    "structure": ("structure",),
    "surface": ("surface",),
    "track_profile": ("track_pointing",),
    "weather": ("air", "sound"),
}

RENAMED: dict[str, tuple[str, str]] = {}  # former name -> name, version without the former: docs/people/stable.md

__all__ = [
    "ArgumentError",
    "CatseyeError",
    "EstimationError",
    "FrameError",
    "InputError",
    "ValidityError",
    "__version__",
    "acoustic",
    "adjust",
    "air",
    "archive",
    "backup_journal",
    "baseline",
    "beam",
    "budget",
    "calibrate",
    "certificate",
    "check_journal",
    "compare",
    "design",
    "examples",
    "explain",
    "export",
    "fit_pointing",
    "glass",
    "link",
    "load",
    "locate",
    "night",
    "panels",
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
    "predict_pointing",
    "query",
    "reduce",
    "reduce_nights",
    "refractometer",
    "replay",
    "replay_journals",
    "report_of",
    "restore",
    "safety",
    "save",
    "save_triplet_form",
    "show",
    "simulate",
    "simulate_runs",
    "sound",
    "structure",
    "surface",
    "topic",
    "topics",
    "track",
    "track_pointing",
    "trends",
    "triplet",
]


if not TYPE_CHECKING:  # else mypy would accept every name

    def __getattr__(name: str) -> Any:
        if name in RENAMED:
            from catseye.deprecation import warn_deprecated

            replacement, removal = RENAMED[name]
            warn_deprecated(f"catseye.{name}", f"catseye.{replacement}", removal)
            name = replacement
        for file, names in FACE.items():
            if name in names:
                value = globals()[name] = getattr(import_module(f"catseye.api.{file}"), name)
                return value
        raise AttributeError(f"module 'catseye' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
