"""EDM baseline as CSV tables."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE, PPM
from catseye.gateways.writers.columns import Column, Table, each
from catseye.reduction.baseline.result import Pillar, Span

if TYPE_CHECKING:
    from catseye.reduction.baseline.result import BaselineCalibration

PAGE = "baseline.md"
NamedPillar = tuple[str, Pillar]

PILLARS = Table[Sequence[NamedPillar]](
    "pillars.csv",
    PAGE,
    (
        Column("pillar", "", "name, in the order along the line", each(lambda p: p[0])),
        Column("x_m", "m", "place along the line from the first pillar to the last", each(lambda p: p[1].x), ".6f"),
        Column("y_m", "m", "offset from the line, to its left", each(lambda p: p[1].y), ".6f"),
        Column("height_m", "m", "height; empty where no file has it", each(lambda p: p[1].height), ".6f"),
        Column("u_x_mm", "mm", "standard uncertainty of x", each(lambda p: p[1].u_x / MILLIMETRE), ".4f"),
        Column("u_y_mm", "mm", "standard uncertainty of y", each(lambda p: p[1].u_y / MILLIMETRE), ".4f"),
    ),
)

DISTANCES = Table[Sequence[Span]](
    "distances.csv",
    PAGE,
    (
        Column("from_pillar", "", "first pillar", each(lambda s: s.start)),
        Column("to_pillar", "", "second pillar", each(lambda s: s.end)),
        Column("distance_m", "m", "horizontal distance at the reference height", each(lambda s: s.distance), ".6f"),
        Column("u_distance_mm", "mm", "standard uncertainty of the distance", each(lambda s: s.u / MILLIMETRE), ".4f"),
    ),
)


def _kept(values: np.ndarray, calibration: "BaselineCalibration") -> np.ndarray:
    """Values of the used shots among all shots; nan for excluded ones."""
    every = np.full(len(calibration.keep), np.nan)
    every[calibration.keep] = values
    return every


OBSERVATIONS = Table["BaselineCalibration"](
    "observations.csv",
    PAGE,
    (
        Column("row", "", "shot, from 1", lambda c: np.arange(1, len(c.observations) + 1)),
        Column("from_pillar", "", "pillar of the instrument", lambda c: [c.names[k] for k in c.observations.start]),
        Column("to_pillar", "", "pillar of the target", lambda c: [c.names[k] for k in c.observations.end]),
        Column("set", "", "set of shots, from 1", lambda c: c.observations.set + 1),
        Column("setup", "", "set-up of the instrument, from 1", lambda c: c.observations.setup + 1),
        Column("slope_m", "m", "slope distance as displayed", lambda c: c.observations.slope, ".6f"),
        Column(
            "group_refractivity_ppm",
            "ppm",
            "group refractivity of the air",
            lambda c: (c.lengths.index - 1.0) / PPM,
            ".4f",
        ),
        Column(
            "first_velocity_mm",
            "mm",
            "first velocity correction: index of the air",
            lambda c: c.lengths.first / MILLIMETRE,
            ".4f",
        ),
        Column(
            "second_velocity_um",
            "um",
            "second velocity correction: curvature of the beam in the index",
            lambda c: c.lengths.second * 1e6,
            ".4f",
        ),
        Column("arc_to_chord_um", "um", "arc to chord correction", lambda c: c.lengths.chord * 1e6, ".4f"),
        Column(
            "slope_to_level_mm",
            "mm",
            "slope to horizontal at the reference height",
            lambda c: c.lengths.level / MILLIMETRE,
            ".4f",
        ),
        Column("horizontal_m", "m", "horizontal distance at the reference height", lambda c: c.lengths.distance, ".7f"),
        Column(
            "direction_deg",
            "deg",
            "horizontal direction, if observed",
            lambda c: c.observations.direction / DEGREE,
            ".7f",
        ),
        Column("residual_mm", "mm", "observed less adjusted", lambda c: c.shot_residuals / MILLIMETRE, "+.4f"),
        Column(
            "w_shot", "", "standardised residual of the shot in its set", lambda c: _kept(c.solution.w_shot, c), "+.3f"
        ),
        Column(
            "w_set",
            "",
            "standardised residual of its set",
            lambda c: _kept(c.solution.w_set[c.solution.used.set], c),
            "+.3f",
        ),
        Column(
            "status",
            "",
            "`used`, or the reason of the exclusion",
            lambda c: [reason or "used" for reason in c.rejected],
        ),
        Column("place", "", "line of the file", lambda c: c.observations.where),
    ),
)


def pillars_csv(calibration: "BaselineCalibration") -> str:
    """Pillars along the line with their standard uncertainties."""
    return PILLARS.csv(list(calibration.pillars.items()))


def distances_csv(calibration: "BaselineCalibration") -> str:
    """Horizontal distances of all pairs of pillars at the reference height, with uncertainty."""
    return DISTANCES.csv(calibration.spans)


def observations_csv(calibration: "BaselineCalibration") -> str:
    """Every shot from the displayed length to its residual."""
    return OBSERVATIONS.csv(calibration)
