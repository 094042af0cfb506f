"""Sentences on an archive."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from catseye.gateways.writers.passage import Passage
from catseye.names import counted
from catseye.records.archive.layout import INPUTS, PROVENANCE, SAMPLES, TABLES
from catseye.records.archive.verification import ArchiveCheck

MEGABYTE = 1e6
SHARES = {"tables": tuple(TABLES), "samples": (SAMPLES,), "inputs": (INPUTS,), "provenance": (PROVENANCE,)}
MOST_NAMES = 5


class SourceOutcome(Protocol):
    """Outcome of a source: its value has `night` and `added`."""

    @property
    def name(self) -> str: ...
    @property
    def state(self) -> str: ...
    @property
    def why(self) -> str: ...
    @property
    def value(self) -> dict[str, Any] | None: ...


def size_passages(
    directory: Path, nights: int, years: Sequence[int], sizes: Mapping[str, int], raw_bytes: int
) -> list[Passage]:
    """Nights and sizes of an archive.

    sizes       bytes by kind of file
    raw_bytes   of all inputs before compression; 0 where unknown
    """
    if not nights:
        return [Passage("The archive", f"{directory}/ is empty.")]
    total = sum(sizes.values())
    span = f"{years[0]}" if len(years) == 1 else f"{years[0]} to {years[-1]}"
    share = f", {total / raw_bytes:.3f} of the {megabytes(raw_bytes)} of its inputs" if raw_bytes else ""
    parts = {name: sum(sizes.get(kind, 0) for kind in kinds) for name, kinds in SHARES.items()}
    texts = [f"{name} {megabytes(size)}" for name, size in parts.items() if size]
    return [
        Passage("The archive", f"{counted(nights, 'night')} of {span} in {directory}/."),
        Passage("Size", f"{megabytes(total)}{share}: {', '.join(texts)}."),
    ]


def change_passages(
    outcomes: Sequence[SourceOutcome], removed: Sequence[str], replaced: Sequence[str], joined: Sequence[int]
) -> list[Passage]:
    """Nights added, present, failed, removed; years joined."""
    values = [outcome.value for outcome in outcomes if outcome.value is not None]
    added = [str(value["night"]) for value in values if value["added"]]
    present = [str(value["night"]) for value in values if not value["added"]]
    passages = [
        Passage(title, f"{counted(len(names), 'night')}: {listed(names)}.")
        for title, names in (("Added", added), ("In it before", present), ("Removed", removed), ("Replaced", replaced))
        if names
    ]
    passages += [Passage("Joined", f"tables of {', '.join(map(str, joined))}.")] if joined else []
    return passages + [Passage("Failed", f"{each.name}: {each.why}.") for each in outcomes if each.state == "failed"]


def listed(names: Sequence[str]) -> str:
    """First few names.

    >>> listed(["a", "b", "c", "d", "e", "f"])
    'a, b, c, d, e, ...'
    """
    return ", ".join(names[:MOST_NAMES]) + (", ..." if len(names) > MOST_NAMES else "")


def check_passages(check: ArchiveCheck) -> list[Passage]:
    """Result of a verification: each damaged file by its name."""
    passages = [Passage("Damaged", f"{problem}.") for problem in check.problems]
    if not check.problems:
        text = f"{counted(check.files, 'file')}, {megabytes(check.size)}, as the index has them."
        passages.append(Passage("Checked", text))
    if check.strangers:
        text = f"{counted(len(check.strangers), 'file')}, such as an interrupted run leaves: {listed(check.strangers)}."
        passages.append(Passage("Not in the index", text))
    return passages


def megabytes(size: float) -> str:
    """Size as text.

    >>> megabytes(9_356_133), megabytes(12_000)
    ('9.36 MB', '0.012 MB')
    """
    return f"{size / MEGABYTE:.3g} MB" if size < 1e9 else f"{size / 1e9:.3g} GB"
