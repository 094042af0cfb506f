"""Corner heights and screw turns from panel setting instrument readings.

Two things are set at a corner. The screws set the panels' corners to each other: only each height relative to the
mean of those that meet there counts, which the tool measures to some µm whatever the rest of the dish does. The
actuator under them moves all alike: that mean over the design is measured through the shaft's height, only as
accurately as the lasers determine it. A height here is a departure: of the panel's surface from design offset and map,
so that zero at all corners lays the panel's best fit on the design.

Source: [PARKER04] chapter 11.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from catseye.constants import MILLIMETRE
from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import NONCENTRALITY, LeastSquaresSolution, SolverSettings, adjust
from catseye.estimation.quality.reliability import checked, single_level, w_critical
from catseye.geometry.antenna.panel_surface import axes
from catseye.records.panels.instrument import PanelInstrument
from catseye.records.panels.layout import PanelLayout
from catseye.records.panels.readings import PanelReadings, PanelSurvey
from catseye.reduction.panels.maps import FittedMap
from catseye.reduction.panels.model import PanelModel, corner_places, panel_model, used_layout

LEVEL = 0.05  # of the tests: probability of a false alarm among all readings
DECISIVE = 9.0  # difference of squared statistics below which two readings explain a conflict alike
ROUNDS = 12  # of rejection, one reading a corner at a time


@dataclass(frozen=True)
class Doubt:
    """Reading contradicted by its neighbours.

    corner, panel, gauge, member, where   of the reading
    error    m, best explanation (observed minus expected)
    w        its test statistic
    rivals   other readings of the corner that explain the conflict as well: "line 9, c_mm"
    out      True if rejected
    """

    corner: str
    panel: str
    gauge: str
    member: str
    where: str
    error: float
    w: float
    rivals: tuple[str, ...]
    out: bool


@dataclass(frozen=True, eq=False)
class PanelHeights:
    """Heights of panel corners from a table of readings.

    Arrays (p, 4) by panel and place of the layout used, m.

    layout            panels that were read
    readings, model, solution   of the adjustment
    times             (p, 4) readings used at the corner; 0: the height is inferred, not read
    departure         of the corner from design and map; u_departure its standard uncertainty
    relative          departure less the mean of those read at the same corner, nan where fewer than two meet
    u_relative        of it
    conforms          probability that |relative| is within the goal
    turns             clockwise above zero, that brings relative to zero; u_turns of them
    actuator          (c,) m, mean departure read at a corner, corrected by the opposite travel of the actuator; nan
    u_actuator        (c,)
    fit               (p, 3) piston (m) and slopes (rad) of each panel's best fit along its x and y; u_fit
    doubts            readings in doubt: the worst of each corner and its rivals; worst first
    variance_factor, degrees_of_freedom
    """

    layout: PanelLayout
    sheet: PanelInstrument
    readings: PanelReadings
    model: PanelModel
    solution: LeastSquaresSolution
    times: np.ndarray
    departure: np.ndarray
    u_departure: np.ndarray
    relative: np.ndarray
    u_relative: np.ndarray
    conforms: np.ndarray
    turns: np.ndarray
    u_turns: np.ndarray
    actuator: np.ndarray
    u_actuator: np.ndarray
    fit: np.ndarray
    u_fit: np.ndarray
    doubts: tuple[Doubt, ...]
    variance_factor: float
    degrees_of_freedom: float
    surveyed: bool

    @property
    def known(self) -> np.ndarray:
        """True (p, 4) where a relative height was measured."""
        return np.isfinite(self.relative)

    def value(self, parameter: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parameters and their standard uncertainties by column."""
        return self.solution.x[parameter], np.sqrt(self.solution.q.diagonal()[parameter])


