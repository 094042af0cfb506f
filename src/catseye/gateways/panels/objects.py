"""Panel setting as JSON and text."""

from collections.abc import Iterable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from catseye.gateways.writers.passage import Passage
from catseye.names import counted
from catseye.reduction.panels.crew import members, sessions, standing, zeros
from catseye.reduction.panels.heights import surface_rms
from catseye.reduction.panels.job import verdicts

if TYPE_CHECKING:
    from catseye.reduction.panels.crew import CornerStatistics, Reader, Setting
    from catseye.reduction.panels.heights import Doubt, PanelHeights
    from catseye.reduction.panels.job import PanelWork

FORMAT = "catseye-panels-1"


class Screw(NamedTuple):
    """Row of the list of screws; SI unless the name has a unit."""

    panel: str
    corner: str
    x: float
    y: float
    readings: int
    departure: float
    u_departure: float
    relative: float
    u_relative: float
    probability_within: float
    turns: float
    u_turns: float
    verdict: str


def screws(heights: "PanelHeights") -> Iterable[Screw]:
    """Screws of the panels read, in the layout's order."""
    layout, verdict = heights.layout, verdicts(heights)
    for i, panel in enumerate(layout.panels):
        for k in range(4):
            c = layout.quad[i, k]
            yield Screw(
                panel,
                layout.corners[c],
                float(layout.xy[c, 0]),
                float(layout.xy[c, 1]),
                int(heights.times[i, k]),
                float(heights.departure[i, k]),
                float(heights.u_departure[i, k]),
                float(heights.relative[i, k]),
                float(heights.u_relative[i, k]),
                float(heights.conforms[i, k]),
                float(heights.turns[i, k]),
                float(heights.u_turns[i, k]),
                str(verdict[i, k]),
            )


def panels_object(work: "PanelWork") -> dict[str, Any]:
    """Object that `catseye panels --json` prints: SI units."""
    last = work.latest
    return {
        "format": FORMAT,
        "verdict": work.verdict.to_object(),
        "instrument": {"name": work.sheet.name, "serial": work.sheet.serial},
        "layout": {"panels": len(work.layout.panels), "corners": len(work.layout.corners)},
        "goal": work.sheet.goal_um * 1e-6,
        "as_found": _heights_object(work.found),
        "as_left": None if work.left is None else _heights_object(work.left),
        "setting": None if work.setting is None else _setting_object(work.setting),
        "screws_from": "as_found" if work.left is None else "as_left",
        "screws": [screw._asdict() for screw in screws(last)],
        "actuators": {
            name: {"mean_departure": last.actuator[c], "u": last.u_actuator[c]}
            for c, name in enumerate(last.layout.corners)
            if np.isfinite(last.actuator[c])
        },
        "panels": {
            name: {"piston": last.fit[p, 0], "slope_x": last.fit[p, 1], "slope_y": last.fit[p, 2],
                   "u_piston": last.u_fit[p, 0], "u_slope_x": last.u_fit[p, 1], "u_slope_y": last.u_fit[p, 2],
                   "map_rms": work.maps[name].rms if name in work.maps else None}
            for p, name in enumerate(last.layout.panels)
        },
        "notes": list(work.notes),
    }  # fmt: skip


def _heights_object(heights: "PanelHeights") -> dict[str, Any]:
    return {
        "panels": len(heights.layout.panels),
        "placements": int(np.sum(heights.readings.corner >= 0)),
        "readings": int(sum(f.active.sum() for f in heights.solution.fits[: len(heights.model.blocks)])),
        "standing": asdict(standing(heights)),
        "surface_rms": surface_rms(heights, heights.departure)[0],
        "surveyed": heights.surveyed,
        "variance_factor": heights.variance_factor,
        "degrees_of_freedom": heights.degrees_of_freedom,
        "members": [_reader_object(r) for r in members(heights)],
        "sessions": [_reader_object(r) for r in sessions(heights)],
        "zeros": {name: {"zero": value, "u": u} for name, value, u in zeros(heights)},
        "doubts": [asdict(d) for d in heights.doubts],
    }


