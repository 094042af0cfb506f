"""Calibration report forms of the notes for a monument and a mirror, one page each."""

from collections.abc import Callable, Sequence
from datetime import datetime
from html import escape

import numpy as np

from catseye.constants import DEGREE
from catseye.gateways.calibrations.field_report_fields import (
    written_aid,
    written_matrix,
    written_u,
    written_value,
)
from catseye.gateways.certificates.statement import SIGNATURES
from catseye.gateways.writers.page import page
from catseye.geometry.mirror.mount import gamma, lambda_
from catseye.reduction.calibrations.field_report import FORMS, Report, ReportField
from catseye.version import __version__

HEADED = 3  # fields in the form's head: number, date, initials
SERVO_ROWS = 9  # an axis's position at the cube and its eight chip settings
MATRIX_CELLS = 9
WIDTH = 250  # of a sketch, in its own units
AXIS = 62.0  # length of an axis in a sketch
DRAWN = "Rotations in the sketches are exaggerated; all are positive as drawn."
STYLE = """<style>
@page { margin: 9mm 12mm; }
body { max-width: 186mm; padding: 8mm 0; font-size: 9.5pt; line-height: 1.3; }
header { display: flex; justify-content: space-between; align-items: baseline; padding-bottom: .8mm; }
header span { color: var(--faint); font-size: 8pt; }
h1 { font-size: 14.5pt; margin: 0; } h2 { font-size: 9pt; margin: 2.6mm 0 .8mm; border: 0; padding: 0; }
.head { display: grid; grid-template-columns: 1fr 1fr 1.4fr; gap: 6mm; margin: 2mm 0 2.4mm; }
.head div { border-bottom: 1px solid var(--ink); min-height: 6.4mm; display: flex; align-items: end; gap: 2mm; }
.head span { color: var(--faint); font-size: 8.5pt; } .head b { font-size: 10.5pt; line-height: 1.1; }
.two { display: grid; grid-template-columns: 121mm 1fr; gap: 5mm; }
.mirror .two { grid-template-columns: 127mm 1fr; } .mirror .two td.f { width: 58mm; }
.half { display: grid; grid-template-columns: 1fr 1fr; gap: 5mm; }
table { font-size: 9pt; } th { position: static; font-size: 8pt; padding: .4mm 1.5mm; }
td { padding: .35mm 1.5mm; border: 1px solid var(--line); height: 5.2mm; line-height: 1.15; vertical-align: middle; }
tr:last-child td { border-bottom: 1px solid var(--line); }
td small { display: block; white-space: nowrap; color: var(--faint); font-size: 7pt; }
td.v { text-align: right; overflow-wrap: anywhere; } td.v:not(:empty) { font-weight: 600; }
td.u { text-align: right; width: 16mm; } td.unit { width: 13mm; color: var(--faint); } td.f { width: 47mm; }
.half td.f { width: auto; } .half td.v { width: 22mm; }
.half td.unit { width: 27mm; font-size: 7.5pt; white-space: nowrap; }
.mirror td.f small { display: inline; margin-left: 1.5mm; } .half td { height: 4.8mm; }
.matrix td { width: 33.33%; height: 6mm; } .matrix td span { color: var(--faint); margin-right: 3mm; }
.matrix td b { float: right; font-weight: 600; }
.notes { border: 1px solid var(--line); min-height: 20mm; padding: 1mm 2mm; font-size: 8pt; }
.monument .notes { min-height: 40mm; }
.sign { display: grid; grid-template-columns: repeat(3, 1fr); gap: 8mm; margin: 9mm 0 1.2mm; }
.sign div { border-top: 1px solid var(--ink); padding-top: .6mm; font-size: 8pt; color: var(--faint); }
footer { font-size: 7pt; color: var(--faint); overflow-wrap: anywhere; }
svg { display: block; width: 100%; height: auto; }
svg text { font-size: 12px; fill: var(--ink); text-anchor: middle; dominant-baseline: central; }
svg .title { font-size: 11px; font-weight: 600; text-anchor: start; } svg .old { fill: var(--faint); }
svg .said { font-size: 11px; } svg .turn { fill: none; stroke: #d9641e; stroke-width: 1.6; }
svg .angle { fill: #d9641e; font-weight: 600; }
@media print { body { padding: 0; font-size: 9.5pt; } table { font-size: 9pt; } * { print-color-adjust: exact; } }
</style>"""