def reduce_panels(
    readings: PanelReadings,
    layout: PanelLayout,
    sheet: PanelInstrument,
    *,
    survey: PanelSurvey | None = None,
    maps: Mapping[str, FittedMap] | None = None,
    reject: bool = False,
) -> PanelHeights:
    """Heights and turns from a table of readings.

    readings, layout, sheet   as read
    survey   heights of shafts; without it heights of the whole surface depend on `u_set_um` alone, relative ones do not
    maps     of panels by name
    reject   leave out rejected readings, both of two where nothing decides which is wrong

    Raises InputError for readings that touch no panel, EstimationError where there is no answer.
    """
    used, _, corners = used_layout(readings, layout, sheet)
    number = np.full(len(layout.corners), -1)
    number[corners] = np.arange(len(corners))
    used_readings = _renumbered(readings, number)
    shaft_heights = None if survey is None else _survey_of(survey, number)
    model = panel_model(used_readings, used, sheet, survey=shaft_heights, maps=maps)
    active = [np.ones(len(g.observed), dtype=bool) for g in model.groups]
    solution = _solved(model, active)
    first = _doubts(model, used_readings, sheet, solution)
    out: list[tuple[tuple[int, int], Doubt]] = []
    for _ in range(ROUNDS if reject else 0):
        worst = _worst_of_corners(_doubts(model, used_readings, sheet, solution))
        if not worst:
            break
        for at, doubt in worst:
            active[at[0]][at[1]] = False
            out.append((at, doubt))
        solution = _solved(model, active)
    named = [_left_out(d) for _, d in out] if reject else [d for _, d in _worst_of_corners(first)]
    return _heights(
        used,
        sheet,
        used_readings,
        model,
        solution,
        tuple(sorted(named, key=lambda d: -abs(d.w))),
        shaft_heights is not None,
    )


def _left_out(doubt: Doubt) -> Doubt:
    return Doubt(**{**doubt.__dict__, "out": True})


def _solved(model: PanelModel, active: list[np.ndarray]) -> LeastSquaresSolution:
    solution = adjust(np.zeros(model.columns.size), model.groups, active=active, solver=SolverSettings(iterations=5))
    if not solution.solved:
        raise EstimationError(f"panel corners: {solution.status}")
    return solution.require_converged()


def _renumbered(readings: PanelReadings, number: np.ndarray) -> PanelReadings:
    corner = np.where(readings.corner < 0, -1, number[np.maximum(readings.corner, 0)])
    return PanelReadings(**{**readings.__dict__, "corner": corner})


def _survey_of(survey: PanelSurvey, number: np.ndarray) -> PanelSurvey:
    on_layout = number[survey.corner] >= 0
    return PanelSurvey(number[survey.corner[on_layout]], survey.height[on_layout], survey.u[on_layout], survey.digest)


def _doubts(
    model: PanelModel, readings: PanelReadings, sheet: PanelInstrument, solution: LeastSquaresSolution
) -> list[tuple[tuple[int, int], Doubt, list[tuple[int, int]]]]:
    """Readings that the tests reject, with their rivals.

    (group, row), the doubt, and its rivals' (group, row).
    """
    fits = solution.fits[: len(model.blocks)]
    tested = [f.active & checked(f) for f in fits]
    many = int(sum(t.sum() for t in tested))
    if not many:
        return []
    critical = w_critical(single_level(LEVEL, many))
    doubts = []
    for g, (fit, test, block) in enumerate(zip(fits, tested, model.blocks, strict=True)):
        size = np.abs(np.where(test, fit.standardised, 0.0))
        corner = model.tips.corner[block]
        for k in np.flatnonzero(size > critical):
            alike = np.flatnonzero((corner == corner[k]) & test & (size[k] ** 2 - size**2 < DECISIVE))
            rivals_of_row = [int(j) for j in alike if j != k]
            doubt = _doubt(model, readings, sheet, block[k], fit.estimated_error[k], fit.standardised[k])
            rivals = tuple(_reading(model, readings, sheet, block[j]) for j in rivals_of_row)
            doubts.append(((g, int(k)), Doubt(**{**doubt.__dict__, "rivals": rivals}), [(g, j) for j in rivals_of_row]))
    return sorted(doubts, key=lambda item: -abs(item[1].w))


def _worst_of_corners(
    doubts: list[tuple[tuple[int, int], Doubt, list[tuple[int, int]]]],
) -> list[tuple[tuple[int, int], Doubt]]:
    """Worst reading of each corner with its rivals."""
    worst: dict[str, tuple[tuple[int, int], Doubt, list[tuple[int, int]]]] = {}
    doubt_at = {at: d for at, d, _ in doubts}
    for item in doubts:
        worst.setdefault(item[1].corner, item)
    selection = []
    for at, doubt, rivals in worst.values():
        selection.append((at, doubt))
        selection += [(rival, doubt_at.get(rival, doubt)) for rival in rivals if rival in doubt_at]
    return selection


