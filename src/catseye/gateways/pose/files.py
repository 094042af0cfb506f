"""Files of a pose: pose.json, points.csv, report.html, provenance.json."""

from collections.abc import Mapping
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import Any

from catseye.aliases import Progress
from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.estimation.shapes.pose import Pose
from catseye.gateways.pose.objects import (
    beam_rows,
    pose_result_object,
    pose_rows,
    pose_words,
)
from catseye.gateways.pose.tables import POINTS, points_csv
from catseye.gateways.writers.objects import json_page, versions
from catseye.gateways.writers.page import card, page, paragraph, picture, section, table
from catseye.gateways.writers.samplers_fits import SamplerColumn, SamplerTable, join_tables
from catseye.gateways.writers.verdict import verdict_line
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.records.network.written_pose import GROUP_POSE
from catseye.reduction.pose.findings import PoseFindings
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
        "report.html": lambda: pose_report(result, when, inputs),
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


def pose_report(result: PoseFindings, when: datetime, inputs: Mapping[str, str]) -> str:
    """Complete HTML report of a pose."""
    from catseye.gateways.pose.figures import pose_figures  # matplotlib is heavy
    from catseye.gateways.writers.drawing import svgs

    drawn = svgs(pose_figures(result))
    group = result.pose
    title = f"Pose of {group.group} in {group.epoch.campaign or 'an epoch'}, against {group.against}"
    header = (
        f"<header><h1>{escape(title)}</h1>"
        f'<div class="faint">fitted by catseye on {when:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ; second = '
        f"pivot + translation + rotation (first − pivot), rotations right-handed</div></header>"
    )
    words = "".join(f"<dt>{escape(a)}</dt><dd>{escape(b)}</dd>" for a, b in pose_words(result))
    body = [
        header,
        verdict_line(result.verdict),
        section("summary", "Summary", f'<div class="cards">{"".join(_cards(group.pose))}</div>', f"<dl>{words}</dl>"),
        section(
            "pose",
            "Six degrees of freedom",
            table(("component", "value", "u", "unit"), pose_rows(result), "tnnt"),
            paragraph("The full covariance is in pose.json; it transforms exactly to another pivot or frame."),
        ),
        section(
            "residuals",
            "Residuals",
            picture(
                drawn["residuals"],
                "Residuals of the points: second position minus first position moved by the pose. Arrows lie in "
                "the plane of the drawing; the colour is the component across it.",
            ),
        ),
    ]
    if result.beam is not None:
        body.append(_beam_section(result.beam, drawn["terms"]))
    facts = [("made (UTC)", f"{when:%Y-%m-%d %H:%M:%S}"), *versions().items()]
    body.append(
        section(
            "provenance",
            "Provenance",
            table(("file read", "SHA-256"), list(inputs.items()), "th"),
            table(("item", "value"), facts, "tt"),
        )
    )
    return page(f"catseye: {title}", "\n".join(body))


def _cards(pose: Pose) -> list[str]:
    return [
        card(f"{'xyz'[k]}", f"{pose.translation[k] / MILLIMETRE:+.3f} mm", f"u = {pose.u[k] / MILLIMETRE:.3f} mm")
        for k in range(3)
    ] + [
        card(f"about {'xyz'[k]}", f"{pose.rotation[k] / ARCSECOND:+.2f}″", f"u = {pose.u[3 + k] / ARCSECOND:.2f}″")
        for k in range(3)
    ]


def _beam_section(beam: PointingOffset, figure: str) -> str:
    terms = [
        (name, *(f"{part[k] / (ARCSECOND if k < 2 else MILLIMETRE):+.3f}" for k in range(3)))
        for name, part in beam.terms.items()
    ]
    return section(
        "pointing",
        "Beam and focus",
        table(("component", "value", "u", "unit"), beam_rows(beam), "tnnt"),
        picture(figure, "Terms of the pointing offset; a correction is its opposite."),
        table(("term", "azimuth × cos E (″)", "elevation (″)", "focus (mm)"), terms, "tnnn"),
    )
