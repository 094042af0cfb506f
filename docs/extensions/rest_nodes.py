"""Nodes of reStructuredText that an extension writes into a Markdown page."""

from docutils import nodes
from docutils.utils import new_document
from myst_parser.mocking import MockRSTParser
from sphinx.util.docutils import SphinxDirective


def rest_nodes(directive: SphinxDirective, lines: list[str]) -> list[nodes.Node]:
    """Nodes of lines of reStructuredText, at the place of a directive."""
    document = new_document(directive.state.document["source"], directive.state.document.settings)
    document.reporter = directive.state.document.reporter
    MockRSTParser().parse("\n" * (directive.lineno - 1) + "\n".join(lines), document)
    for node in document.findall(nodes.Element):
        for name in node.get("names", []):
            if not isinstance(node, nodes.section):
                directive.state.document.nameids.setdefault(name, node["ids"][0] if node["ids"] else None)
    return list(document.children)
