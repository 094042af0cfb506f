"""Sentences of a calibration for a terminal, and values rounded by u."""

import math
from collections.abc import Iterator, Sequence

from catseye.gateways.writers.passage import Passage
from catseye.reduction.calibrations.calibration import Calibration
from catseye.reduction.calibrations.check_outcome import CheckOutcome
from catseye.reduction.calibrations.conformity import Conformity

MOST_NAMED = 12  # readings named at most


def rounded(value: float, u: float) -> tuple[str, str]:
    """Value and u as text: u with two digits, the value to the same decimal place.

    >>> rounded(180.68514159, 0.00545), rounded(-173.7, 12.0), rounded(1.5, 0.0)
    (('180.6851', '0.0054'), ('-174', '12'), ('1.5', '0'))
    """
    if not (math.isfinite(value) and math.isfinite(u)):
        return f"{value:g}", "unknown"
    if u <= 0.0:
        return f"{value:.12g}", "0"
    places = max(0, 1 - math.floor(math.log10(u)))
    if float(f"{u:.1e}") >= 10.0 ** (2 - places) and places > 0:  # 0.0996 rounds up to 0.10, one digit fewer
        places -= 1
    return f"{value:.{places}f}", f"{u:.{places}f}"


def test_line(decision: CheckOutcome) -> str:
    """One test as a line: number, limit, outcome and meaning.

    A comparison that chose a model has no outcome other than its text.

    >>> test_line(CheckOutcome("cyclic order 1: F", 1816.0, 4.541, None, "significant: kept"))
    'cyclic order 1: F 1816, limit 4.541: significant: kept'
    """
    if decision.passed is None:
        values = f" {decision.statistic:.4g}, limit {decision.limit:.4g}" if decision.comparison else ""
        return f"{decision.name}{values}: {'' if values else 'not judged; '}{decision.text}"
    outcome = "passed" if decision.passed else "FAILED"
    numbers = f" {decision.comparison}" if decision.comparison else ""
    return f"{decision.name}{numbers}: {outcome}; {decision.text}"


def passages(calibration: Calibration) -> Iterator[tuple[str, str]]:
    """Title and text of each paragraph that a terminal shows of a calibration."""
    provenance = calibration.provenance
    yield (
        "Calibration",
        f"{calibration.title}; serial {provenance['serial']}, measured on {provenance['measured_on']} by "
        f"{provenance['by']}, valid until {provenance['valid_until']}.",
    )
    for number, q in enumerate(calibration.quantities):
        value, u = rounded(q.value, q.u)
        yield "" if number else "Found", f"{q.key} = {value}, u {u} {q.unit}: {q.meaning}"
    for number, decision in enumerate((*calibration.decisions, *calibration.plausible)):
        yield "" if number else "Tests", test_line(decision)
    odd = [f"{number} ({state})" for number, state in enumerate(calibration.states, start=1) if state != "used"]
    if odd:
        more = f" and {len(odd) - MOST_NAMED} more" if len(odd) > MOST_NAMED else ""
        yield "Readings", f"{len(calibration.rows)}, of which {', '.join(odd[:MOST_NAMED])}{more}"
    elif calibration.states:
        yield "Readings", f"{len(calibration.rows)}, all used"
    for number, note in enumerate(calibration.notes):
        yield "" if number else "Notes", note


def conformity_passages(conformities: Sequence[Conformity]) -> list[Passage]:
    """Statements of conformity as passages of a terminal."""
    passages = []
    for number, each in enumerate(conformities):
        limits = each.specification
        span = " to ".join("none" if end is None else f"{end:.12g}" for end in (limits.lower, limits.upper))
        text = f"{each.quantity.key}: {each.statement}; limits {span} {each.quantity.unit}, probability of conformity "
        passages.append(Passage("" if number else "Conformity", f"{text}{each.probability:.4f}"))
    return passages
