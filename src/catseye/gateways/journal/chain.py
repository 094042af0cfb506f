"""Report of a journal's hash chain as JSON and text."""

from typing import Any

from catseye.coordinator.journal.check import ChainReport


def chain_object(report: ChainReport) -> dict[str, Any]:
    """Chain of a run as an object for JSON."""
    return {
        "run": report.run,
        "uuid": report.uuid,
        "chained": report.chained,
        "intact": report.intact,
        "ended": report.ended,
        "events": report.events,
        "head": None if report.head is None else str(report.head),
        "heads_given": report.given,
        "heads_found": report.heads,
        "problems": list(report.problems),
        "problem_count": report.count,
        "first_wrong_event": report.first,
        "wrong_events": sorted(report.bad),
    }


def chain_words(report: ChainReport) -> list[str]:
    """Chain of a run in sentences."""
    if not report.chained and not report.count:
        return ["none: an older catseye wrote the run; later changes cannot be detected."]
    if report.count:
        more = report.count - len(report.problems)
        return [
            *(f"{problem}." for problem in report.problems),
            *([f"{more} more of these."] if more else []),
            f"Altered from event {report.first} on; of {report.events} events "
            f"{len(report.bad)} are wrong themselves. Use a backup, or export the others as of a damaged journal.",
        ]
    end = "" if report.ended else "; it has no end: still running, killed, or truncated there"
    head_check = f", and contains the {report.heads} given heads" if report.heads else ", checked against no head"
    return [f"{report.events} events are unaltered up to head {report.head}{head_check}{end}."]
