"""Refractometer path as JSON, text, table and report."""

from collections import Counter
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.constants import PPM, TWO_PI
from catseye.gateways.air.charts import refractometer_charts
from catseye.gateways.air.tables import series_csv
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.report import Card, ReportSection, ResultReport, TableBlock, Text, origin_section
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.report_parts import ReportTable, number, text, uncertainty
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.air.group_index import phase_slope
from catseye.reduction.air.refractometer_calibration import STATUS
from catseye.signal.cycles.whole import CycleStatus

if TYPE_CHECKING:
    from catseye.reduction.air.refractometer_calibration import PathCalibration

FORMAT = "catseye-refractometer-1"


def refractometer_object(calibration: "PathCalibration") -> dict[str, Any]:
    """Object that `catseye refractometer --json` prints."""
    sheet, readings = calibration.readings.sheet, calibration.readings
    counts = Counter(calibration.status)
    return {
        "verdict": calibration.verdict.to_object(),
        "path": sheet.path,
        "path_length": sheet.path_length_m,
        "modulation_hz": sheet.modulation_hz,
        "wavelength_um": sheet.wavelength_um,
        "model": sheet.air_model,
        "co2_ppm": sheet.co2_ppm,
        "readings": {"total": len(readings), **{word.replace(" ", "_"): counts[word] for word in STATUS}},
        "group_index": 1.0 + calibration.index_0,
        "u_group_index": calibration.u_index_0,
        "phase": calibration.phase_0 % TWO_PI,
        "mjd_utc": calibration.mjd_0,
        "temperature_c": calibration.temperature_0_c,
        "pressure_hpa": calibration.pressure_0_hpa,
        "humidity_percent": calibration.humidity_0_percent,
        "phase_per_index": float(phase_slope(sheet.path_length_m, modulation_hz=sheet.modulation_hz)),
        "budget": calibration.budget,
        "slope": {"ratio": calibration.slope.ratio, "u_ratio": calibration.slope.u, "agrees": calibration.slope.agrees},
        "thermometers": {n: {"offset_c": v, "u_offset_c": u} for n, (v, u) in calibration.thermometers.items()},
        "drift": [{"hours": h, "phase": v, "u_phase": u} for h, v, u in calibration.drift],
        "noise": {
            "thermometers_over_claimed": calibration.thermometer_scatter,
            "places_over_claimed": calibration.places,
            "air": calibration.air_noise,
            "readings_that_hang_together": calibration.correlation,
        },
        "variance_factor": calibration.variance_factor,
        "degrees_of_freedom": calibration.degrees_of_freedom,
        "length_sensitivity_per_m": calibration.length_sensitivity,
        "absolute": _absolute(calibration),
        "sections": _sections(calibration),
        "notes": calibration.notes,
        "series": {
            "mjd_utc": readings.mjd_utc,
            "group_index": 1.0 + calibration.refractivity,
            "u_group_index": calibration.u_refractivity,
            "temperature_c": calibration.temperature_c,
            "u_temperature_c": calibration.u_temperature_c,
            "status": calibration.status,
        },
    }


def _absolute(calibration: "PathCalibration") -> dict[str, Any]:
    absolute = calibration.absolute
    return {
        "group_index": float(absolute.group_index),
        "u_group_index": float(absolute.u),
        "cycles": int(absolute.cycles),
        "margin": float(absolute.margin),
        "status": CycleStatus(int(absolute.status)).name.lower(),
        "path_length_of_weather": calibration.path_length,
        "u_path_length_of_weather": calibration.u_path_length,
    }


def _sections(calibration: "PathCalibration") -> list[dict[str, Any]]:
    readings = calibration.readings
    return [
        {
            "first_mjd_utc": readings.mjd_utc[s.first],
            "last_mjd_utc": readings.mjd_utc[s.last],
            "begins_with": s.reason,
            "text": s.text,
            "calibrated": f"index {k + 1}" in calibration.names,
        }
        for k, s in enumerate(calibration.followed.sections)
    ]


def passages(calibration: "PathCalibration") -> list[Passage]:
    """Summary passages for a reader, in order."""
    sheet, counts = calibration.readings.sheet, Counter(calibration.status)
    good = np.isfinite(calibration.refractivity)
    n, u, t = (
        calibration.refractivity[good] / PPM,
        calibration.u_refractivity[good] / PPM,
        calibration.temperature_c[good],
    )
    exclusions = ", ".join(f"{counts[word]} {word}" for word in STATUS[1:] if counts[word])
    passages = [
        Passage(
            "The readings",
            f"{counts['good']} of {len(calibration.readings)} used" + (f"; {exclusions}" if exclusions else ""),
        ),
        Passage(
            "Calibration",
            f"n_g - 1 = {calibration.index_0 / PPM:.3f} ± {calibration.u_index_0 / PPM:.3f} ppm at the phase "
            f"{calibration.phase_0 % TWO_PI:.4f} rad ({calibration.temperature_0_c:.2f} °C, "
            f"{calibration.pressure_0_hpa:.2f} hPa, {calibration.humidity_0_percent:.1f} %, {sheet.air_model})",
        ),
        Passage(
            "Contributions",
            ", ".join(f"{cause} {part / PPM:.3f}" for cause, part in calibration.budget.items()) + " ppm",
        ),
        Passage("The slope", _slope(calibration)),
        Passage(
            "The air",
            f"n_g - 1 from {n.min():.2f} to {n.max():.2f} ppm, ± {np.median(u):.2f} per reading"
            + (f", as air of {np.nanmin(t):.2f} to {np.nanmax(t):.2f} °C" if np.isfinite(t).any() else ""),
        ),
        Passage("The length", _length(calibration)),
        Passage(
            "Its error",
            f"25 mm of it change the index by {0.025e9 * abs(calibration.length_sensitivity):.2g}e-9 at most, at the "
            "reading farthest from the calibration's",
        ),
    ]
    return passages + [Passage("Note", note) for note in calibration.notes]


