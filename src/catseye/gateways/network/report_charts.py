"""Scenes and charts of the reports on networks, their plans and their comparison."""

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.gateways.writers.report import ChartBlock, SceneBlock, Text
from catseye.gateways.writers.report_parts import Axis, Beams, Chart, Scene, categories
from catseye.reduction.network.adjusted import AdjustedNetwork
from catseye.reduction.network.comparison import UNTESTED, ComparedEpochs

MOST_BEAMS = 20_000  # observations drawn and charted: the worst ones
SHARE = 0.12  # length of the longest displacement as drawn, share of the network's extent
FRAME = "x east, y north, z up"
VERDICTS = ("stable", "undecided", "moved", "held", UNTESTED)


def network_view(adjusted: AdjustedNetwork, *, predicted: bool = False) -> SceneBlock | Text:
    """Scene of points, ellipsoids and observations; a sentence if no point has x and y.

    predicted   True for a plan, whose observations have no residuals
    """
    rows = _placed(adjusted)
    if not len(rows):
        return Text("No view: no point has x and y.", faint=True)
    ellipsoids = "95 % ellipsoids" if adjusted.answered else "no ellipsoids, for the uncertainties are unknown"
    lines = "lines are observations" + ("" if predicted else ", coloured by their test statistic")
    scale = f", {'variance factor applied' if adjusted.scaled else 'a priori'}" if adjusted.answered else ""
    flat = "" if np.array_equal(adjusted.network.axes, np.eye(3)) else " The tables have the axes of the file."
    beams, count = _beams(adjusted, rows, predicted=predicted)
    most = f" The {len(beams.start)} worst of {count} observed pairs." if len(beams.start) < count else ""
    groups, group = _roles(adjusted, rows)
    scene = Scene(
        frame=FRAME,
        names=[adjusted.names[i] for i in rows],
        x=_places(adjusted)[rows],
        groups=groups,
        group=group,
        covariance=_covariance(adjusted)[rows] if adjusted.answered else None,
        info=_lines(adjusted, rows),
        beams=beams,
    )
    return SceneBlock("network", scene, f"Points with {ellipsoids}{scale}; {lines}.{flat}{most}")


def _placed(adjusted: AdjustedNetwork) -> np.ndarray:
    """Rows of points with x and y."""
    level = adjusted.network.points.existing[:, :2].all(axis=1)
    return np.flatnonzero(level & np.isfinite(_places(adjusted)).all(axis=1))


def _places(adjusted: AdjustedNetwork) -> np.ndarray:
    """Coordinates (n, 3) m, x east, y north, z up; 0 for a height that does not exist."""
    return np.where(adjusted.network.points.existing, adjusted.solution.x, 0.0)


def _covariance(adjusted: AdjustedNetwork) -> np.ndarray:
    return np.nan_to_num(adjusted.solution.covariance) * adjusted.factor


def _roles(adjusted: AdjustedNetwork, rows: np.ndarray) -> tuple[list[str], np.ndarray]:
    """Groups of the points, station or target, held or not, and each point's group."""
    held = np.asarray(~adjusted.network.points.free.any(axis=1))
    names = ("target", "station", "held point", "held station")
    kind = adjusted.stations[rows].astype(int) + 2 * held[rows]
    used = np.unique(kind)
    return [names[k] for k in used], np.searchsorted(used, kind)


def _lines(adjusted: AdjustedNetwork, rows: np.ndarray) -> list[str]:
    """Line of each point: uncertainties along the file's axes, and observations."""
    axes, u = adjusted.network.axis_names, adjusted.u / MILLIMETRE

    def line(i: int) -> str:
        parts = " / ".join(f"{axis} {v:.4g}" for axis, v in zip(axes, u[i], strict=True) if np.isfinite(v))
        return (f"u {parts} mm, " if parts else "") + f"{adjusted.observation_counts[i]} observations"

    return [line(i) for i in rows.tolist()]


