"""Explanation of a shot as JSON and as text lines."""

from datetime import datetime, timedelta
from typing import Any

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.estimation.quality.propagation import Input, agreement
from catseye.gateways.epoch.summary import MEANING
from catseye.gateways.writers.passage import Passage
from catseye.records.night.campaign import REFERENCE
from catseye.reduction.budget.explanation import Explanation

MICROMETRE = 1e-6
SMALLEST_SHARE = 5e-5  # of a row in the text table
START_OF_MJD = datetime(1858, 11, 17)


def explanation_object(explanation: Explanation, seed: int | None = None) -> dict[str, Any]:
    """Object that `catseye explain --json` prints: metres, shares of 1, null where undefined.

    seed   of the Monte Carlo, if one was run

    An input's value and standard uncertainty are in its unit, its sensitivity in metres per unit, its contribution
    in metres. Infinite degrees of freedom are null, and so is `agrees` if there are too few draws.
    """
    budget, cycles = explanation.budget, explanation.cycles
    return {
        "verdict": explanation.verdict.to_object(),
        "shot": explanation.shot,
        "ranger": explanation.ranger,
        "target": explanation.target,
        "mjd_utc": explanation.mjd_utc,
        "status": explanation.status,
        "reason": explanation.reason or "",
        "amplitude": abs(explanation.phasor),
        "phase": float(np.mod(np.angle(explanation.phasor), 2.0 * np.pi)),
        "u_phase": explanation.u_across / abs(explanation.phasor) if explanation.phasor else None,
        "range": budget and budget.value,
        "u_range": budget and budget.u,
        "expanded_uncertainty": budget and budget.expanded,
        "coverage_probability": budget and budget.probability,
        "coverage_factor": budget and budget.coverage_factor,
        "effective_degrees_of_freedom": budget and budget.degrees_of_freedom,
        "cycles": cycles and int(cycles.cycles),
        "margin": cycles and float(cycles.margin),
        "slip_probability": cycles and float(cycles.slip_probability),
        "coarse_from": explanation.coarse or None,
        "inputs": _inputs(explanation),
        "correlations": _correlations(explanation),
        "monte_carlo": _monte_carlo(explanation, seed),
        "adjusted": _adjusted(explanation),
        "references": [{"shot": s, "after": after, "weight": w} for s, after, w in explanation.references],
        "notes": list(explanation.notes),
    }


def _inputs(explanation: Explanation) -> list[dict[str, Any]]:
    budget = explanation.budget
    if budget is None:
        return []
    return [
        {
            "name": item.given.name,
            "value": item.given.value,
            "unit": item.unit,
            "standard_uncertainty": item.given.u,
            "distribution": item.given.distribution,
            "degrees_of_freedom": item.given.degrees_of_freedom,
            "sensitivity": item.slope,
            "contribution": contribution,
            "share": share,
            "source": item.source,
        }
        for item, contribution, share in zip(explanation.items, budget.contribution, budget.share, strict=True)
    ]


def _correlations(explanation: Explanation) -> list[dict[str, Any]]:
    if explanation.budget is None:
        return []
    r = explanation.budget.correlation
    return [
        {"first": explanation.items[i].given.name, "second": explanation.items[j].given.name, "correlation": r[i, j]}
        for i in range(len(r))
        for j in range(i)
        if r[i, j] != 0.0
    ]


def _monte_carlo(explanation: Explanation, seed: int | None) -> dict[str, Any] | None:
    scattered, budget = explanation.scattered, explanation.budget
    if scattered is None or budget is None:
        return None
    return {
        "draws": len(scattered.values),
        "seed": seed,
        "mean": scattered.mean,
        "standard_uncertainty": scattered.u,
        "low": scattered.low,
        "high": scattered.high,
        "shortest": list(scattered.shortest),
        "coverage_probability": scattered.probability,
        "agrees": agreement(budget, scattered, digits=1),
    }


