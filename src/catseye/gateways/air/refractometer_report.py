"""A refractometer path as objects, text, table, figure and page."""

import csv
import io
from collections import Counter
from collections.abc import Callable
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.constants import PPM, TWO_PI
from catseye.gateways.writers.objects import json_page, versions
from catseye.gateways.writers.page import card, page, paragraph, picture, section, table
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.air.group_index import phase_slope
from catseye.reduction.air.refractometer_calibration import STATUS
from catseye.signal.cycles.whole import CycleStatus

if TYPE_CHECKING:
    from catseye.reduction.air.refractometer_calibration import PathCalibration

FORMAT = "catseye-refractometer-1"
SERIES = ("mjd_utc", "section", "phase_rad", "group_refractivity_ppm", "u_group_refractivity_ppm", "temperature_c",
          "u_temperature_c", "weather_refractivity_ppm", "residual_ppm", "standardised", "status")  # fmt: skip


def refractometer_object(found: "PathCalibration") -> dict[str, Any]:
    """A calibrated path as `catseye refractometer --json` gives it."""
    sheet, readings, parameters = found.readings.sheet, found.readings, _parameters(found)
    absolute = found.absolute
    counts = Counter(found.status)
    return {
        "path": sheet.path,
        "path_length": sheet.path_length_m,
        "modulation_hz": sheet.modulation_hz,
        "wavelength_um": sheet.wavelength_um,
        "model": sheet.air_model,
        "co2_ppm": sheet.co2_ppm,
        "readings": {"total": len(readings), **{word.replace(" ", "_"): counts[word] for word in STATUS}},
        "group_index": 1.0 + found.index_0,
        "u_group_index": found.u_index_0,
        "phase": found.phase_0 % TWO_PI,
        "mjd_utc": found.mjd_0,
        "temperature_c": found.temperature_0_c,
        "pressure_hpa": found.pressure_0_hpa,
        "humidity_percent": found.humidity_0_percent,
        "phase_per_index": float(phase_slope(sheet.path_length_m, modulation_hz=sheet.modulation_hz)),
        "budget": found.budget,
        "slope": {"ratio": found.slope.ratio, "u_ratio": found.slope.u, "agrees": found.slope.agrees},
        "thermometers": {n: {"offset_c": v, "u_offset_c": u} for n, (v, u) in parameters["thermometers"].items()},
        "drift": [{"hours": h, "phase": v, "u_phase": u} for h, v, u in parameters["drift"]],
        "noise": {
            "thermometers_over_claimed": found.thermometer_scatter,
            "places_over_claimed": found.places,
            "air": found.air_noise,
            "readings_that_hang_together": found.correlation,
        },
        "variance_factor": found.variance_factor,
        "degrees_of_freedom": found.degrees_of_freedom,
        "absolute": {
            "group_index": float(absolute.group_index),
            "u_group_index": float(absolute.u),
            "cycles": int(absolute.cycles),
            "margin": float(absolute.margin),
            "status": CycleStatus(int(absolute.status)).name.lower(),
            "path_length_of_weather": found.path_length,
            "u_path_length_of_weather": found.u_path_length,
        },
        "sections": [
            {
                "first_mjd_utc": readings.mjd_utc[s.first],
                "last_mjd_utc": readings.mjd_utc[s.last],
                "begins_with": s.reason,
                "text": s.text,
                "calibrated": f"index {k + 1}" in found.names,
            }
            for k, s in enumerate(found.followed.sections)
        ],
        "notes": found.notes,
        "series": {
            "mjd_utc": readings.mjd_utc,
            "group_index": 1.0 + found.refractivity,
            "u_group_index": found.u_refractivity,
            "temperature_c": found.temperature_c,
            "u_temperature_c": found.u_temperature_c,
            "status": found.status,
        },
    }


