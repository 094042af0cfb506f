"""Parts of self-contained HTML pages: style, tables, pictures, all escaped."""

import base64
from collections.abc import Iterable, Sequence
from html import escape

STYLE = """
:root { --ink: #22303c; --faint: #6b7883; --line: #dfe5ea; --soft: #f5f7f9; --accent: #1f5a99; --bad: #b3262f; }
* { box-sizing: border-box; }
html { background: #fff; }
body { margin: 0 auto; max-width: 1060px; padding: 2.2rem 1.4rem 4rem; color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
header { border-bottom: 3px solid var(--accent); padding-bottom: .8rem; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .2rem; }
h2 { font-size: 1.3rem; margin: 2.8rem 0 .6rem; padding-bottom: .25rem; border-bottom: 1px solid var(--line); }
h3 { font-size: 1.02rem; margin: 1.5rem 0 .4rem; }
p { margin: .5rem 0; max-width: 78ch; }
.faint, figcaption, caption { color: var(--faint); font-size: .9rem; }
nav { margin: .9rem 0 0; font-size: .9rem; display: flex; flex-wrap: wrap; gap: .2rem 1.1rem; }
a { color: var(--accent); text-decoration: none; } a:hover { text-decoration: underline; }
dl { display: grid; grid-template-columns: 7.5rem 1fr; gap: .45rem 1rem; margin: 1.2rem 0; }
dt { font-weight: 600; } dd { margin: 0; max-width: 82ch; }
figure { margin: 1rem 0 1.4rem; } figure img { display: block; width: 100%; height: auto; }
figcaption { margin-top: .35rem; max-width: 90ch; }
.scroll { overflow: auto; max-height: 46rem; border: 1px solid var(--line); border-radius: 4px; margin: .7rem 0; }
table { border-collapse: collapse; width: 100%; font-size: .87rem; font-variant-numeric: tabular-nums; }
th { position: sticky; top: 0; background: var(--soft); text-align: left; font-weight: 600; line-height: 1.3; }
th, td { padding: .32rem .7rem; border-bottom: 1px solid var(--line); vertical-align: top; }
tr:last-child td { border-bottom: 0; } td.n, th.n { text-align: right; white-space: nowrap; }
td.w { white-space: normal; min-width: 18rem; } td.h { font-family: ui-monospace, monospace; font-size: .78rem; }
.notes li { margin: .2rem 0; } .bad { color: var(--bad); font-weight: 600; }
.verdict { margin: 1.1rem 0; padding: .7rem .95rem; border-radius: 4px; max-width: none; border-left: 6px solid; }
.verdict b { margin-right: .1rem; } .verdict.good { background: #eaf4f0; border-color: #1e8e74; }
.verdict.doubtful { background: #fbf3e2; border-color: #b87a00; }
.verdict.failed { background: #fbecec; border-color: var(--bad); }
summary { cursor: pointer; color: var(--accent); margin: .6rem 0; }
@media print { body { max-width: none; padding: 0; font-size: 10pt; } nav { display: none; }
  .scroll { overflow: visible; max-height: none; border: 0; } figure, tr { break-inside: avoid; }
  h2, h3 { break-after: avoid; } th { position: static; } table { font-size: 8pt; } }
"""


def page(title: str, body: str) -> str:
    """Complete HTML document without scripts or external resources."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def section(key: str, title: str, *parts: str) -> str:
    return (
        f'<section id="{key}">\n<h2>{escape(title)}</h2>\n' + "\n".join(part for part in parts if part) + "\n</section>"
    )


def paragraph(text: str, kind: str = "") -> str:
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def picture(svg: str, caption: str) -> str:
    source = base64.b64encode(svg.encode()).decode()
    alternative = escape(caption, quote=True)
    return (
        f'<figure><img src="data:image/svg+xml;base64,{source}" alt="{alternative}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def table(columns: Sequence[str], rows: Iterable[Sequence[str]], kinds: str) -> str:
    """Scrolling table; `kinds` has a letter per column: n number, t text, w wide text, h hash."""
    head = "".join(f'<th class="{kind}">{escape(name)}</th>' for name, kind in zip(columns, kinds, strict=True))
    lines = (
        "<tr>"
        + "".join(f'<td class="{kind}">{escape(cell)}</td>' for cell, kind in zip(row, kinds, strict=True))
        + "</tr>"
        for row in rows
    )
    return (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>'
        + "\n".join(lines)
        + "</tbody></table></div>"
    )


def folded(title: str, *parts: str) -> str:
    return f"<details><summary>{escape(title)}</summary>" + "\n".join(parts) + "</details>"
