"""Words of the glossary as targets of links: `glossary.md#scan-point`."""

import re

from docutils import nodes
from sphinx.application import Sphinx

PAGE = "glossary"


def slugs(word: str) -> list[str]:
    """Targets of an entry: its words before a bracket, each of several between commas.

    >>> slugs("cat's-eye, ball"), slugs("run (of a journal)")
    (['cats-eye', 'ball'], ['run-of-a-journal', 'run'])
    """
    whole = [word] if "(" in word else word.split(", ")
    texts = [*whole, *([word.partition(" (")[0]] if "(" in word else [])]
    return [re.sub(r"[^\w-]+", "-", text.lower().replace("'", "").replace("’", "")).strip("-") for text in texts]


def add_targets(app: Sphinx, doctree: nodes.document) -> None:
    """Make each word of the glossary a target, the first where a word has two meanings."""
    if app.env.docname != PAGE:
        return
    known = app.env.metadata[PAGE].setdefault("myst_slugs", {})
    for row in doctree.findall(nodes.row):
        if not isinstance(row.parent, nodes.tbody):
            continue
        word = row[0].astext()
        for slug in slugs(word):
            if slug not in known and slug not in doctree.ids:
                row[0]["ids"].append(slug)
                doctree.ids[slug] = row[0]
                known[slug] = (row.line or 0, slug, word)


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the targets when the page is read."""
    app.connect("doctree-read", add_targets)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
