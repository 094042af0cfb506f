"""Figure of returns by angle: readings, the judged kind's theory, and the other kinds."""

import numpy as np

from catseye.constants import DEGREE
from catseye.gateways.writers.drawing import FAINT, SERIES, Figure, styled
from catseye.reduction.scans.angles import AngleComparison

FINE = 361
MOST_GROUPS = 4  # of a fixed angle, in one panel
MARKS = tuple(
    {"ls": "", "marker": mark, "mfc": fill} for fill in (None, "white") for mark in ("o", "s", "^", "D")
)  # by analyser


def angle_figure(comparison: AngleComparison) -> Figure:
    """Returns by incidence and by rotation, those that were varied, with residuals over u below."""
    r = comparison.readings
    panels = [k for k, angle in enumerate((r.incidence, r.rotation)) if np.ptp(angle) > 0.0] or [0]
    with styled():
        figure = Figure(figsize=(4.9 * len(panels) + 0.4, 5.0), layout="constrained")
        grid = figure.subplots(2, len(panels), squeeze=False, height_ratios=(3, 1), sharex="col")
        for column, k in enumerate(panels):
            _draw(grid[0, column], grid[1, column], comparison, k)
        grid[0, 0].set_ylabel("amplitude (V)" if r.unit == "V" else "power (mW)")
        grid[1, 0].set_ylabel("residual / u")
        figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
        return figure


def _draw(above, below, comparison: AngleComparison, k: int) -> None:
    """One panel: varied angle k (0 incidence, 1 rotation), groups of the other."""
    r, fit = comparison.readings, comparison.fit
    angles = np.stack([r.incidence, r.rotation])
    groups = _groups(angles[k], angles[1 - k])
    line = np.linspace(angles[k].min(), angles[k].max(), FINE)
    analysers = np.full(len(r), np.nan) if r.analyser is None else r.analyser
    cases = [(held, angle) for held in groups for angle in np.unique(analysers)]
    for j, (held, angle) in enumerate(cases):
        incidence, rotation = (line, np.full(FINE, held)) if k == 0 else (np.full(FINE, held), line)
        use = (np.abs(angles[1 - k] - held) < 1e-6) & ((analysers == angle) | np.isnan(angle) & np.isnan(analysers))
        style = MARKS[list(np.unique(analysers)).index(angle) if not np.isnan(angle) else 0]
        suffix = "" if np.isnan(angle) else f", analyser {angle / DEGREE:.4g}°"
        if j == 0:
            for second, colour in zip((o for o in comparison.fits if o is not fit), (3, 2, 4, 5), strict=False):
                kind_label = f"{second.kind}{suffix}"
                above.plot(
                    line / DEGREE,
                    second.at(incidence, rotation, angle),
                    "--",
                    color=SERIES[colour],
                    lw=1.1,
                    label=kind_label,
                )
        label = f"{fit.kind}, fitted" if j == 0 else None
        above.plot(line / DEGREE, fit.at(incidence, rotation, angle), color=SERIES[1], lw=1.5, label=label)
        label = f"readings, u{suffix}" if held == groups[0] else None
        marks = {**style, "ms": 3.5 if suffix else 3.0, "color": SERIES[0]}
        above.errorbar(angles[k][use] / DEGREE, r.value[use], fit.sigma[use], lw=0.7, label=label, **marks)
        below.plot(angles[k][use] / DEGREE, ((r.value - fit.predicted) / fit.sigma)[use], **{**marks, "ls": ""})
    below.axhline(0.0, color=FAINT, lw=0.8)
    axis, fixed = ("incidence", "rotation") if k == 0 else ("rotation", "incidence")
    places = ", ".join(f"{g / DEGREE:.4g}°" for g in groups)
    above.set_title(f"By {axis}, at {fixed} {places}")
    above.set_ylim(0.0, 1.15 * r.value.max())
    below.set_xlabel(f"{axis} (°)")


def _groups(varied: np.ndarray, held: np.ndarray) -> list[float]:
    """Values of the held angle at which the other was varied most, at most `MOST_GROUPS`."""
    values, counts = np.unique(np.round(held, 9), return_counts=True)
    spread = [np.ptp(varied[np.abs(held - value) < 1e-6]) for value in values]
    order = sorted(range(len(values)), key=lambda j: (spread[j] <= 0.0, -counts[j]))
    return [float(values[j]) for j in order[:MOST_GROUPS] if spread[j] > 0.0]
