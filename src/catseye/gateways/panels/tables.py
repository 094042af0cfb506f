"""Panel setting as CSV tables: screws, actuators, panels, readings."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.panels.objects import screws
from catseye.gateways.writers.written import cell, csv_text

if TYPE_CHECKING:
    from catseye.reduction.panels.heights import PanelHeights
    from catseye.reduction.panels.job import PanelWork

SCREWS = (
    "panel", "corner", "x_m", "y_m", "readings", "height_um", "u_height_um", "relative_um", "u_relative_um",
    "probability_within", "turns_clockwise", "u_turns", "verdict",
)  # fmt: skip
READINGS = (
    "place", "corner", "panel", "session", "member", "turn", "gauge", "reading_mm", "design_rise_um", "residual_um",
    "w", "redundancy", "status",
)  # fmt: skip


def screws_csv(heights: "PanelHeights") -> str:
    """Table of screws of the panels read: positions and turns."""
    rows = [
        (s.panel, s.corner, f"{s.x:.4f}", f"{s.y:.4f}", s.readings, _um(s.departure), _um(s.u_departure),
         _um(s.relative), _um(s.u_relative), cell(s.probability_within, ".4f"), cell(s.turns, "+.3f"),
         cell(s.u_turns, ".3f"), s.verdict)
        for s in screws(heights)
    ]  # fmt: skip
    return csv_text(SCREWS, rows)


def actuators_csv(heights: "PanelHeights") -> str:
    """Table of corners read: mean departure, which the actuator removes, and the shaft's height."""
    at = heights.model.columns
    shaft, u_shaft = heights.value(at.shaft(np.arange(len(heights.layout.corners))))
    rows = [
        (name, f"{heights.layout.xy[c, 0]:.4f}", f"{heights.layout.xy[c, 1]:.4f}", _um(heights.actuator[c]),
         _um(heights.u_actuator[c]), _um(shaft[c]), _um(u_shaft[c]))
        for c, name in enumerate(heights.layout.corners) if np.isfinite(heights.actuator[c])
    ]  # fmt: skip
    columns = ("corner", "x_m", "y_m", "mean_height_um", "u_mean_height_um", "shaft_height_um", "u_shaft_height_um")
    return csv_text(columns, rows)


def panels_csv(work: "PanelWork") -> str:
    """Table of panels read: piston and slopes of the best fit, and data of the map."""
    heights = work.latest
    rows = []
    for p, name in enumerate(heights.layout.panels):
        fitted = work.maps.get(name)
        rows.append(
            (name, _um(heights.fit[p, 0]), _um(heights.u_fit[p, 0]), *(_um(v) for v in heights.fit[p, 1:]),
             *(_um(v) for v in heights.u_fit[p, 1:]), "" if fitted is None else _um(fitted.rms),
             "" if fitted is None else int(fitted.outlying.sum()))
        )  # fmt: skip
    columns = (
        "panel", "piston_um", "u_piston_um", "slope_x_urad", "slope_y_urad", "u_slope_x_urad", "u_slope_y_urad",
        "map_rms_um", "map_outlying_points",
    )  # fmt: skip
    return csv_text(columns, rows)


def readings_csv(heights: "PanelHeights") -> str:
    """Table of readings with residual and test."""
    tips, readings = heights.model.tips, heights.readings
    rows: list[Sequence[Any]] = []
    for fit, block in zip(heights.solution.fits, heights.model.blocks, strict=False):
        for k, tip in enumerate(block):
            row, gauge = tips.row[tip], tips.gauge[tip]
            rows.append(
                (readings.where[row], heights.layout.corners[tips.corner[tip]], heights.layout.panels[tips.panel[tip]],
                 readings.sessions[readings.session[row]], readings.member[row], readings.turn[row],
                 heights.sheet.gauge[gauge].name, f"{readings.reading[row, gauge] / MILLIMETRE:.3f}",
                 _um(tips.rise[tip]), _um(fit.residual[k]), cell(fit.standardised[k], "+.2f"),
                 cell(fit.redundancy[k], ".3f"), "used" if fit.active[k] else "left out")
            )  # fmt: skip
    rows.sort(key=lambda r: (int(r[0].split()[1]), r[6]))
    return csv_text(READINGS, rows)


def crew_csv(work: "PanelWork") -> str:
    """Table of members and sessions, as found and as left, for the control chart."""
    from catseye.reduction.panels.crew import members, sessions

    rows = []
    for when, heights in (("as found", work.found), ("as left", work.left)):
        if heights is None:
            continue
        for kind, readers in (("member", members(heights)), ("session", sessions(heights))):
            rows += [
                (when, kind, r.name, r.readings, cell(r.degrees_of_freedom, ".1f"), cell(r.variance_factor, ".4f"),
                 cell(r.low, ".4f"), cell(r.high, ".4f"), _um(r.u_gauge), r.doubts, *(_um(v) for v in r.closure))
                for r in readers
            ]  # fmt: skip
    columns = (
        "when", "kind", "name", "readings", "degrees_of_freedom", "variance_factor", "low", "high", "u_gauge_um",
        "doubts", "closure_a_um", "closure_b_um", "closure_c_um", "closure_d_um",
    )  # fmt: skip
    return csv_text(columns, rows)


def _um(value: float) -> str:
    return cell(value * 1e6, ".2f")
