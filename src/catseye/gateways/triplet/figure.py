"""Figure of the placements in a triplet's calibration."""

from typing import Any

import numpy as np

from catseye.gateways.writers.drawing import BAD, FAINT, SERIES, Figure, styled
from catseye.reduction.triplet.result import TOLERANCE, TripletReduction

MICROMETRES = 1e6
NEAREST, FARTHEST = 1.6, 4.0  # tolerances from L_MPBC to the edge; points further off are named there
MANY = 12  # most placements with spacers on the axis


def triplet_figure(reduction: TripletReduction) -> Figure:
    """H_corr of each placement against the surface plate and the limits, and the best one's budget."""
    with styled():
        figure = Figure(figsize=(9.4, 4.0), layout="constrained")
        placements, budget = figure.subplots(1, 2, width_ratios=(2.2, 1.0))
        _draw_placements(placements, reduction)
        _draw_budget(budget, reduction)
        return figure


def _draw_placements(ax: Any, reduction: TripletReduction) -> None:
    number = np.arange(1, len(reduction.h) + 1)
    plate, limit = reduction.l_mpbc * MICROMETRES, TOLERANCE * MICROMETRES
    edge = (0.4, len(reduction.h) + 0.6)
    ax.axhspan(plate - limit, plate + limit, color="#f2f6f3", lw=0, label="accepted: L_MPBC ± 150 µm")
    u_plate = reduction.u_l_mpbc * MICROMETRES
    ax.axhspan(plate - u_plate, plate + u_plate, color="#cfe6dd", lw=0)
    ax.axhline(plate, color=SERIES[2], lw=1.4, label=f"L_MPBC {plate:+.1f} µm, u {u_plate:.1f}")
    if np.isfinite(reduction.h_corr):
        best, u = reduction.h_corr * MICROMETRES, reduction.u_h_corr * MICROMETRES
        ax.axhline(best, color=SERIES[0], lw=1.2, ls="--", label=f"H_corr {best:+.1f} µm, u {u:.1f}")
    h, u_h = reduction.h * MICROMETRES, reduction.u * MICROMETRES
    reach = np.max(np.abs(h - plate), where=np.abs(h - plate) < 0.9 * FARTHEST * limit, initial=0.0)
    span = max(NEAREST * limit, 1.15 * float(reach))
    near = np.abs(h - plate) < span
    odd = np.isin(np.arange(len(h)), reduction.suspects)
    for rows, colour, name in ((near & ~odd, SERIES[0], "placement, ± u"), (near & odd, BAD, "contradicted, retained")):
        if rows.any():
            ax.errorbar(
                number[rows], h[rows], u_h[rows], fmt="o", color=colour, ms=5, elinewidth=1.2, capsize=3, label=name
            )
    memo = reduction.memo.h_corr_by_int * MICROMETRES
    drawn = np.abs(memo - plate) < span
    ax.plot(number[drawn] + 0.14, memo[drawn], "D", mfc="none", color=FAINT, ms=4, label="by the memo's formulas")
    for k in np.flatnonzero(np.isfinite(h) & ~near):
        above = h[k] > plate
        ax.annotate(
            f"{number[k]}: {h[k] / 1e3:+.3f} mm {'↑' if above else '↓'}",
            (number[k], plate + (1.0 if above else -1.0) * 0.97 * span),
            color=BAD, ha="center", va="top" if above else "bottom", fontsize=8,
        )  # fmt: skip
    ax.set_xlim(*edge)
    ax.set_ylim(plate - span, plate + span)
    spacers = [f"\n{placement.spacer_mm:g}" if len(h) <= MANY else "" for placement in reduction.measurement.placement]
    step = 1 + len(h) // (2 * MANY)
    ax.set_xticks(number[::step], [f"{k}{spacer}" for k, spacer in zip(number, spacers, strict=True)][::step])
    ax.set_xlabel("placement" + (", and its spacer (mm)" if len(h) <= MANY else ""))
    ax.set_ylabel("ball above the prisms' midpoint (µm)")
    ax.set_title("Placements")
    ax.get_figure().legend(*ax.get_legend_handles_labels(), loc="outside lower left", ncols=3)


def _draw_budget(ax: Any, reduction: TripletReduction) -> None:
    shares = sorted(reduction.budget.items(), key=lambda item: item[1])
    ax.barh([name for name, _ in shares], [value * MICROMETRES for _, value in shares], color=SERIES[0], height=0.6)
    for row, (_, value) in enumerate(shares):
        ax.text(value * MICROMETRES, row, f" {value * MICROMETRES:.2g}", va="center", fontsize=8)
    ax.margins(x=0.18)
    ax.grid(False, axis="y")
    ax.set_xlabel("share in u of H_corr (µm)")
    ax.set_title("Budget")
