"""Directive `gallery`: the figures of a result, drawn at build, with what they show and how to make them.

Its syntax is that of `gallery_blocks`. The build fails where a figure has no line or a line no figure. The report of
a result, where it has one, can be downloaded beside its figures.
"""

import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

from gallery_blocks import GalleryBlock, GalleryCalls, block_of

CALLS = "catseye_gallery_calls"  # key of the page being read
logger = logging.getLogger(__name__)


class Gallery(SphinxDirective):
    """Draw the figures of one result."""

    has_content = True
    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """Commands, and a grid of thumbnails that lead to the figures."""
        page = self.env.current_document
        if CALLS not in page:
            page[CALLS] = GalleryCalls().__enter__()
        calls: GalleryCalls = page[CALLS]
        try:
            block = block_of(self.arguments[0], [*self.block_text.splitlines()[1:-1]])
            found, drawn = calls.figures(block)
        except Exception as problem:  # noqa: BLE001 - whatever it is, it is told with its page and line
            logger.error("gallery: %s: %s", type(problem).__name__, problem, location=self.get_location())
            return []
        grid = nodes.container("", classes=["gallery"])
        for name, figure in drawn.items():
            grid += self._thumbnail(block, name, figure)
        return [self._commands(block), grid, *self._report(found, block)]

    def _commands(self, block: GalleryBlock) -> nodes.Node:
        """Block with the command and the call."""
        text = f"$ {block.command}\n>>> catseye.show({block.call})"
        shown = nodes.literal_block(text, text, language="text", classes=["terminal"])
        self.set_source_info(shown)
        return shown

    def _file(self, name: str, content: str) -> str:
        """Path of a file that the build copies, from the page's folder."""
        where = Path(self.env.doctreedir).resolve() / "gallery" / name
        where.parent.mkdir(parents=True, exist_ok=True)
        where.write_text(content, encoding="utf-8")
        page = Path(self.env.doc2path(self.env.docname)).resolve()
        return Path(os.path.relpath(where, page.parent)).as_posix()

    def _number(self) -> int:
        """Number of the next figure or report of the page."""
        page = self.env.current_document
        page["catseye_gallery_number"] = page.get("catseye_gallery_number", 0) + 1
        return int(page["catseye_gallery_number"])

    def _thumbnail(self, block: GalleryBlock, name: str, figure: Any) -> nodes.Node:
        """Figure with its line."""
        from catseye.gateways.writers.drawing import svg

        word = "".join(c if c.isalnum() else "-" for c in name)
        uri = self._file(f"figure-{self._number()}-{word}.svg", svg(figure))
        image = nodes.image(
            "", uri=uri, alt=f"{name}: {block.lines[name]}", width="100%"
        )  # a width makes it a link to the figure
        caption = nodes.caption("", "", nodes.strong("", name.replace("_", " ")), nodes.Text(f": {block.lines[name]}"))
        made = nodes.figure("", image, caption, classes=["gallery-figure"])
        self.set_source_info(made)
        return made

    def _report(self, found: Any, block: GalleryBlock) -> list[nodes.Node]:
        """Link to the report of the result, if it has one."""
        from catseye.gateways.writers.report_page import report_page

        report = found._report(datetime.now(UTC))
        if report is None:
            return []
        content = report_page(report)
        word = "-".join(block.command.split()[1:3]).replace("/", "-")
        name = f"report-{self._number()}-{word}.html"
        target = "/" + os.path.relpath(
            Path(self.env.srcdir) / Path(self.env.docname).parent / self._file(name, content),
            self.env.srcdir,
        )
        link = addnodes.download_reference("", "", nodes.Text("report.html"), reftarget=target, refdoc=self.env.docname)
        return [nodes.paragraph("", "", nodes.Text("All of it on one page to explore: "), link)]


def close(app: Sphinx, _doctree: nodes.document) -> None:
    """Remove the directory of a page that has been read."""
    page = app.env.current_document
    if CALLS in page:
        page[CALLS].__exit__()
        del page[CALLS]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("gallery", Gallery)
    app.add_css_file("gallery.css")
    app.connect("doctree-read", close)
    return {"version": "1", "env_version": 1, "parallel_read_safe": True, "parallel_write_safe": True}