def mark(kind: str) -> str:
    """Text that identifies a page of a kind as catseye's."""
    return f"<title>{FORMS[kind].title}"


def field_report(report: Report, when: datetime) -> str:
    """HTML page of the form.

    report    filled or blank
    when      UTC, of the filling
    """
    form = FORMS[report.kind]
    head, body = report.fields[:HEADED], report.fields[HEADED:-MATRIX_CELLS]
    servo = [body[-2 * SERVO_ROWS : -SERVO_ROWS], body[-SERVO_ROWS:]] if report.kind == "mirror" else []
    main = body[: len(body) - SERVO_ROWS * len(servo)]
    parts = [
        STYLE,
        f'<div class="{report.kind}">',
        f"<header><h1>{form.title}</h1><span>{form.figure}</span></header>",
        '<div class="head">' + "".join(_headed(field) for field in head) + "</div>",
        f'<div class="two"><div>{_rows(main)}</div><div>{sketches(report.kind)}</div></div>',
        _servo(servo),
        _matrix(report, form.rule),
        _notes(report),
        '<div class="sign">' + "".join(f"<div>{name}: initials, date</div>" for name in SIGNATURES) + "</div>",
        f"<footer>{escape(_origin(report, when))}</footer></div>",
    ]
    name = written_value(report.fields[0])
    return page(f"{form.title} {name}".strip(), "\n".join(part for part in parts if part))


def _headed(field: ReportField) -> str:
    return f"<div><span>{field.entry.name}</span><b>{escape(written_value(field))}</b></div>"


def _rows(fields: Sequence[ReportField]) -> str:
    lines = "\n".join(
        f'<tr><td class="f">{f.entry.name}{_small(f.entry.sense)}</td>'
        f'<td class="v">{escape(written_value(f))}{_small(written_aid(f))}</td>'
        f'<td class="u">{written_u(f)}</td><td class="unit">{f.entry.unit}</td></tr>'
        for f in fields
    )
    return (
        '<table><thead><tr><th>field</th><th class="n">value</th><th class="n">u (1σ)</th><th>unit</th></tr></thead>'
        f"<tbody>{lines}</tbody></table>"
    )


def _servo(axes: Sequence[Sequence[ReportField]]) -> str:
    """Settings of both axes side by side, one table each."""
    if not axes:
        return ""
    tables = [
        "<table><tbody>"
        + "\n".join(
            f'<tr><td class="f">{f.entry.name}{_small(f.entry.sense)}</td>'
            f'<td class="v">{escape(written_value(f))}</td><td class="unit">{f.entry.unit}</td></tr>'
            for f in axis
        )
        + "</tbody></table>"
        for axis in axes
    ]
    return "<h2>Axis 0 is azimuth, axis 1 elevation</h2>" + f'<div class="half">{"".join(tables)}</div>'


def _matrix(report: Report, rule: str) -> str:
    cells = report.fields[-MATRIX_CELLS:]
    matrix_cells = [
        f"<td><span>{field.entry.name}</span><b>{text}</b></td>"
        for field, text in zip(cells, written_matrix(cells), strict=True)
    ]
    rows = "\n".join("<tr>" + "".join(matrix_cells[row : row + 3]) + "</tr>" for row in (0, 3, 6))
    stated = [field.u for field in cells if field.u]
    most = f"; u of an element at most {max(stated):.1e}" if stated else ""
    return f'<h2>{rule}{most}</h2><table class="matrix"><tbody>{rows}</tbody></table>'


