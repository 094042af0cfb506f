"""Choice of cardinal points as JSON, text, figure and files."""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from catseye.aliases import Progress
from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.gateways.structure.model.files import FORMAT
from catseye.gateways.structure.model.tables import POINTS
from catseye.gateways.writers.drawing import FAINT, INK, SERIES, STYLE, Figure, mpl, svg
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.design.cardinal_points import NATS, PointChoice


def choice_object(choice: PointChoice) -> dict[str, Any]:
    """Object that `catseye model choose --json` prints; m, rad and bits."""
    before, after = choice.candidates.u([]), choice.candidates.u(choice.order)
    return {
        "verdict": choice.verdict.to_object(),
        "points": choice.names,
        "bits": choice.gains / NATS,
        "bits_of_all": choice.of_all / NATS,
        "candidates": {
            name: {"lines": int(choice.candidates.lines[i]), "alone_bits": choice.alone[i] / NATS}
            for i, name in enumerate(choice.candidates.names)
        },
        "coefficients": {
            label: {"u_before": before[k], "u_after": after[k]} for k, label in enumerate(choice.candidates.labels)
        },
        "exchanges": choice.exchanges,
        "hidden": choice.hidden,
        "notes": list(choice.notes),
    }


def choice_passages(choice: PointChoice) -> list[Passage]:
    """Passages on the points, their information, notes."""
    n, bits = len(choice.candidates.names), choice.gains[-1] / NATS
    return [
        Passage("Points", f"{', '.join(choice.names)}, of {n} targets; {choice.exchanges} exchanges"),
        Passage("Information", f"{bits:.1f} bits of {choice.of_all / NATS:.1f} that all of them would give"),
        *(Passage("Note", note) for note in choice.notes),
    ]


def choice_lines(choice: PointChoice) -> list[str]:
    """Lines of a terminal: each point with its information, then u of each coefficient before and after."""
    lines = [f"{'point':<12}{'lines':>7}{'bits':>10}{'alone':>10}"]
    for k, i in enumerate(choice.order):
        numbers = f"{choice.candidates.lines[i]:>7}{choice.gains[k] / NATS:10.1f}{choice.alone[i] / NATS:10.1f}"
        lines.append(f"{choice.candidates.names[i]:<12}{numbers}")
    lines += ["", f"{'coefficient':<34}{'u before':>10}{'u after':>10}"]
    before, after = choice.candidates.u([]), choice.candidates.u(choice.order)
    for label, was, now in zip(choice.candidates.labels, before, after, strict=True):
        unit, name = (ARCSECOND, '"') if " turn_" in label else (MILLIMETRE, "mm")
        lines.append(f"{label:<34}{was / unit:10.3f}{now / unit:10.3f}  {name}")
    return lines


def choice_figure(choice: PointChoice) -> Figure:
    """Information of the chosen points one after another, and of each candidate by itself."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.2, 3.8), layout="constrained")
        remainder, right = figure.subplots(1, 2, width_ratios=[1.0, 1.2])
        at = np.arange(1, len(choice.order) + 1)
        remainder.axhline(choice.of_all / NATS, color=FAINT, linewidth=0.9, linestyle="--")
        remainder.text(1, choice.of_all / NATS, "all points", va="bottom", ha="left", fontsize=8, color=INK)
        remainder.plot(at, choice.gains / NATS, "o-", color=SERIES[0], markersize=4.0)
        remainder.set_xticks(at, choice.names, rotation=60, ha="right", fontsize=7)
        remainder.set_ylim(0.0, 1.1 * choice.of_all / NATS)
        remainder.set_ylabel("information (bits)")
        remainder.set_title("Together, in their order")
        order = np.argsort(-choice.alone)[:30]
        colors = [SERIES[1] if int(i) in choice.order else SERIES[5] for i in order]
        right.bar(np.arange(len(order)), choice.alone[order] / NATS, color=colors)
        names = [choice.candidates.names[int(i)] for i in order]
        right.set_xticks(np.arange(len(order)), names, rotation=60, ha="right", fontsize=7)
        right.set_title("Each by itself; chosen ones in orange")
        return figure


def write_choice(
    choice: PointChoice, directory: Path, inputs: Mapping[str, str], *, progress: Progress | None = None
) -> None:
    """Write the files of `catseye model choose --out`.

    directory   existing, from `writers.output.atomic_directory`
    inputs      SHA-256 of each input file, by name
    progress    called for each file
    """
    files: Files = {
        "model-points.csv": lambda: POINTS.csv(choice),
        "model.json": lambda: json_page({"format": FORMAT, **choice_object(choice)}),
        "information.svg": lambda: svg(choice_figure(choice)),
    }
    provenance = {"format": FORMAT, "made_by": "catseye model choose"}
    write_files(files, directory, {**provenance, **origin(datetime.now(UTC), inputs)}, progress=progress)
