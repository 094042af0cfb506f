"""Identified servo as JSON, text and table."""

import math
from typing import Any

from catseye.constants import DEGREE, TWO_PI
from catseye.gateways.writers.columns import Column, Table
from catseye.gateways.writers.passage import Passage
from catseye.reduction.steering.servo_identification import NAMES, ServoFit, ServoLoop
from catseye.verdict import Verdict

WINDOWS = Table[ServoFit](
    "windows.csv",
    "servo.md",
    (
        Column("move", "", "name of the move", lambda fit: [fit.moves[k].name for k in fit.move]),
        Column("time_s", "s", "middle of the window", lambda fit: fit.centre, ".6f"),
        Column("measured", "", "mean acceleration over the window, counts/s²", lambda fit: fit.measured, ".3f"),
        Column("predicted", "", "by the identified axis and the drive, counts/s²", lambda fit: fit.predicted, ".3f"),
        Column("residual", "", "measured less predicted, counts/s²", lambda fit: fit.residual, ".3f"),
    ),
)


def servo_object(fit: ServoFit, loop: ServoLoop | None, verdict: Verdict) -> dict[str, Any]:
    """Object that `catseye servo identify --json` prints."""
    return {
        "verdict": verdict.to_object(),
        "moves": len(fit.moves),
        "windows": len(fit.measured),
        "parameters": list(NAMES),
        **dict(zip(NAMES, fit.values, strict=True)),
        **{f"u_{name}": u for name, u in zip(NAMES, fit.u, strict=True)},
        "covariance": fit.covariance,
        "scatter": fit.scatter,
        "scatter_of_counts": fit.expected,
        "loop": None if loop is None else _loop_object(loop),
    }


def _loop_object(loop: ServoLoop) -> dict[str, Any]:
    kp, ki, kd, interval = loop.gains
    return {
        "kp": kp,
        "ki": ki,
        "kd": kd,
        "interval": interval,
        "crossover_hz": loop.crossover / TWO_PI,
        "bandwidth_hz": loop.bandwidth / TWO_PI,
        "phase_margin": loop.phase,
        "gain_margin": loop.gain if math.isfinite(loop.gain) else None,
        "gain_margin_below": loop.gain_below,
    }


def servo_passages(fit: ServoFit, loop: ServoLoop | None) -> list[Passage]:
    """Quantities of the axis, scatter, loop."""
    (gain, decay, friction, delay), (u_gain, u_decay, u_friction, u_delay) = fit.values, fit.u
    rows = [
        Passage("Gain", f"{gain:.0f} ± {u_gain:.0f} counts/s² a step of the 8-bit converter"),
        Passage("Viscous", f"decay of the speed {decay:.3f} ± {u_decay:.3f} 1/s without drive"),
        Passage("Coulomb", f"dry friction {friction:.2f} ± {u_friction:.2f} steps"),
        Passage("Delay", f"{1e3 * delay:.2f} ± {1e3 * u_delay:.2f} ms from the sample to the drive"),
        Passage(
            "Scatter",
            f"{fit.scatter:.0f} counts/s² over {len(fit.measured)} windows, {fit.expected:.0f} by whole counts alone",
        ),
    ]
    if loop is not None:
        rise = f"{loop.gain:.1f}" if math.isfinite(loop.gain) else "any factor"
        rows.append(
            Passage(
                "Loop",
                f"crossover {loop.crossover / TWO_PI:.1f} Hz, bandwidth {loop.bandwidth / TWO_PI:.1f} Hz, phase margin "
                f"{loop.phase / DEGREE:.0f}°; its gain may rise by {rise}, fall to {loop.gain_below:.2f}",
            )
        )
    return rows
