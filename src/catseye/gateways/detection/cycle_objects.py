"""Lengths from several modulation frequencies: rows, JSON, figure."""

import math
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from catseye.gateways.writers.drawing import BAD, SERIES, Figure, styled
from catseye.gateways.writers.passage import Passage
from catseye.reduction.detection.cycle_lengths import CycleLengths
from catseye.signal.cycles.frequencies import ModulationSet
from catseye.signal.cycles.sets import SURE

LEAST = 0.1  # standard uncertainties, lower edge of a misfit in the figure
NAMED = 24  # shots with names in it


def cycle_passages(lengths: CycleLengths) -> list[Passage]:
    """Frequencies with the lengths they separate, and the least sure shot, in words.

    lengths   from `cycle_lengths`
    """
    passages = [Passage("Frequencies", _set_text(item)) for item in lengths.sets]
    if lengths.advice is not None:
        passages.append(Passage("Better", _set_text(lengths.advice)))
    one = lengths.least_sure
    if one.status == "misfit":
        text = f"{one.shot}: no length fits its phases, chi-square {one.misfit:.1f} of the best, {one.length:.4f} m"
        passages.append(Passage("Least sure", text))
    elif math.isfinite(one.length):
        second = f"next {one.next_length:.4f} m" if math.isfinite(one.next_length) else "no other within the limits"
        passages.append(
            Passage(
                "Least sure",
                f"{one.shot}: {one.length:.6f} m, {second}, {math.sqrt(max(one.discrimination, 0.0)):.1f} standard "
                f"uncertainties worse; probability of wrong cycles {one.slip_probability:.2g}",
            )
        )
    return passages


def _set_text(each: ModulationSet) -> str:
    names = ", ".join(f"{hz / 1e6:.9g}" for hz in each.frequencies_hz)
    alias = "" if each.first_alias is None else f"; lengths {each.first_alias:.4f} m apart are not told apart surely"
    return (
        f"{names} MHz over {each.span:g} m: two lengths are {each.separation:.1f} standard uncertainties apart or more "
        f"({2.0 * SURE:g} needed), nearest {each.nearest:.4f} m; probability of a slip {each.slip_probability:.1g} at "
        f"most, u of a length {1e6 * each.u_length:.2f} µm{alias}"
    )


def cycle_rows(lengths: CycleLengths) -> Iterator[str]:
    """Each shot as a line of text.

    lengths   from `cycle_lengths`
    """
    yield ""
    yield f"{'shot':<14}{'length':>13}{'u':>9}{'cycles':>20}{'chi²':>8}{'next':>12}{'slip':>10}{'cascade':>13}  status"
    yield f"{'':<14}{'m':>13}{'µm':>9}{'':>20}{'':>8}{'m':>12}{'':>10}{'m':>13}"
    for s in lengths.shots:
        cycles = " ".join(str(n) for n in s.cycles)
        numbers = (
            f"{_text(s.length, '.6f'):>13}{_text(1e6 * s.u_length, '.2f'):>9}{cycles:>20}{_text(s.misfit, '.2f'):>8}"
        )
        thin = " (thin)" if s.cascade_thin else ""
        second = f"{_text(s.next_length, '.4f'):>12}{_text(s.slip_probability, '.1e'):>10}"
        yield f"{s.shot:<14}{numbers}{second}{_text(s.cascade_length, '.6f'):>13}{thin}  {s.status}"


def cycle_object(lengths: CycleLengths) -> dict[str, Any]:
    """JSON object, SI units.

    lengths   from `cycle_lengths`
    """
    return {
        "verdict": lengths.verdict.to_object(),
        "within": list(lengths.within),
        "group_index": lengths.group_index,
        "sets": [{**asdict(item), "unambiguous": item.unambiguous} for item in lengths.sets],
        "advice": None if lengths.advice is None else asdict(lengths.advice),
        "shots": [asdict(item) for item in lengths.shots],
    }


def cycle_figure(lengths: CycleLengths) -> Figure:
    """All lengths of the least sure shot by their misfit, and the second best of every shot.

    lengths   from `cycle_lengths`
    """
    one, shots = lengths.least_sure, lengths.shots
    length, square = lengths.candidates(one)
    with styled():
        figure = Figure(figsize=(10.5, 4.2))
        edges = {"left": 0.075, "right": 0.985, "bottom": 0.16, "top": 0.9, "wspace": 0.24}
        every, slips = figure.subplots(1, 2, gridspec_kw={**edges, "width_ratios": (1.5, 1.0)})
        misfit = np.maximum(np.sqrt(square), LEAST)
        every.semilogy(length, misfit, ".", ms=2.0, color=SERIES[0], label="other whole cycles")
        best = int(np.argmin(square))
        every.semilogy(length[best], misfit[best], "o", ms=7.0, color=SERIES[1], label=f"{length[best]:.4f} m")
        every.axhline(SURE, color=BAD, lw=1.0, ls=(0, (4, 2)), label=f"{SURE:g} standard uncertainties")
        every.set(title=f"Shot {one.shot}: every length between the limits", xlabel="length (m)")
        every.set(ylabel="misfit (standard uncertainties)", ylim=(LEAST / 1.5, 8.0 * float(misfit.max())))
        every.legend(loc="upper center", ncols=3, markerscale=1.5)
        apart = np.sqrt(np.maximum([s.discrimination if math.isfinite(s.discrimination) else 0.0 for s in shots], 0.0))
        slips.bar(np.arange(len(shots)), apart, color=[SERIES[2] if s.status == "found" else BAD for s in shots])
        slips.axhline(SURE, color=BAD, lw=1.0, ls=(0, (4, 2)))
        slips.set(title="Second best length of each shot", xlabel="shot, in the table's order")
        slips.set(ylabel="worse by (standard uncertainties)", ylim=(0.0, 1.15 * max(float(apart.max()), SURE)))
        if len(shots) <= NAMED:
            slips.set_xticks(np.arange(len(shots)), [s.shot for s in shots], rotation=60, ha="right", fontsize=7.5)
        return figure


def _text(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else ""