def _notes(report: Report) -> str:
    missing = report.missing
    blank_note = ""
    if missing:
        names = ", ".join(entry.name for entry in missing)
        count = f"{len(missing)} field{'' if len(missing) == 1 else 's'}"
        blank_note = f"{count} missing in the record and left blank: {escape(names)}."
    lines = [escape(line) for line in report.notes.splitlines()]
    return f'<h2>NOTES</h2><div class="notes">{"<br>".join([*lines, *([blank_note] if blank_note else [])])}</div>'


def _origin(report: Report, when: datetime) -> str:
    if not report.file:
        return f"Blank form of catseye {__version__}. u is the standard uncertainty (1σ). {DRAWN}"
    words = {"serial": "serial", "valid_until": "valid until", "report": "report"}
    provenance = "".join(
        f", {word} {report.provenance[key]}" for key, word in words.items() if report.provenance[key] is not None
    )
    return (
        f"From {report.file}, SHA-256 {report.sha256}{provenance}. Printed by catseye {__version__}, "
        f"{when:%Y-%m-%d %H:%M:%S} UTC. u is the standard uncertainty (1σ), empty where the record has none. "
        f"{DRAWN}"
    )


def _small(text: str) -> str:
    return f"<small>{text}</small>" if text else ""


def sketches(kind: str) -> str:
    """Sketches of axes and positive senses, with the rotations that compute the matrix.

    kind   monument or mirror
    """
    drawn = (_plan(), _tip(), _pitch()) if kind == "monument" else (_turned_plan(), _turned_side(), _face())
    return "\n".join(drawn)


def _plan() -> str:
    """Monument from above: east right, north up."""
    o, alpha1 = np.array([96.0, 96.0]), 40.0 * DEGREE
    azimuth = np.pi - alpha1
    axes = gamma(alpha1, 0.0, 0.0)[:, :2]
    return _sketch(
        "From above: azimuth, α₁",
        176,
        _arrow(o, (0, 1), "N", old=True),
        _arrow(o, (0, -1), "S", old=True),
        _arrow(o, (1, 0), "E", old=True, length=1.4 * AXIS),
        _arrow(o, axes[0], "x̂"),
        _arrow(o, axes[2], "ẑ"),
        _turn(o, lambda t: gamma(t * alpha1, 0.0, 0.0)[2, :2], "α₁", 46.0),
        _turn(o, lambda t: (np.sin(t * azimuth), np.cos(t * azimuth)), "azimuth", 22.0, named=0.56),
        _through(o, "ŷ up", (-24, 0)),
        _caption((192, 148), "ẑ: fixed point"),
        _caption((192, 162), "to v-block"),
    )


def _tip() -> str:
    """Mount seen from its v-block."""
    o, alpha2 = np.array([92.0, 108.0]), 16.0 * DEGREE

    def axes(t: float) -> np.ndarray:
        return (gamma(0.0, t * alpha2, 0.0) @ gamma(0.0, 0.0, 0.0).T)[:, :2]

    return _sketch(
        "From the v-block: α₂, x̂ rises",
        152,
        _arrow(o, axes(0)[0], "level", old=True, length=1.3 * AXIS),
        _arrow(o, axes(0)[1], "up", old=True),
        _arrow(o, axes(1)[0], "x̂", length=1.3 * AXIS),
        _arrow(o, axes(1)[1], "ŷ"),
        _turn(o, lambda t: axes(t)[0], "α₂", 58.0),
        _through(o, "ẑ towards you", (0, 19)),
    )


