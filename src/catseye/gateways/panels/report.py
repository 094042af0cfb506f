"""All files of a crew's work: list of screws, tables, object, and a report of one HTML page."""

from collections.abc import Callable
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catseye.gateways.panels.objects import (
    FORMAT,
    doubt_text,
    micrometres,
    panels_object,
    panels_verdict,
    passages,
    screws,
)
from catseye.gateways.panels.tables import actuators_csv, crew_csv, panels_csv, readings_csv, screws_csv
from catseye.gateways.writers.objects import json_page, versions
from catseye.gateways.writers.page import card, folded, page, paragraph, picture, section, table
from catseye.gateways.writers.samplers_fits import join_tables
from catseye.gateways.writers.verdict import verdict_line
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.panels.crew import members, sessions, standing

if TYPE_CHECKING:
    from catseye.reduction.panels.crew import Reader
    from catseye.reduction.panels.job import PanelWork

Progress = Callable[[str, int, int], None]
SHOWN = 200  # screws in the report; screws.csv has all
CAPTIONS = {
    "corners": "Each quarter of a panel is the height of its corner over the mean of those that meet there: what "
    "screws set. Grey was not read. The colours end at 98 % of all.",
    "surface": "Left: each panel's mean departure from design and map, the best shift and tilt of the whole dish "
    "taken off: what actuators set. Right: how well it is known.",
    "lie": "Left: share of corners that lie nearer to their neighbours' mean than so much. Right: standard "
    "uncertainties.",
    "control": "Control chart: how readings scatter beside what the sheet claims, by session and by member. Red is out "
    "of control.",
    "turning": "What turning did: change of relative heights between the two tables over what was asked for.",
}


def write_panels(work: "PanelWork", directory: Path, progress: Progress | None = None) -> None:
    """Tables, object, report, and last the provenance with the hashes of the others.

    work        as reduced
    directory   exists, and is ours to fill: see `writers.output.whole_directory`
    progress    told of each file
    """
    when = datetime.now(UTC)
    files: Files = {
        "screws.csv": lambda: screws_csv(work.latest),
        "actuators.csv": lambda: actuators_csv(work.latest),
        "panels.csv": lambda: panels_csv(work),
        "readings.csv": lambda: readings_csv(work.found),
        **({} if work.left is None else {"readings-as-left.csv": lambda: _left(work)}),
        "crew.csv": lambda: crew_csv(work),
        "panels.json": lambda: json_page(panels_object(work)),
        "report.html": lambda: panels_report(work, when),
    }
    provenance = {"format": FORMAT, "made_by": "catseye panels"}
    write_files(files, directory, {**provenance, **origin(when, work.inputs)}, progress=progress)
    join_tables(directory, frame="of each corner or panel: z the normal towards the focus")


def _left(work: "PanelWork") -> str:
    assert work.left is not None
    return readings_csv(work.left)


def panels_report(work: "PanelWork", when: datetime) -> str:
    """The whole page; `when` is UTC."""
    from catseye.gateways.panels.figures import panel_figures

    names = {"result": "Result", "screws": "Screws", "crew": "Crew", "doubts": "In doubt", "provenance": "Provenance"}
    links = "".join(f'<a href="#{key}">{name}</a>' for key, name in names.items())
    header = (
        f'<header><h1>Panel setting</h1><div class="faint">{escape(work.sheet.name)}, reduced by catseye on '
        f"{when:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ</div><nav>{links}</nav></header>"
    )
    drawn = panel_figures(work)
    words = "".join(f"<dt>{escape(p.title)}</dt><dd>{escape(p.text)}</dd>" for p in passages(work))
    figures = {name: picture(drawn[name], text) for name, text in CAPTIONS.items() if name in drawn}
    body = [
        header,
        verdict_line(panels_verdict(work)),
        _cards(work),
        section("result", "Result", f"<dl>{words}</dl>", *(figures[n] for n in ("corners", "lie", "surface"))),
        section("screws", "Screws", _screws(work)),
        section("crew", "Crew", *(figures[n] for n in ("turning", "control") if n in figures), _crew(work)),
        section("doubts", "Readings in doubt", _doubts(work)),
        section(
            "provenance",
            "Provenance",
            table(("file read", "SHA-256"), list(work.inputs.items()), "th"),
            table(("what", "value"), [("made (UTC)", f"{when:%Y-%m-%d %H:%M:%S}"), *versions().items()], "tt"),
        ),
    ]
    return page("catseye: panel setting", "\n".join(body))


def _cards(work: "PanelWork") -> str:
    goal = work.sheet.goal_um
    cards = []
    for name, heights in (("As found", work.found), ("As left", work.left)):
        if heights is None:
            continue
        one = standing(heights)
        cards.append(
            card(name, f"{micrometres(one.rms)} µm rms", f"{one.corners} corners about their neighbours' mean")
        )
        share = f"{100 * one.expected_within:.1f} %" if one.corners else "-"
        cards.append(card(f"{name}: within {goal:g} µm", share, "expected in truth, uncertainty counted"))
    return f'<div class="cards">{"".join(cards)}</div>'


def _screws(work: "PanelWork") -> str:
    rows = sorted((s for s in screws(work.latest) if s.verdict == "turn"), key=lambda s: -abs(s.turns))
    cells = [
        (s.corner, s.panel, micrometres(s.relative, "+.1f"), micrometres(s.u_relative), f"{s.turns:+.3f}",
         f"{360 * s.turns:+.0f}", f"{s.probability_within:.3f}")
        for s in rows[:SHOWN]
    ]  # fmt: skip
    if not cells:
        return paragraph("No screw needs a turn.")
    columns = ("corner", "panel", "height (µm)", "u (µm)", "turns", "degrees", "within the goal (probability)")
    note = f"The {len(cells)} largest of {len(rows)} turns; clockwise above zero. All are in screws.csv."
    return paragraph(note) + table(columns, cells, "ttnnnnn")


def _crew(work: "PanelWork") -> str:
    parts = []
    for name, heights in (("as found", work.found), ("as left", work.left)):
        if heights is None:
            continue
        parts.append(f"<h3>{escape(name.capitalize())}</h3>{_readers(members(heights), 'member')}")
        parts.append(folded(f"Sessions {name}", _readers(sessions(heights), "session")))
    return "".join(parts)


def _readers(readers: list["Reader"], kind: str) -> str:
    def number(value: float, form: str) -> str:
        return format(value, form) if np.isfinite(value) else "-"

    rows = [
        (r.name, str(r.readings), number(r.variance_factor, ".3f"),
         f"{number(r.low, '.3f')} to {number(r.high, '.3f')}",
         micrometres(r.u_gauge, ".2f"), str(r.doubts), " ".join(micrometres(v, "+.1f") for v in r.closure))
        for r in readers
    ]  # fmt: skip
    columns = (
        kind,
        "readings",
        "variance factor",
        "good: between",
        "repeatability (µm)",
        "in doubt",
        "closure a-d (µm)",
    )
    return table(columns, rows, "tnntnnt")


def _doubts(work: "PanelWork") -> str:
    parts = []
    for name, heights in (("as found", work.found), ("as left", work.left)):
        if heights is not None and heights.doubts:
            rows = [(d.where, d.corner, doubt_text(d)) for d in heights.doubts]
            parts.append(f"<h3>{escape(name.capitalize())}</h3>" + table(("place", "corner", "what"), rows, "ttw"))
    return "".join(parts) or paragraph("No reading is contradicted by the others beyond what chance does.")
