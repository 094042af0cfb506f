"""Files of panel setting: list of screws, tables, JSON and a report."""

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from catseye.aliases import Progress
from catseye.gateways.panels.objects import (
    FORMAT,
    doubt_text,
    micrometres,
    panels_object,
    passages,
    screws,
)
from catseye.gateways.panels.report_charts import control_charts, corner_charts, surface_charts, turning_charts
from catseye.gateways.panels.tables import (
    ACTUATORS,
    CREW,
    PANELS,
    READINGS,
    SCREWS,
    actuators_csv,
    crew_csv,
    panels_csv,
    readings_csv,
    screws_csv,
)
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.report import (
    Block,
    Card,
    Heading,
    ReportSection,
    ResultReport,
    TableBlock,
    Text,
    origin_section,
)
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.report_parts import ReportTable, number, text, uncertainty
from catseye.gateways.writers.samplers_fits import join_tables
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.panels.crew import members, sessions, standing

if TYPE_CHECKING:
    from catseye.reduction.panels.crew import Reader
    from catseye.reduction.panels.heights import PanelHeights
    from catseye.reduction.panels.job import PanelWork


def write_panels(work: "PanelWork", directory: Path, progress: Progress | None = None) -> None:
    """Write tables, JSON, report, and the provenance with their hashes.

    work        as reduced
    directory   existing, from `writers.output.atomic_directory`
    progress    called for each file
    """
    when = datetime.now(UTC)
    files: Files = {
        "screws.csv": lambda: screws_csv(work.latest),
        "actuators.csv": lambda: actuators_csv(work.latest),
        "panels.csv": lambda: panels_csv(work),
        "readings.csv": lambda: readings_csv(work.found),
        **({} if work.left is None else {"readings-as-left.csv": lambda: _as_left_csv(work)}),
        "crew.csv": lambda: crew_csv(work),
        "panels.json": lambda: json_page(panels_object(work)),
        "report.html": lambda: report_page(panels_report(work, when)),
    }
    provenance = {"format": FORMAT, "made_by": "catseye panels"}
    write_files(files, directory, {**provenance, **origin(when, work.inputs)}, progress=progress)
    join_tables(
        directory,
        [SCREWS, ACTUATORS, PANELS, READINGS, CREW],
        frame="of each corner or panel: z the normal towards the focus",
    )


def _as_left_csv(work: "PanelWork") -> str:
    assert work.left is not None
    return readings_csv(work.left)


def panels_report(work: "PanelWork", when: datetime) -> ResultReport:
    """Report of panel setting; `when` is UTC."""
    return ResultReport(
        title="Panel setting",
        subtitle=(f"{work.sheet.name}, reduced by catseye on {when:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ"),
        verdict=work.verdict,
        cards=_cards(work),
        passages=passages(work),
        sections=[
            ReportSection("result", "Result", [*corner_charts(work), *surface_charts(work.latest)]),
            ReportSection("screws", "Screws", _screws(work)),
            ReportSection("crew", "Crew", [*turning_charts(work), *control_charts(work), *_crew(work)]),
            ReportSection("doubts", "Doubtful readings", _doubts(work)),
            origin_section(when, work.inputs),
        ],
        label="catseye: panel setting",
    )


def _stages(work: "PanelWork") -> list[tuple[str, "PanelHeights"]]:
    return [("As found", work.found)] + ([] if work.left is None else [("As left", work.left)])


def _cards(work: "PanelWork") -> list[Card]:
    goal, cards = work.sheet.goal_um, []
    for name, heights in _stages(work):
        one = standing(heights)
        share = f"{100 * one.expected_within:.1f} %" if one.corners else "-"
        cards += [
            Card(name, f"{micrometres(one.rms)} µm rms", f"{one.corners} corners about their neighbours' mean"),
            Card(f"{name}: within {goal:g} µm", share, "expected truly, with the uncertainty"),
        ]
    return cards


def _screws(work: "PanelWork") -> list[Block]:
    rows = sorted((s for s in screws(work.latest) if s.verdict == "turn"), key=lambda s: -abs(s.turns))
    if not rows:
        return [Text("No screw needs a turn.")]
    table = ReportTable(
        (
            text("corner", "corner", [s.corner for s in rows]),
            text("panel", "panel", [s.panel for s in rows]),
            number("height", "height", [s.relative * 1e6 for s in rows], "µm", 1, u="u_height"),
            uncertainty("u_height", "u", [s.u_relative * 1e6 for s in rows], "µm", 1),
            number("turns", "turns", [s.turns for s in rows], digits=3),
            number("degrees", "turns", [360.0 * s.turns for s in rows], "°", 0),
            number("within", "within the goal (probability)", [s.probability_within for s in rows], digits=3),
        ),
        "corner",
    )
    note = f"{len(rows)} turns, the largest first; clockwise is positive. Every corner is in screws.csv."
    return [Text(note), TableBlock("screws", table)]


def _crew(work: "PanelWork") -> list[Block]:
    blocks: list[Block] = []
    for name, heights in _stages(work):
        key = name.lower().replace(" ", "-")
        blocks += [
            Heading(name),
            TableBlock(f"members-{key}", _readers(members(heights), "member")),
            TableBlock(f"sessions-{key}", _readers(sessions(heights), "session"), folded=f"Sessions {name.lower()}"),
        ]
    return blocks


def _readers(readers: list["Reader"], kind: str) -> ReportTable:
    closure = [[v * 1e6 for v in r.closure] for r in readers]
    sides = max((len(c) for c in closure), default=0)
    return ReportTable(
        (
            text("name", kind, [r.name for r in readers]),
            number("readings", "readings", [r.readings for r in readers], digits=0),
            number("variance_factor", "variance factor", [r.variance_factor for r in readers], digits=3),
            number("low", "good: from", [r.low for r in readers], digits=3),
            number("high", "good: to", [r.high for r in readers], digits=3),
            uncertainty("u_gauge", "repeatability", [r.u_gauge * 1e6 for r in readers], "µm", 2),
            number("doubts", "in doubt", [r.doubts for r in readers], digits=0),
            *(
                number(f"closure_{'abcd'[k]}", f"closure {'abcd'[k]}", [c[k] for c in closure], "µm", 1)
                for k in range(sides)
            ),
        )
    )


def _doubts(work: "PanelWork") -> list[Block]:
    blocks: list[Block] = []
    heads = (text("place", "place"), text("corner", "corner"), text("what", "what", kind="long"))
    for name, heights in _stages(work):
        if heights.doubts:
            table = ReportTable.of_rows(
                [(d.where, d.corner, doubt_text(d)) for d in heights.doubts], *heads, name="corner"
            )
            blocks += [Heading(name), TableBlock(f"doubts-{name.lower().replace(' ', '-')}", table)]
    return blocks or [Text("No reading is in significant contradiction to the others.")]
