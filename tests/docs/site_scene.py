"""A small documentation site in a temporary directory, built with the extensions of docs/."""

import io
from pathlib import Path

import pytest


def build(place: Path, pages: dict[str, str], *, extensions: tuple[str, ...], fresh: bool = True, **settings):
    """Build pages to HTML; the application with its status, and the warnings."""
    application = pytest.importorskip("sphinx.application", reason="extra docs is not installed")
    docutils = pytest.importorskip("sphinx.util.docutils")
    source = place / "source"
    for name, text in pages.items():
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        if not (source / name).is_file() or (source / name).read_text(encoding="utf-8") != text:
            (source / name).write_text(text, encoding="utf-8")
    warnings = io.StringIO()
    with docutils.docutils_namespace(), docutils.patch_docutils():
        app = application.Sphinx(
            str(source),
            None,
            str(place / "html"),
            str(place / "doctrees"),
            "html",
            confoverrides={"extensions": ["myst_parser", *extensions], "html_theme": "basic", **settings},
            status=None,
            warning=warnings,
            freshenv=fresh,
        )
        app.build()
    return app, warnings.getvalue()
