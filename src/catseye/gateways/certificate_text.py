"""What a terminal shows of a calibration."""

from collections.abc import Iterator

from catseye.gateways.certificate import rounded
from catseye.reduction.calibrations.calibration import Calibration

SHOWN = 12  # readings named at most


def passages(found: Calibration) -> Iterator[tuple[str, str]]:
    """(title, text) of each paragraph."""
    said = found.provenance
    yield (
        "Calibration",
        f"{found.title}; serial {said['serial']}, measured on {said['measured_on']} by {said['by']}, valid until "
        f"{said['valid_until']}.",
    )
    for number, q in enumerate(found.quantities):
        value, u = rounded(q.value, q.u)
        yield "" if number else "Found", f"{q.key} = {value}, u {u} {q.unit}: {q.meaning}"
    for number, decision in enumerate(found.decisions):
        outcome = {True: "passed", False: "FAILED", None: "not judged"}[decision.passed]
        numbers = f" {decision.statistic:.4g}, limit {decision.limit:.4g}" if decision.limit == decision.limit else ""
        yield "" if number else "Tests", f"{decision.name}{numbers}: {outcome}; {decision.text}"
    odd = [f"{number} ({state})" for number, state in enumerate(found.states, start=1) if state != "used"]
    if odd:
        more = f" and {len(odd) - SHOWN} more" if len(odd) > SHOWN else ""
        yield "Readings", f"{len(found.rows)}, of which {', '.join(odd[:SHOWN])}{more}"
    elif found.states:
        yield "Readings", f"{len(found.rows)}, all used"
    for number, note in enumerate(found.notes):
        yield "" if number else "Notes", note
