"""Report and files of a design study."""

from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path

from catseye.aliases import Progress
from catseye.constants import MILLIMETRE
from catseye.gateways.design.figures import caption_of, design_figures
from catseye.gateways.design.objects import FORMAT, design_object, design_passages
from catseye.gateways.design.tables import MAPS, MOVES, NUMBERS, POINTS, map_name
from catseye.gateways.design.words import quantity_of
from catseye.gateways.writers.drawing import svg
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.report import (
    Block,
    Card,
    DrawingBlock,
    ReportSection,
    ResultReport,
    TableBlock,
    Text,
    origin_section,
)
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.report_parts import ReportTable, number, text
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.design.study import DesignStudy
from catseye.reduction.network.words import quantity


def design_report(study: DesignStudy, when: datetime, inputs: Mapping[str, str]) -> ResultReport:
    """Report of a design study.

    when     UTC
    inputs   SHA-256 of each input file, by name
    """
    scene = study.after.scene
    drawn = {
        name: DrawingBlock(name, svg(figure), caption_of(study, name)) for name, figure in design_figures(study).items()
    }
    return ResultReport(
        title=f"{scene.name}: design study",
        subtitle=(
            f"Predicted by catseye on {when:%Y-%m-%d %H:%M} UTC from geometry and claimed uncertainties; every visible "
            "pair is ranged once; u = standard uncertainty, 1σ"
        ),
        verdict=study.verdict,
        cards=_cards(study),
        passages=design_passages(study),
        sections=[
            _places(study, drawn["places"]),
            _points(study, drawn["points"]),
            _numbers(study, drawn.get("numbers")),
            _drawings("maps", "Maps", [drawn.get(map_name(item)) for item in study.maps]),
            _drawings("search", "Search", [drawn.get("search")]),
            _origin(study, when, inputs),
        ],
        label=f"catseye: {scene.name}, design",
    )


def _cards(study: DesignStudy) -> list[Card]:
    before, after = study.before, study.after
    cards = [
        Card("Before", quantity(before.u, "m"), quantity_of(study.aim)),
        Card("After", quantity(after.u, "m"), f"{100 * study.gain:.1f} % less"),
        Card("Rangers", str(len(after.scene.rangers)), f"{after.ranges} ranges; before {len(before.scene.rangers)}"),
    ]
    if study.scatter is not None:
        check = study.scatter[1]
        cards.append(
            Card("Scatter after", quantity(check.u, "m"), f"± {quantity(check.u_u, 'm')} of {check.runs} runs")
        )
    return cards


def _drawings(key: str, title: str, blocks: list[DrawingBlock | None]) -> ReportSection | None:
    return ReportSection(key, title, blocks) if any(blocks) else None


def _places(study: DesignStudy, drawing: Block) -> ReportSection:
    rows = [(m.unit, m.frame, *m.before, *m.after, m.distance) for m in study.moves]
    table = ReportTable.of_rows(
        rows,
        text("unit", "unit"),
        text("frame", "frame"),
        *(number(f"{axis}_before", f"{axis} before", unit="m", digits=2) for axis in "xyz"),
        *(number(f"{axis}_after", f"{axis} after", unit="m", digits=2) for axis in "xyz"),
        number("distance", "move", unit="m", digits=2),
        name="unit",
    )
    varied = Text("Varied: " + "; ".join(item.text for item in study.varied) + ".")
    return ReportSection("places", "Places", [varied, drawing, TableBlock("moves", table)])


def _points(study: DesignStudy, drawing: Block) -> ReportSection:
    first, last = study.before.longest[0] / MILLIMETRE, study.after.longest[0] / MILLIMETRE
    table = ReportTable(
        (
            text("point", "point", list(study.aim.interest)),
            number("before", "longest axis before", first, "mm", 4),
            number("after", "longest axis after", last, "mm", 4),
        ),
        name="point",
    )
    return ReportSection("points", "Points of interest", [drawing, TableBlock("points", table)])


def _numbers(study: DesignStudy, drawing: Block | None) -> ReportSection | None:
    if not study.numbers:
        return None
    rows = [(n.number, n.u / MILLIMETRE, n.change) for n in study.numbers]
    table = ReportTable.of_rows(
        rows, number("number", "number", digits=0), number("u", "u", unit="mm", digits=4), text("change", "last change")
    )
    return ReportSection("numbers", "Numbers", [drawing, TableBlock("numbers", table)])


def _origin(study: DesignStudy, when: datetime, inputs: Mapping[str, str]) -> ReportSection:
    claim, scene = study.after.scene.claim, study.after.scene
    facts = {
        "range": f"u {claim.constant / MILLIMETRE:g} mm and {claim.relative * 1e6:g} ppm, squared and added",
        "air": f"{scene.u_scale * 1e6:g} ppm, common to all ranges",
        "distances used": f"{scene.limits.near:g} to {scene.limits.far:g} m",
        "between rangers": f"{study.constraints.apart:g} m at least",
        "from solids": f"{study.constraints.clearance:g} m at least",
        "seed of the scatter": str(study.settings.seed),
    }
    return origin_section(when, inputs, facts)


def write_design(
    study: DesignStudy, directory: Path, inputs: Mapping[str, str], *, progress: Progress | None = None
) -> None:
    """Write report, JSON, tables and figures into an empty directory."""
    now = datetime.now(UTC)
    figures = design_figures(study)
    files: dict[str, Callable[[], str | bytes | Iterator[str]]] = {
        "report.html": lambda: report_page(design_report(study, now, inputs)),
        "design.json": lambda: json_page(design_object(study)),
        MOVES.file: lambda: MOVES.csv(study),
        POINTS.file: lambda: POINTS.csv(study),
    }
    if study.numbers:
        files[NUMBERS.file] = lambda: NUMBERS.csv(study)
    for item in study.maps:
        files[f"{map_name(item)}.csv"] = lambda drawn=item: MAPS.csv(drawn)  # type: ignore[misc]
    for name, figure in figures.items():
        files[f"{name}.svg"] = lambda drawn=figure: svg(drawn)  # type: ignore[misc]
    written: Files = files
    write_files(written, directory, {"format": FORMAT, **origin(now, inputs)}, progress=progress)
