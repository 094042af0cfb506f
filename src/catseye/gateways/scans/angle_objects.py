"""Returns by angle as JSON, text and tables."""

from typing import Any

import numpy as np

from catseye.constants import DEGREE
from catseye.gateways.scans.tables import PAGE
from catseye.gateways.writers.columns import Column, Table, each
from catseye.gateways.writers.passage import Passage
from catseye.reduction.scans.angles import NAMES, AngleComparison, KindFit

KINDS = Table[tuple[KindFit, ...]](
    "kinds.csv",
    PAGE,
    (
        Column("kind", "", "kind of retroreflector, the likeliest first", each(lambda fit: fit.kind)),
        Column("gain", "", "return at normal incidence, in the readings' unit", each(lambda fit: fit.values[0]), ".5f"),
        Column("u_gain", "", "its standard uncertainty", each(lambda fit: fit.u[0]), ".5f"),
        Column("background", "", "return without the retroreflector", each(lambda fit: fit.values[1]), ".5f"),
        Column("u_background", "", "its standard uncertainty", each(lambda fit: fit.u[1]), ".5f"),
        Column(
            "incidence_zero_deg", "deg", "the stage's at normal incidence", each(lambda f: f.values[2] / DEGREE), ".4f"
        ),
        Column("u_incidence_zero_deg", "deg", "its standard uncertainty", each(lambda fit: fit.u[2] / DEGREE), ".4f"),
        Column(
            "rotation_zero_deg",
            "deg",
            "the stage's with the ranger on the side of an edge, modulo 120; empty if nothing shows it",
            each(lambda fit: fit.values[3] / DEGREE if fit.determined[3] else None),
            ".4f",
        ),
        Column("u_rotation_zero_deg", "deg", "its standard uncertainty", each(lambda fit: fit.u[3] / DEGREE), ".4f"),
        Column("chi2", "", "of the readings and the background's prior", each(lambda fit: fit.chi2), ".3f"),
        Column("degrees_of_freedom", "", "of the readings", each(lambda fit: fit.degrees_of_freedom)),
        Column("p", "", "probability of a larger chi-square", each(lambda fit: fit.p), ".3g"),
        Column("half_deg", "deg", "incidence at half of the normal return", each(lambda fit: fit.half / DEGREE), ".2f"),
    ),
)
RETURNS = Table[AngleComparison](
    "returns.csv",
    PAGE,
    (
        Column("table", "", "file of the reading", lambda c: [c.readings.names[k] for k in c.readings.table]),
        Column("incidence_deg", "deg", "as the stage counts", lambda c: c.readings.incidence / DEGREE, ".5f"),
        Column("rotation_deg", "deg", "as the stage counts", lambda c: c.readings.rotation / DEGREE, ".5f"),
        Column(
            "analyser_deg",
            "deg",
            "analyser from the field of the light; empty without one",
            lambda c: [None if np.isnan(a) else a / DEGREE for a in _analysers(c)],
            ".4f",
        ),
        Column("measured", "", "return, in the readings' unit", lambda c: c.readings.value, ".5f"),
        Column("predicted", "", "by the judged kind", lambda c: c.fit.predicted, ".5f"),
        Column("u", "", "standard uncertainty of the reading", lambda c: c.fit.sigma, ".5f"),
    ),
)


def _analysers(comparison: AngleComparison) -> np.ndarray:
    """Analyser of each reading, rad, (n,); nan without one."""
    readings = comparison.readings
    return np.full(len(readings), np.nan) if readings.analyser is None else readings.analyser


def _light(comparison: AngleComparison) -> list[Passage]:
    """Polarization of the light and the analysers, if known."""
    if comparison.polarization is None:
        return []
    through = ", ".join(
        "none" if np.isnan(angle) else f"{angle / DEGREE:.4g}°" for angle in np.unique(_analysers(comparison))
    )
    field = f"its field at {comparison.polarization / DEGREE:.4g}° from the plane of incidence"
    return [Passage("The light", f"polarized, {field}; analyser: {through}")]


def _kind_object(fit: KindFit) -> dict[str, Any]:
    values = dict(zip(NAMES, fit.values, strict=True))
    values["rotation_zero"] = float(fit.values[3]) if fit.determined[3] else None
    return {
        "kind": fit.kind,
        **values,
        **{f"u_{name}": u for name, u in zip(NAMES, fit.u, strict=True)},
        "covariance": fit.covariance,
        "chi2": fit.chi2,
        "degrees_of_freedom": fit.degrees_of_freedom,
        "p": fit.p,
        "half": fit.half,
    }


def comparison_object(comparison: AngleComparison) -> dict[str, Any]:
    """Object that `catseye scan compare --json` prints."""
    return {
        "verdict": comparison.verdict.to_object(),
        "kind": comparison.fit.kind,
        "unit": comparison.readings.unit,
        "readings": len(comparison.readings),
        "polarization": comparison.polarization,
        "analysers": [] if comparison.readings.analyser is None else np.unique(_analysers(comparison)),
        "parameters": list(NAMES),
        "kinds": [_kind_object(fit) for fit in comparison.fits],
    }


def comparison_passages(comparison: AngleComparison) -> list[Passage]:
    """Kind, its parameters, and the others."""
    fit, unit = comparison.fit, comparison.readings.unit
    zero = f"normal incidence at {fit.values[2] / DEGREE:+.3f} ± {fit.u[2] / DEGREE:.3f}° of the stage"
    if fit.determined[3]:
        zero += f", an edge at rotation {fit.values[3] / DEGREE:+.2f} ± {fit.u[3] / DEGREE:.2f}° (modulo 120)"
    others = "; ".join(
        f"{other.kind} {other.chi2 / max(other.degrees_of_freedom, 1):.3g}"
        for other in comparison.fits
        if other is not fit
    )
    half = f", half of it at {fit.half / DEGREE:.1f}°" if np.isfinite(fit.half) else ""
    return [
        Passage(
            "Kind", f"{fit.kind}: variance factor {fit.chi2 / max(fit.degrees_of_freedom, 1):.2f}, p = {fit.p:.3g}"
        ),
        Passage("Return", f"{fit.values[0]:.4g} ± {fit.u[0]:.2g} {unit} at normal incidence{half}"),
        Passage("Stage", zero),
        *_light(comparison),
        Passage("Other kinds", f"variance factors {others}"),
    ]