def _adjusted(explanation: Explanation) -> dict[str, Any] | None:
    adjusted = explanation.adjusted
    if adjusted is None:
        return None
    return {
        "range": adjusted.range_,
        "u_range": adjusted.u_range,
        "residual": adjusted.residual,
        "standardised": adjusted.standardised,
        "redundancy": adjusted.redundancy,
        "distance": adjusted.distance,
        "u_distance": adjusted.u_distance,
        "used": adjusted.used,
    }


def explanation_passages(explanation: Explanation) -> list[Passage]:
    """Passages on the shot, its return, range, cycles, Monte Carlo and network."""
    passages = [Passage(f"Shot {explanation.shot}", _shot(explanation)), Passage("The return", _return(explanation))]
    if explanation.budget is not None:
        passages += [Passage("The range", _range(explanation)), Passage("Whole cycles", _cycles(explanation))]
        passages.append(Passage("Correlation", _shared(explanation)))
    if explanation.scattered is not None:
        passages.append(Passage("Monte Carlo", _scatter(explanation)))
    if explanation.adjusted is not None:
        passages.append(Passage("The network", _network(explanation)))
    return [*passages, *([Passage("Notes", "; ".join(explanation.notes) + ".")] if explanation.notes else [])]


def when(explanation: Explanation) -> str:
    """Calendar date and time of the trigger."""
    return f"{START_OF_MJD + timedelta(days=explanation.mjd_utc):%Y-%m-%d %H:%M:%S} UTC"


def metres(length: float) -> str:
    """Length to micrometres, in groups of three digits.

    >>> metres(71.1038541)
    '71.103\u202f854 m'
    """
    integer, _, decimals = f"{length:.6f}".partition(".")
    return f"{integer}.{decimals[:3]}\u202f{decimals[3:]} m"


def micrometres(u: float) -> str:
    """Small length with two or three digits.

    >>> micrometres(7.8169e-5), micrometres(-3.4e-6)
    ('78 µm', '-3.4 µm')
    """
    size = u / MICROMETRE
    return f"{size:.0f} µm" if abs(size) >= 10.0 else f"{size:.1f} µm"


def distribution(quantity: Input) -> str:
    """Name of the distribution, with its degrees of freedom if finite."""
    degrees = quantity.degrees_of_freedom
    return quantity.distribution + (f", {degrees:.0f}" if np.isfinite(degrees) else "")


def _shot(explanation: Explanation) -> str:
    what = "its internal cube" if explanation.target == REFERENCE else explanation.target
    start = f"{explanation.ranger} on {what} at {when(explanation)}. "
    if explanation.status == "used":
        return start + "It was used in the adjustment."
    if explanation.status == "reference":
        return start + "It tracks the drift of the electronics and has no range."
    meaning = MEANING.get(explanation.status, "")
    meaning = f" ({meaning})" if explanation.reason and meaning and meaning not in explanation.reason else ""
    return start + (
        f"Not used: {explanation.reason}{meaning}." if explanation.reason else f"Status: {explanation.status}."
    )


def _return(explanation: Explanation) -> str:
    amplitude = abs(explanation.phasor)
    if not np.isfinite(explanation.u_across) or amplitude == 0.0:
        return f"{amplitude:.4f} V after the leakage; its noise is unknown."
    return (
        f"{amplitude:.4f} V after the leakage, phase {np.mod(np.angle(explanation.phasor), 2.0 * np.pi):.4f} rad; "
        f"noise of the samples in quadrature {1e3 * explanation.u_across:.2f} mV, that is "
        f"{1e3 * explanation.u_across / amplitude:.2f} mrad."
    )


def _range(explanation: Explanation) -> str:
    budget = explanation.budget
    assert budget is not None
    degrees = budget.degrees_of_freedom
    many = "infinitely many" if degrees > 1e6 else f"{degrees:.0f}"
    return (
        f"{metres(budget.value)}, u {micrometres(budget.u)}, scan point to reference point as this shot alone gives "
        f"it; with {100.0 * budget.probability:g} % within ±{micrometres(budget.expanded)} "
        f"(k {budget.coverage_factor:.2f}, {many} degrees of freedom)."
        + (" It does not include the reason for which this shot was rejected." if explanation.reason else "")
    )


