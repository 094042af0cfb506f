"""Figure of a subreflector's actuators at rest and moved."""

from typing import Any

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.writers.drawing import BAD, FAINT, GRID, INK, SERIES, Figure, styled
from catseye.geometry.antenna.subreflector import prime_focus_from_subreflector
from catseye.reduction.pose.subreflector import SubreflectorState


def actuators_figure(state: SubreflectorState) -> Figure:
    """Actuators at rest and moved, from the side and along the axis, and their lengths between the limits."""
    joints = state.mount.joints
    fixed, rest = joints["fixed"], joints["moving"]
    moved = prime_focus_from_subreflector(state.six[:3], state.six[3:], pivot=joints["pivot"]).single.points(rest)
    with styled():
        figure = Figure(figsize=(10.4, 4.2), layout="constrained")
        side, along, lengths = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.1))
        for ax, (i, k), title in ((side, (1, 2), "From the side"), (along, (0, 1), "Along the axis")):
            _draw(ax, fixed[:, [i, k]], rest[:, [i, k]], colour=FAINT, label="at rest")
            _draw(ax, fixed[:, [i, k]], moved[:, [i, k]], colour=SERIES[0], label="moved")
            ax.plot(*joints["pivot"][[i, k]], "+", color=INK, ms=9, label="pivot at rest")
            ax.set_xlabel(f"{'xyz'[i]}, prime focus (m)")
            ax.set_ylabel(f"{'xyz'[k]}, prime focus (m)")
            ax.set_title(title)
            ax.set_aspect("equal", adjustable="datalim")
        _limits(lengths, state)
        figure.legend(*side.get_legend_handles_labels(), loc="outside lower center", ncols=3)
        return figure


def _draw(ax: Any, fixed: np.ndarray, moving: np.ndarray, *, colour: str, label: str) -> None:
    """Draw six actuators and the outline of their moving joints."""
    for k, (start, end) in enumerate(zip(fixed, moving, strict=True)):
        ax.plot(*np.transpose([start, end]), color=colour, lw=1.5, marker="o", ms=3, label=label if k == 0 else None)
    order = np.argsort(np.arctan2(*(moving - moving.mean(axis=0)).T))
    ax.plot(*moving[[*order, order[0]]].T, color=colour, lw=0.9, ls=":")


def _limits(ax: Any, state: SubreflectorState) -> None:
    """Draw each length less that at rest between its limits."""
    rows = np.arange(len(state.names))
    low, high = ((state.limits[:, k] - state.rest) / MILLIMETRE for k in (0, 1))
    ax.hlines(rows, low, high, color=GRID, lw=6)
    change = (state.lengths - state.rest) / MILLIMETRE
    ax.plot(np.zeros(len(rows)), rows, "|", color=FAINT, ms=10)
    for k in rows:
        ax.plot(change[k], k, "o", color=BAD if state.beyond[k] else SERIES[0], ms=5)
    ax.set_yticks(rows, state.names)
    ax.invert_yaxis()
    ax.set_xlabel("length less that at rest (mm)")
    ax.set_title("Lengths between their limits")