def _pitch() -> str:
    """Mount from the side, the v-block on the right."""
    o, alpha3 = np.array([92.0, 108.0]), 16.0 * DEGREE

    def axes(t: float) -> np.ndarray:
        return (gamma(0.0, 0.0, t * alpha3) @ gamma(0.0, 0.0, 0.0).T)[:, [2, 1]]

    return _sketch(
        "Looking along x̂: α₃, v-block sinks",
        152,
        _arrow(o, axes(0)[2], "level", old=True, length=1.3 * AXIS),
        _arrow(o, axes(0)[1], "up", old=True),
        _arrow(o, axes(1)[2], "ẑ v-block", length=1.1 * AXIS),
        _arrow(o, axes(1)[1], "ŷ"),
        _turn(o, lambda t: axes(t)[2], "α₃", 58.0),
        _through(o, "x̂ away from you", (-22, 19), away=True),
    )


def _turned_plan() -> str:
    """Mirror from above, the v-block on the right."""
    return _offset_axes(
        "From above: Δx, Δz, β₂",
        lambda t: lambda_(0.0, t * 16.0 * DEGREE)[:, [2, 0]],
        names=("ẑ", "x̂", "z̃", "x̃"),
        marks=("Δz", "Δx", "β₂"),
        rows=(2, 0),
        third="ŷ up",
    )


def _turned_side() -> str:
    """Mirror from the side, the v-block on the right."""
    return _offset_axes(
        "Looking along x̂: Δy, Δz, β₁",
        lambda t: lambda_(t * 16.0 * DEGREE, 0.0)[:, [2, 1]],
        names=("ẑ", "ŷ", "z̃", "ỹ"),
        marks=("Δz", "Δy", "β₁"),
        rows=(2, 1),
        third="x̂ away",
    )


def _offset_axes(
    title: str,
    axes: Callable[[float], np.ndarray],
    *,
    names: Sequence[str],
    marks: Sequence[str],
    rows: Sequence[int],
    third: str,
) -> str:
    """Mount axes at the ball and mirror axes at the scan point; right and up are positive.

    axes     function of the share of the rotation to the mirror's axes (3, 2) in the sketch
    names    mount axes right and up, mirror axes right and up
    marks    offsets right and up, angle
    rows     of the axes drawn right and up
    third    name of the axis through the paper
    """
    ball, shift = np.array([44.0, 124.0]), np.array([62.0, 44.0])
    point = ball + shift * (1, -1)
    corner = np.array([point[0], ball[1]])
    right, up = rows
    return _sketch(
        title,
        151,
        _arrow(ball, axes(0)[right], names[0], length=2.6 * AXIS),
        _arrow(ball, axes(0)[up], names[1], length=1.25 * AXIS),
        _arrow(point, axes(0)[right], "", old=True, length=1.5 * AXIS),
        _arrow(point, axes(1)[right], names[2], length=1.5 * AXIS),
        _arrow(point, axes(1)[up], names[3], length=0.8 * AXIS),
        _dashed(point, corner),
        _dashed(point, (ball[0], point[1])),
        _caption(corner + np.array([-31, 10]), marks[0]),
        _caption((point[0] + 15, 0.5 * (point[1] + ball[1]) + 8), marks[1]),
        _turn(point, lambda t: axes(t)[right], marks[2], 62.0),
        _through(ball, third, (-14, 17), away="away" in third),
        f'<circle cx="{point[0]:.1f}" cy="{point[1]:.1f}" r="3.5"/>',
    )


def _face() -> str:
    """Mirror axes, seen from the v-block: azimuth of the beam."""
    o, theta = np.array([92.0, 86.0]), 50.0 * DEGREE
    return _sketch(
        "From the v-block: Θ from x̃, Φ from z̃",
        132,
        _arrow(o, (1, 0), "x̃", length=1.3 * AXIS),
        _arrow(o, (0, 1), "ỹ", length=0.9 * AXIS),
        _arrow(o, (np.cos(theta), np.sin(theta)), "beam", old=True),
        _turn(o, lambda t: (np.cos(t * theta), np.sin(t * theta)), "Θ", 34.0),
        _through(o, "z̃ towards you", (-2, 17)),
        _caption((125, 122), "beam (sinΦ cosΘ, sinΦ sinΘ, cosΦ)"),
    )


