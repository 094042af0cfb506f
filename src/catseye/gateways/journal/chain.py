"""Report of a journal's hash chain as JSON and text."""

from collections.abc import Sequence
from typing import Any

from catseye.coordinator.journal.check import ChainReport
from catseye.gateways.writers.verdict import Verdict

NO_HEAD = (
    "checked against no head: a rewritten or truncated history, or one whose last run was deleted, would not "
    "be detected (--head EVENT:HASH, from the coordinator's log)"
)


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
            f"{len(report.bad)} are wrong themselves. Use a backup, or skip them: export --damaged.",
        ]
    end = "" if report.ended else "; it has no end: still running, killed, or truncated there"
    head_check = f", and contains the {report.heads} given heads" if report.heads else ", checked against no head"
    return [f"{report.events} events are unaltered up to head {report.head}{head_check}{end}."]


def export_verdict(chain: ChainReport | None, rows: int, doubts: Sequence[str] = ()) -> Verdict:
    """Verdict of an export.

    chain    check of the run's events; None if not checked
    rows     number of rows written
    doubts   notes that make the export doubtful
    """
    altered = []
    if chain and chain.count and not chain.chained:
        altered = [f"nothing vouches for any of it: {chain.problems[0]}"]
    elif chain and chain.count:
        altered = [f"exported without {chain.count} altered events"]
    if not rows:
        return Verdict("doubtful", "no event of the run lies in the span: the tables are empty")
    return Verdict("good", f"{rows} rows written").hearing([*altered, *doubts])


def chain_verdict(reports: list[ChainReport]) -> Verdict:
    """Verdict of all checked runs."""
    wrong = [report for report in reports if report.count]
    if wrong:
        return Verdict("failed", f"run {wrong[0].run} was altered: {wrong[0].problems[0]}")
    bare = [report.run for report in reports if not report.chained]
    if bare:
        return Verdict("doubtful", f"run {bare[0]} has no chain and cannot be checked")
    heads = sum(report.heads for report in reports)
    head_check = f"which contains the {heads} given heads" if heads else NO_HEAD
    unaltered = "all events are unaltered, by a chain of hashes from the first to the last"
    return Verdict("good", f"{unaltered}, {head_check}")
