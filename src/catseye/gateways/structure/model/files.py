"""Files of the commands of a structural model: tables, JSON, figures, provenance."""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from catseye.aliases import Progress
from catseye.gateways.structure.model.figures import coefficient_figure, elevation_figure, epoch_figure, side_figure
from catseye.gateways.structure.model.fit_objects import fit_object, fit_passages
from catseye.gateways.structure.model.objects import displacement_object, displacement_passages
from catseye.gateways.structure.model.tables import BEAM, COEFFICIENTS, DISPLACEMENTS, RESIDUALS, BeamRows, EpochRows
from catseye.gateways.writers.drawing import svg
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.report import Card, ResultReport
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.table_report import PartOfReport, report_table, table_report
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.names import counted
from catseye.reduction.network.words import quantity
from catseye.reduction.structure.beam import BeamOffset
from catseye.reduction.structure.displacement import ModelDisplacements
from catseye.reduction.structure.model_fit import ModelFindings

FORMAT = "catseye-model-1"


def displacement_report(
    displaced: ModelDisplacements, beam: BeamOffset | None, when: datetime, inputs: Mapping[str, str]
) -> ResultReport:
    """Report of displacements.

    when     UTC
    inputs   SHA-256 of each input file, by name
    """
    size = np.linalg.norm(displaced.ground, axis=2)
    posture, point = np.unravel_index(int(np.argmax(size)), size.shape)
    figures = {
        "elevation": (
            elevation_figure(displaced),
            "Displacements with elevation, of the points that move most; dotted lines: the postures.",
        ),
        "side": (
            side_figure(displaced),
            "Points from the side, at the first posture; arrows: displacements, enlarged.",
        ),
    }
    beam_rows = [] if beam is None else [report_table(BEAM, BeamRows(displaced, beam))]
    return table_report(
        "Displacements by the structural model",
        f"{size.shape[1]} points in {counted(size.shape[0], 'posture')}, of the rigid telescope, ground axes",
        displaced.verdict,
        cards=[
            Card("Largest", quantity(float(size[posture, point]), "m"), displaced.names[point]),
            Card("Points", str(size.shape[1]), counted(size.shape[0], "posture")),
        ],
        passages=displacement_passages(displaced, beam),
        parts=[
            PartOfReport("Displacements", [report_table(DISPLACEMENTS, displaced)], figures),
            PartOfReport("Beam", beam_rows),
        ],
        when=when,
        inputs=inputs,
    )


def model_fit_report(findings: ModelFindings, when: datetime, inputs: Mapping[str, str]) -> ResultReport:
    """Report of a fitted model; arguments as for `displacement_report`."""
    rows = EpochRows(findings)
    return table_report(
        "Fit of the structural model",
        f"{len(findings.coefficients)} coefficients before and after",
        findings.verdict,
        cards=[Card("Coefficients", str(len(findings.coefficients)), "free, the others as they were")],
        passages=fit_passages(findings),
        parts=[
            PartOfReport(
                "Coefficients",
                [report_table(COEFFICIENTS, findings.coefficients)],
                {
                    "coefficients": (
                        coefficient_figure(findings),
                        "Fitted coefficients less those of the model; bars: 2 u.",
                    )
                },
            ),
            PartOfReport(
                "Residuals",
                [report_table(RESIDUALS, rows)],
                {"residuals": (epoch_figure(findings), "Residuals of each epoch, measured less the model.")},
            ),
        ],
        when=when,
        inputs=inputs,
    )


def write_displacements(
    displaced: ModelDisplacements,
    beam: BeamOffset | None,
    directory: Path,
    inputs: Mapping[str, str],
    *,
    progress: Progress | None = None,
) -> None:
    """Write the files of `catseye model displace --out`.

    directory   existing, from `writers.output.atomic_directory`
    inputs      SHA-256 of each input file, by name
    progress    called for each file
    """
    when = datetime.now(UTC)
    files: Files = {
        "report.html": lambda: report_page(displacement_report(displaced, beam, when, inputs)),
        "displacements.csv": lambda: DISPLACEMENTS.csv(displaced),
        "model.json": lambda: json_page({"format": FORMAT, **displacement_object(displaced, beam)}),
        "elevation.svg": lambda: svg(elevation_figure(displaced)),
        "side.svg": lambda: svg(side_figure(displaced)),
    }
    if beam is not None:
        files = {**files, "beam.csv": lambda: BEAM.csv(BeamRows(displaced, beam))}
    provenance = {"format": FORMAT, "made_by": "catseye model displace"}
    write_files(files, directory, {**provenance, **origin(when, inputs)}, progress=progress)


def write_model_fit(
    findings: ModelFindings, directory: Path, inputs: Mapping[str, str], *, progress: Progress | None = None
) -> None:
    """Write the files of `catseye model fit --out`; arguments as for `write_displacements`."""
    when = datetime.now(UTC)
    files: Files = {
        "report.html": lambda: report_page(model_fit_report(findings, when, inputs)),
        "model-coefficients.csv": lambda: COEFFICIENTS.csv(findings.coefficients),
        "model-residuals.csv": lambda: RESIDUALS.csv(EpochRows(findings)),
        "model.json": lambda: json_page({"format": FORMAT, **fit_object(findings)}),
        "coefficients.svg": lambda: svg(coefficient_figure(findings)),
        "residuals.svg": lambda: svg(epoch_figure(findings)),
    }
    provenance = {"format": FORMAT, "made_by": "catseye model fit"}
    write_files(files, directory, {**provenance, **origin(when, inputs)}, progress=progress)
