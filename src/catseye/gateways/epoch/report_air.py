"""Section on the air of a reduction's report."""

from catseye.gateways.epoch.objects import benchmark_object
from catseye.gateways.epoch.report_charts import refractivity_chart, weather_charts
from catseye.gateways.writers.report import Block, ChartBlock, ReportSection, TableBlock, Text
from catseye.gateways.writers.report_parts import ReportTable, number, text, uncertainty
from catseye.reduction.air.group_index import benchmark_refractometers
from catseye.reduction.epoch.epoch import Reduction


def air_section(reduction: Reduction) -> ReportSection:
    """Refractivity, weather, estimates of the air, benchmark paths."""
    *stations, (profile, (value, u)) = reduction.coordinates.air.items()
    rows = [(f"{name}: thermometer reads too high by", v, s, "°C") for name, (v, s) in stations]
    label, unit = (
        ("gradient with height", "°C/m")
        if profile == "gradient"
        else ("midway between the stations warmer than interpolated by", "°C")
    )
    rows.append((label, value, u, unit))
    rows += [
        (f"{line}: acoustic temperature too high by", warm, s, "°C")
        for line, (warm, s) in reduction.coordinates.sound.items()
    ]
    estimated = ReportTable.of_rows(
        rows,
        text("parameter", f"estimated with the coordinates (model {reduction.settings.air_model})"),
        number("value", "value", digits=4, u="u"),
        uncertainty("u", "u", digits=4),
        text("unit", "unit"),
    )
    return ReportSection(
        "air",
        "Air",
        [
            _refractivity(reduction),
            *(
                ChartBlock(key, chart, "Readings of the weather stations.")
                for key, chart in weather_charts(reduction).items()
            ),
            TableBlock("air", estimated),
            *_benchmarks(reduction),
        ],
    )


def _refractivity(reduction: Reduction) -> ChartBlock | None:
    chart = refractivity_chart(reduction)
    caption = (
        "Group refractivity (n − 1) along every used path, coloured by its mean height above their middle. "
        f"Dashed: the mean, {reduction.coordinates.refractivity_ppm:.2f} ppm."
    )
    return None if chart is None else ChartBlock("refractivity", chart, caption)


def _benchmarks(reduction: Reduction) -> list[Block]:
    """Benchmark paths as refractometers."""
    rows = [
        (
            one["benchmark"],
            one["ranger"],
            one["shots"],
            *(one[key] for key in ("path_ppm", "u_path_ppm", "weather_ppm", "u_weather_ppm", "adjusted_ppm")),
            one["thermometers_too_warm_c"],
            one["u_thermometers_too_warm_c"],
        )
        for one in map(benchmark_object, benchmark_refractometers(reduction))
        if one["shots"]
    ]
    if not rows:
        return []
    lead = (
        "Each benchmark path is a refractometer: n_g − 1 (ppm) from its phase, its certificate and the ranger's sheet, "
        "compared with the weather stations as read and as adjusted."
    )
    table = ReportTable.of_rows(
        rows,
        text("point", "benchmark"),
        text("ranger", "ranger"),
        number("shots", "shots", digits=0),
        number("path", "path", unit="ppm", digits=2, u="u_path"),
        uncertainty("u_path", "u path", unit="ppm", digits=2),
        number("stations", "stations", unit="ppm", digits=2, u="u_stations"),
        uncertainty("u_stations", "u stations", unit="ppm", digits=2),
        number("adjusted", "adjusted", unit="ppm", digits=2),
        number("too_warm", "stations too warm", unit="°C", digits=2, u="u_too_warm"),
        uncertainty("u_too_warm", "u too warm", unit="°C", digits=2),
        name="point",
    )
    return [Text(lead), TableBlock("benchmarks", table)]
