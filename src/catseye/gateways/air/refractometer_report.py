"""Refractometer path as JSON, text, table, figure and page."""

from collections import Counter
from collections.abc import Callable
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.constants import PPM, TWO_PI
from catseye.gateways.air.tables import series_csv
from catseye.gateways.writers.objects import json_page, versions
from catseye.gateways.writers.page import card, page, paragraph, picture, section, table
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.verdict import verdict_line
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.air.group_index import phase_slope
from catseye.reduction.air.refractometer_calibration import STATUS
from catseye.signal.cycles.whole import CycleStatus

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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


def refractometer_figures(calibration: "PathCalibration") -> "dict[str, Figure]":
    """Figures of the night with residuals, and phase against weather."""
    from catseye.gateways.writers.drawing import styled  # matplotlib is heavy

    with styled():
        return {"night": _night(calibration), "slope": _line(calibration)}


def _svgs(calibration: "PathCalibration") -> dict[str, str]:
    from catseye.gateways.writers.drawing import svgs  # matplotlib is heavy

    return svgs(refractometer_figures(calibration))


def _night(calibration: "PathCalibration"):
    from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure

    hours, good = calibration.readings.hours, np.isfinite(calibration.refractivity)
    used = np.array([s == "good" for s in calibration.status])
    off = np.array([s == "weather off" for s in calibration.status])
    figure = Figure(figsize=(9.4, 6.4), layout="constrained")
    index, residual, warm = figure.subplots(3, 1, sharex=True, gridspec_kw={"height_ratios": (3, 2, 2)})
    index.scatter(hours, calibration.weather.mean / PPM, s=5, c=SERIES[1], lw=0, alpha=0.6, label="from weather")
    path = np.where(good, calibration.refractivity, np.nan) / PPM
    gaps = np.flatnonzero(np.diff(hours) > 10.0 * np.median(np.diff(hours))) + 1
    lines = [np.insert(v, gaps, np.nan) for v in (hours, path, calibration.temperature_c, calibration.u_temperature_c)]
    index.plot(lines[0], lines[1], color=SERIES[0], lw=1.2, label="from phase")
    for row in np.flatnonzero([s == "stray" for s in calibration.status]):
        index.axvline(hours[row], color=BAD, lw=0.6, ls=":", alpha=0.6)
    low, high = np.nanpercentile(path, [0, 100])
    index.set_ylim(low - 0.25 * (high - low) - 0.2, high + 0.25 * (high - low) + 0.2)
    index.set_ylabel("n_g − 1 (ppm)")
    index.set_title(f"{calibration.readings.sheet.path}: group index of the path (dotted: stray phases)")
    residual.axhline(0.0, color=FAINT, lw=0.8)
    residual.scatter(hours[used], calibration.residual[used] / PPM, s=5, c=INK, lw=0, alpha=0.7, label="used")
    residual.scatter(hours[off], calibration.residual[off] / PPM, s=14, c=BAD, marker="x", lw=0.8, label="excluded")
    spread = 6.0 * float(np.nanstd(calibration.residual[used])) / PPM
    residual.set_ylim(-spread, spread)
    residual.set_ylabel("weather − path (ppm)")
    when, _, t, u = lines
    warm.fill_between(when, t - u, t + u, color=SERIES[0], alpha=0.25, lw=0, label="± u")
    warm.plot(when, t, color=SERIES[0], lw=1.0, label="path mean")
    warm.set_ylabel("°C")
    warm.set_xlabel(f"hours since MJD {calibration.readings.mjd_utc[0]:.4f} UTC")
    for ax in (index, residual, warm):
        for s in calibration.followed.sections[1:]:
            ax.axvline(hours[s.first], color=BAD, lw=1.0)
        ax.legend(loc="best", ncols=2)
    return figure


