"""Positions of targets as text and JSON."""

from typing import Any

import numpy as np

from catseye.gateways.writers.passage import Passage
from catseye.names import counted
from catseye.reduction.network.positions import LocatedTargets
from catseye.reduction.network.words import listed, quantity

FEW = 40  # targets that a terminal lists one by one
STEPS = 8  # of an iteration in a sentence
FORMAT = "catseye-positions-1"


def positions_passages(located: LocatedTargets) -> list[Passage]:
    """Passages on positions, second solutions, the iteration, and the agreement of the ranges."""
    found, total = int(located.found.sum()), len(located.found)
    text = f"{found} of {counted(total, 'target')} found"
    if found:
        u = np.sqrt(np.diagonal(located.positions.covariance[located.found], axis1=1, axis2=2))
        usual, worst = quantity(float(np.median(u)), "m"), quantity(float(u.max()), "m")
        text += f"; a coordinate is usually known to {usual}, the worst to {worst} (1σ)"
    first = np.flatnonzero(~located.found)
    failure = f"first target {located.target_names[first[0]]}: {located.words[first[0]]}." if len(first) else ""
    return [
        Passage("Positions", text + "."),
        *([Passage("The others", failure)] if failure else []),
        *_second(located),
        *_iteration(located),
        *_agreement(located),
    ]


def _second(located: LocatedTargets) -> list[Passage]:
    if located.other is None:
        return []
    ambiguous = np.isfinite(located.other.x).all(axis=1) & located.found
    if not ambiguous.any():
        return [Passage("Mirror images", "None: the ranges exclude every mirror image.")]
    names = [located.target_names[k] for k in np.flatnonzero(ambiguous)]
    apart = np.linalg.norm(located.positions.x[ambiguous] - located.other.x[ambiguous], axis=1)
    return [
        Passage(
            "Mirror images",
            f"{listed(names)}: the mirror image in the plane of the stations fits as well, {apart.min():.3f} m away"
            + (f" to {apart.max():.3f} m" if len(names) > 1 else "")
            + "; something else must choose.",
        )
    ]


def _iteration(located: LocatedTargets) -> list[Passage]:
    if located.iteration is None:
        return []
    steps = located.iteration.iterations
    k = int(np.argmax(steps))
    chosen = int(steps[k])
    sizes = located.iteration.differences[:chosen, k]
    differences = ", ".join(f"{size:.3g}" for size in sizes[:STEPS]) + (", ..." if chosen > STEPS else "")
    return [
        Passage(
            "The iteration",
            f"{int(steps.min())} to {int(steps.max())} solutions of eq. 3.7, each averaged with the one before; "
            f"{located.target_names[k]}: old and new value differ by {differences} m.",
        )
    ]


def _agreement(located: LocatedTargets) -> list[Passage]:
    checked = np.isfinite(located.p)
    if not checked.any():
        return []
    freedom = int(located.positions.degrees_of_freedom[checked].sum())
    text = (
        f"{counted(int(checked.sum()), 'target')} with more than three ranges: residuals are "
        f"{np.sqrt(located.variance_factor):.3g} times their claims overall, with {freedom} degrees of freedom"
    )
    bad = np.flatnonzero(located.contradicting)
    if len(bad):
        order = bad[np.argsort(located.p[bad])]
        text += f"; {listed([located.target_names[k] for k in order])}: contradicting, p = {located.p[order[0]]:.2g}"
    return [Passage("Agreement", text + ".")]


def position_rows(located: LocatedTargets) -> list[str]:
    """Coordinates of a few targets, a line each; none of many."""
    if len(located.target_names) > FEW:
        return []
    rows = []
    for k, name in enumerate(located.target_names):
        if not np.isfinite(located.positions.x[k]).all():
            rows.append(f"{'':<14}{name:<10} {located.words[k].partition(':')[0]}")
            continue
        u = np.sqrt(np.diag(located.positions.covariance[k]))
        p = f"   p {located.p[k]:.3f}" if np.isfinite(located.p[k]) else "   not checked"
        rows.append(_row(name, located.positions.x[k], u) + p)
        if located.other is not None and np.isfinite(located.other.x[k]).all():
            rows.append(_row("  or", located.other.x[k], np.sqrt(np.diag(located.other.covariance[k]))))
    return rows


def _row(name: str, x: np.ndarray, u: np.ndarray) -> str:
    places = "  ".join(f"{axis} {v:11.5f}" for axis, v in zip("xyz", x, strict=True))
    return f"{'':<14}{name:<10} {places}   u {', '.join(f'{v * 1e3:.3f}' for v in u)} mm"


def positions_object(located: LocatedTargets) -> dict[str, Any]:
    """Object of `catseye locate --json`: arrays in the order of the targets and stations."""
    closure, u_closure = located.closure
    second, iteration = located.other, located.iteration
    return {
        "format": FORMAT,
        "verdict": located.verdict.to_object(),
        "method": "least_squares" if iteration is None else "averaging",
        "names": list(located.target_names),
        "stations": list(located.station_names),
        "x": located.positions.x,
        "covariance": located.positions.covariance,
        "status": located.words,
        "found": located.found,
        "pvv": located.positions.pvv,
        "ranges": located.positions.ranges,
        "p": located.p,
        "contradicting": located.contradicting,
        "residual": located.residual,
        "redundancy": located.redundancy,
        "too_short": located.too_short,
        "closure": closure,
        "u_closure": u_closure,
        "variance_factor": located.variance_factor,
        "other_x": None if second is None else second.x,
        "other_covariance": None if second is None else second.covariance,
        "steps": None if iteration is None else iteration.iterations,
        "step_x": None if iteration is None else iteration.averages,
        "step_difference": None if iteration is None else iteration.differences,
    }
