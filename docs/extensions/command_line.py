"""Directives of commands: `command` runs lines of a terminal and shows them with their output.

    ```{command}
    catseye reduce night-01 --out night
    ```

`command` runs each line in order in a directory of the page's own, with `catseye` this checkout's. A line that
ends in a backslash goes on in the next. Options: `:lines: 12` shows the first lines of each output; `:hide-output:`
shows none; `:hide:` shows nothing at all; `:status: 1` is the exit status to expect. Any other status fails the build,
with page and line.

`command-file NAME` writes its content to a file of that directory and shows it. `command-figure NAME` shows a
figure that an earlier command of the page wrote; `:alt:` describes it.

A page runs when it is read: an incremental build runs the pages that changed and those that failed, a parallel one
runs pages beside each other.
"""

import os
import shutil
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

from page_commands import PageDirectory, commands_of

DIRECTORY = "catseye_page_directory"  # key of the page being read
logger = logging.getLogger(__name__)


def failures_of(env: BuildEnvironment) -> set[str]:
    """Pages with a command that failed."""
    if not hasattr(env, "catseye_failures"):
        env.catseye_failures = set()
    return env.catseye_failures


class PageDirective(SphinxDirective):
    """Directive that works in the directory of its page."""

    @property
    def directory(self) -> PageDirectory:
        """Directory of this page, made at its first use."""
        page = self.env.current_document
        if DIRECTORY not in page:
            page[DIRECTORY] = PageDirectory()
        return page[DIRECTORY]

    def refuse(self, text: str) -> list[nodes.Node]:
        """Fail the build at this line."""
        failures_of(self.env).add(self.env.docname)
        logger.error(text, location=self.get_location(), type="command_line")
        return []

    def literal(self, text: str, language: str) -> nodes.literal_block:
        """Block of fixed-width text."""
        block = nodes.literal_block(text, text, language=language, classes=["terminal"])
        self.set_source_info(block)
        return block


class Command(PageDirective):
    """Run commands and show them with their output."""

    has_content = True
    option_spec: ClassVar[dict[str, Any]] = {
        "lines": directives.positive_int,
        "status": int,
        "hide-output": directives.flag,
        "hide": directives.flag,
    }

    def run(self) -> list[nodes.Node]:
        """Terminal block of all commands."""
        commands = commands_of("\n".join(self.content))
        if not commands:
            return self.refuse("a command block has no command")
        shown = []
        for number, command in enumerate(commands, 1):
            outcome = self.directory.run(command)
            expected = self.options.get("status", 0) if number == len(commands) else 0
            if outcome.status != expected:
                first = command.split("\n")[0]
                self.refuse(
                    f"`{first}` ended with status {outcome.status}, expected {expected}\n{outcome.output}".strip()
                )
            shown.append(f"$ {command}")
            if outcome.output and "hide-output" not in self.options:
                shown.append(self.shortened(outcome.output))
        return [] if "hide" in self.options else [self.literal("\n".join(shown), "console")]

    def shortened(self, output: str) -> str:
        """First lines of an output, with a mark where more follow."""
        lines = output.split("\n")
        most = self.options.get("lines", len(lines))
        return "\n".join(lines if len(lines) <= most else [*lines[:most], "..."])


class CommandFile(PageDirective):
    """Write a file for the commands of the page, and show it."""

    has_content = True
    required_arguments = 1
    option_spec: ClassVar[dict[str, Any]] = {"language": directives.unchanged, "hide": directives.flag}
    LANGUAGES: ClassVar[dict[str, str]] = {".toml": "toml", ".json": "json", ".py": "python", ".xml": "xml"}

    def run(self) -> list[nodes.Node]:
        """Block with the file's name above it."""
        name, text = self.arguments[0], "\n".join(self.content)
        try:
            self.directory.write(name, text)
        except ValueError as problem:
            return self.refuse(str(problem))
        if "hide" in self.options:
            return []
        language = self.options.get("language", self.LANGUAGES.get(Path(name).suffix, "text"))
        container = nodes.container("", literal_block=True, classes=["literal-block-wrapper"])
        caption = nodes.caption("", "", nodes.literal(name, name))
        self.set_source_info(caption)
        return [nodes.container("", caption, self.literal(text, language), **container.attributes)]


class CommandFigure(PageDirective):
    """Show a figure that an earlier command of the page wrote."""

    required_arguments = 1
    option_spec: ClassVar[dict[str, Any]] = {
        "alt": directives.unchanged_required,
        "width": directives.length_or_percentage_or_unitless,
    }

    def run(self) -> list[nodes.Node]:
        """Figure with the alternative text that says what it shows."""
        name = self.arguments[0]
        if not self.options.get("alt"):
            return self.refuse(f"command-figure {name} needs :alt: with what the figure shows")
        try:
            written = self.directory.file(name)
        except ValueError as problem:
            return self.refuse(str(problem))
        if not written.is_file():
            return self.refuse(f"command-figure {name}: no earlier command of the page wrote it")
        copied = Path(self.env.doctreedir) / "commands" / self.env.docname / name
        copied.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(written, copied)
        page = Path(self.env.doc2path(self.env.docname)).resolve()
        uri = Path(os.path.relpath(copied.resolve(), page.parent)).as_posix()
        image = nodes.image("", uri=uri, alt=self.options["alt"])
        if "width" in self.options:
            image["width"] = self.options["width"]
        figure = nodes.figure("", image, classes=["command-figure"])
        self.set_source_info(figure)
        return [figure]


def close_page(app: Sphinx, _doctree: nodes.document) -> None:
    """Remove the directory of a page that has been read."""
    page = app.env.current_document
    if DIRECTORY in page:
        page[DIRECTORY].close()
        del page[DIRECTORY]


def forget(_app: Sphinx, env: BuildEnvironment, docname: str) -> None:
    """Forget the failure of a page that is read anew."""
    failures_of(env).discard(docname)


def merge(_app: Sphinx, env: BuildEnvironment, _docnames: list[str], other: BuildEnvironment) -> None:
    """Take the failures of a parallel reader."""
    failures_of(env).update(failures_of(other))


def outdated(
    _app: Sphinx, env: BuildEnvironment, _added: set[str], _changed: set[str], _removed: set[str]
) -> list[str]:
    """Pages to run again since a command failed."""
    return sorted(failures_of(env))


def finish(app: Sphinx, problem: Exception | None) -> None:
    """Fail the build for a failed command, also where warnings pass."""
    if problem is None and failures_of(app.env):
        app.statuscode = 1


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directives."""
    app.add_directive("command", Command)
    app.add_directive("command-file", CommandFile)
    app.add_directive("command-figure", CommandFigure)
    app.connect("doctree-read", close_page)
    app.connect("env-purge-doc", forget)
    app.connect("env-merge-info", merge)
    app.connect("env-get-outdated", outdated)
    app.connect("build-finished", finish)
    return {"version": "1", "env_version": 1, "parallel_read_safe": True, "parallel_write_safe": True}