def _line(calibration: "PathCalibration"):
    from catseye.gateways.writers.drawing import INK, SERIES, Figure

    sheet = calibration.readings.sheet
    slope = float(phase_slope(sheet.path_length_m, modulation_hz=sheet.modulation_hz))
    figure = Figure(figsize=(9.4, 4.2), layout="constrained")
    ax = figure.add_subplot()
    used = np.array([s == "good" for s in calibration.status])
    drift = (calibration.refractivity - calibration.index_0) * slope  # phase without drift and jumps
    weather = calibration.refractivity + calibration.residual  # from the thermometers in use
    ax.scatter(weather[used] / PPM, drift[used], s=8, c=SERIES[0], lw=0, alpha=0.6, label="readings")
    ends = np.array([np.nanmin(weather[used]), np.nanmax(weather[used])])
    ax.plot(ends / PPM, (ends - calibration.index_0) * slope, color=INK, lw=1.1, label="theory: −(4πf/c) L")
    ax.set_xlabel("n_g − 1 from weather (ppm)")
    ax.set_ylabel("phase relative to the reference phase (rad)")
    ax.set_title("Phase against weather: the phase falls as the index rises")
    ax.legend(loc="best")
    return figure


def refractometer_report(calibration: "PathCalibration", when: datetime) -> str:
    """HTML report; `when` is UTC."""
    drawn, sheet = _svgs(calibration), calibration.readings.sheet
    words = "".join(f"<dt>{escape(p.title)}</dt><dd>{escape(p.text)}</dd>" for p in passages(calibration))
    cards = [
        card(
            "n_g − 1",
            f"{calibration.index_0 / PPM:.3f} ± {calibration.u_index_0 / PPM:.3f} ppm",
            "at the reference phase",
        ),
        card("Weather over phase", _card_slope(calibration), "1: the path's air changes as at the sensors"),
        card(
            "Readings", f"{calibration.status.count('good')} of {len(calibration.readings)}", "used in the calibration"
        ),
    ]
    thermometers = [(n, f"{v:+.3f}", f"{u:.3f}") for n, (v, u) in calibration.thermometers.items()]
    facts = [*versions().items(), *((k, str(v)) for k, v in sheet.model_dump(exclude_none=True).items())]
    body = [
        f"<header><h1>{escape(sheet.path)}: refractometer</h1><div class='faint'>calibrated by catseye on "
        f"{when:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ</div></header>",
        verdict_line(calibration.verdict),
        section("summary", "Summary", f'<div class="cards">{"".join(cards)}</div>', f"<dl>{words}</dl>"),
        section(
            "night",
            "The night",
            picture(drawn["night"], "Index of the path from phase and from weather; their difference; and the mean "
                    "temperature equivalent to the index at the measured pressure and humidity. Red lines: a jump, "
                    "or a gap after which the whole cycles are unknown."),
            picture(drawn["slope"], "The theoretical slope is not fitted: readings along it show that the path's air "
                    "changes as the air at the sensors."),
        ),
        section(
            "budget",
            "Budget",
            paragraph("Standard uncertainty of the calibrated index by cause; causes add in quadrature."),
            table(("cause", "ppm"), [(c, f"{p / PPM:.4f}") for c, p in calibration.budget.items()], "tn"),
            table(("thermometer", "reads too high (°C)", "u (°C)"), thermometers, "tnn"),
        ),
        section(
            "provenance",
            "Provenance",
            table(("file read", "SHA-256"), list(calibration.readings.hashes.items()), "th"),
            table(("item", "value"), facts, "tt"),
        ),
    ]  # fmt: skip
    return page("catseye: refractometer", "\n".join(body))


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
    when = datetime.now(UTC)
    files: Files = {
        "group_index.csv": lambda: series_csv(calibration),
        "refractometer.json": lambda: json_page(refractometer_object(calibration)),
        "night.svg": lambda: _svgs(calibration)["night"],
        "report.html": lambda: refractometer_report(calibration, when),
    }
    sheet = calibration.readings.sheet.model_dump(mode="json", exclude_none=True)
    provenance = {"format": FORMAT, "made_by": "catseye refractometer", "sheet": sheet}
    write_files(files, directory, {**provenance, **origin(when, calibration.readings.hashes)}, progress=progress)