def _beams(adjusted: AdjustedNetwork, rows: np.ndarray, *, predicted: bool) -> tuple[Beams, int]:
    """Active observations of two points, the worst ones of many, and their number."""
    table = adjusted.table
    place = np.full(len(adjusted.names) + 1, -1)
    place[rows] = np.arange(len(rows))
    order = table.worst_first
    ends = place[table.ends[order, :2]]
    joined = np.asarray(ends.min(axis=1, initial=0) >= 0)
    drawn = order[table.active[order] & joined]
    shown = drawn[:MOST_BEAMS]
    ends = place[table.ends[shown, :2]]
    value = np.full(len(shown), np.nan) if predicted else adjusted.statistic[shown]
    return Beams(ends[:, 0], ends[:, 1], value, [adjusted.label(int(k)) for k in shown]), len(drawn)


def residual_charts(adjusted: AdjustedNetwork) -> list[ChartBlock]:
    """Test statistics by number, station, target and elevation; histogram and normal plot; none without a solution."""
    table = adjusted.table
    tested = np.flatnonzero(np.isfinite(adjusted.statistic))
    if not len(tested):
        return []
    if len(tested) > MOST_BEAMS:
        tested = np.sort(tested[np.argsort(-np.abs(adjusted.statistic[tested]), kind="stable")[:MOST_BEAMS]])
    statistic = Axis(
        f"test statistic {'τ' if adjusted.test == 'tau' else 'w'}", "", adjusted.statistic[tested], digits=3
    )
    names = [adjusted.label(int(k)) for k in tested]
    limits = (-adjusted.critical, adjusted.critical) if np.isfinite(adjusted.critical) else ()
    kinds = [kind.replace("_", " ") for kind in table.kinds]

    def chart(x: Axis, rows: np.ndarray | None = None) -> Chart:
        at = np.arange(len(tested)) if rows is None else rows
        y = Axis(statistic.label, "", adjusted.statistic[tested[at]], digits=3)
        return Chart(
            "scatter", x, y, names=[names[k] for k in at], group=table.kind[tested[at]], groups=kinds, limits=limits
        )

    points = [*adjusted.names, "none"]
    stations, targets = ([points[i] for i in table.ends[tested, role]] for role in (0, 1))
    blocks = [
        ChartBlock(
            "w-by-number",
            chart(Axis("number in the file", "", tested, digits=0)),
            f"Test statistics of {len(tested)} observations; dashed: ±{adjusted.critical:.2f}, beyond which an "
            f"observation is suspect (level {adjusted.level:g} for all tests together).",
        ),
        ChartBlock("w-by-station", chart(categories("from", stations)), "The same by first point."),
        ChartBlock("w-by-target", chart(categories("to", targets)), "The same by second point."),
    ]
    elevation = _elevation(adjusted, tested)
    rows = np.flatnonzero(np.isfinite(elevation))
    if len(rows):
        x = Axis("elevation of the second point", "°", elevation[rows] / DEGREE, digits=3)
        blocks.append(ChartBlock("w-by-elevation", chart(x, rows), "The same by elevation."))
    return [
        *blocks,
        ChartBlock(
            "w-histogram",
            Chart("histogram", statistic, limits=limits),
            "Their histogram: a normal distribution of width 1 where the claimed uncertainties hold.",
        ),
        ChartBlock(
            "w-normal", Chart("normal", statistic, names=names), "Against the quantiles of that normal distribution."
        ),
    ]


def _elevation(adjusted: AdjustedNetwork, rows: np.ndarray) -> np.ndarray:
    """Elevation from first to second point, rad; nan where there is none."""
    x = np.vstack([np.where(adjusted.network.points.existing, adjusted.solution.x, np.nan), np.full((1, 3), np.nan)])
    path = x[adjusted.table.ends[rows, 1]] - x[adjusted.table.ends[rows, 0]]
    return np.arctan2(path[:, 2], np.hypot(path[:, 0], path[:, 1]))


def redundancy_chart(adjusted: AdjustedNetwork) -> ChartBlock | None:
    """Redundancy numbers of the active observations; None without any."""
    table = adjusted.table
    active = np.flatnonzero(table.active & np.isfinite(table.redundancy))
    if not len(active):
        return None
    x = Axis("redundancy number", "", np.clip(table.redundancy[active], 0.0, 1.0), digits=4)
    return ChartBlock(
        "redundancy",
        Chart("histogram", x, limits=(0.1,)),
        "Redundancy numbers: share of an error that shows in the observation's own residual. Below 0.1 (dashed) an "
        "observation is hardly checked: over nine tenths of an error would affect the coordinates.",
    )


