"""Result of a simulation: JSON for programs, lines for people."""

import math
from collections import Counter
from collections.abc import Iterator
from typing import Any

from catseye.constants import ARCSECOND
from catseye.coordinator.firing import GOOD, OF_THE_LINE
from catseye.coordinator.journal.chain import Head
from catseye.gateways.writers.verdict import Verdict
from catseye.names import counted
from catseye.records.night.live import TICKS_PER_DAY
from catseye.service.book import RunSummary
from catseye.service.comparison import EpochComparison
from catseye.service.world import TwinWords

SHOWN = 5  # problems shown to people: first those of more than single shots
CLAIMS = ("as claimed", "better than claimed", "worse than claimed")  # an epoch's chi² in, below, above its band
OFFSETS = (
    ("cross_elevation_arcsec", "beam azimuth × cos E", ARCSECOND, "″"),
    ("elevation_arcsec", "beam elevation", ARCSECOND, "″"),
    ("focus_mm", "focus", 1e-3, "mm"),
)


def simulation_verdict(book: RunSummary) -> Verdict:
    """Verdict on a simulation: epochs against truth and their own doubts."""
    if not book.epochs:
        return Verdict("failed", "no epoch was solved: the run was too short (expected at least half a minute)")
    compared = list(book.comparisons.values())
    if not compared:
        return Verdict("doubtful", "no epoch could be compared with the truth")
    worse = sum(comparison.chi2 > comparison.band[1] for comparison in compared)
    if worse > len(compared) // 10:
        return Verdict("doubtful", f"{worse} of {len(compared)} epochs are farther from the truth than claimed")
    doubtful = [row for row in book.epochs if row["doubt"]]
    if len(doubtful) > len(book.epochs) // 10:
        text = f"{len(doubtful)} of {len(book.epochs)} epochs are doubtful: {doubtful[-1]['doubt']}"
        return Verdict("doubtful", text)
    return Verdict("good", f"{len(compared) - worse} of {len(compared)} epochs are as near the truth as claimed")


def simulation_object(
    book: RunSummary,
    world: TwinWords,
    journal: str | None,
    *,
    seconds: float,
    rangers: int,
    told: int,
    head: Head | None = None,
) -> dict[str, Any]:
    """JSON object of `catseye simulate --json`.

    seconds   of the site's time, from the first round on
    rangers   number of rangers not excluded
    told      shots reported by rangers; durable ones are in the book
    """
    return {
        "verdict": simulation_verdict(book).to_object(),
        "seed": world.seed,
        "start_mjd": world.start_mjd,
        "motion": world.motion,
        "seconds": seconds,
        "rangers": rangers,
        "shots": told,
        "acknowledged": book.acknowledged,
        "used": sum(book.fates[status] for status in GOOD),
        "rejected": {reason: n for reason, n in sorted(book.fates.items()) if reason not in GOOD},
        "epochs": [epoch_object(row, book.comparisons.get(row["number"])) for row in book.epochs],
        "faults": list(world.faults),
        "found": [
            {
                "fault": fault.text,
                "after_s": fault.after,
                "kind": None if fault.by is None else fault.by.kind,
                "text": None if fault.by is None else fault.by.text,
            }
            for fault in book.faults
        ],
        "troubles": [
            {"who": who, "kind": kind, "count": n, "text": book.troubles.texts[who, kind]}
            for (who, kind), n in sorted(book.troubles.counts.items())
        ],
        "journal": journal,
        "journal_head": None if head is None else str(head),
    }


def epoch_object(row: dict[str, Any], compared: EpochComparison | None) -> dict[str, Any]:
    """An epoch for JSON, with its errors if compared with truth."""
    epoch = {
        "number": row["number"],
        "mjd": row["ticks"] / TICKS_PER_DAY,
        "points": row["names"],
        "shots": row["used"],
        "rejected": row["rejected"],
        "doubt": row["doubt"],
    }
    if compared is None:
        return epoch
    return epoch | {
        "compared": compared.points,
        "rms_mm": compared.rms_mm,
        "worst_mm": compared.worst_mm,
        "worst": compared.worst,
        "mean_u_mm": compared.mean_u_mm,
        "chi2_per_coordinate": compared.chi2,
        "chi2_band": list(compared.band),
        "beam": {
            key: {"found": offset / unit, "u": u / unit, "true": true / unit}
            for (key, _, unit, _), offset, u, true in zip(
                OFFSETS, compared.offset, compared.u_offset, compared.true_offset, strict=True
            )
        },
    }