def _parameters(found: "PathCalibration") -> dict[str, Any]:
    drift = [name for name in found.names if name.startswith("drift at ")]
    return {
        "thermometers": {name: found.of(name) for name in found.readings.thermometers},
        "drift": [(float(name.split()[2]), *found.of(name)) for name in drift],
    }


def passages(found: "PathCalibration") -> list[Passage]:
    """What a person should know, in order."""
    sheet, counts = found.readings.sheet, Counter(found.status)
    good = np.isfinite(found.refractivity)
    n, u, t = found.refractivity[good] / PPM, found.u_refractivity[good] / PPM, found.temperature_c[good]
    others = ", ".join(f"{counts[word]} {word}" for word in STATUS[1:] if counts[word])
    made = [
        Passage("The readings", f"{counts['good']} of {len(found.readings)} used" + (f"; {others}" if others else "")),
        Passage(
            "Calibration",
            f"n_g - 1 = {found.index_0 / PPM:.3f} ± {found.u_index_0 / PPM:.3f} ppm at the phase "
            f"{found.phase_0 % TWO_PI:.4f} rad ({found.temperature_0_c:.2f} °C, {found.pressure_0_hpa:.2f} hPa, "
            f"{found.humidity_0_percent:.1f} %, {sheet.air_model})",
        ),
        Passage(
            "Of it",
            ", ".join(f"{cause} {part / PPM:.3f}" for cause, part in found.budget.items()) + " ppm",
        ),
        Passage("The slope", _slope(found)),
        Passage(
            "The air",
            f"n_g - 1 from {n.min():.2f} to {n.max():.2f} ppm, each ± {np.median(u):.2f}"
            + (f"; as warm as {np.nanmin(t):.2f} to {np.nanmax(t):.2f} °C" if np.isfinite(t).any() else ""),
        ),
        Passage("The length", _length(found)),
    ]
    return made + [Passage("Note", note) for note in found.notes]


def _slope(found: "PathCalibration") -> str:
    sheet, slope = found.readings.sheet, found.slope
    theory = float(phase_slope(sheet.path_length_m, modulation_hz=sheet.modulation_hz)) * PPM * 1e3
    if slope.agrees is None:
        return f"{theory:.3f} mrad a ppm by theory; the index changed too little to test it"
    verdict = "agrees" if slope.agrees else "DISAGREES"
    times = f"{slope.ratio:.3f} ± {slope.u:.3f} times"
    return f"{theory:.3f} mrad a ppm by theory; the weather's index goes {times} as far as that: {verdict}"


def _length(found: "PathCalibration") -> str:
    sheet, absolute = found.readings.sheet, found.absolute
    if absolute.status != CycleStatus.SURE:
        return (
            f"{sheet.path_length_m:.4f} m ± {sheet.u_path_length_mm:g} mm does not tell the whole cycles: no absolute "
            "index (five u must fit into a quarter wavelength, 50 mm at 1500 MHz)"
        )
    return (
        f"{sheet.path_length_m:.5f} m ± {sheet.u_path_length_mm:g} mm alone gives n_g - 1 = "
        f"{(float(absolute.group_index) - 1.0) / PPM:.2f} ± {float(absolute.u) / PPM:.2f} ppm "
        f"(N {int(absolute.cycles)}); the weather's index asks for {found.path_length:.6f} m "
        f"± {found.u_path_length * 1e3:.3f} mm"
    )


def series_csv(found: "PathCalibration") -> str:
    """A row a reading; a cell is empty where there is no number."""
    readings = found.readings
    columns = (
        [f"{v:.8f}" for v in readings.mjd_utc],
        [str(k + 1) for k in found.followed.section],
        [f"{v:.6f}" for v in found.followed.phase],
        *(
            [f"{v:.4f}" if np.isfinite(v) else "" for v in values]
            for values in (
                found.refractivity / PPM,
                found.u_refractivity / PPM,
                found.temperature_c,
                found.u_temperature_c,
                found.weather.mean / PPM,
                found.residual / PPM,
                found.standardised,
            )
        ),
        found.status,
    )
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(SERIES)
    writer.writerows(zip(*columns, strict=True))
    return stream.getvalue()


