"""Verdicts on a journal's verification and on exports from it."""

from collections.abc import Sequence

from catseye.coordinator.journal.check import ChainReport
from catseye.verdict import Verdict

NO_HEAD = (
    "checked against no head: a rewritten or truncated history, or one whose last run was deleted, would not "
    "be detected (give a head, EVENT:HASH, from the coordinator's log)"
)


def chain_verdict(reports: Sequence[ChainReport]) -> Verdict:
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