def epoch_line(compared: EpochComparison) -> str:
    """An epoch beside the truth, in one line."""
    low, high = compared.band
    return (
        f"epoch {compared.number}: {compared.points} points, off by {compared.rms_mm:.3f} mm rms "
        f"({compared.worst} {compared.worst_mm:.2f} mm), claimed u {compared.mean_u_mm:.3f} mm, "
        f"chi² {compared.chi2:.2f} a coordinate (99 % within {low:.2f} to {high:.2f}): {_claim(compared)}"
    )


def _claim(compared: EpochComparison) -> str:
    if compared.fits:
        return CLAIMS[0]
    return CLAIMS[1] if compared.chi2 < compared.band[0] else CLAIMS[2]


def beam_lines(compared: EpochComparison) -> Iterator[str]:
    """Beam offset since the reference epoch, beside the truth; else nothing."""
    for (_, name, unit, symbol), offset, u, true in zip(
        OFFSETS, compared.offset, compared.u_offset, compared.true_offset, strict=True
    ):
        if math.isfinite(offset):
            yield f"{name:<21} {offset / unit:+7.3f} ± {u / unit:.3f} {symbol}   true {true / unit:+7.3f} {symbol}"


def summary(
    book: RunSummary,
    world: TwinWords,
    journal: str | None,
    *,
    seconds: float,
    rangers: int,
    told: int,
    head: Head | None = None,
) -> list[tuple[str, str]]:
    """Title and text of each passage; arguments as of `simulation_object`."""
    bad = {reason: n for reason, n in sorted(book.fates.items()) if reason not in GOOD}
    missing = told - book.acknowledged
    acknowledged = "all acknowledged" if not missing else f"{book.acknowledged} acknowledged, {missing} not"
    passages = [
        (
            "Shots",
            f"{told} by {rangers} rangers in {seconds:.0f} s, {acknowledged}; "
            + (", ".join(f"{n} {reason}" for reason, n in bad.items()) or "none rejected")
            + ".",
        )
    ]
    if not book.epochs:
        passages.append(("Epochs", "none was solved: the run was too short (expected at least half a minute)."))
    compared = list(book.comparisons.values())
    if compared:
        last = compared[-1]
        by_claim = Counter(_claim(item) for item in compared)
        claims = ", ".join(f"{by_claim[claim]} {claim}" for claim in CLAIMS if by_claim[claim])
        passages.append(
            (
                "Truth",
                f"{counted(len(book.epochs), 'epoch')}, {len(compared)} compared with the truth: {claims}. "
                f"The last, {epoch_line(last)}.",
            )
        )
        lines = list(beam_lines(last))
        if lines:
            passages.append(
                ("Beam", "; ".join(" ".join(line.split()) for line in lines) + ", since the reference epoch.")
            )
    counts = book.troubles.counts
    worst = sorted(counts.items(), key=lambda pair: (pair[0][1] in OF_THE_LINE, -pair[1]))[:SHOWN]
    noticed = [item.line(book.ticks) for item in book.faults]
    noticed += [f"{book.troubles.texts[key]}" + (f" ({n} times)" if n > 1 else "") for key, n in worst]
    if noticed:
        passages.append(("Events", "; ".join(noticed) + "."))
    if world.faults:
        missed = [item.text for item in book.faults if item.by is None and item.begins <= book.ticks]
        detection = f"; not detected: {', '.join(missed)}" if missed else "; all that began were detected"
        passages.append(("Faults", "injected: " + "; ".join(world.faults) + detection + "."))
    passages.append(
        (
            "Journal",
            f"{journal}, head {head}: catseye replay {journal}" if journal else "none was written.",
        )
    )
    return passages
