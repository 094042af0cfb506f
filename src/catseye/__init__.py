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
    from catseye.api.atmosphere.logger import weather
    from catseye.api.atmosphere.ray import path
    from catseye.api.atmosphere.sound_field import acoustic_field
    from catseye.api.baseline import baseline
    from catseye.api.budget.points import budget
    from catseye.api.budget.shot import explain
    from catseye.api.deformation.movements import movements
    from catseye.api.detection.buffer import phase
    from catseye.api.detection.cycles import cycles
    from catseye.api.detection.frequencies import frequencies
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
    from catseye.api.laboratory import (
        calibrate,
        certificate,
        save_calibration_template,
        save_triplet_form,
        triplet,
    )
    from catseye.api.light.stray import stray
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
    from catseye.api.scans.compare import compare_scan
    from catseye.api.scans.fit import fit_scan
    from catseye.api.scans.plots import plot_quadrant, plot_visibility
    from catseye.api.scans.search import search_scan
    from catseye.api.scans.servo import identify_servo
    from catseye.api.steering import point
    from catseye.api.structure import structure
    from catseye.api.surface import surface
    from catseye.api.telescope.cardinal_points import choose_model
    from catseye.api.telescope.displacement import displace_model
    from catseye.api.telescope.finite_elements import import_model
    from catseye.api.telescope.frames import convert
    from catseye.api.telescope.model_fit import fit_model
    from catseye.api.telescope.subreflector import subreflector
    from catseye.api.telescope.tracking import track
    from catseye.api.telescope.vibration import follow
    from catseye.api.track_profile import track_pointing
    from catseye.api.triplet.hollow import range_triplets
    from catseye.api.triplet.mount import aim_triplets, bound_triplets
    from catseye.api.triplet.ranges import adjust_triplets, reduce_triplets
    from catseye.api.weather import air, sound

FACE = {  # file of catseye.api -> its exported names
    "air_paths": ("acoustic", "refractometer"),
    "atmosphere.logger": ("weather",),
    "atmosphere.ray": ("path",),
    "atmosphere.sound_field": ("acoustic_field",),
    "baseline": ("baseline",),
    "budget.points": ("budget",),
    "budget.shot": ("explain",),
    "deformation.movements": ("movements",),
    "detection.buffer": ("phase",),
    "detection.cycles": ("cycles",),
    "detection.frequencies": ("frequencies",),
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
    "laboratory": ("calibrate", "certificate", "save_calibration_template", "save_triplet_form", "triplet"),
    "light.stray": ("stray",),
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
    "scans.compare": ("compare_scan",),
    "scans.fit": ("fit_scan",),
    "scans.plots": ("plot_quadrant", "plot_visibility"),
    "scans.search": ("search_scan",),
    "scans.servo": ("identify_servo",),
    "steering": ("point",),
    "structure": ("structure",),
    "surface": ("surface",),
    "telescope.frames": ("convert",),
    "telescope.subreflector": ("subreflector",),
    "telescope.tracking": ("track",),
    "telescope.vibration": ("follow",),
    "telescope.cardinal_points": ("choose_model",),
    "telescope.displacement": ("displace_model",),
    "telescope.finite_elements": ("import_model",),
    "telescope.model_fit": ("fit_model",),
    "track_profile": ("track_pointing",),
    "triplet.hollow": ("range_triplets",),
    "triplet.mount": ("aim_triplets", "bound_triplets"),
    "triplet.ranges": ("adjust_triplets", "reduce_triplets"),
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
    "acoustic_field",
    "adjust",
    "adjust_triplets",
    "aim_triplets",
    "air",
    "archive",
    "backup_journal",
    "baseline",
    "beam",
    "bound_triplets",
    "budget",
    "calibrate",
    "certificate",
    "check_journal",
    "choose_model",
    "compare",
    "compare_scan",
    "convert",
    "cycles",
    "design",
    "displace_model",
    "examples",
    "explain",
    "export",
    "fit_model",
    "fit_pointing",
    "fit_scan",
    "follow",
    "frequencies",
    "glass",
    "identify_servo",
    "import_model",
    "link",
    "load",
    "locate",
    "movements",
    "night",
    "panels",
    "path",
    "phase",
    "plan",
    "plot_aberration",
    "plot_air",
    "plot_beam",
    "plot_coating",
    "plot_polarization",
    "plot_quadrant",
    "plot_return",
    "plot_servo",
    "plot_sky",
    "plot_visibility",
    "point",
    "pose",
    "predict_pointing",
    "query",
    "range_triplets",
    "reduce",
    "reduce_nights",
    "reduce_triplets",
    "refractometer",
    "replay",
    "replay_journals",
    "report_of",
    "restore",
    "safety",
    "save",
    "save_calibration_template",
    "save_triplet_form",
    "search_scan",
    "show",
    "simulate",
    "simulate_runs",
    "sound",
    "stray",
    "structure",
    "subreflector",
    "surface",
    "topic",
    "topics",
    "track",
    "track_pointing",
    "trends",
    "triplet",
    "weather",
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
