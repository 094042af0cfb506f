"""Fit of a structural model as JSON and text."""

from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.gateways.writers.passage import Passage
from catseye.reduction.structure.model_fit import ModelFindings


def fit_object(findings: ModelFindings) -> dict[str, Any]:
    """Object that `catseye model fit --json` prints; m and rad."""
    rows = findings.coefficients
    return {
        "verdict": findings.verdict.to_object(),
        "model": findings.antenna.record.title,
        "epochs": len(findings.epochs),
        "elevation_deg": _elevations(findings),
        "coefficients": [
            {
                "owner": row.owner,
                "component": row.component,
                "function": row.function,
                "before": row.before,
                "value": row.after,
                "u": row.u,
            }
            for row in rows
        ],
        "covariance_order": [f"{row.owner} {row.component} {row.function}" for row in rows],
        "covariance": findings.fit.covariance,
        "places": findings.fit.places,
        "variance_factor": findings.fit.variance_factor,
        "degrees_of_freedom": findings.fit.degrees_of_freedom,
        "p": findings.p,
        "residual_rms": float(np.sqrt(np.mean(findings.residuals**2))),
        "notes": list(findings.notes),
    }


def _elevations(findings: ModelFindings) -> list[float]:
    e = [float(np.ravel(epoch.posture.elevation)[0]) / DEGREE for epoch in findings.epochs]
    return [min(e), max(e)]


def fit_passages(findings: ModelFindings) -> list[Passage]:
    """Passages on the epochs, the residuals, the largest change, notes."""
    low, high = _elevations(findings)
    targets = {name for epoch in findings.epochs for name in epoch.names}
    rms = np.sqrt(np.mean(findings.residuals**2)) / MILLIMETRE
    most = max(findings.coefficients, key=lambda row: abs(row.after - row.before) / row.u)
    unit, name = (ARCSECOND, '"') if most.turns else (MILLIMETRE, " mm")
    change = f"{(most.after - most.before) / unit:+.2f}{name}, {abs(most.after - most.before) / most.u:.1f} u"
    return [
        Passage(
            "Fit",
            f"{len(findings.coefficients)} coefficients from {len(targets)} targets in {len(findings.epochs)} epochs, "
            f"elevation {low:.1f} to {high:.1f} degrees; residuals {rms:.3f} mm rms, p = {findings.p:.3f}",
        ),
        Passage("Changed most", f"{most.owner} {most.component} {most.function}: {change}"),
        *(Passage("Note", note) for note in findings.notes),
    ]


def fit_lines(findings: ModelFindings) -> list[str]:
    """Lines of a terminal: each coefficient before and after, with u and the change in u."""
    lines = [f"{'':<34}{'model':>10}{'fitted':>10}{'u':>9}{'change/u':>10}"]
    for row in findings.coefficients:
        unit, name = (ARCSECOND, '"') if row.turns else (MILLIMETRE, "mm")
        head = f"{row.owner} {row.component} {row.function}"
        values = f"{row.before / unit:10.3f}{row.after / unit:10.3f}{row.u / unit:9.3f}"
        lines.append(f"{head:<34}{values}{(row.after - row.before) / row.u:10.1f}  {name}")
    return lines
