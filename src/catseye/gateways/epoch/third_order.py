"""Third order of a reduction: measured places less the structural model's, as text, table, JSON and section."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.gateways.writers.columns import Column, Table
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.report import ReportSection, TableBlock, Text
from catseye.gateways.writers.report_parts import ReportTable, number, text, uncertainty
from catseye.reduction.epoch.epoch import Reduction
from catseye.reduction.structure.corrections import Corrections
from catseye.reduction.structure.third_order import ThirdOrder

STRUCTURE_CSV = "structure.csv"
DOCUMENT = "structure.json"
PAGE = "results.md"
UNITS = np.repeat([MILLIMETRE, ARCSECOND], 3)


def _part(name: str, doc: str, values: str, k: int) -> Column[ThirdOrder]:
    """Column of one component, mm."""
    return Column(name, "mm", f"{doc}, {'xyz'[k]}", lambda t: getattr(t, values)[:, k] / MILLIMETRE, ".3f")


STRUCTURE = Table[ThirdOrder](
    STRUCTURE_CSV,
    PAGE,
    (
        Column("point", "", "name of the target or ranger", lambda t: t.names),
        *(
            _part(f"model_{a}_mm", "displacement by the model, ground axes", "displacement", k)
            for k, a in enumerate("xyz")
        ),
        *(_part(f"residual_{a}_mm", "measured less place by the model", "residual", k) for k, a in enumerate("xyz")),
        *(_part(f"u_residual_{a}_mm", "standard uncertainty of the residual", "u", k) for k, a in enumerate("xyz")),
    ),
)


def third_order_object(order: ThirdOrder) -> dict[str, Any]:
    """Object of `structure` in `--json`, and of structure.json: m, rad, m²."""
    return {
        "model": order.title,
        "azimuth_deg": float(np.asarray(order.posture.azimuth)) / DEGREE,
        "elevation_deg": float(np.asarray(order.posture.elevation)) / DEGREE,
        "temperature_c": float(np.asarray(order.posture.temperature_c)),
        "points": {
            name: {"displacement": order.displacement[k], "residual": order.residual[k], "u_residual": order.u[k]}
            for k, name in enumerate(order.names)
        },
        "corrections": None if order.corrections is None else _corrections_object(order.corrections),
        "frames_alone": {
            frame: {
                "targets": motion.names,
                "shift_and_turn": motion.six,
                "correction": motion.correction,
                "covariance": motion.covariance,
                "residual": motion.residual,
                "pvv": motion.pvv,
                "degrees_of_freedom": motion.degrees_of_freedom,
            }
            for frame, motion in order.alone.items()
        },
    }


def _corrections_object(corrections: Corrections) -> dict[str, Any]:
    u = np.sqrt(np.maximum(np.diag(corrections.covariance), 0.0)).reshape(-1, 6)
    return {
        "frames": {
            name: {"shift_and_turn": corrections.six[name], "u": u[k]} for k, name in enumerate(corrections.frames)
        },
        "covariance_order": corrections.frames,
        "covariance": corrections.covariance,
        "targets": {
            name: {"residual": corrections.residual[k], "standardised": corrections.standardised[k]}
            for k, name in enumerate(corrections.names)
        },
        "pvv": corrections.pvv,
        "degrees_of_freedom": corrections.degrees_of_freedom,
    }


def third_order_passage(order: ThirdOrder) -> Passage:
    """Sentences on the model's displacement, what remains of it, and the frames' corrections."""
    moved = np.linalg.norm(order.displacement, axis=1)
    most = int(np.argmax(moved))
    name, length, u = order.largest
    sentences = [
        f'By the structural model "{order.title}" {order.names[most]} is displaced most, by '
        f"{moved[most] / MILLIMETRE:.1f} mm. Measured places less the model's differ most for {name}: "
        f"{length / MILLIMETRE:.1f} mm (u {u / MILLIMETRE:.1f}, of its record, the model and the measurement)."
    ]
    if order.corrections is None:
        sentences.append("No target of the model's own groups was measured, so its frames have no corrections.")
        return Passage("The structure", " ".join(sentences))
    corrections = order.corrections
    spread = np.sqrt(np.maximum(np.diag(corrections.covariance), 1e-30)).reshape(-1, 6)
    for k, frame in enumerate(corrections.frames):
        six, u_six = corrections.six[frame] / UNITS, spread[k] / UNITS
        sentences.append(
            f"{frame}: {', '.join(f'{v:+.2f}' for v in six[:3])} mm (u {', '.join(f'{v:.2f}' for v in u_six[:3])}), "
            f"{', '.join(f'{v:+.1f}' for v in six[3:])}″ (u {', '.join(f'{v:.1f}' for v in u_six[3:])})."
        )
    sentences.insert(
        1, f"{len(corrections.names)} targets of its groups correct its frames, shift and turn about x, y, z:"
    )
    return Passage("The structure", " ".join(sentences))


def third_order_sections(reduction: Reduction) -> Sequence[ReportSection]:
    """Section of the report; none without a structural model."""
    order = reduction.third_order
    if order is None:
        return ()
    rows = [
        (name, *(v for k in range(3) for v in (order.displacement[i, k] / MILLIMETRE,)),
         *(v for k in range(3) for v in (order.residual[i, k] / MILLIMETRE, order.u[i, k] / MILLIMETRE)))
        for i, name in enumerate(order.names)
    ]  # fmt: skip
    columns = [
        text("point", "point"),
        *(number(f"model_{a}", f"model {a} (mm)", digits=2) for a in "xyz"),
        *(
            column
            for a in "xyz"
            for column in (
                number(f"residual_{a}", f"residual {a} (mm)", digits=2, u=f"u_{a}"),
                uncertainty(f"u_{a}", "u", digits=2),
            )
        ),
    ]
    return (
        ReportSection(
            "structure",
            "Structure: measured less model",
            [
                Text(
                    "Displacement of each target and ranger of the telescope by the structural model, and its measured "
                    "place less the place by the model; ground axes. The u of a residual is mostly that of the typed "
                    "place."
                ),
                TableBlock("structure", ReportTable.of_rows(rows, *columns)),
            ],
        ),
    )


def structure_csv(order: ThirdOrder) -> str:
    """Table of the targets and rangers."""
    return STRUCTURE.csv(order)