def _reading(model: PanelModel, readings: PanelReadings, sheet: PanelInstrument, tip: int) -> str:
    return f"{readings.where[model.tips.row[tip]]}, {sheet.gauge[model.tips.gauge[tip]].name}_mm"


def _doubt(
    model: PanelModel, readings: PanelReadings, sheet: PanelInstrument, tip: int, error: float, w: float
) -> Doubt:
    tips = model.tips
    return Doubt(
        corner=model.layout.corners[tips.corner[tip]],
        panel=model.layout.panels[tips.panel[tip]],
        gauge=sheet.gauge[tips.gauge[tip]].name,
        member=readings.member[tips.row[tip]],
        where=readings.where[tips.row[tip]],
        error=float(error),
        w=float(w),
        rivals=(),
        out=False,
    )


def times_read(model: PanelModel, solution: LeastSquaresSolution) -> np.ndarray:
    """Number (p, 4) of used readings at each corner of a panel."""
    times = np.zeros(model.target.shape, dtype=int)
    for fit, block in zip(solution.fits, model.blocks, strict=False):
        tip = block[fit.active]
        panel, corner = model.tips.panel[tip], model.tips.corner[tip]
        at_corner = model.layout.quad[panel] == corner[:, None]
        row, place = np.nonzero(at_corner)
        np.add.at(times, (panel[row], place), 1)
    return times


def meetings(layout: PanelLayout, selected: np.ndarray) -> np.ndarray:
    """Columns (c, 4) of the selected heights that meet at each corner.

    Selected by (p, 4) bool; -1 fills up.
    """
    column = np.flatnonzero(selected.ravel())
    corner = layout.quad.ravel()[column]
    order = np.argsort(corner, kind="stable")
    column, corner = column[order], corner[order]
    rank = np.arange(len(corner)) - np.searchsorted(corner, corner)
    meet = np.full((len(layout.corners), max(4, int(rank.max(initial=0)) + 1)), -1)
    meet[corner, rank] = column
    return meet


@dataclass(frozen=True, eq=False)
class CornerHeights:
    """Heights at corners from the panels that were read there, m.

    relative, u_relative   (p, 4) minus the mean of those that meet, nan where fewer than two do
    mean, u_mean           (c,) of those that meet, nan where none was read
    """

    relative: np.ndarray
    u_relative: np.ndarray
    mean: np.ndarray
    u_mean: np.ndarray


def _corner_heights(
    layout: PanelLayout, model: PanelModel, solution: LeastSquaresSolution, departure: np.ndarray, times: np.ndarray
) -> CornerHeights:
    """Corner heights by the panels' departures (p, 4).

    Of those with `times` above zero.
    """
    meet = meetings(layout, times > 0)
    on = meet >= 0
    count = on.sum(axis=1)
    flat, u_map = departure.ravel(), model.u_target.ravel()
    share = np.where(on, 1.0 / np.maximum(count, 1)[:, None], 0.0)
    mean = np.where(count > 0, np.sum(np.where(on, flat[meet], 0.0) * share, axis=1), np.nan)
    maps = np.where(on, u_map[meet] ** 2, 0.0)

    def variance(weight: np.ndarray) -> np.ndarray:
        """Variance (c,) of weighted sums of the corners that meet.

        The tool's and the maps'.
        """
        inside = solution.q.products(meet, weight)
        return np.sum(np.where(on, inside * weight, 0.0), axis=1) + np.sum(maps * weight**2, axis=1)

    difference, u_difference = np.full(len(flat), np.nan), np.full(len(flat), np.nan)
    several = count > 1
    for k in range(meet.shape[1]):
        rows = several & on[:, k]
        weight = np.where(on, (np.arange(meet.shape[1]) == k) - share, 0.0)
        difference[meet[rows, k]] = flat[meet[rows, k]] - mean[rows]
        u_difference[meet[rows, k]] = np.sqrt(variance(weight)[rows])
    u_mean = np.where(count > 0, np.sqrt(variance(share)), np.nan)
    return CornerHeights(difference.reshape(departure.shape), u_difference.reshape(departure.shape), mean, u_mean)


