"""A subreflector's position and actuators as text and JSON."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.gateways.writers.passage import Passage
from catseye.reduction.pose.subreflector import LENGTHS, POSE, SubreflectorState

SOURCES = {
    LENGTHS: "from the lengths of the actuators: of the positions that have them, the one reached from rest",
    POSE: "from a measured pose of the subreflector",
}
UNITS = np.repeat([MILLIMETRE, DEGREE], 3)


def subreflector_passages(state: SubreflectorState) -> Sequence[Passage]:
    """Source of the position with frame and pivot, and the way back to rest of a measured one."""
    pivot = ", ".join(f"{v:g}" for v in state.mount.pivot_mm)
    source = SOURCES.get(state.source, "as wanted; u is that of the position which the actuators attain")
    text = f"{source}. Prime-focus axes: shift from rest of the pivot at {pivot} mm, then turns about x, y, z."
    passages = [Passage("Position", text)]
    if state.source == POSE:
        back = (state.rest - state.lengths) / MILLIMETRE
        lengths = ", ".join(f"{name} {v:+.3f}" for name, v in zip(state.names, back, strict=True))
        passages.append(Passage("To rest", f"change the lengths by {lengths} mm."))
    return passages


def subreflector_lines(state: SubreflectorState) -> list[str]:
    """Two tables: shift and turn with u, lengths with change, u and limits."""
    u = np.sqrt(np.diag(state.covariance)) / UNITS
    lines = [f"{'component':<9}  {'value':>11}  {'u':>9}"]
    for k, value in enumerate(state.six / UNITS):
        name, unit = f"{'shift' if k < 3 else 'turn'} {'xyz'[k % 3]}", "mm" if k < 3 else "deg"
        lines.append(f"{name:<9}  {value:>11.5f}  {u[k]:>9.2g}  {unit}")
    width = max(8, *(len(name) for name in state.names))
    lines += ["", f"{'actuator':<{width}}  {'length mm':>11}  {'change mm':>10}  {'u mm':>8}  {'limits mm':>15}"]
    spread = np.sqrt(np.diag(state.lengths_covariance)) / MILLIMETRE
    changes, limits = (state.lengths - state.rest) / MILLIMETRE, state.limits / MILLIMETRE
    for k, name in enumerate(state.names):
        between = f"{limits[k, 0]:g} to {limits[k, 1]:g}"
        out = "  beyond" if state.beyond[k] else ""
        lines.append(
            f"{name:<{width}}  {state.lengths[k] / MILLIMETRE:>11.4f}  {changes[k]:>+10.4f}  {spread[k]:>8.2g}  "
            f"{between:>15}{out}"
        )
    return lines


def subreflector_object(state: SubreflectorState) -> dict[str, Any]:
    """JSON object of a subreflector's state, SI keys."""
    return {
        "frame": "prime_focus",
        "pivot": state.mount.joints["pivot"].tolist(),
        "source": state.source,
        "shift": state.six[:3].tolist(),
        "turn": state.six[3:].tolist(),
        "covariance": state.covariance.tolist(),
        "actuators": list(state.names),
        "lengths": state.lengths.tolist(),
        "lengths_at_rest": state.rest.tolist(),
        "lengths_covariance": state.lengths_covariance.tolist(),
        "beyond_limits": state.beyond.tolist(),
        "lengths_by_position": state.slopes.tolist(),
    }
