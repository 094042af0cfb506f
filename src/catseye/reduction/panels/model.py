"""Panel setting instrument readings as observations of corner heights.

reading = H(place) + D(place) - s + lean · place + zero + offset

H   deviation of the panel's surface from the paraboloid at the gauge's tip: heights e of its four corners shared
    bilinearly, and the map's shape between them
D   rise of the paraboloid itself over the tangent plane at the corner: 28 to 47 µm at 106 mm
s   height of the shaft's shoulder; the same for all placements at the corner
lean    of the tool's axis from the design normal, towards the tool's x and y: the base plane falls that way
zero    of a gauge in a session; offset: sheet's corrections

All is linear. Errors that placements of one corner share without a parameter (the lean where none was read, the local
slope of each panel) make their readings correlated: one block per corner.

Source: [PARKER04] chapter 11.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.errors import InputError
from catseye.estimation.observations.kind import ObservationKind
from catseye.geometry.antenna.panel_surface import axes, cosine_of_slope, panels_under, warps
from catseye.geometry.antenna.panel_tool import turned
from catseye.records.files.refusal import refusal
from catseye.records.panels.instrument import PanelInstrument
from catseye.records.panels.layout import PanelLayout
from catseye.records.panels.readings import PanelReadings, PanelSurvey
from catseye.reduction.panels.maps import FittedMap

MICROMETRE = 1e-6
GAUGES = 4


@dataclass(frozen=True, eq=False)
class RowColumns(ObservationKind):
    """Linear observations, each of a few parameters.

    observed = sum of coefficients times parameters, per row; -1 stands for none.

    coefficient   (m, w)
    """

    kind: ClassVar[str] = "linear"
    unit: ClassVar[str] = "m"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    columns: np.ndarray
    coefficient: np.ndarray

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, w) at the parameters x."""
        return np.sum(self.coefficient * np.where(self.columns < 0, 0.0, x[self.columns]), axis=1), self.coefficient