def _slope(calibration: "PathCalibration") -> str:
    sheet, slope = calibration.readings.sheet, calibration.slope
    theory = float(phase_slope(sheet.path_length_m, modulation_hz=sheet.modulation_hz)) * PPM * 1e3
    if slope.agrees is None:
        return f"{theory:.3f} mrad per ppm in theory; the index varied too little to test it"
    verdict = "agrees" if slope.agrees else "DISAGREES"
    times = f"{slope.ratio:.3f} ± {slope.u:.3f} times"
    return f"{theory:.3f} mrad per ppm in theory; against the weather's index {times} that: {verdict}"


def _length(calibration: "PathCalibration") -> str:
    sheet, absolute = calibration.readings.sheet, calibration.absolute
    if absolute.status != CycleStatus.SURE:
        return (
            f"{sheet.path_length_m:.4f} m ± {sheet.u_path_length_mm:g} mm does not fix the whole cycles: no absolute "
            "index (five u must fit into a quarter wavelength, 50 mm at 1500 MHz)"
        )
    return (
        f"{sheet.path_length_m:.5f} m ± {sheet.u_path_length_mm:g} mm alone gives n_g - 1 = "
        f"{(float(absolute.group_index) - 1.0) / PPM:.2f} ± {float(absolute.u) / PPM:.2f} ppm "
        f"(N {int(absolute.cycles)}); the weather's index implies {calibration.path_length:.6f} m "
        f"± {calibration.u_path_length * 1e3:.3f} mm"
    )


def refractometer_report(calibration: "PathCalibration", when: datetime) -> ResultReport:
    """Report of a refractometer path; `when` is UTC."""
    sheet = calibration.readings.sheet
    good = f"{calibration.status.count('good')} of {len(calibration.readings)}"
    index = f"{calibration.index_0 / PPM:.3f} ± {calibration.u_index_0 / PPM:.3f} ppm"
    causes = [(cause, part / PPM) for cause, part in calibration.budget.items()]
    thermometers = [(name, v, u) for name, (v, u) in calibration.thermometers.items()]
    return ResultReport(
        title=f"{sheet.path}: refractometer",
        subtitle=f"calibrated by catseye on {when:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ",
        verdict=calibration.verdict,
        cards=[
            Card("n_g − 1", index, "at the reference phase"),
            Card("Weather over phase", _card_slope(calibration), "1: the path's air changes as at the sensors"),
            Card("Readings", good, "used in the calibration"),
        ],
        passages=passages(calibration),
        sections=[
            ReportSection("night", "The night", refractometer_charts(calibration)),
            ReportSection(
                "budget",
                "Budget",
                [
                    Text("Standard uncertainty of the calibrated index by cause; causes add in quadrature."),
                    TableBlock(
                        "budget",
                        ReportTable.of_rows(
                            causes, text("cause", "cause"), uncertainty("u", "u", unit="ppm", digits=4)
                        ),
                    ),
                    TableBlock(
                        "thermometers",
                        ReportTable.of_rows(
                            thermometers,
                            text("thermometer", "thermometer"),
                            number("offset", "reads too high", unit="°C", digits=3, u="u"),
                            uncertainty("u", "u", unit="°C", digits=3),
                        ),
                    ),
                ],
            ),
            origin_section(
                when,
                calibration.readings.hashes,
                {key: str(value) for key, value in sheet.model_dump(exclude_none=True).items()},
            ),
        ],
        label="catseye: refractometer",
    )


def _card_slope(calibration: "PathCalibration") -> str:
    slope = calibration.slope
    return "not tested" if slope.agrees is None else f"{slope.ratio:.3f} ± {slope.u:.3f}"


def write_refractometer(
    calibration: "PathCalibration", directory: Path, progress: Callable[[str, int, int], None] | None = None
) -> None:
    """Write table, JSON, figure, report, and last the provenance with their hashes.

    calibration   a calibrated path
    directory     existing, from `writers.output.atomic_directory`
    progress      called for each file
    """
    from catseye.gateways.air.refractometer_figures import acquired_svg, night_svg  # matplotlib is heavy

    when = datetime.now(UTC)
    files: Files = {
        "group_index.csv": lambda: series_csv(calibration),
        "refractometer.json": lambda: json_page(refractometer_object(calibration)),
        "acquired.svg": lambda: acquired_svg(calibration),
        "night.svg": lambda: night_svg(calibration),
        "report.html": lambda: report_page(refractometer_report(calibration, when)),
    }
    sheet = calibration.readings.sheet.model_dump(mode="json", exclude_none=True)
    provenance = {"format": FORMAT, "made_by": "catseye refractometer", "sheet": sheet}
    write_files(files, directory, {**provenance, **origin(when, calibration.readings.hashes)}, progress=progress)