def _reader_object(reader: "Reader") -> dict[str, Any]:
    return {**asdict(reader), "in_control": reader.in_control}


def _setting_object(setting: "Setting") -> dict[str, Any]:
    return {
        "corners": len(setting.names),
        "gain": setting.gain,
        "u_gain": setting.u_gain,
        "scatter": setting.scatter,
    }


def micrometres(value: float, form: str = ".1f") -> str:
    """Length in µm as text; a dash if unknown.

    >>> micrometres(2.54e-5)
    '25.4'
    """
    return format(value * 1e6, form) if np.isfinite(value) else "-"


def standing_text(one: "CornerStatistics", goal_um: float) -> str:
    if not one.corners:
        return "no corner with two panels read"
    true = micrometres(one.rms_true)
    return (
        f"{one.corners} panel corners lie {micrometres(one.rms)} µm rms about their neighbours' mean "
        f"({true} µm without the scatter of the measurement; median u {micrometres(one.median_u)} µm); "
        f"{100 * one.within:.1f} % within ± {goal_um:g} µm as measured, {100 * one.expected_within:.1f} % expected "
        f"truly; surely within {one.surely}, surely not {one.surely_not}, undecided {one.undecided}"
    )


def doubt_text(one: "Doubt") -> str:
    also = f"; {' or '.join(one.rivals)} would also explain it" if one.rivals else ""
    return (
        f"{one.where}, {one.gauge}_mm by {one.member} at {one.corner} on {one.panel}: {micrometres(one.error, '+.0f')} "
        f"µm off, w = {one.w:+.1f}{also}{'; left out' if one.out else ''}"
    )


def passages(work: "PanelWork") -> list[Passage]:
    """Passages of the command's output."""
    heights, last = work.found, work.latest
    serial = "" if work.sheet.serial is None else f", serial {work.sheet.serial}"
    goal = work.sheet.goal_um
    passages = [
        Passage(
            "The tool",
            f"{work.sheet.name}{serial}: {counted(int(np.sum(heights.readings.corner >= 0)), 'placement')} in "
            f"{counted(len(heights.readings.sessions), 'session')} on {len(heights.layout.panels)} panels; variance "
            f"factor {heights.variance_factor:.3f} with {heights.degrees_of_freedom:.0f} degrees of freedom",
        ),
        Passage("As found", standing_text(standing(heights), goal)),
    ]
    if work.left is not None:
        passages.append(Passage("As left", standing_text(standing(work.left), goal)))
    if work.setting is not None:
        setting = work.setting
        passages.append(
            Passage(
                "The turning",
                f"{len(setting.names)} corners moved {setting.gain:.3f} (u {setting.u_gain:.3f}) of the request; "
                f"scatter {micrometres(setting.scatter)} µm rms, of turning and reading",
            )
        )
    verdict = verdicts(last)
    turn = verdict == "turn"
    largest = float(np.nanmax(np.abs(last.turns), initial=0.0)) if last.known.any() else 0.0
    passages.append(
        Passage(
            "The screws",
            f"turn {int(turn.sum())}, leave {int((verdict == 'leave').sum())}, read first "
            f"{int((verdict == 'read').sum())}; {int((verdict == 'alone').sum())} have no neighbour and "
            f"are set by their actuator only; the largest turn is {largest:.2f}",
        )
    )
    rms = surface_rms(last, last.departure)[0]
    passages.append(
        Passage(
            "The surface",
            f"panel corners depart {rms * 1e6:.0f} µm rms from the best fit of the design, shift and tilt free"
            + ("" if last.surveyed else "; of little significance without a survey"),
        )
    )
    for when, one in (("found", heights), ("left", work.left)):
        passages += [Passage(f"Doubt, {when}", doubt_text(d)) for d in (() if one is None else one.doubts[:5])]
    passages += [Passage("Note", note) for note in work.notes]
    return passages