@dataclass(frozen=True, eq=False)
class PanelColumns:
    """Positions of the parameters.

    Corner heights (p, 4), shafts (c,), zeros (s, 4), levels (s, 2).
    """

    panels: int
    corners: int
    sessions: int

    @property
    def size(self) -> int:
        """Number of all parameters."""
        return 4 * self.panels + self.corners + 6 * self.sessions

    def height(self, panel: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Columns of panels' corner heights, by panel and place 0 to 3."""
        return 4 * panel + place

    def shaft(self, corner: np.ndarray) -> np.ndarray:
        """Columns of the shafts' heights, by corner of the dish."""
        return 4 * self.panels + corner

    def zero(self, session: np.ndarray, gauge: np.ndarray) -> np.ndarray:
        """Columns of the gauges' zeros, by session and gauge 0 to 3."""
        return 4 * self.panels + self.corners + 6 * session + gauge

    def level(self, session: np.ndarray, axis: int) -> np.ndarray:
        """Columns of the level's zeros, by session and axis 0 or 1."""
        return 4 * self.panels + self.corners + 6 * session + 4 + axis


@dataclass(frozen=True, eq=False)
class Tips:
    """Individual readings, (n,) each, grouped by corner.

    row, gauge    of the table
    corner        number
    panel         under the tip
    share         (n, 4) of the panel's corners in the tip's height
    tool, place   (n, 2) m, the tip in the tool's and in the corner's axes
    at            (n, 3) m, the tip on the surface, reflector frame
    rise          m, of the paraboloid
    """

    row: np.ndarray
    gauge: np.ndarray
    corner: np.ndarray
    panel: np.ndarray
    share: np.ndarray
    tool: np.ndarray
    place: np.ndarray
    at: np.ndarray
    rise: np.ndarray


def tips_of(readings: PanelReadings, layout: PanelLayout, sheet: PanelInstrument) -> Tips:
    """Positions touched by the readings.

    InputError for one where no panel is.
    """
    on = np.isfinite(readings.reading) & (readings.corner >= 0)[:, None]
    row, gauge = np.nonzero(on)
    order = np.argsort(readings.corner[row], kind="stable")
    row, gauge = row[order], gauge[order]
    corner = readings.corner[row]
    tool = (np.array([[g.x_mm, g.y_mm] for g in sheet.gauge]) * MILLIMETRE)[gauge]
    place = turned(tool, readings.turn[row])
    at, rise = axes(layout.xy[corner], layout.focal_length).places(place[:, 0], place[:, 1], layout.focal_length)
    panel, share = panels_under(at[:, :2], layout.xy[layout.quad])
    if np.any(panel < 0):
        k = int(np.argmax(panel < 0))
        raise refusal(
            readings.file,
            f"{readings.where[row[k]]}, {sheet.gauge[gauge[k]].name}_mm at {layout.corners[corner[k]]}, turn "
            f"{readings.turn[row[k]]}, has no panel under it (expected a blank cell, or another turn)",
        )
    return Tips(row=row, gauge=gauge, corner=corner, panel=panel, share=share, tool=tool, place=place, at=at, rise=rise)


def corrected(readings: PanelReadings, layout: PanelLayout, sheet: PanelInstrument, *, tips: Tips) -> np.ndarray:
    """Readings (n,), m, corrected by the gauges' sheet.

    r + linearity, over 1 + scale, less zero per °C; a tip sags by sag · cos(slope) on the dish and by sag on the flat,
    so that it reads sag (1 - cos) too low. Raises InputError where a correction needs a missing column.
    """
    raw = readings.reading[tips.row, tips.gauge]
    result = gauge_corrected(raw, tips.gauge, sheet)
    warm = np.array([g.zero_um_per_c for g in sheet.gauge])[tips.gauge] * MICROMETRE
    sag = np.array([g.sag_um for g in sheet.gauge])[tips.gauge] * MICROMETRE
    for name, factor, values in (
        ("temperature_c", warm, readings.temperature_c[tips.row]),
        ("elevation_deg", sag, readings.elevation[tips.row]),
    ):
        missing = (factor != 0.0) & np.isnan(values)
        if missing.any():
            where = readings.where[tips.row[int(np.argmax(missing))]]
            raise refusal(readings.file, f"{where}, {name} is blank (expected a value: the sheet's gauges need it)")
    warmer = np.nan_to_num(readings.temperature_c[tips.row] - sheet.flat_temperature_c)
    normal = axes(layout.xy[tips.corner], layout.focal_length).z
    upright = cosine_of_slope(normal, np.nan_to_num(readings.elevation[tips.row], nan=np.pi / 2.0))
    return result - warm * warmer + np.where(sag != 0.0, sag * (1.0 - upright), 0.0)


def gauge_corrected(raw: np.ndarray, gauge: np.ndarray, sheet: PanelInstrument) -> np.ndarray:
    """Readings (n,), m, of gauges (n,), corrected for linearity and scale."""
    result = np.array(raw)
    for k, g in enumerate(sheet.gauge):
        of_gauge = gauge == k
        if g.linearity:
            at, correction = np.array(g.linearity).T
            result[of_gauge] += np.interp(result[of_gauge], at * MILLIMETRE, correction * MICROMETRE)
        result[of_gauge] /= 1.0 + g.scale_ppm * 1e-6
    return result


@dataclass(frozen=True, eq=False)
class PanelModel:
    """Observations, parameters and rows of the adjustment.

    groups     readings by block size first, then flat, priors, warps, survey
    blocks     for each group of readings, (m,) numbers of its tips
    target     (p, 4) m, height of each panel corner by design and map
    u_target   (p, 4) m, of the map at that place; zero without one
    """

    layout: PanelLayout
    columns: PanelColumns
    tips: Tips
    groups: tuple[RowColumns, ...]
    blocks: tuple[np.ndarray, ...]
    target: np.ndarray
    u_target: np.ndarray
    mapped: np.ndarray


def panel_axes(layout: PanelLayout, panel: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Places (n, 2), m, in the axes of panels (n,).

    From places (n, 3); the origin is the mean of the corners, x outwards.
    """
    middle = layout.xy[layout.quad].mean(axis=1)[panel]
    frame = axes(middle, layout.focal_length)
    arm = at - frame.origin
    return np.stack([np.sum(arm * frame.x, axis=1), np.sum(arm * frame.y, axis=1)], axis=1)


def corner_places(layout: PanelLayout) -> np.ndarray:
    """Corners (p, 4, 2), m, in their panels' axes."""
    at = axes(layout.xy[layout.quad], layout.focal_length).origin
    panel = np.repeat(np.arange(len(layout.panels)), 4)
    return panel_axes(layout, panel, at.reshape(-1, 3)).reshape(-1, 4, 2)


def panel_model(
    readings: PanelReadings,
    layout: PanelLayout,
    sheet: PanelInstrument,
    *,
    survey: PanelSurvey | None = None,
    maps: Mapping[str, FittedMap] | None = None,
) -> PanelModel:
    """Observations of a table of readings.

    readings   as read
    layout     every panel of it becomes a parameter: `used_layout` selects those that a gauge touched
    sheet      of the instrument
    survey     heights of shafts
    maps       by panel
    """
    tips = tips_of(readings, layout, sheet)
    columns = PanelColumns(len(layout.panels), len(layout.corners), len(readings.sessions))
    places = corner_places(layout)
    shape, between = _mapped(layout, tips, places, maps or {})
    mapped = np.array([name in (maps or {}) for name in layout.panels])
    observed = corrected(readings, layout, sheet, tips=tips) - tips.rise - between
    lean = readings.lean[tips.row]
    read = np.isfinite(lean[:, 0])
    observed = observed - np.sum(np.nan_to_num(lean) * tips.tool, axis=1)
    names = np.array([-1])
    level = [np.where(read, columns.level(readings.session[tips.row], k), names) for k in (0, 1)]
    at = np.column_stack(
        [columns.height(tips.panel[:, None], np.arange(4)), columns.shaft(tips.corner),
         columns.zero(readings.session[tips.row], tips.gauge), *level]
    )  # fmt: skip
    n = len(observed)
    factor = np.column_stack([tips.share, -np.ones(n), np.ones(n), np.where(read[:, None], -tips.tool, 0.0)])
    groups, blocks = _reading_groups(layout, sheet, tips, mapped, (observed, at, factor, read))
    prior, target = sheet.panel, layout.offset + shape
    u_target = np.where(mapped, prior.u_map_um * MICROMETRE, 0.0)[:, None] * np.ones(4)
    more = [
        *_flat(readings, sheet, columns),
        _priors(sheet, columns, target),
        _warps(layout, sheet, places, target, mapped),
        _shafts(layout, sheet, columns, survey),
    ]
    return PanelModel(
        layout=layout,
        columns=columns,
        tips=tips,
        groups=(*groups, *more),
        blocks=blocks,
        target=target,
        u_target=u_target,
        mapped=mapped,
    )


def _mapped(
    layout: PanelLayout, tips: Tips, places: np.ndarray, maps: Mapping[str, FittedMap]
) -> tuple[np.ndarray, np.ndarray]:
    """Shape of panels at corners (p, 4) and at tips (n,), m.

    At tips minus the bilinear part of the corners.
    """
    shape, between = np.zeros((len(layout.panels), 4)), np.zeros(len(tips.row))
    local = panel_axes(layout, tips.panel, tips.at)
    for p, name in enumerate(layout.panels):
        if name in maps:
            shape[p] = maps[name].at(places[p])
            on_panel = np.flatnonzero(tips.panel == p)
            if len(on_panel):
                between[on_panel] = maps[name].at(local[on_panel]) - tips.share[on_panel] @ shape[p]
    return shape, between


def _reading_groups(
    layout: PanelLayout,
    sheet: PanelInstrument,
    tips: Tips,
    mapped: np.ndarray,
    rows: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
) -> tuple[list[RowColumns], tuple[np.ndarray, ...]]:
    """Blocks of one corner each, grouped by size."""
    observed, at, factor, read = rows
    prior = sheet.panel
    single = (sheet.u_gauge_um**2 + sheet.resolution_um**2 / 12.0) * MICROMETRE**2
    lean = (sheet.u_lean_arcsec * ARCSECOND) ** 2
    free = (sheet.lean_limit_arcmin * 60.0 * ARCSECOND) ** 2 / 3.0
    slope = np.where(mapped, prior.u_map_slope_urad, prior.u_slope_urad)[tips.panel] * 1e-6
    shape = np.where(mapped, prior.u_map_um, prior.u_shape_um)[tips.panel] * MICROMETRE
    at_home = np.any(layout.quad[tips.panel] == tips.corner[:, None], axis=1)
    shape = np.where(at_home, 0.0, shape)  # a panel without a corner here: its edge may be off its corners' line
    _, start, count = np.unique(tips.corner, return_index=True, return_counts=True)
    groups, blocks = [], []
    for size in np.unique(count):
        which = (start[count == size][:, None] + np.arange(size)).astype(int)  # (b, r)

        def pairs(values: np.ndarray, which: np.ndarray = which) -> np.ndarray:
            """Scalar products (b, r, r) of the rows of a block."""
            inside = values[which]
            return inside @ np.swapaxes(inside, 1, 2) if values.ndim == 2 else inside[:, :, None] * inside[:, None, :]

        def equal(values: np.ndarray, which: np.ndarray = which) -> np.ndarray:
            return values[which][:, :, None] == values[which][:, None, :]

        weight = read.astype(float)
        c = single * np.eye(size) + np.where(equal(tips.row), pairs(tips.tool), 0.0) * pairs(weight) * lean
        c = c + pairs(tips.place) * pairs(1.0 - weight) * free
        c = c + np.where(equal(tips.panel), pairs(tips.place) * pairs(slope) + pairs(shape), 0.0)
        flat = which.ravel()
        groups.append(RowColumns(f"readings of {size}", observed[flat], c, at[flat], factor[flat]))
        blocks.append(flat)
    return groups, tuple(blocks)


def flat_means(readings: PanelReadings, sheet: PanelInstrument) -> tuple[np.ndarray, np.ndarray]:
    """Mean reading (s, 4), m, of each gauge on the flat, and number.

    By session; nan where none.
    """
    sessions = len(readings.sessions)
    mean, many = np.full((sessions, GAUGES), np.nan), np.zeros((sessions, GAUGES), dtype=int)
    warm = np.nan_to_num(readings.temperature_c - sheet.flat_temperature_c)
    for s in range(sessions):
        for g, gauge in enumerate(sheet.gauge):
            on_flat = np.flatnonzero(
                (readings.corner < 0) & (readings.session == s) & np.isfinite(readings.reading[:, g])
            )
            many[s, g] = len(on_flat)
            if len(on_flat):
                value = gauge_corrected(readings.reading[on_flat, g], np.full(len(on_flat), g), sheet)
                mean[s, g] = np.mean(value - gauge.zero_um_per_c * MICROMETRE * warm[on_flat])
    return mean, many


def _flat(readings: PanelReadings, sheet: PanelInstrument, columns: PanelColumns) -> list[RowColumns]:
    """Flat means as observations of the gauges' zeros.

    The flat's own unevenness is the same in all sessions.
    """
    mean, many = flat_means(readings, sheet)
    session, gauge = np.nonzero(many)
    if not len(session):
        return []
    single = (sheet.u_gauge_um**2 + sheet.resolution_um**2 / 12.0) * MICROMETRE**2
    c = np.diag(single / many[session, gauge])
    c = c + np.where(gauge[:, None] == gauge, (sheet.u_flat_um * MICROMETRE) ** 2, 0.0)
    at = columns.zero(session, gauge)[:, None]
    return [RowColumns("flat", mean[session, gauge], c, at, np.ones((len(at), 1)))]


def _priors(sheet: PanelInstrument, columns: PanelColumns, target: np.ndarray) -> RowColumns:
    """Priors: heights near their targets, zeros and levels near zero."""
    many = np.arange(columns.size)
    first, last = 4 * columns.panels, columns.size - 6 * columns.sessions
    at = np.concatenate([many[:first], many[last:]])
    u = np.concatenate(
        [np.full(first, sheet.panel.u_set_um * MICROMETRE),
         np.tile([*[sheet.u_zero_um * MICROMETRE] * 4, *[sheet.u_level_arcsec * ARCSECOND] * 2], columns.sessions)]
    )  # fmt: skip
    observed = np.concatenate([target.ravel(), np.zeros(6 * columns.sessions)])
    return RowColumns("priors", observed, u**2, at[:, None], np.ones((len(at), 1)))


def _warps(
    layout: PanelLayout, sheet: PanelInstrument, places: np.ndarray, target: np.ndarray, mapped: np.ndarray
) -> RowColumns:
    """Priors of panels' stiffness.

    The four corners lie as made, except for the twist that four screws force on the panel.
    """
    null = warps(places)
    prior = sheet.panel
    u_shape = np.where(mapped, prior.u_map_um, prior.u_shape_um)
    u = np.sqrt(prior.u_twist_um**2 + u_shape**2 * np.sum(null**2, axis=1)) * MICROMETRE
    at = np.arange(4 * len(layout.panels)).reshape(-1, 4)
    return RowColumns("warps", np.sum(null * target, axis=1), u**2, at, null)


def _shafts(
    layout: PanelLayout, sheet: PanelInstrument, columns: PanelColumns, survey: PanelSurvey | None
) -> RowColumns:
    """Priors of shafts.

    From the lasers' prism positions; others with the wide uncertainty of a panel's setting.
    """
    corners = np.arange(len(layout.corners))
    height, u = np.zeros(len(corners)), np.full(len(corners), sheet.panel.u_set_um * MICROMETRE)
    if survey is not None:
        height[survey.corner] = survey.height
        u[survey.corner] = np.hypot(survey.u, sheet.u_stand_um * MICROMETRE)
    at = columns.shaft(corners)[:, None]
    return RowColumns("shafts", height, u**2, at, np.ones((len(at), 1)))


def used_layout(
    readings: PanelReadings, layout: PanelLayout, sheet: PanelInstrument
) -> tuple[PanelLayout, np.ndarray, np.ndarray]:
    """Panels that a gauge touched.

    And the numbers of their panels and corners in the whole layout.

    Raises InputError where nothing was read but the flat.
    """
    tips = tips_of(readings, layout, sheet)
    panels = np.unique(tips.panel)
    if not len(panels):
        raise InputError(f"{readings.file}: holds no reading at a corner (expected placements beside {'FLAT'})")
    corners = np.unique(layout.quad[panels])
    uncovered = np.setdiff1d(tips.corner, corners)
    if len(uncovered):
        raise InputError(
            f"{readings.file}: at {layout.corners[uncovered[0]]} no panel with a corner there was read (expected one)"
        )
    return layout.only(panels), panels, corners