def displacement_view(compared: ComparedEpochs, lengthening: float) -> SceneBlock | Text:
    """Scene of points by verdict, displacements and their ellipsoids; a sentence if no point has x and y.

    lengthening   of the displacements as drawn
    """
    first, d = compared.first, compared.deformation
    rows = _placed(first)
    if not len(rows):
        return Text("No view: no point has x and y.", faint=True)
    place = np.full(len(first.names), -1)
    place[rows] = np.arange(len(rows))
    common = place[compared.rows] >= 0
    verdicts = np.array([*compared.verdicts])
    group = np.full(len(rows), len(VERDICTS))
    group[place[compared.rows[common]]] = [VERDICTS.index(word) for word in verdicts[common]]
    used = np.unique(group)
    x = _places(first)[rows]
    covariance = np.zeros((len(rows), 3, 3))
    covariance[place[compared.rows[common]]] = np.nan_to_num(d.covariance[common])
    shift = np.nan_to_num(d.displacement)
    arrows = {
        f"displacement of {d.names[k]}": np.stack([x[place[row]], x[place[row]] + lengthening * shift[k]])
        for k, row in enumerate(compared.rows.tolist())
        if common[k] and np.any(shift[k] != 0.0)
    }
    scene = Scene(
        frame=FRAME,
        names=[first.names[i] for i in rows],
        x=x,
        groups=[(*VERDICTS, "not compared")[k] for k in used],
        group=np.searchsorted(used, group),
        covariance=covariance,
        info=_displacement_lines(compared, rows),
        lines=arrows,
    )
    times = f"{lengthening:,.0f}".replace(",", "\u2009")
    caption = (
        f"Points by verdict. Lines: displacements, drawn {times} times as long; ellipsoids: 95 % of the displacements, "
        "about no displacement. A point is judged by all of its coordinates together."
    )
    return SceneBlock("displacements", scene, caption)


def _displacement_lines(compared: ComparedEpochs, rows: np.ndarray) -> list[str]:
    place = {int(row): k for k, row in enumerate(compared.rows)}
    axes = compared.first.network.axis_names
    lines = []
    for row in rows.tolist():
        k = place.get(row)
        if k is None:
            lines.append("not compared")
            continue
        moved = compared.displacement[k] / MILLIMETRE
        parts = " / ".join(f"d{axis} {v:+.3f}" for axis, v in zip(axes, moved, strict=True) if np.isfinite(v))
        lines.append(f"{compared.verdicts[k]}: {parts} mm, p {compared.deformation.p[k]:.2g}")
    return lines


def displacement_chart(compared: ComparedEpochs) -> ChartBlock | None:
    """Displacements of each point along each axis; None without any."""
    d, axes = compared.deformation, compared.first.network.axis_names
    known = np.argwhere(np.isfinite(compared.displacement))
    if not len(known):
        return None
    value = compared.displacement[known[:, 0], known[:, 1]] / MILLIMETRE
    names = [d.names[k] for k in known[:, 0]]
    chart = Chart(
        "scatter",
        categories("point", names),
        Axis("displacement", "mm", value, digits=5),
        u=compared.u[known[:, 0], known[:, 1]] / MILLIMETRE,
        names=names,
        group=known[:, 1],
        groups=[f"d{axis}" for axis in axes],
        limits=(0.0,),
    )
    return ChartBlock("displacement-by-point", chart, "Displacements along each axis of the file, with their u.")


def lengthening(compared: ComparedEpochs) -> float:
    """Enlargement of displacements, 1, 2 or 5 times a power of ten; 1 without any."""
    rows = _placed(compared.first)
    length = np.linalg.norm(np.nan_to_num(compared.deformation.displacement), axis=1)
    if not len(rows) or not np.any(length > 0.0):
        return 1.0
    extent = max(float(np.max(np.ptp(_places(compared.first)[rows], axis=0))), 1e-3)
    ratio = SHARE * extent / float(length.max())
    power = 10.0 ** np.floor(np.log10(ratio))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step <= ratio / power * (1.0 + 1e-9)))