def _cycles(explanation: Explanation) -> str:
    cycles, scene = explanation.cycles, explanation.scene
    assert cycles is not None
    assert scene is not None
    slip = float(cycles.slip_probability)
    chance = "below 1e-12" if slip < 1e-12 else f"{slip:.1e}"
    return (
        f"{int(cycles.cycles)} half wavelengths, decided by {explanation.coarse}: margin "
        f"{float(cycles.margin) / MILLIMETRE:.2f} mm of {0.5 * scene.half / MILLIMETRE:.2f}, u of the coarse length "
        f"{float(cycles.u) / MILLIMETRE:.2g} mm; probability of another number {chance}."
    )


def _shared(explanation: Explanation) -> str:
    pairs = [f"{c['first']} and {c['second']}: {c['correlation']:+.2f}" for c in _correlations(explanation)]
    return "An effect common to target and references, such as leakage, is one input; " + (
        f"correlated are {', '.join(pairs)}." if pairs else "no two inputs are correlated."
    )


def _scatter(explanation: Explanation) -> str:
    scattered, budget = explanation.scattered, explanation.budget
    assert scattered is not None
    assert budget is not None
    verdict = {
        True: "the budget's interval agrees",
        False: "the budget's interval differs: use this one",
        None: "too few draws to compare the budget's interval",
    }[agreement(budget, scattered, digits=1)]
    u = f"u {micrometres(scattered.u)}" if np.isfinite(scattered.u) else "too few cycles for a u"
    return (
        f"{len(scattered.values)} draws of all inputs through the whole chain: {u}, "
        f"{100.0 * scattered.probability:g} % between {metres(scattered.low)} and {metres(scattered.high)}; {verdict}."
    )


def _network(explanation: Explanation) -> str:
    adjusted = explanation.adjusted
    assert adjusted is not None
    side = "more" if adjusted.residual > 0.0 else "less"
    text = (
        f"with zero, leakage and air as estimated this shot gives {metres(adjusted.range_)} (u "
        f"{micrometres(adjusted.u_range)} of its own), {micrometres(abs(adjusted.residual))} {side} than between "
        f"the adjusted points, {metres(adjusted.distance)} (u {micrometres(adjusted.u_distance)}); "
        f"w {adjusted.standardised:+.1f}, redundancy {adjusted.redundancy:.2f}."
    )
    return text[0].upper() + text[1:]


def budget_lines(explanation: Explanation) -> list[str]:
    """Table of inputs for a terminal, by share; the smallest are combined in one line."""
    budget = explanation.budget
    if budget is None:
        return []
    lines = [f"{'share %':>7} {'µm':>7}  {'input':<35}{'value':>11}{'u':>10} {'unit':<5}{'mm/unit':>10}  distribution"]
    order = np.argsort(-np.abs(budget.share), kind="stable")
    listed = [k for k in order if abs(budget.share[k]) >= SMALLEST_SHARE]
    for k in listed:
        item, quantity = explanation.items[k], explanation.items[k].given
        lines.append(
            f"{100.0 * budget.share[k]:7.2f} {abs(budget.contribution[k]) / MICROMETRE:7.2f}  {quantity.name:<35}"
            f"{quantity.value:>11.6g}{quantity.u:>10.2g} {item.unit:<5}{item.slope / MILLIMETRE:>10.4g}  "
            f"{distribution(quantity)}"
        )
    small = [k for k in order if k not in set(listed)]
    if small:
        size = float(np.sqrt(np.sum(budget.contribution[small] ** 2))) / MICROMETRE
        share = 100.0 * float(budget.share[small].sum())
        lines.append(f"{share:7.2f} {size:7.2f}  {len(small)} smaller inputs (JSON and page have them)")
    return [*lines, f"{100.0:7.2f} {budget.u / MICROMETRE:7.2f}  together"]
