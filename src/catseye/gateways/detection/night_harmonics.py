"""Harmonics of a night's shots: figure and chart."""

import numpy as np

from catseye.gateways.writers.drawing import BAD, FAINT, SERIES, Figure
from catseye.gateways.writers.report_parts import Axis, Chart
from catseye.reduction.epoch.epoch import Reduction
from catseye.signal.detection.harmonics import DISTORTED, SURE

PIXELS = 2000  # marks from which they are rasterised
CHARTED = 4000  # shots of the chart, which travels in a report; a night of a whole dish has 20 000
LEAST = 0.01  # %, lower edge of the figure, on which smaller ones stand
ORDERS = ("second", "third")


def harmonics_figure(reduction: Reduction) -> Figure | None:
    """Second and third harmonic of each shot by its return, with the limit; None without a shot.

    reduction   of a campaign
    """
    rows = shots_with_harmonics(reduction)
    if not len(rows):
        return None
    phases = reduction.phases
    size, share = phases.amplitude[rows], np.maximum(100.0 * phases.relative_harmonics[rows], LEAST)
    figure = Figure(figsize=(9.4, 3.9), layout="constrained")
    ax = figure.add_subplot()
    many = len(rows) > PIXELS
    for i, name in enumerate(ORDERS):
        ax.scatter(size, share[:, i], s=3 if many else 9, color=SERIES[i], lw=0, alpha=0.6, label=name, rasterized=many)
    over = phases.distorted[rows]
    if over.any():
        worst = np.max(share[over], axis=1)
        ax.scatter(size[over], worst, s=42, facecolors="none", edgecolors=BAD, lw=1.2, label="distorted")
    across = np.geomspace(float(size.min()), float(size.max()) * 1.001, 100)
    u = float(np.median(phases.u_phasor[rows]))
    ax.plot(across, 100.0 * (DISTORTED + SURE * u / across), color=BAD, lw=1.0, label=f"limit: 2 % and {SURE:g} u")
    ax.plot(across, 100.0 * u / across, color=FAINT, lw=1.0, ls=(0, (4, 2)), label="u of noise alone")
    ax.set(xscale="log", yscale="log", xlabel="amplitude of the return (V)", ylabel="harmonic over fundamental (%)")
    ax.set_ylim(LEAST, max(100.0, 1.5 * float(np.max(share))))
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(lambda value, _: f"{value:g}")
    ax.xaxis.set_minor_formatter(lambda value, _: f"{value:g}" if float(f"{value:.0e}") in (2.0, 3.0, 5.0) else "")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure


def harmonics_chart(reduction: Reduction) -> Chart | None:
    """The larger of both harmonics of each shot by its return; None without a shot.

    Of more than `CHARTED` shots those with the largest harmonics, and all that are distorted.

    reduction   of a campaign
    """
    rows = shots_with_harmonics(reduction)
    if not len(rows):
        return None
    phases = reduction.phases
    largest = phases.relative_harmonics.max(axis=1)
    if len(rows) > CHARTED:
        by_size = rows[np.lexsort((largest[rows], phases.distorted[rows]))]
        rows = np.sort(by_size[-max(CHARTED, int(phases.distorted[rows].sum())) :])
    over = phases.distorted[rows].astype(int)
    return Chart(
        "scatter",
        Axis("amplitude of the return", "V", phases.amplitude[rows], digits=4),
        Axis("larger of second and third harmonic", "%", 100.0 * largest[rows], digits=3),
        names=reduction.campaign.shots.shot[rows].tolist(),
        group=over,
        groups=("within the limit", "distorted")[: int(over.max()) + 1],
        limits=(100.0 * DISTORTED,),
    )


def shots_with_harmonics(reduction: Reduction) -> np.ndarray:
    """Rows of the shots whose samples show a return."""
    usable = np.array([reason is None for reason in reduction.phases.reason], dtype=bool)
    return np.flatnonzero(usable & np.isfinite(reduction.phases.relative_harmonics).all(axis=1))
