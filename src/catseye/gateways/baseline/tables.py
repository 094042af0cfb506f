"""EDM baseline as CSV tables."""

from typing import TYPE_CHECKING

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE, PPM
from catseye.gateways.writers.written import cell, csv_text

if TYPE_CHECKING:
    from catseye.reduction.baseline.result import BaselineCalibration

OBSERVATIONS = (
    "row", "from_pillar", "to_pillar", "set", "setup", "slope_m", "group_refractivity_ppm", "first_velocity_mm",
    "second_velocity_um", "arc_to_chord_um", "slope_to_level_mm", "horizontal_m", "direction_deg", "residual_mm",
    "w_shot", "w_set", "status", "place",
)  # fmt: skip


def pillars_csv(calibration: "BaselineCalibration") -> str:
    """Pillars along the line with their standard uncertainties."""
    rows = [
        (name, f"{p.x:.6f}", f"{p.y:.6f}", cell(p.height, ".6f"), f"{p.u_x / MILLIMETRE:.4f}",
         f"{p.u_y / MILLIMETRE:.4f}")
        for name, p in calibration.pillars.items()
    ]  # fmt: skip
    return csv_text(("pillar", "x_m", "y_m", "height_m", "u_x_mm", "u_y_mm"), rows)


def distances_csv(calibration: "BaselineCalibration") -> str:
    """Horizontal distances of all pairs of pillars at the reference height, with uncertainty."""
    rows = [(a, b, f"{d:.6f}", f"{u / MILLIMETRE:.4f}") for a, b, d, u in calibration.spans]
    return csv_text(("from_pillar", "to_pillar", "distance_m", "u_distance_mm"), rows)


def observations_csv(calibration: "BaselineCalibration") -> str:
    """Every shot from the displayed length to its residual."""
    shots, lengths, s = calibration.observations, calibration.lengths, calibration.solution
    residual = calibration.shot_residuals
    w_shot, w_set = np.full(len(shots), np.nan), np.full(len(shots), np.nan)
    w_shot[calibration.keep], w_set[calibration.keep] = s.w_shot, s.w_set[s.used.set]
    rows = [
        (
            k + 1,
            calibration.names[shots.start[k]],
            calibration.names[shots.end[k]],
            shots.set[k] + 1,
            shots.setup[k] + 1,
            f"{shots.slope[k]:.6f}",
            f"{(lengths.index[k] - 1.0) / PPM:.4f}",
            f"{lengths.first[k] / MILLIMETRE:.4f}",
            f"{lengths.second[k] * 1e6:.4f}",
            f"{lengths.chord[k] * 1e6:.4f}",
            f"{lengths.level[k] / MILLIMETRE:.4f}",
            f"{lengths.distance[k]:.7f}",
            cell(shots.direction[k] / DEGREE, ".7f"),
            cell(residual[k] / MILLIMETRE, "+.4f"),
            cell(w_shot[k], "+.3f"),
            cell(w_set[k], "+.3f"),
            calibration.rejected[k] or "used",
            shots.where[k],
        )
        for k in range(len(shots))
    ]
    return csv_text(OBSERVATIONS, rows)
