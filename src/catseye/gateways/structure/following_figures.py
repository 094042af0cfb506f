"""Figure of a followed vibration: samples, predictions, what comes next, and residuals."""

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure, styled
from catseye.reduction.structure.following import FollowedVibration

TAIL_S = 12.0  # s of the end
NEXT = 200  # times of the curve beyond the last sample


def following_figure(vibration: FollowedVibration) -> Figure:
    """Last seconds of the samples with their predictions and 2 u, and residuals of all that were checked."""
    samples, checked = vibration.samples, vibration.checked
    seconds = samples.seconds
    end, axes = float(seconds[-1]), samples.axes
    last = seconds[checked] > end - TAIL_S
    reach = float(max(vibration.leads.max(initial=0.0), 1e-3))
    ahead = samples.end + np.linspace(0.0, reach, NEXT)
    curve, spread = vibration.state.predicted(ahead)
    offset = vibration.state.mean[-len(axes) :]
    with styled():
        figure = Figure(figsize=(9.4, 1.2 + 2.1 * len(axes)), layout="constrained")
        panels = figure.subplots(len(axes), 2, squeeze=False, width_ratios=(1.6, 1.0), sharex="col")
        for k, axis in enumerate(axes):
            panel, residuals = panels[k]
            value = samples.values[checked, k]
            predicted = value - vibration.residual[:, k]
            u = np.sqrt(vibration.claim[:, k, k])
            at = seconds[checked][last]
            low, high = (predicted + s * 2.0 * u for s in (-1.0, 1.0))
            panel.fill_between(at, low[last] / MILLIMETRE, high[last] / MILLIMETRE, color=SERIES[0], alpha=0.18, lw=0)
            panel.plot(
                at,
                predicted[last] / MILLIMETRE,
                color=SERIES[0],
                lw=1.0,
                label=f"predicted {vibration.ahead:.3g} s ahead",
            )
            panel.plot(at, value[last] / MILLIMETRE, ".", color=INK, ms=3.0, label="sample")
            middle, wide = curve[:, k] + offset[k], 2.0 * np.sqrt(spread[:, k, k])
            panel.fill_between(ahead, (middle - wide) / MILLIMETRE, (middle + wide) / MILLIMETRE, color=SERIES[1],
                              alpha=0.18, lw=0)  # fmt: skip
            panel.plot(ahead, middle / MILLIMETRE, color=SERIES[1], lw=1.0, label="what comes next, 2 u")
            panel.axvline(end, color=FAINT, lw=0.7, ls=":")
            panel.set_ylabel(f"{axis} (mm)")
            about = value - np.nanmean(value)
            residuals.plot(seconds[checked], about / MILLIMETRE, color=FAINT, lw=0.7, label="vibration")
            residuals.plot(
                seconds[checked], vibration.residual[:, k] / MILLIMETRE, color=BAD, lw=0.8, label="after following"
            )
        panels[0, 0].set_title("Samples and predictions")
        panels[0, 1].set_title("Before and after following")
        for ax in panels[-1]:
            ax.set_xlabel("time (s)")
        handles, labels = panels[0, 0].get_legend_handles_labels()
        handles_right, labels_right = panels[0, 1].get_legend_handles_labels()
        figure.legend([*handles, *handles_right], [*labels, *labels_right], loc="outside lower center", ncols=5)
        return figure
