"""Deformation between two adjusted epochs as JSON and CSV, in the axes of the first epoch's file."""

from typing import Any

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.estimation.deformation.deformation import CongruenceTest
from catseye.gateways.writers.objects import plain
from catseye.gateways.writers.passage import Passage
from catseye.reduction.network.adjusted import AdjustedNetwork
from catseye.reduction.network.comparison import NAMED, ComparedEpochs

FORMAT = "catseye-comparison-1"
SMALLEST = np.finfo(float).tiny  # smaller probabilities are zero in double precision


def comparison_object(compared: ComparedEpochs) -> dict[str, Any]:
    """Object that `catseye adjust A B --json` prints; SI units.

    compared   two epochs
    """
    d, factor = compared.deformation, compared.variance_factor
    columns = zip(
        d.names,
        compared.displacement,
        compared.covariance,
        compared.u,
        compared.length,
        *compared.difference,
        d.statistic,
        d.p,
        d.p_adjusted,
        d.detectable,
        compared.verdicts,
        strict=True,
    )
    keys = (
        "displacement",
        "covariance",
        "u",
        "length",
        "difference",
        "difference_covariance",
        "statistic",
        "p",
        "p_adjusted",
        "detectable",
        "verdict",
    )
    return plain(
        {
            "format": FORMAT,
            "verdict": compared.verdict.to_object(),
            "status": d.status,
            "axes": list(compared.first.network.axis_names),
            "datum": d.datum,
            "level": d.level,
            "power": d.power,
            "words": list(compared.moved.words),
            "carried": list(compared.moved.carried),
            "frame": list(compared.moved.frame),
            "apart": compared.moved.apart,
            "conclusive": d.conclusive,
            "homogeneity": compared.moved.homogeneity,
            "variance_factor": factor.value,
            "variance_factor_degrees_of_freedom": factor.degrees_of_freedom,  # null: known
            "congruence": {"all": _test(d.before), "stable": _test(d.after)},
            "moved": [name for name, verdict in zip(d.names, compared.verdicts, strict=True) if verdict == "moved"],
            "stable": [name for name, verdict in zip(d.names, compared.verdicts, strict=True) if verdict == "stable"],
            "steps": [vars(step) for step in d.steps],
            "points": {
                name: {**dict(zip(keys, values, strict=True)), "moved": values[-1] == "moved"}
                for name, *values in columns
            },
            "epochs": [_epoch(compared.first), _epoch(compared.second)],
        }
    )


def _test(test: CongruenceTest) -> dict[str, Any]:
    return {"statistic": test.pvv, "degrees_of_freedom": test.degrees_of_freedom, "p": test.p}


def _epoch(epoch: AdjustedNetwork) -> dict[str, Any]:
    solution = epoch.solution
    return {
        "source": epoch.network.source,
        "status": solution.status,
        "datum": solution.datum,
        "variance_factor": solution.variance_factor,
        "degrees_of_freedom": solution.degrees_of_freedom,
        "suspects": epoch.suspects,
    }


def comparison_passages(compared: ComparedEpochs) -> list[Passage]:
    """Summary of movements and assumptions, in sentences.

    compared   two epochs
    """
    d = compared.deformation
    passages = [Passage("Movements", f"{d.status[0].upper()}{d.status[1:]}.")]
    for i, (name, word) in enumerate(zip(d.names, compared.verdicts, strict=True)):
        if word in ("moved", "undecided") and len(passages) <= NAMED:
            parts = ", ".join(
                f"d{axis} {value / MILLIMETRE:+.3f} (u {u / MILLIMETRE:.3f})"
                for axis, value, u in zip(
                    compared.first.network.axis_names, compared.displacement[i], compared.u[i], strict=True
                )
                if np.isfinite(value)
            )
            chance = f"p = {d.p[i]:.2g}" if d.p[i] > 0.0 else f"p < {SMALLEST:.0e}"
            passages.append(Passage(name, f"{parts} mm; probability by chance {chance}."))
    count = sum(word in ("moved", "undecided") for word in compared.verdicts)
    if count > NAMED:
        passages.append(Passage("Others", f"{count - NAMED} more points moved or are undecided."))
    words = [word for word in compared.moved.words if word != d.status]
    return passages + (
        [Passage("Assumed", " ".join(f"{word[0].upper()}{word[1:]}." for word in words))] if words else []
    )
