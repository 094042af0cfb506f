"""Blank form of a triplet's calibration, to print and fill in by hand in the laboratory."""

from collections.abc import Iterable
from html import escape

from catseye.gateways.writers.page import page

TITLE = "Triplet calibration, blank sheet"
MARK = f"<title>{TITLE}"  # identifies a page of catseye
PLACEMENTS = 3
BOXES = """<style>
table.form { table-layout: fixed; margin: .3rem 0 .9rem; } table.form th { background: var(--soft); }
table.form td { height: 1.75rem; border: 1px solid var(--line); vertical-align: middle; }
table.form td.box { background: #fff; } table.form th { border: 1px solid var(--line); }
table.form code { font-size: .8rem; color: var(--faint); }
h2 { margin: 1.1rem 0 .3rem; } ol { margin: .3rem 0; padding-left: 1.3rem; font-size: .88rem; }
.sign { display: grid; grid-template-columns: repeat(3, 1fr); gap: 2.2rem; margin: 2.6rem 0 0; }
.sign div { border-top: 1px solid var(--ink); padding-top: .3rem; font-size: .85rem; color: var(--faint); }
@media print { @page { margin: 12mm; } h2 { margin: .7rem 0 .2rem; } table.form td { height: 1.5rem; } }
</style>"""

HEAD = (
    ("triplet", "unit, as TR01", ""),
    ("measured_on", "day, as 2003-05-14", ""),
    ("by", "person measuring", ""),
    ("air_model", "formula of the ranger's index program", ""),
    ("modulation_hz", "modulation", "Hz"),
    ("wavelength_um", "laser, in vacuum", "µm"),
)
DATA_SHEET = (
    ("bk7_to_air_group_index_ratio", "n, group index of the glass over the air's", "1"),
    ("left_prism.serial", "left prism, odd", ""),
    ("left_prism.height_mm", "D₁, corner to pole point", "mm"),
    ("left_prism.hrp_mm", "H_rp(T₁) = D₁ / n", "mm"),
    ("left_prism.pc_mm", "Pc(T₁), below 0", "mm"),
    ("right_prism.serial", "right prism, even", ""),
    ("right_prism.height_mm", "D₂", "mm"),
    ("right_prism.hrp_mm", "H_rp(T₂) = D₂ / n", "mm"),
    ("right_prism.pc_mm", "Pc(T₂), below 0", "mm"),
    ("ball.r1_mm", "R₁, small ball", "mm"),
    ("ball.r2_mm", "R₂, large ball-cap", "mm"),
    ("ball.pc_b_mm", "Pc_B, below 0", "mm"),
    ("d12_mm", "D₁₂, between T₁ and T₂", "mm"),
    ("u_d12_mm", "standard uncertainty of D₁₂", "mm"),
)
PLATE = (
    ("l1_mm", "L₁, pole point of the left prism, prisms up", "mm"),
    ("l2_mm", "L₂, pole point of the right prism", "mm"),
    ("l_bt_mm", "L_BT, vertex of the ball, facing the plate", "mm"),
    ("l_post_mm", "L_post, half-length of the fixture", "mm"),
    ("u_height_mm", "standard uncertainty of a height", "mm"),
    ("top_surface_mm", "painted top plate, several places (optional)", "mm"),
)
RANGES = (
    ("spacer_mm", "spacer in front of the rear stops", "mm"),
    ("d_toppl_mm", "D_TOPPL: S to back stops, minus L_post and spacer", "mm"),
    ("h_s_mm", "h_S, beam above the line of the prisms", "mm"),
    ("phi_1_rad", "Φ₁, left prism", "rad"),
    ("phi_2_rad", "Φ₂, right prism", "rad"),
    ("phi_zrg_rad", "Φ_ZRG, reference prism", "rad"),
    ("phi_cal_rad", "Φ_Cal, from the ranger's record", "rad"),
    ("temperature_c", "air", "°C"),
    ("pressure_hpa", "air", "hPa"),
    ("humidity_percent", "air", "%"),
    ("phi_bcfp_rad", "FLIPPED: Φ_BCfp, ball", "rad"),
    ("phi_zrg_flipped_rad", "FLIPPED: Φ_ZRG again", "rad"),
    ("temperature_flipped_c", "FLIPPED: air", "°C"),
    ("pressure_flipped_hpa", "FLIPPED: air", "hPa"),
    ("humidity_flipped_percent", "FLIPPED: air", "%"),
    ("u_phase_rad", "standard uncertainty of a phase", "rad"),
)
STEPS = (
    "Surface plate, prisms up: heights of both prisms' faces and of the ball's vertex.",
    "Unit against back and side stops, prisms towards the ranger, upper long side level; distance and height of S.",
    "Phases of both prisms and of the reference prism; temperature, pressure, humidity.",
    "Turn the unit over about its long axis, against the same stops; phase of the ball, reference and weather again.",
    "Repeat the flip, then with spacers. Phases are in [0, 2π); lengths are in millimetres, never inches.",
)


def blank_form() -> str:
    """Form as a self-contained page; each box shows its key in the file."""
    placements = [f"no. {k + 1}" for k in range(PLACEMENTS)]
    body = [
        BOXES,
        f'<header><h1>{TITLE}</h1><div class="faint">beside each box: its key in the sheet for catseye triplet</div>'
        "</header>",
        "<ol>" + "".join(f"<li>{escape(step)}</li>" for step in STEPS) + "</ol>",
        "<h2>Unit</h2>" + _boxes(HEAD, ["value"]),
        "<h2>Data sheet</h2>" + _boxes(DATA_SHEET, ["value"]),
        "<h2>[surface_plate]</h2>" + _boxes(PLATE, ["value"]),
        "<h2>[[placement]], one column each</h2>" + _boxes(RANGES, placements),
        '<div class="sign"><div>measured by, date</div><div>entered by, date</div><div>checked by, date</div></div>',
    ]
    return page(TITLE, "\n".join(body))


def _boxes(rows: Iterable[tuple[str, str, str]], heads: list[str]) -> str:
    top = "<th>quantity</th><th>key</th><th>unit</th>" + "".join(f"<th>{head}</th>" for head in heads)
    widths = '<col style="width:38%"><col style="width:24%"><col style="width:8%">' + "<col>" * len(heads)
    lines = "".join(
        f"<tr><td>{escape(what)}</td><td><code>{key}</code></td><td>{escape(unit)}</td>"
        + '<td class="box"></td>' * len(heads)
        + "</tr>"
        for key, what, unit in rows
    )
    return (
        f'<table class="form"><colgroup>{widths}</colgroup><thead><tr>{top}</tr></thead><tbody>{lines}</tbody></table>'
    )
