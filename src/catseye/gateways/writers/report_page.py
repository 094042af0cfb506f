"""Self-contained HTML page of a report: its words readable without scripts, its data gzipped inside."""

import base64
import gzip
import json
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from html import escape
from importlib.resources import files
from typing import Any

from catseye.gateways.writers.report import Card, ResultReport, report_object
from catseye.gateways.writers.verdict import verdict_line
from catseye.records.files.report_file import DATA, SHARED
from catseye.version import __version__

POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
ROUNDED = (
    "Numbers of this page are rounded to their useful digits: coordinates to 0.1 µm, standard uncertainties to four "
    "digits. The command's CSV and JSON files have all digits."
)
SHORT = 50  # values of a column; shorter ones are repeated
WITHOUT = (
    "The tables, charts and drawings of this report need a browser with scripts; they load nothing from elsewhere."
)


def report_page(report: ResultReport) -> str:
    """HTML document of a report, without external resources; the same bytes for the same report."""
    data = _compact(_once(report_object(report)))
    packed = base64.b64encode(gzip.compress(data.encode("utf-8"), 9, mtime=0)).decode("ascii")
    style, script = _static("report.css", "style"), _static("report.js", "script")
    return "\n".join(
        (
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
            f"<title>{escape(report.label or report.title)}</title>",
            f'<meta name="generator" content="catseye {__version__}">',
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<style>{style}</style>\n</head>\n<body>",
            *_words(report),
            f"<noscript><p>{WITHOUT}</p></noscript>",
            '<div id="catseye-report"></div>',
            f'<footer><p class="faint">{ROUNDED}</p></footer>',
            f"{DATA}{packed}</script>",
            f"<script>{script}</script>",
            "</body>\n</html>\n",
        )
    )


def _compact(value: Any) -> str:
    return json.dumps(value, allow_nan=False, ensure_ascii=False, separators=(",", ":"))


def _once(report: dict[str, Any]) -> dict[str, Any]:
    """Report whose repeated columns are written once: `{"shared": k}` is the k-th list of `shared`."""
    texts: dict[int, str] = {}

    def columns(part: Any) -> Iterator[list[Any]]:
        if isinstance(part, list) and len(part) >= SHORT and not isinstance(part[0], dict | list):
            yield part
        elif isinstance(part, dict | list):
            for item in part.values() if isinstance(part, dict) else part:
                yield from columns(item)

    for column in columns(report):
        texts[id(column)] = _compact(column)
    count = Counter(texts.values())
    places = {text: k for k, text in enumerate(dict.fromkeys(t for t in texts.values() if count[t] > 1))}
    if not places:
        return report

    def replaced(part: Any) -> Any:
        if isinstance(part, list):
            place = places.get(texts.get(id(part), ""))
            return [replaced(item) for item in part] if place is None else {SHARED: place}
        return {key: replaced(item) for key, item in part.items()} if isinstance(part, dict) else part

    return {**replaced(report), SHARED: [json.loads(text) for text in places]}


def _words(report: ResultReport) -> Iterator[str]:
    """Heading, verdict, cards and passages, escaped."""
    yield f'<header><h1>{escape(report.title)}</h1><div class="faint">{escape(report.subtitle)}</div></header>'
    if report.verdict is not None:
        yield verdict_line(report.verdict)
    if report.cards:
        yield f'<div class="cards">{"".join(map(_card, report.cards))}</div>'
    if report.passages:
        words = "".join(f"<dt>{escape(p.title)}</dt><dd>{escape(p.text)}</dd>" for p in report.passages)
        yield f"<dl>{words}</dl>"


def _card(card: Card) -> str:
    return (
        f'<div class="card"><span class="name">{escape(card.name)}</span><b>{escape(card.value)}</b>'
        f"<span>{escape(card.remark)}</span></div>"
    )


@cache
def _static(name: str, element: str) -> str:
    """Text of a built file, such that it cannot end its element."""
    text = (files("catseye.gateways.writers") / "static" / name).read_text(encoding="utf-8").strip()
    return re.sub(f"</(?={element})", r"<\\/", text, flags=re.IGNORECASE).replace("<!--", r"<\!--")
