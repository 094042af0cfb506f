"""Movements from changes of ranges as text and JSON."""

from typing import Any

import numpy as np

from catseye.gateways.deformation.tables import constraint_word
from catseye.gateways.writers.passage import Passage
from catseye.names import counted
from catseye.reduction.deformation.movements import ConstraintTest, MeasuredMovements, verdict_words
from catseye.reduction.network.words import listed, quantity

FEW = 40  # points that a terminal lists one by one
FORMAT = "catseye-movements-1"


def movement_passages(measured: MeasuredMovements) -> list[Passage]:
    """Passages on movements, constraints, air and the changes."""
    passages = [Passage("Movements", verdict_words(measured) + ".")]
    if measured.tests:
        passages.append(Passage("Constraints", "; ".join(_test(test) for test in measured.tests) + "."))
    value, u = measured.air
    if np.isfinite(u):
        passages.append(
            Passage(
                "The air",
                f"its index changed by {value:+.3f} ppm (u {u:.3f}; {measured.air_ppm:g} before), common to all lines.",
            )
        )
    passages.append(Passage("The changes", _changes(measured)))
    return passages


def _test(test: ConstraintTest) -> str:
    word = constraint_word(test.rejected, test.degrees_of_freedom)
    chance = f" (p = {test.p:.2g}, {counted(test.degrees_of_freedom, 'degree')} of freedom)"
    return (
        f"{test.kind} {test.name} {'is ' if word != 'holds' else ''}{word}{chance if test.degrees_of_freedom else ''}"
    )


def _changes(measured: MeasuredMovements) -> str:
    changes = measured.changes
    lines = int(np.isfinite(changes.change).sum())
    text = f"{counted(lines, 'line')} from {counted(len(changes.stations), 'station')}, taken not to move"
    if measured.degrees_of_freedom:
        factor = float(measured.solution.pvv) / measured.degrees_of_freedom if measured.solution else np.nan
        text += (
            f"; residuals are {np.sqrt(factor):.3g} times their claims, with {measured.degrees_of_freedom} degrees of "
            f"freedom (p = {measured.p_fit:.2g})"
        )
    if measured.solution is not None:
        u = np.sqrt(np.maximum(np.diag(measured.solution.approximation), 0.0)).max()
        text += f". The approximate coordinates add at most {quantity(float(u), 'm')} to a movement's u"
    if changes.alone:
        text += f". Not used, measured in one epoch only: {listed(changes.alone)}"
    return text + "."


def movement_rows(measured: MeasuredMovements) -> list[str]:
    """Movements of a few points, a line each; none of many."""
    if len(measured.changes.points) > FEW:
        return []
    rows = []
    for k, name in enumerate(measured.changes.points):
        if not measured.determined[k]:
            rows.append(f"{'':<14}{name:<10} undetermined")
            continue
        moved = "  ".join(f"d{axis} {v * 1e3:9.4f}" for axis, v in zip("xyz", measured.displacement[k], strict=True))
        u = ", ".join(f"{v * 1e3:.4f}" for v in measured.u[k])
        rows.append(f"{'':<14}{name:<10} {moved}   u {u} mm   {measured.words[k]}")
    return rows


def movements_object(measured: MeasuredMovements) -> dict[str, Any]:
    """Object of `catseye movements --json`: SI units, points in the order of the table of points."""
    value, u = measured.air
    return {
        "format": FORMAT,
        "verdict": measured.verdict.to_object(),
        "names": list(measured.changes.points),
        "stations": list(measured.changes.stations),
        "displacement": measured.displacement,
        "u": measured.u,
        "covariance": measured.covariance,
        "p": measured.p,
        "words": list(measured.words),
        "constraint": list(measured.constraint_names),
        "constraints": [
            {
                "name": test.name,
                "kind": test.kind,
                "points": list(test.points),
                "statistic": test.statistic,
                "degrees_of_freedom": test.degrees_of_freedom,
                "p": test.p,
                "verdict": constraint_word(test.rejected, test.degrees_of_freedom),
            }
            for test in measured.tests
        ],
        "air": {"change": value * 1e-6, "u": u * 1e-6, "u_before": measured.air_ppm * 1e-6},
        "change": measured.changes.change,
        "residual": measured.residual,
        "standardised": measured.standardised,
        "pvv": None if measured.solution is None else float(measured.solution.pvv),
        "degrees_of_freedom": measured.degrees_of_freedom,
        "p_fit": measured.p_fit,
        "one_epoch_only": list(measured.changes.alone),
    }
