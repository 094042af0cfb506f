"""Directive `sections`: sections and equations of a document, with the commands that lead there and their formulas."""

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import sections
from rest_nodes import rest_nodes

WIDTHS = (22, 34, 20, 24)


class SectionTable(SphinxDirective):
    """Table a chapter of one document, named by its key in the bibliography."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Headings and tables."""
        self.env.note_dependency(str(sections.ROOT / "docs" / "sections.toml"))
        found: list[nodes.Node] = []
        rows = [row for row in sections.rows() if row.document == self.arguments[0]]
        for chapter in dict.fromkeys(row.chapter for row in rows):
            lines = [".. list-table::", "   :header-rows: 1", f"   :widths: {' '.join(map(str, WIDTHS))}", ""]
            lines += self._line("section", "content", "command", "formulas")
            for row in rows:
                if row.chapter == chapter:
                    lines += self._line(row.place, row.content, self._doors(row), self._formulas(row))
            found += [nodes.rubric(chapter, chapter), *rest_nodes(self, lines)]
        return found

    def _line(self, *cells: str) -> list[str]:
        return [f"   {'*' if k == 0 else ' '} - {cell}" for k, cell in enumerate(cells)]

    def _doors(self, row: sections.Row) -> str:
        if not row.computes:
            return row.doors[0].replace("`", "``")
        return ", ".join(f"``{door}``" for door in row.doors)

    def _formulas(self, row: sections.Row) -> str:
        """Files that cite the row and are reached by one of its doors."""
        if not row.computes:
            return ""
        reached = {node for door in row.doors for node in sections.formulas(row, door)}
        files = sorted({module.removeprefix("catseye.").replace(".", "/") for module, _ in reached})
        return ", ".join(f"``{file}``" for file in files)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("sections", SectionTable)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