def refractometer_figures(found: "PathCalibration") -> dict[str, str]:
    """The night and its residuals, and phase against weather, as SVG text."""
    from catseye.gateways.writers.drawing import STYLE, mpl, svg  # matplotlib is heavy

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        return {"night": svg(_night(found)), "slope": svg(_line(found))}


def _night(found: "PathCalibration"):
    from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure

    hours, good = found.readings.hours, np.isfinite(found.refractivity)
    used = np.array([s == "good" for s in found.status])
    off = np.array([s == "weather off" for s in found.status])
    figure = Figure(figsize=(9.4, 6.4), layout="constrained")
    index, rest, warm = figure.subplots(3, 1, sharex=True, gridspec_kw={"height_ratios": (3, 2, 2)})
    index.scatter(hours, found.weather.mean / PPM, s=5, c=SERIES[1], lw=0, alpha=0.6, label="by the weather")
    path = np.where(good, found.refractivity, np.nan) / PPM
    gaps = np.flatnonzero(np.diff(hours) > 10.0 * np.median(np.diff(hours))) + 1
    lines = [np.insert(v, gaps, np.nan) for v in (hours, path, found.temperature_c, found.u_temperature_c)]
    index.plot(lines[0], lines[1], color=SERIES[0], lw=1.2, label="by the phase")
    for row in np.flatnonzero([s == "stray" for s in found.status]):
        index.axvline(hours[row], color=BAD, lw=0.6, ls=":", alpha=0.6)
    low, high = np.nanpercentile(path, [0, 100])
    index.set_ylim(low - 0.25 * (high - low) - 0.2, high + 0.25 * (high - low) + 0.2)
    index.set_ylabel("n_g − 1 (ppm)")
    index.set_title(f"{found.readings.sheet.path}: group index of the path (dotted: stray phases)")
    rest.axhline(0.0, color=FAINT, lw=0.8)
    rest.scatter(hours[used], found.residual[used] / PPM, s=5, c=INK, lw=0, alpha=0.7, label="used")
    rest.scatter(hours[off], found.residual[off] / PPM, s=14, c=BAD, marker="x", lw=0.8, label="left out")
    spread = 6.0 * float(np.nanstd(found.residual[used])) / PPM
    rest.set_ylim(-spread, spread)
    rest.set_ylabel("weather − path (ppm)")
    when, _, t, u = lines
    warm.fill_between(when, t - u, t + u, color=SERIES[0], alpha=0.25, lw=0, label="± u")
    warm.plot(when, t, color=SERIES[0], lw=1.0, label="mean of the path")
    warm.set_ylabel("°C")
    warm.set_xlabel(f"hours since MJD {found.readings.mjd_utc[0]:.4f} UTC")
    for ax in (index, rest, warm):
        for s in found.followed.sections[1:]:
            ax.axvline(hours[s.first], color=BAD, lw=1.0)
        ax.legend(loc="best", ncols=2)
    return figure


def _line(found: "PathCalibration"):
    from catseye.gateways.writers.drawing import INK, SERIES, Figure

    sheet = found.readings.sheet
    slope = float(phase_slope(sheet.path_length_m, modulation_hz=sheet.modulation_hz))
    figure = Figure(figsize=(9.4, 4.2), layout="constrained")
    ax = figure.add_subplot()
    used = np.array([s == "good" for s in found.status])
    drift = (found.refractivity - found.index_0) * slope  # what the phase would be without drift and jumps
    weather = found.refractivity + found.residual  # of the thermometers that were not left out
    ax.scatter(weather[used] / PPM, drift[used], s=8, c=SERIES[0], lw=0, alpha=0.6, label="readings")
    ends = np.array([np.nanmin(weather[used]), np.nanmax(weather[used])])
    ax.plot(ends / PPM, (ends - found.index_0) * slope, color=INK, lw=1.1, label="theory: −(4πf/c) L")
    ax.set_xlabel("n_g − 1 by the weather (ppm)")
    ax.set_ylabel("phase from the reference phase (rad)")
    ax.set_title("Phase against weather: the phase falls as the index rises")
    ax.legend(loc="best")
    return figure


