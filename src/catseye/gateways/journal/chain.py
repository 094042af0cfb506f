"""What a journal's chain says, for programs and for people."""

from collections.abc import Sequence
from typing import Any

from catseye.coordinator.journal.check import ChainReport
from catseye.gateways.writers.verdict import Verdict

NO_HEAD = (
    "checked against no head: a history that was written anew, cut at its end, or whose last run was deleted would not "
    "show (--head EVENT:HASH, from the coordinator's log)"
)


def chain_object(report: ChainReport) -> dict[str, Any]:
    """A run's chain as a plain object for JSON."""
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
    """A run's chain in sentences, for people."""
    if not report.chained and not report.count:
        return ["none: an older catseye wrote the run, and nothing tells whether it was changed since."]
    if report.count:
        more = report.count - len(report.problems)
        return [
            *(f"{problem}." for problem in report.problems),
            *([f"{more} more like these."] if more else []),
            f"From event {report.first} on this is not what was written; of {report.events} events "
            f"{len(report.bad)} are wrong themselves. Take a backup's, or leave those out: export --damaged.",
        ]
    end = "" if report.ended else "; it has no end: it lasts, was killed, or was cut there"
    told = f", and has the {report.heads} heads that were told" if report.heads else ", checked against no head"
    return [f"{report.events} events are as they were written up to head {report.head}{told}{end}."]


def export_verdict(chain: ChainReport | None, rows: int, doubts: Sequence[str] = ()) -> Verdict:
    """The verdict of what was exported.

    chain    the check of the run's events; None: they were not checked
    rows     how many were written
    doubts   notes that speak against the export
    """
    altered = []
    if chain and chain.count and not chain.chained:
        altered = [f"nothing vouches for any of it: {chain.problems[0]}"]
    elif chain and chain.count:
        altered = [f"exported without {chain.count} events that are not as they were written"]
    return Verdict("good", f"{rows} rows written").hearing([*altered, *doubts])


def chain_verdict(reports: list[ChainReport]) -> Verdict:
    """The verdict of all runs that were checked."""
    wrong = [report for report in reports if report.count]
    if wrong:
        return Verdict("failed", f"run {wrong[0].run} is not as it was written: {wrong[0].problems[0]}")
    bare = [report.run for report in reports if not report.chained]
    if bare:
        return Verdict("doubtful", f"run {bare[0]} has no chain, so that nothing of it could be checked")
    heads = sum(report.heads for report in reports)
    known = f"which has the {heads} heads that were told" if heads else NO_HEAD
    whole = "every event is as it was written, by a chain of hashes from the first to the last"
    return Verdict("good", f"{whole}, {known}")
