"""Verdict and sentences on many units."""

import statistics
from collections.abc import Sequence
from typing import Any

from catseye.gateways.writers.passage import Passage
from catseye.names import counted
from catseye.service.many.unit import UnitOutcome
from catseye.verdict import Verdict

WORDS = ("good", "doubtful", "failed")


def outcome_verdict(outcome: UnitOutcome) -> Verdict:
    """Verdict of one unit: its failure, its value's own "verdict", or good without one."""
    if outcome.state == "failed":
        return Verdict("failed", outcome.why)
    own: Any = (outcome.value or {}).get("verdict")
    return Verdict(own["word"], own["why"]) if isinstance(own, dict) else Verdict("good", "it is done")


def many_verdict(outcomes: Sequence[UnitOutcome], noun: str) -> Verdict:
    """Verdict on all: good where every unit is done and good, else the worst with its counts."""
    verdicts = [outcome_verdict(outcome) for outcome in outcomes]
    total = counted(len(outcomes), noun)
    if broken := sum(outcome.state == "failed" for outcome in outcomes):
        return Verdict("failed", f"{broken} of {total} {'has' if broken == 1 else 'have'} no result")
    bad = {word: sum(verdict.word == word for verdict in verdicts) for word in WORDS}
    if bad["failed"]:
        return Verdict(
            "failed", f"{bad['failed']} of {total} failed by {'its' if bad['failed'] == 1 else 'their'} tests"
        )
    if bad["doubtful"]:
        return Verdict("doubtful", f"{bad['doubtful']} of {total} {'is' if bad['doubtful'] == 1 else 'are'} doubtful")
    return Verdict("good", f"{total} done, and each is good" if len(outcomes) > 1 else f"{total} done, and it is good")


def many_passages(outcomes: Sequence[UnitOutcome], noun: str) -> list[Passage]:
    """Counts and times, and a passage for each unit that failed or is not good."""
    failed = [outcome for outcome in outcomes if outcome.state == "failed"]
    resumed = sum(outcome.state == "resumed" for outcome in outcomes)
    text = f"{len(outcomes) - len(failed)} of {counted(len(outcomes), noun)} done"
    text += f", {resumed} of them in an earlier run" if resumed else ""
    if seconds := [outcome.seconds for outcome in outcomes if outcome.state != "failed"]:
        text += f"; each took {statistics.median(seconds):.2g} s at the median, {max(seconds):.2g} s at most"
    passages = [Passage(f"The {noun}s", f"{text}.")]
    passages += [Passage("Failed", f"{outcome.name}: {outcome.why.rstrip('.')}.") for outcome in failed]
    for outcome in outcomes:
        verdict = outcome_verdict(outcome)
        if outcome.state != "failed" and verdict.word != "good":
            passages.append(Passage(verdict.word.capitalize(), f"{outcome.name}: {verdict.why.rstrip('.')}."))
    return passages
