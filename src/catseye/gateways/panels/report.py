"""Files of panel setting: list of screws, tables, JSON and an HTML report."""

from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catseye.aliases import Progress
from catseye.gateways.panels.objects import (
    FORMAT,
    doubt_text,
    micrometres,
    panels_object,
    panels_verdict,
    passages,
    screws,
)
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
from catseye.gateways.writers.objects import json_page, versions
from catseye.gateways.writers.page import card, folded, page, paragraph, picture, section, table
from catseye.gateways.writers.samplers_fits import join_tables
from catseye.gateways.writers.verdict import verdict_line
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.panels.crew import members, sessions, standing

if TYPE_CHECKING:
    from catseye.reduction.panels.crew import Reader
    from catseye.reduction.panels.job import PanelWork

MOST_LISTED = 200  # screws in the report; screws.csv has all
CAPTIONS = {
    "corners": "Each quarter of a panel shows the height of its corner above the mean of those that meet there, which "
    "screws adjust. Grey: not read. The colours end at 98 % of all.",
    "surface": "Left: each panel's mean departure from design and map, after the best shift and tilt of the complete "
    "dish, which actuators adjust. Right: its standard uncertainty.",
    "lie": "Left: share of corners within a distance from their neighbours' mean. Right: standard uncertainties.",
    "control": "Control chart: scatter of the readings against the sheet's claim, by session and by member. Red: out "
    "of control.",
    "turning": "Effect of turning: change of relative heights between the two tables against the requested change.",
}


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
        "report.html": lambda: panels_report(work, when),
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


def panels_report(work: "PanelWork", when: datetime) -> str:
    """HTML report; `when` is UTC."""
    from catseye.gateways.panels.figures import panel_figures

    names = {
        "result": "Result",
        "screws": "Screws",
        "crew": "Crew",
        "doubts": "Doubtful readings",
        "provenance": "Provenance",
    }
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
        section("doubts", "Doubtful readings", _doubts(work)),
        section(
            "provenance",
            "Provenance",
            table(("file read", "SHA-256"), list(work.inputs.items()), "th"),
            table(("item", "value"), [("made (UTC)", f"{when:%Y-%m-%d %H:%M:%S}"), *versions().items()], "tt"),
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
        cards.append(card(f"{name}: within {goal:g} µm", share, "expected truly, with the uncertainty"))
    return f'<div class="cards">{"".join(cards)}</div>'


def _screws(work: "PanelWork") -> str:
    rows = sorted((s for s in screws(work.latest) if s.verdict == "turn"), key=lambda s: -abs(s.turns))
    cells = [
        (s.corner, s.panel, micrometres(s.relative, "+.1f"), micrometres(s.u_relative), f"{s.turns:+.3f}",
         f"{360 * s.turns:+.0f}", f"{s.probability_within:.3f}")
        for s in rows[:MOST_LISTED]
    ]  # fmt: skip
    if not cells:
        return paragraph("No screw needs a turn.")
    columns = ("corner", "panel", "height (µm)", "u (µm)", "turns", "degrees", "within the goal (probability)")
    note = f"The {len(cells)} largest of {len(rows)} turns; clockwise is positive. All are in screws.csv."
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
    return "".join(parts) or paragraph("No reading is in significant contradiction to the others.")
