"""Followed vibration as text and JSON."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.gateways.writers.cells import aligned
from catseye.gateways.writers.passage import Passage
from catseye.reduction.structure.arm_motion import ArmMotion
from catseye.reduction.structure.following import FollowedVibration
from catseye.verdict import Verdict


def following_object(vibration: FollowedVibration, motion: ArmMotion | None, verdict: Verdict) -> dict[str, Any]:
    """JSON object of a followed vibration, SI keys."""
    state = vibration.state
    frequency, u_frequency = state.frequencies_hz()
    (amplitude, u_amplitude), (phase, u_phase) = state.amplitudes(), state.phases()
    modes = [
        {
            "name": name,
            "locked": bool(vibration.locked[k]),
            "frequency_hz": float(frequency[k]),
            "u_frequency_hz": float(u_frequency[k]),
            "damping_ratio": state.modes[k].damping_ratio,
            "amplitude": amplitude[k].tolist(),
            "u_amplitude": u_amplitude[k].tolist(),
            "phase": phase[k].tolist(),
            "u_phase": u_phase[k].tolist(),
        }
        for k, name in enumerate(vibration.names)
    ]
    return {
        "verdict": verdict.to_object(),
        "axes": list(vibration.samples.axes),
        "time": float(state.time),
        "modes": modes,
        "predicted": [
            {"lead": float(lead), "displacement": at.tolist(), "covariance": q.tolist()}
            for lead, at, q in zip(vibration.leads, vibration.predicted, vibration.covariance, strict=True)
        ],
        "check": {
            "ahead": vibration.ahead,
            "samples": len(vibration.residual),
            "before": vibration.before.tolist(),
            "after": vibration.after.tolist(),
            "claimed": vibration.expected.tolist(),
            "ratio": vibration.ratio,
        },
        "motion": None if motion is None else _motion_object(motion, vibration.leads),
    }


def _motion_object(motion: ArmMotion, leads: np.ndarray) -> dict[str, Any]:
    rows = []
    for k, lead in enumerate(leads):
        six = motion.six[k]
        row = {"lead": float(lead), "translation": six[:3].tolist(), "rotation": six[3:].tolist()}
        row["covariance"] = motion.covariance[k].tolist()
        if motion.place is not None and motion.moved is not None and motion.spread is not None:
            row["ranger"] = {"place": motion.place[k].tolist(), "moved": motion.moved[k].tolist(),
                             "covariance": motion.spread[k].tolist()}  # fmt: skip
        rows.append(row)
    ranger = None if motion.ranger is None else {"name": motion.ranger, "frame": "ground"}
    return {"frame": motion.frame, "pivot": motion.pivot.tolist(), "ranger": ranger, "times": rows}


def following_passages(vibration: FollowedVibration, motion: ArmMotion | None) -> Sequence[Passage]:
    """Sentences: each mode, the check, the arm's motion."""
    state, axes = vibration.state, vibration.samples.axes
    frequency, u_frequency = state.frequencies_hz()
    (amplitude, u_amplitude), (phase, u_phase) = state.amplitudes(), state.phases()
    passages = []
    for k, name in enumerate(vibration.names):
        parts = [f"{frequency[k]:.4f} Hz, u {u_frequency[k]:.4f}"]
        for a, axis in enumerate(axes):
            size, u = amplitude[k, a] / MILLIMETRE, u_amplitude[k, a] / MILLIMETRE
            if size < 2.0 * u:
                parts.append(f"{axis} below {2.0 * u:.3f} mm")
                continue
            turn, u_turn = phase[k, a] / DEGREE, u_phase[k, a] / DEGREE
            parts.append(f"{axis} {size:.3f} mm, u {u:.3f}, at {turn:.1f} deg, u {u_turn:.1f}")
        text = "; ".join(parts)
        passages.append(Passage(name.capitalize(), text if vibration.locked[k] else f"{text}; its phase is not known"))
    before, after, claim = (
        ", ".join(f"{axis} {v / MILLIMETRE:.4f}" for axis, v in zip(axes, values, strict=True))
        for values in (vibration.before, vibration.after, vibration.expected)
    )
    text = f"{len(vibration.residual)} samples predicted {vibration.ahead:.3g} s ahead: rms {before} mm before, "
    passages.append(Passage("Following", f"{text}{after} mm after, {claim} mm claimed"))
    if motion is not None:
        pivot = ", ".join(f"{v:g}" for v in motion.pivot)
        passages.append(
            Passage(
                "Motion", f"of the frame {motion.frame.replace('_', ' ')}, its own axes, pivot {pivot} m, by vibration"
            )
        )
    return passages


def following_lines(vibration: FollowedVibration, motion: ArmMotion | None) -> list[str]:
    """Table of the prediction as text, and of the arm's motion below it."""
    axes = vibration.samples.axes
    rows = [["ahead s", *(f"{axis} mm" for axis in axes), *(f"u_{axis} mm" for axis in axes)]]
    u = np.sqrt(np.diagonal(vibration.covariance, axis1=-2, axis2=-1))
    for lead, at, spread in zip(vibration.leads, vibration.predicted, u, strict=True):
        rows.append([f"{lead:.3f}", *(f"{v / MILLIMETRE:.3f}" for v in (*at, *spread))])
    lines = aligned(rows)
    if motion is None:
        return lines
    rows = [["ahead s", *(f"shift {a} mm" for a in "xyz"), *(f"turn {a} arcsec" for a in "xyz")]]
    if motion.moved is not None:
        rows[0] += [f"{motion.ranger} {a} mm" for a in "xyz"]
    for k, lead in enumerate(vibration.leads):
        row = [f"{lead:.3f}", *(f"{v / MILLIMETRE:.3f}" for v in motion.six[k, :3])]
        row += [f"{v / ARCSECOND:.2f}" for v in motion.six[k, 3:]]
        rows.append(row if motion.moved is None else row + [f"{v / MILLIMETRE:.3f}" for v in motion.moved[k]])
    return [*lines, "", *aligned(rows)]
