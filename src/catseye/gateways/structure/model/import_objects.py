"""Import of a finite element result as JSON, text, figure and files."""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from catseye.aliases import Progress
from catseye.constants import MILLIMETRE
from catseye.gateways.structure.model.files import FORMAT
from catseye.gateways.structure.model.tables import NODES
from catseye.gateways.writers.drawing import SERIES, STYLE, Figure, mpl, svg
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.structure.finite_elements import ImportedModel


def import_object(model: ImportedModel) -> dict[str, Any]:
    """Object that `catseye model import --json` prints; m."""
    return {
        "verdict": model.verdict.to_object(),
        "model": model.record.title,
        "terms": model.terms,
        "frames": model.frames,
        "targets": {
            match.target: {
                "node": match.node,
                "distance": match.distance,
                "displacement": (model.rigid + model.residual)[i],
                "own": model.residual[i],
            }
            for i, match in enumerate(model.matches)
        },
        "unmatched": model.unmatched,
        "misfit": model.misfit,
        "notes": list(model.notes),
    }


def import_passages(model: ImportedModel) -> list[Passage]:
    """Passages on the nodes, the size of the displacements, notes."""
    own = float(np.max(np.linalg.norm(model.residual, axis=2)))
    farthest = max(match.distance for match in model.matches)
    return [
        Passage(
            "Nodes",
            f"{len(model.matches)} targets of {', '.join(model.frames)} have a node, at most {farthest:.3f} m from it",
        ),
        Passage(
            "Displacement",
            f"up to {model.largest / MILLIMETRE:.2f} mm by {', '.join(model.terms)}; {own / MILLIMETRE:.2f} mm of it "
            "are in no frame's motion and become shifts of the points",
        ),
        *(Passage("Note", note) for note in model.notes),
    ]


def import_lines(model: ImportedModel) -> list[str]:
    """Lines of a terminal: each target's displacement by each term."""
    lines = [f"{'target':<12}{'node':>8}  {'term':<8}{'displacement x, y, z, mm':^30}{'of it own, mm':^30}"]
    for i, match in enumerate(model.matches):
        for k, term in enumerate(model.terms):
            total, local = ((values[i, k]) / MILLIMETRE for values in (model.rigid + model.residual, model.residual))
            numbers = " ".join(f"{v:9.3f}" for v in (*total, *local))
            lines.append(f"{match.target:<12}{match.node:>8}  {term:<8}{numbers}")
    return lines


def import_figure(model: ImportedModel) -> Figure:
    """Length of each target's displacement by each term, and of its part that no frame's motion has."""
    names = [match.target for match in model.matches]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.2, 1.4 + 0.2 * len(names)), layout="constrained")
        panels = np.atleast_1d(figure.subplots(1, len(model.terms), sharey=True))
        for k, panel in enumerate(panels):
            at = np.arange(len(names))
            total = np.linalg.norm((model.rigid + model.residual)[:, k], axis=1) / MILLIMETRE
            local = np.linalg.norm(model.residual[:, k], axis=1) / MILLIMETRE
            panel.barh(at - 0.2, total, height=0.36, color=SERIES[0], label="displacement")
            panel.barh(at + 0.2, local, height=0.36, color=SERIES[1], label="of it in no frame's motion")
            panel.set_yticks(at, names, fontsize=7)
            panel.set_ylim(len(names) - 0.4, -0.6)
            panel.set_title(model.terms[k])
            panel.set_xlabel("length (mm)")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
        return figure


def write_import(
    model: ImportedModel, directory: Path, inputs: Mapping[str, str], *, progress: Progress | None = None
) -> None:
    """Write the files of `catseye model import --out`.

    directory   existing, from `writers.output.atomic_directory`
    inputs      SHA-256 of each input file, by name
    progress    called for each file
    """
    files: Files = {
        "model-nodes.csv": lambda: NODES.csv(model),
        "model.json": lambda: json_page({"format": FORMAT, **import_object(model)}),
        "targets.svg": lambda: svg(import_figure(model)),
    }
    provenance = {"format": FORMAT, "made_by": "catseye model import"}
    write_files(files, directory, {**provenance, **origin(datetime.now(UTC), inputs)}, progress=progress)