def refractometer_report(found: "PathCalibration", when: datetime) -> str:
    """The whole page; `when` in UTC."""
    drawn, sheet = refractometer_figures(found), found.readings.sheet
    words = "".join(f"<dt>{escape(p.title)}</dt><dd>{escape(p.text)}</dd>" for p in passages(found))
    parameters = _parameters(found)["thermometers"]
    cards = [
        card("n_g − 1", f"{found.index_0 / PPM:.3f} ± {found.u_index_0 / PPM:.3f} ppm", "at the reference phase"),
        card("Weather over phase", _card_slope(found), "1: the path's air changes as the sensors'"),
        card("Readings", f"{found.status.count('good')} of {len(found.readings)}", "used in the calibration"),
    ]
    thermometers = [(n, f"{v:+.3f}", f"{u:.3f}") for n, (v, u) in parameters.items()]
    facts = [*versions().items(), *((k, str(v)) for k, v in sheet.model_dump(exclude_none=True).items())]
    body = [
        f"<header><h1>{escape(sheet.path)}: refractometer</h1><div class='faint'>calibrated by catseye on "
        f"{when:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ</div></header>",
        section("summary", "Summary", f'<div class="cards">{"".join(cards)}</div>', f"<dl>{words}</dl>"),
        section(
            "night",
            "The night",
            picture(drawn["night"], "Index of the path by phase and by weather; what is left between them; and the "
                    "mean temperature that the index stands for at the pressure and humidity read. Red lines: a jump, "
                    "or a gap over which the whole cycles are not known."),
            picture(drawn["slope"], "The theoretical slope is not fitted: readings along it say that the path's air "
                    "changes as the sensors' does."),
        ),
        section(
            "budget",
            "Budget",
            paragraph("Standard uncertainty of the calibrated index by cause; causes add in squares."),
            table(("cause", "ppm"), [(c, f"{p / PPM:.4f}") for c, p in found.budget.items()], "tn"),
            table(("thermometer", "reads too high (°C)", "u (°C)"), thermometers, "tnn"),
        ),
        section(
            "provenance",
            "Provenance",
            table(("file read", "SHA-256"), list(found.readings.hashes.items()), "th"),
            table(("what", "value"), facts, "tt"),
        ),
    ]  # fmt: skip
    return page("catseye: refractometer", "\n".join(body))


def _card_slope(found: "PathCalibration") -> str:
    slope = found.slope
    return "not tested" if slope.agrees is None else f"{slope.ratio:.3f} ± {slope.u:.3f}"


def write_refractometer(
    found: "PathCalibration", directory: Path, progress: Callable[[str, int, int], None] | None = None
) -> None:
    """Table, object, report, and last the provenance with the hashes of the others.

    found       a calibrated path
    directory   exists, and is ours to fill: see `writers.output.whole_directory`
    progress    told of each file
    """
    when = datetime.now(UTC)
    files: Files = {
        "group_index.csv": lambda: series_csv(found),
        "refractometer.json": lambda: json_page(refractometer_object(found)),
        "night.svg": lambda: refractometer_figures(found)["night"],
        "report.html": lambda: refractometer_report(found, when),
    }
    sheet = found.readings.sheet.model_dump(mode="json", exclude_none=True)
    made = {"format": FORMAT, "made_by": "catseye refractometer", "sheet": sheet}
    write_files(files, directory, {**made, **origin(when, found.readings.hashes)}, progress)