def _sketch(title: str, height: int, *shapes: str) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" role="img">'
        f'<text class="title" x="0" y="8">{title}</text>{"".join(shapes)}</svg>'
    )


def _arrow(
    start: np.ndarray, direction: Sequence[float] | np.ndarray, name: str, *, old: bool = False, length: float = AXIS
) -> str:
    """Axis with its name; an old one, before the rotation, is faint and dashed.

    Directions are (right, up).
    """
    along = np.asarray(direction, dtype=float) * (1, -1)
    tip = start + length * along
    line = f'x1="{start[0]:.1f}" y1="{start[1]:.1f}" x2="{tip[0]:.1f}" y2="{tip[1]:.1f}"'
    look = 'stroke="#6b7883" stroke-dasharray="4 3"' if old else 'stroke="#1f5a99" stroke-width="1.8"'
    kind = ' class="old"' if old else ""
    x, y = tip + (8 + 3 * len(name)) * along * (1, 0) + 11 * along * (0, 1)
    label = f'<text{kind} x="{x:.1f}" y="{y:.1f}">{name}</text>' if name else ""
    return f"<line {line} {look}/>{_head(tip, along, '#6b7883' if old else '#1f5a99')}{label}"


def _turn(
    centre: np.ndarray,
    path: Callable[[float], Sequence[float] | np.ndarray],
    name: str,
    radius: float,
    named: float = 0.5,
) -> str:
    """Arc of a positive angle, from t = 0 to 1, with its name at t = `named`."""
    points = [centre + radius * np.asarray(path(t), dtype=float) * (1, -1) for t in np.linspace(0.0, 1.0, 33)]
    outline = "L".join(f"{x:.2f} {y:.2f}" for x, y in points)
    out = points[round(32 * named)] - centre
    x, y = centre + out * (1 + (8 + 3 * len(name)) / np.linalg.norm(out))
    head = _head(points[-1], points[-1] - points[-2], "#d9641e")
    label = f'<text class="angle" x="{x:.1f}" y="{y:.1f}">{name}</text>'
    return f'<path class="turn" data-angle="{name}" d="M{outline}"/>{head}{label}'


def _head(tip: np.ndarray, along: np.ndarray, colour: str) -> str:
    """Head of an arrow, as an SVG polygon."""
    unit = along / np.linalg.norm(along)
    side = np.array([-unit[1], unit[0]])
    corners = (tip + 3 * unit, tip - 6 * unit + 3.5 * side, tip - 6 * unit - 3.5 * side)
    return f'<polygon points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in corners)}" fill="{colour}"/>'


def _through(at: np.ndarray, name: str, shift: tuple[float, float], *, away: bool = False) -> str:
    """Axis through the paper: a dot towards the viewer, a cross away."""
    x, y = at
    ring = f'<circle cx="{x}" cy="{y}" r="6" fill="#fff" stroke="#1f5a99" stroke-width="1.6"/>'
    cross = f'<path d="M{x - 4} {y - 4}L{x + 4} {y + 4}M{x - 4} {y + 4}L{x + 4} {y - 4}" stroke="#1f5a99"/>'
    return ring + (cross if away else f'<circle cx="{x}" cy="{y}" r="2.2"/>') + _caption(at + shift, name)


def _dashed(a: np.ndarray, b: Sequence[float] | np.ndarray) -> str:
    return f'<line x1="{a[0]}" y1="{a[1]}" x2="{b[0]}" y2="{b[1]}" stroke="#22303c" stroke-dasharray="2 2"/>'


def _caption(at: Sequence[float] | np.ndarray, text: str) -> str:
    return f'<text class="said" x="{at[0]:.1f}" y="{at[1]:.1f}">{text}</text>'
