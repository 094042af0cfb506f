"""Files of a pose: pose.json, points.csv, report.html, provenance.json."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from catseye.aliases import Progress
from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.estimation.shapes.pose import COMPONENTS, Pose
from catseye.gateways.pose.charts import pose_blocks, residual_table, terms_charts
from catseye.gateways.pose.objects import pose_result_object, pose_words
from catseye.gateways.pose.tables import POINTS, points_csv
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.report import Block, Card, ReportSection, ResultReport, TableBlock, Text, origin_section
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.report_parts import ReportTable, number, text, uncertainty
from catseye.gateways.writers.samplers_fits import SamplerColumn, SamplerTable, join_tables
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.records.network.written_pose import GROUP_POSE
from catseye.reduction.pose.findings import PoseFindings
from catseye.reduction.pose.pointing_offsets import COMPONENTS as BEAM
from catseye.reduction.pose.pointing_offsets import PointingOffset


def write_pose(
    result: PoseFindings,
    directory: Path,
    inputs: Mapping[str, str],
    *,
    settings: Mapping[str, Any],
    progress: Progress | None = None,
) -> None:
    """Write the files, and last the provenance.

    result      a pose
    directory   existing, from `writers.output.atomic_directory`
    inputs      SHA-256 of each input file, by name
    settings    settings of the command
    progress    called for each file
    """
    when = datetime.now(UTC)
    files: Files = {
        "points.csv": lambda: points_csv(result),
        "pose.json": lambda: json_page(pose_result_object(result)),
        "report.html": lambda: report_page(pose_report(result, when, inputs)),
    }
    provenance = {"format": GROUP_POSE, "made_by": "catseye pose", "settings": dict(settings)}
    write_files(files, directory, {**provenance, **origin(when, inputs)}, progress=progress)
    pose = result.pose.pose
    pivot = f"{', '.join(f'{v:.6f}' for v in pose.pivot)} m"
    six = SamplerTable(
        "POSE",
        {
            "TRANSLATION": SamplerColumn("m", pose.translation[None], "of the pivot"),
            "ROTATION": SamplerColumn("rad", pose.rotation[None], "rotation vector, right-handed"),
            "COVARIANCE": SamplerColumn("", pose.covariance[None], "6 x 6, translation then rotation, m and rad"),
        },
        comment="second = pivot + translation + rotation (first - pivot)",
        frame=pose.frame,
        pivot=pivot,
    )
    join_tables(directory, [POINTS], frame=pose.frame, pivot=pivot, tables={"POSE": six})


def pose_report(result: PoseFindings, when: datetime, inputs: Mapping[str, str]) -> ResultReport:
    """Report of a pose; `when` is UTC."""
    group = result.pose
    return ResultReport(
        title=f"Pose of {group.group} in {group.epoch.campaign or 'an epoch'}, against {group.against}",
        subtitle=(
            f"fitted by catseye on {when:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ; second = pivot + "
            "translation + rotation (first − pivot), rotations right-handed"
        ),
        verdict=result.verdict,
        cards=_cards(group.pose),
        passages=[Passage(title, words) for title, words in pose_words(result)],
        sections=[
            ReportSection(
                "pose",
                "Six degrees of freedom",
                [
                    TableBlock("pose", _components(COMPONENTS, *_six(group.pose))),
                    Text("The full covariance is in pose.json; it transforms exactly to another pivot or frame."),
                ],
            ),
            ReportSection(
                "residuals", "Residuals", [*pose_blocks(result), TableBlock("residuals", residual_table(result))]
            ),
            None if result.beam is None else ReportSection("pointing", "Beam and focus", _beam(result.beam)),
            origin_section(when, inputs),
        ],
        label=f"catseye: pose of {group.group}",
    )


def _six(pose: Pose) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Values, uncertainties and units of a pose."""
    scale = np.repeat([MILLIMETRE, ARCSECOND], 3)
    return np.concatenate([pose.translation, pose.rotation]) / scale, pose.u / scale, ["mm"] * 3 + ["″"] * 3


def _components(names: Sequence[str], values: np.ndarray, u: np.ndarray, units: Sequence[str]) -> ReportTable:
    return ReportTable(
        (
            text("component", "component", names),
            number("value", "value", values, digits=3, u="u"),
            uncertainty("u", "u", u, digits=3),
            text("unit", "unit", units),
        )
    )


def _cards(pose: Pose) -> list[Card]:
    return [
        Card(f"{'xyz'[k]}", f"{pose.translation[k] / MILLIMETRE:+.3f} mm", f"u = {pose.u[k] / MILLIMETRE:.3f} mm")
        for k in range(3)
    ] + [
        Card(f"about {'xyz'[k]}", f"{pose.rotation[k] / ARCSECOND:+.2f}″", f"u = {pose.u[3 + k] / ARCSECOND:.2f}″")
        for k in range(3)
    ]


def _beam(beam: PointingOffset) -> list[Block]:
    scale = np.array([ARCSECOND, ARCSECOND, MILLIMETRE])
    u = np.sqrt(np.maximum(np.diag(beam.covariance), 0.0))
    terms = ReportTable.of_rows(
        [(name, *(np.asarray(part)[:3] / scale)) for name, part in beam.terms.items()],
        text("term", "term"),
        number("azimuth", "azimuth × cos E", unit="″", digits=3),
        number("elevation", "elevation", unit="″", digits=3),
        number("focus", "focus", unit="mm", digits=3),
    )
    offset = _components(BEAM, np.asarray(beam.offset) / scale, u / scale, ("″", "″", "mm"))
    return [TableBlock("beam", offset), *terms_charts(beam), TableBlock("terms", terms)]
