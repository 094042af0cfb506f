"""Files of a structure's model or of its vibration: tables, JSON, report, samplers, provenance."""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from catseye.aliases import Progress
from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.gateways.structure.figures import motion_figure, residual_figure, spectrum_figure
from catseye.gateways.structure.objects import (
    FORMAT,
    structure_samplers,
    vibration_object,
    vibration_samplers,
)
from catseye.gateways.structure.tables import coefficients_csv, prediction_csv, residuals_csv, spectra_csv
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.page import card, page, paragraph, picture, section, table
from catseye.gateways.writers.samplers_fits import SAMPLERS, join_samplers
from catseye.gateways.writers.verdict import Verdict, verdict_line
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.structure.check import LeaveOut
from catseye.reduction.structure.series import Prediction, StructureFit
from catseye.reduction.structure.vibration import Vibration


def write_structure(
    fit: StructureFit,
    directory: Path,
    *,
    answer: Mapping[str, Any],
    check: LeaveOut | None,
    predicted: Prediction | None,
    inputs: Mapping[str, str],
    progress: Progress | None = None,
) -> None:
    """Write the files of a fit.

    fit, check, predicted   as for `structure_object`
    directory               existing, from `writers.output.atomic_directory`
    answer                  object from `structure_object`
    inputs                  SHA-256 of each input file, by name
    progress                called for each file
    """
    when = datetime.now(UTC)
    request = answer.get("prediction") or {}
    files: Files = {
        "coefficients.csv": lambda: coefficients_csv(fit),
        "residuals.csv": lambda: residuals_csv(fit, check),
        "structure.json": lambda: json_page({"format": FORMAT, **answer}),
        "report.html": lambda: _structure_page(fit, answer, check, predicted),
    }
    if predicted is not None:
        files = {"prediction.csv": lambda: prediction_csv(predicted, request), **files}
    provenance = {
        "format": FORMAT,
        "made_by": "catseye structure",
        "model": vars(fit.model) | {"group": fit.series.group},
    }
    write_files(files, directory, {**provenance, **origin(when, inputs)}, progress=progress)
    join_samplers(directory, SAMPLERS, structure_samplers(fit, check, predicted, request=request))


def write_vibration(
    vibration: Vibration,
    directory: Path,
    *,
    zero_mjd: float,
    inputs: Mapping[str, str],
    progress: Progress | None = None,
) -> None:
    """Write the files of a vibration; arguments as for `write_structure`; zero_mjd: MJD of 0 s."""
    when = datetime.now(UTC)
    files: Files = {
        "spectra.csv": lambda: spectra_csv(vibration),
        "vibration.json": lambda: json_page({"format": FORMAT, **vibration_object(vibration)}),
        "report.html": lambda: _vibration_page(vibration),
    }
    provenance = {"format": FORMAT, "made_by": "catseye structure --vibration", "start_mjd_utc": zero_mjd}
    write_files(files, directory, {**provenance, **origin(when, inputs)}, progress=progress)
    join_samplers(directory, SAMPLERS, vibration_samplers(vibration, zero_mjd))


def _structure_page(
    fit: StructureFit, answer: Mapping[str, Any], check: LeaveOut | None, predicted: Prediction | None
) -> str:
    s = fit.series
    cards = [
        card("Epochs", str(len(s)), f"{len(s.names)} points of {s.group}, frame {s.frame}"),
        card("Variance factor", f"{fit.fit.variance_factor:.2f}", f"{fit.fit.degrees_of_freedom} degrees of freedom"),
        card(
            "Scatter between epochs",
            f"{1e3 * np.linalg.norm(fit.scatter.u_six[:3]):.2f} mm",
            f"of the group's shift, and {fit.scatter.u_point * 1e3:.3f} mm of each coordinate: not predictable",
        ),
    ]
    if check is not None:
        cards.append(card("Epochs left out", f"{check.rms * 1e3:.3f} mm rms", f"{check.ratio:.2f} of the claim"))
    six, q = fit.six_of()
    u = np.sqrt(np.maximum(np.diag(q), 0.0)).reshape(-1, 6).T
    units = np.repeat([MILLIMETRE, ARCSECOND], 3)
    rows = [
        [name, *(f"{v:.3f} ± {w:.3f}" for v, w in zip(six[:, k] / units, u[:, k] / units, strict=True))]
        for k, name in enumerate(fit.model.functions)
    ]
    head = ["function", *(f"shift {a}, mm" for a in "xyz"), *(f"turn {a}, arcsec" for a in "xyz")]
    parts = [
        f"<header><h1>Structure: {s.group}</h1></header>",
        verdict_line(Verdict(**answer["verdict"])),
        '<div class="cards">' + "".join(cards) + "</div>",
        *(paragraph(note) for note in answer["notes"]),
        section(
            "motion",
            "Motion of the group",
            picture(
                motion_figure(fit),
                "Shift and rotation about the pivot from the mean of the epochs, at the reference temperature. Band: "
                "two standard uncertainties of a future epoch. Points: epochs without temperature and direction terms.",
            ),
            table(head, rows, "tnnnnnn"),
        ),
        section(
            "residuals",
            "Residuals",
            picture(residual_figure(fit, check), "Measured minus model, for each point and epoch; colours cover 98 %."),
        ),
    ]
    if predicted is not None:
        request = answer["prediction"]
        lines = [
            [f"{e:g}", name, *(f"{v:.5f}" for v in predicted.place[k, i]),
             *(f"{v * 1e3:.3f}" for v in np.sqrt(np.diag(predicted.covariance[k, i])))]
            for k, e in enumerate(request["elevation_deg"])
            for i, name in enumerate(predicted.names)
        ]  # fmt: skip
        warned = [paragraph(text, "bad") for text in predicted.outside]
        columns = ["elevation, degrees", "point", "x, m", "y, m", "z, m", "u x, mm", "u y, mm", "u z, mm"]
        parts.append(section("prediction", "Predicted points", *warned, table(columns, lines, "ntnnnnnn")))
    return page(f"Structure: {s.group}", "\n".join(parts))


def _vibration_page(vibration: Vibration) -> str:
    names = [s.name for s in vibration.series]
    rows = [
        [
            f"{p.peak.frequency_hz:.3f}",
            f"{p.likely_hz:.3f}" if p.decided else "open",
            ", ".join(f"{f:.2f}" for f in p.may_be_hz),
            f"{p.peak.over:.1f}",
            "" if p.shape is None else f"{p.shape.rms.max() * 1e6:.1f} ({names[int(np.argmax(p.shape.rms))]})",
        ]
        for p in vibration.peaks
    ]
    modes = [
        [f"{m.frequency_hz:.4f} ± {m.u_frequency_hz:.4f}", f"{m.damping_ratio:.4f} (× or ÷ {np.exp(m.u_damping):.2f})",
         f"{np.sqrt(m.covariance[0, 0]) * 1e6:.1f}"]
        for m in vibration.modes
    ]  # fmt: skip
    head = ["observed, Hz", "true, Hz", "possible, Hz", "times the background", "largest rms in the band, µm"]
    parts = [
        "<header><h1>Vibration</h1></header>",
        *(paragraph(note) for note in vibration.notes),
        section(
            "spectra",
            "Spectra",
            picture(
                spectrum_figure(vibration),
                "One-sided density of each range; the band is the 95 % interval of the first one's density. Red: half "
                "the rate. A question mark: it may be an alias.",
            ),
            table(head, rows, "nntnt"),
        ),
        section("modes", "Modes", table(["frequency, Hz", "damping ratio", "rms, µm"], modes, "nnn")),
    ]
    return page("Vibration", "\n".join(parts))