def _heights(
    layout: PanelLayout,
    sheet: PanelInstrument,
    readings: PanelReadings,
    model: PanelModel,
    solution: LeastSquaresSolution,
    doubts: tuple[Doubt, ...],
    surveyed: bool,
) -> PanelHeights:
    shape = model.target.shape
    many = model.target.size
    departure = solution.x[:many].reshape(shape) - model.target
    u_departure = np.hypot(np.sqrt(solution.q.diagonal()[:many].reshape(shape)), model.u_target)
    times = times_read(model, solution)
    corners = _corner_heights(layout, model, solution, departure, times)
    goal, pitch = sheet.goal_um * 1e-6, sheet.screw.pitch_mm * MILLIMETRE
    sense = 1.0 if sheet.screw.clockwise == "raises" else -1.0
    fit, u_fit = panel_fits(layout, solution, departure, u_target=model.u_target)
    factor, degrees = solution.variance_factor([f.name for f in solution.fits[: len(model.blocks)]])
    return PanelHeights(
        layout=layout,
        sheet=sheet,
        readings=readings,
        model=model,
        solution=solution,
        times=times,
        departure=departure,
        u_departure=u_departure,
        relative=corners.relative,
        u_relative=corners.u_relative,
        conforms=conformity(corners.relative, corners.u_relative, goal),
        turns=-sense * corners.relative / pitch,
        u_turns=corners.u_relative / pitch,
        actuator=corners.mean,
        u_actuator=corners.u_mean,
        fit=fit,
        u_fit=u_fit,
        doubts=doubts,
        variance_factor=factor,
        degrees_of_freedom=degrees,
        surveyed=surveyed,
    )


def conformity(value: np.ndarray, u: np.ndarray, goal: float) -> np.ndarray:
    """Probability that the true value is within ± goal.

    After the measurement; nan without one.

    value, u   (...) m
    goal       m

    Source: [JCGM106] clause 7, two-sided tolerance interval, normal law.

    >>> round(float(conformity(np.array(25e-6), np.array(1e-6), 25e-6)), 3)
    0.5
    """
    return ndtr((goal - value) / u) - ndtr((-goal - value) / u)


def panel_fits(
    layout: PanelLayout, solution: LeastSquaresSolution, departure: np.ndarray, *, u_target: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Plane through each panel's corners, and its u; m and rad.

    Piston and slopes (p, 3).
    """
    place = corner_places(layout)
    design = np.concatenate([np.ones((*place.shape[:2], 1)), place], axis=2)
    gain = np.linalg.pinv(design)  # (p, 3, 4)
    at = np.arange(departure.size).reshape(-1, 4)
    variance = np.stack(
        [np.sum(solution.q.products(at, gain[:, k]) * gain[:, k] + (gain[:, k] * u_target) ** 2, axis=1)
         for k in range(3)], axis=1,
    )  # fmt: skip
    return np.einsum("pkc,pc->pk", gain, departure), np.sqrt(variance)


def surface_rms(heights: PanelHeights, departure: np.ndarray) -> tuple[float, np.ndarray]:
    """Rms (m) of departures (p, 4) about the dish's rigid motion.

    And the remaining departures.

    Shift and tilts only, five columns: normals, and arms × normals about x and y; a turn about the axis does nothing.
    """
    at = axes(heights.layout.xy[heights.layout.quad].reshape(-1, 2), heights.layout.focal_length)
    arm = np.cross(at.origin, at.z)
    design = np.column_stack([at.z, arm[:, :2] / 50.0])
    remainder = departure.ravel() - design @ np.linalg.lstsq(design, departure.ravel(), rcond=1e-9)[0]
    return float(np.sqrt(np.mean(remainder**2))), remainder.reshape(departure.shape)


def weighed_squares(heights: PanelHeights) -> tuple[np.ndarray, np.ndarray]:
    """Weighted square and redundancy of each tip.

    Its part of v' C^-1 v; they add up to a variance factor of any set of readings.

    Part is v (C^-1 v), exact in sum also with correlations; nan of readings left out.
    """
    part = np.full(len(heights.model.tips.row), np.nan)
    redundancy = np.full(len(part), np.nan)
    for fit, block in zip(heights.solution.fits, heights.model.blocks, strict=False):
        pv = fit.standardised * NONCENTRALITY / fit.detectable_error
        part[block] = np.where(fit.active, fit.residual * pv, np.nan)
        redundancy[block] = np.where(fit.active, fit.redundancy, np.nan)
    return part, redundancy
