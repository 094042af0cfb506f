"""Certificate as a page: one self-contained HTML file, to read, print and sign."""

import base64
from html import escape

from catseye.gateways.certificates.document import (
    BREAK,
    NOT_STATED,
    Block,
    CellTable,
    CertificateDocument,
    Chapter,
    Facts,
    Letterhead,
    Listing,
    Paragraph,
    SvgPicture,
    cells_of,
)
from catseye.gateways.writers.page import page, paragraph, picture, section, table
from catseye.gateways.writers.verdict import verdict_line

PNG = b"\x89PNG"
FEW = 6  # facts in one column
STYLE = """
.letter { display: flex; gap: 1.2rem; align-items: center; border-bottom: 3px solid var(--accent);
  padding-bottom: .7rem; }
.letter img { max-height: 4.4rem; max-width: 14rem; } .letter div { flex: 1; min-width: 0; overflow-wrap: anywhere; }
.letter div { font-size: .86rem; line-height: 1.35; }
.letter b { font-size: 1.05rem; } .letter .accreditation { text-align: right; flex: 0 1 16rem; }
td.t, th.t { hyphens: none; }
h1 { margin: 1.2rem 0 0; }
dl.facts { grid-template-columns: max-content 1fr max-content 1fr; gap: .15rem .9rem; font-size: .88rem; }
p, h1 { overflow-wrap: anywhere; }
dl.few { grid-template-columns: max-content 1fr; }
dl.facts dt { font-weight: 400; color: var(--faint); } dl.facts dd { overflow-wrap: anywhere; }
.scroll { max-height: none; } .block { margin: 1.1rem 0 0; font-weight: 600; font-size: .9rem; }
pre { white-space: pre-wrap; overflow-wrap: anywhere; background: var(--soft); padding: .6rem .9rem; }
.sign { display: grid; grid-template-columns: repeat(3, 1fr); gap: 2.4rem 2rem; margin: 3.2rem 0 1rem; }
.sign div { border-top: 1px solid var(--ink); padding-top: .3rem; font-size: .85rem; color: var(--faint);
  overflow-wrap: anywhere; }
.sign b { display: block; color: var(--ink); }
@media (max-width: 40rem) { dl.facts { grid-template-columns: max-content 1fr; }
  .sign { grid-template-columns: 1fr; } .letter { flex-wrap: wrap; }
  .letter .accreditation { text-align: left; flex-basis: 100%; } }
@media print {
  .sign { break-inside: avoid; break-before: avoid; margin-top: 2.4rem; } .sign div { font-size: 8pt; }
  .scroll { break-inside: auto; } p.block { break-after: avoid; font-size: 8.4pt; margin-top: .8rem; }
  td.w { min-width: 0; } th, td { padding: .2rem .35rem; } thead { display: table-header-group; }
  table { font-size: 7.4pt; table-layout: auto; } section { break-inside: auto; }
  dl.facts, dl.facts dd { font-size: 8.2pt; line-height: 1.45; } td.h { font-size: 6.6pt; }
  h1 { font-size: 17pt; } h2 { font-size: 12pt; margin-top: 1.4rem; }
  p { max-width: none; font-size: 9pt; line-height: 1.4; } p.faint { font-size: 7.6pt; line-height: 1.35; }
  .letter div { font-size: 8.4pt; } .letter img { max-height: 15mm; } .verdict { padding: .4rem .8rem; }
  * { print-color-adjust: exact; } }
"""


def certificate_html(document: CertificateDocument) -> str:
    """HTML page of a certificate."""
    body = [
        f"<style>{STYLE}{_page_style(document)}</style>",
        _letterhead(document.letterhead),
        f"<h1>{escape(document.heading)}</h1>",
        f'<p class="faint">{escape(document.subject)}</p>',
        verdict_line(document.verdict),
        _block(document.facts),
        _results(document),
        *(_chapter(chapter) for chapter in document.chapters),
    ]
    text = page(f"{document.heading}: {document.subject}", "\n".join(body))
    return text.replace(BREAK, "<wbr>").replace("<head>\n", f"<head>\n<!-- {' '.join(document.marks)} -->\n", 1)


def _page_style(document: CertificateDocument) -> str:
    """Margins of the printed page, with the number and the page in its foot."""
    return (
        "@page { size: A4; margin: 16mm 14mm 18mm; "
        f"@bottom-left {{ content: {_css_text(document.heading)}; font: 7.5pt sans-serif; color: #6b7883; }} "
        '@bottom-right { content: "page " counter(page) " of " counter(pages); font: 7.5pt sans-serif; '
        "color: #6b7883; } }"
    )


def _css_text(text: str) -> str:
    """CSS string of any text, every odd character as its number.

    >>> _css_text('a</b>')
    '"a\\\\00003c\\\\00002fb\\\\00003e"'
    """
    return '"' + "".join(c if (c.isalnum() and c.isascii()) or c == " " else f"\\{ord(c):06x}" for c in text) + '"'


def _letterhead(letterhead: Letterhead) -> str:
    logo = ""
    if letterhead.logo:
        kind = "image/png" if letterhead.logo.startswith(PNG) else "image/svg+xml"
        source = base64.b64encode(letterhead.logo).decode()
        logo = f'<img src="data:{kind};base64,{source}" alt="{escape(letterhead.name, quote=True)}">'
    lines = "<br>".join(escape(line) for line in letterhead.lines)
    return (
        f'<header class="letter">{logo}<div><b>{escape(letterhead.name)}</b><br>{lines}</div>'
        f'<div class="accreditation">accreditation<br>{escape(letterhead.accreditation)}</div></header>'
    )


def _results(document: CertificateDocument) -> str:
    """Results with the signatures beneath the table, on the same page of paper where it ends."""
    table_of_results, *explanations = document.results.blocks
    parts = [_block(table_of_results), _signatures(document.signatures), *(_block(block) for block in explanations)]
    return section(document.results.key, document.results.title, *parts)


def _signatures(signatures: tuple[tuple[str, str], ...]) -> str:
    lines = "".join(
        f"<div>{f'<b>{escape(name)}</b>' if name else ''}{escape(role)}, date, signature</div>"
        for role, name in signatures
    )
    return f'<div class="sign">{lines}</div>'


def _chapter(chapter: Chapter) -> str:
    return section(chapter.key, chapter.title, *(_block(block) for block in chapter.blocks))


def _block(block: Block) -> str:
    match block:
        case Facts():
            rows = "".join(
                f"<dt>{escape(name)}</dt><dd{' class=faint' if text == NOT_STATED else ''}>{escape(text)}</dd>"
                for name, text in block.rows
            )
            few = " few" if len(block.rows) <= FEW else ""
            return f'<dl class="facts{few}">{rows}</dl>'
        case Paragraph():
            return paragraph(block.text, "faint" if block.faint else "")
        case CellTable():
            caption = f'<p class="block">{escape(block.caption)}</p>' if block.caption else ""
            return caption + table(block.columns, cells_of(block), block.kinds)
        case SvgPicture():
            return picture(block.svg, block.caption)
        case Listing():
            lines = escape("\n".join(block.lines))
            return f'<p class="block">{escape(block.caption)}</p><pre>{lines}</pre>'
