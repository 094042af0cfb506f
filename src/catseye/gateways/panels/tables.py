"""Panel setting as tables: screws, actuators, panels, readings, crew."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.panels.objects import Screw, screws
from catseye.gateways.writers.columns import Column, Table, Values, each

if TYPE_CHECKING:
    from catseye.estimation.least_squares.adjustment import GroupFit
    from catseye.reduction.panels.crew import Reader
    from catseye.reduction.panels.heights import PanelHeights
    from catseye.reduction.panels.job import PanelWork

PAGE = "panels.md"


def _um(name: str, doc: str, value: Callable[[Any], Values]) -> Column[Any]:
    """Column in micrometres of values in metres."""
    return Column(f"{name}_um", "um", doc, lambda source: 1e6 * np.asarray(value(source), dtype=float), ".2f")


SCREWS = Table[Sequence[Screw]](
    "screws.csv",
    PAGE,
    (
        Column("panel", "", "panel", each(lambda s: s.panel)),
        Column("corner", "", "corner of panels, an actuator", each(lambda s: s.corner)),
        Column("x_m", "m", "place of the corner in the reflector frame, x", each(lambda s: s.x), ".4f"),
        Column("y_m", "m", "place of the corner, y", each(lambda s: s.y), ".4f"),
        Column("readings", "", "number of readings used", each(lambda s: s.readings)),
        _um("height", "departure: height less design offset and map", each(lambda s: s.departure)),
        _um("u_height", "standard uncertainty of the departure", each(lambda s: s.u_departure)),
        _um("relative", "departure less the mean of those read at the corner", each(lambda s: s.relative)),
        _um("u_relative", "standard uncertainty of the relative height", each(lambda s: s.u_relative)),
        Column(
            "probability_within",
            "",
            "probability that the relative height is within the goal",
            each(lambda s: s.probability_within),
            ".4f",
        ),
        Column("turns_clockwise", "", "turns of the screw, clockwise positive", each(lambda s: s.turns), "+.3f"),
        Column("u_turns", "", "standard uncertainty of the turns", each(lambda s: s.u_turns), ".3f"),
        Column("verdict", "", "`leave`, `turn`, `read` (again) or `alone`", each(lambda s: s.verdict)),
    ),
)


class CornerHeight(NamedTuple):
    """Row of actuators.csv, in metres."""

    corner: str
    x: float
    y: float
    actuator: float
    u_actuator: float
    shaft: float
    u_shaft: float


ACTUATORS = Table[Sequence[CornerHeight]](
    "actuators.csv",
    PAGE,
    (
        Column("corner", "", "corner that was read", each(lambda c: c.corner)),
        Column("x_m", "m", "place in the reflector frame, x", each(lambda c: c.x), ".4f"),
        Column("y_m", "m", "place in the reflector frame, y", each(lambda c: c.y), ".4f"),
        _um("mean_height", "mean departure of its panels, which the actuator removes", each(lambda c: c.actuator)),
        _um("u_mean_height", "standard uncertainty of the mean", each(lambda c: c.u_actuator)),
        _um("shaft_height", "height of the actuator's shaft", each(lambda c: c.shaft)),
        _um("u_shaft_height", "standard uncertainty of that height", each(lambda c: c.u_shaft)),
    ),
)


def _slope(name: str, doc: str, value: "Callable[[PanelWork], np.ndarray]") -> "Column[PanelWork]":
    """Column in microradians of values in radians."""
    return Column(f"{name}_urad", "urad", doc, lambda w: 1e6 * value(w), ".2f")


def _map_rms(work: "PanelWork") -> list[float | None]:
    maps = (work.maps.get(panel) for panel in work.latest.layout.panels)
    return [None if fitted is None else fitted.rms for fitted in maps]


def _map_outlying(work: "PanelWork") -> list[int | None]:
    maps = (work.maps.get(panel) for panel in work.latest.layout.panels)
    return [None if fitted is None else int(fitted.outlying.sum()) for fitted in maps]


PANELS = Table["PanelWork"](
    "panels.csv",
    PAGE,
    (
        Column("panel", "", "panel", lambda w: w.latest.layout.panels),
        _um("piston", "shift of the panel's best fit along its normal", lambda w: w.latest.fit[:, 0]),
        _um("u_piston", "standard uncertainty of the piston", lambda w: w.latest.u_fit[:, 0]),
        _slope("slope_x", "slope of the best fit along the panel's x", lambda w: w.latest.fit[:, 1]),
        _slope("slope_y", "slope of the best fit along the panel's y", lambda w: w.latest.fit[:, 2]),
        _slope("u_slope_x", "standard uncertainty of that along x", lambda w: w.latest.u_fit[:, 1]),
        _slope("u_slope_y", "standard uncertainty of that along y", lambda w: w.latest.u_fit[:, 2]),
        _um("map_rms", "rms of the panel's map; empty without one", _map_rms),
        Column("map_outlying_points", "", "number of points of the map left out", _map_outlying),
    ),
)


class GaugeReading(NamedTuple):
    """Row of readings.csv: reading k of a block, of one gauge at one placement."""

    heights: "PanelHeights"
    block: int
    k: int

    @property
    def tip(self) -> int:
        """Index of the tip that touches the panel."""
        return int(self.heights.model.blocks[self.block][self.k])

    @property
    def row(self) -> int:
        """Index of the placement in the file."""
        return int(self.heights.model.tips.row[self.tip])

    @property
    def gauge(self) -> int:
        return int(self.heights.model.tips.gauge[self.tip])

    @property
    def fit(self) -> "GroupFit":
        return self.heights.solution.fits[self.block]


READINGS = Table[Sequence[GaugeReading]](
    "readings.csv",
    PAGE,
    (
        Column("place", "", "line of the file of readings", each(lambda r: r.heights.readings.where[r.row])),
        Column(
            "corner",
            "",
            "corner on which the tool stood",
            each(lambda r: r.heights.layout.corners[r.heights.model.tips.corner[r.tip]]),
        ),
        Column(
            "panel",
            "",
            "panel under the gauge",
            each(lambda r: r.heights.layout.panels[r.heights.model.tips.panel[r.tip]]),
        ),
        Column(
            "session",
            "",
            "session of measurements",
            each(lambda r: r.heights.readings.sessions[r.heights.readings.session[r.row]]),
        ),
        Column("member", "", "member of the crew", each(lambda r: r.heights.readings.member[r.row])),
        Column("turn", "", "quarter turns of the tool on the shaft", each(lambda r: r.heights.readings.turn[r.row])),
        Column("gauge", "", "gauge, `a` to `d`", each(lambda r: r.heights.sheet.gauge[r.gauge].name)),
        Column(
            "reading_mm",
            "mm",
            "reading",
            each(lambda r: r.heights.readings.reading[r.row, r.gauge] / MILLIMETRE),
            ".3f",
        ),
        _um(
            "design_rise",
            "rise of the paraboloid over its tangent plane at the corner",
            each(lambda r: r.heights.model.tips.rise[r.tip]),
        ),
        _um("residual", "observed less adjusted", each(lambda r: r.fit.residual[r.k])),
        Column("w", "", "residual over its own standard deviation", each(lambda r: r.fit.standardised[r.k]), "+.2f"),
        Column("redundancy", "", "redundancy number, 0 (unchecked) to 1", each(lambda r: r.fit.redundancy[r.k]), ".3f"),
        Column("status", "", "`used` or `left out`", each(lambda r: "used" if r.fit.active[r.k] else "left out")),
    ),
    also=("readings-as-left.csv",),
)


class CrewRow(NamedTuple):
    """Row of crew.csv, of one reader."""

    when: str
    kind: str
    reader: "Reader"


def _closure(gauge: str, k: int) -> Column[Sequence[CrewRow]]:
    doc = f"mean change of the zero of gauge {gauge} on the flat, last less first"
    return _um(f"closure_{gauge}", doc, each(lambda c: c.reader.closure[k]))


CREW = Table[Sequence[CrewRow]](
    "crew.csv",
    PAGE,
    (
        Column("when", "", "`as found` or `as left`", each(lambda c: c.when)),
        Column("kind", "", "`member` or `session`", each(lambda c: c.kind)),
        Column("name", "", "name of the member or session", each(lambda c: c.reader.name)),
        Column("readings", "", "number of readings used", each(lambda c: c.reader.readings)),
        Column(
            "degrees_of_freedom",
            "",
            "degrees of freedom of the variance factor",
            each(lambda c: c.reader.degrees_of_freedom),
            ".1f",
        ),
        Column(
            "variance_factor",
            "",
            "variance factor of the readings; 1 where they scatter as the sheet claims",
            each(lambda c: c.reader.variance_factor),
            ".4f",
        ),
        Column("low", "", "lower limit of the variance factor, 99.7 %", each(lambda c: c.reader.low), ".4f"),
        Column("high", "", "upper limit of the variance factor, 99.7 %", each(lambda c: c.reader.high), ".4f"),
        _um("u_gauge", "repeatability of a reading by its scatter", each(lambda c: c.reader.u_gauge)),
        Column("doubts", "", "number of readings in doubt", each(lambda c: c.reader.doubts)),
        *(_closure(gauge, k) for k, gauge in enumerate("abcd")),
    ),
)


def screws_csv(heights: "PanelHeights") -> str:
    """Table of screws of the panels read: positions and turns."""
    return SCREWS.csv(list(screws(heights)))


def actuators_csv(heights: "PanelHeights") -> str:
    """Table of corners read: mean departure, which the actuator removes, and the shaft's height."""
    at, layout = heights.model.columns, heights.layout
    shaft, u_shaft = heights.value(at.shaft(np.arange(len(layout.corners))))
    rows = [
        CornerHeight(
            corner=name,
            x=layout.xy[c, 0],
            y=layout.xy[c, 1],
            actuator=heights.actuator[c],
            u_actuator=heights.u_actuator[c],
            shaft=shaft[c],
            u_shaft=u_shaft[c],
        )
        for c, name in enumerate(layout.corners)
        if np.isfinite(heights.actuator[c])
    ]
    return ACTUATORS.csv(rows)


def panels_csv(work: "PanelWork") -> str:
    """Table of panels read: piston and slopes of the best fit, and data of the map."""
    return PANELS.csv(work)


def readings_csv(heights: "PanelHeights") -> str:
    """Table of readings with residual and test, in the order of the file."""
    blocks = heights.model.blocks[: len(heights.solution.fits)]
    rows = [GaugeReading(heights, block, k) for block, tips in enumerate(blocks) for k in range(len(tips))]
    rows.sort(key=lambda r: (int(heights.readings.where[r.row].split()[1]), heights.sheet.gauge[r.gauge].name))
    return READINGS.csv(rows)


def crew_csv(work: "PanelWork") -> str:
    """Table of members and sessions, as found and as left, for the control chart."""
    from catseye.reduction.panels.crew import members, sessions

    rows = [
        CrewRow(when, kind, reader)
        for when, heights in (("as found", work.found), ("as left", work.left))
        if heights is not None
        for kind, readers in (("member", members(heights)), ("session", sessions(heights)))
        for reader in readers
    ]
    return CREW.csv(rows)
