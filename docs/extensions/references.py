"""Directive `references`: the bibliography of the package, an anchor for each key."""

import re
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from aligned import prose
from docstrings import names_of
from rest_nodes import rest_nodes

DOI = re.compile(r"\b(?:doi:|DOI )?(10\.\d{4,}/[^\s,;]+[^\s,;.])")


class References(SphinxDirective):
    """List of all sources by key."""

    def run(self) -> list[nodes.Node]:
        """Title, place, use and errata of each source."""
        import catseye.bibliography as bibliography

        self.env.note_dependency(bibliography.__file__)
        names = names_of("module", bibliography)
        made = nodes.definition_list(classes=["sources"])
        for key, source in sorted(bibliography.SOURCES.items()):
            label = f"source-{key.lower()}"
            self.env.domains.standard_domain.note_hyperlink_target(label, self.env.docname, label, f"[{key}]")
            locator = DOI.sub(r"`\1 <https://doi.org/\1>`__", prose(source.locator, names))
            lines = [f"{prose(source.title, names)}. {locator}.", "", f"*Used:* {prose(source.used, names)}.", ""]
            if source.errata:
                lines += ["*Errata found:*", "", *(f"- {prose(text, names)}" for text in source.errata), ""]
            term = nodes.term("", f"[{key}]", ids=[label])
            self.set_source_info(term)
            made += nodes.definition_list_item("", term, nodes.definition("", *rest_nodes(self, lines)))
        return [made]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("references", References)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
