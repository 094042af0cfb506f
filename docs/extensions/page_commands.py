"""Commands of a page: found in its text, run in a directory of the page's own."""

import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2] / "src"
WIDTH = 100  # columns of a terminal block
PROGRAM = """# catseye without its progress, whose lines depend on the machine's speed
import math

from catseye.cli import terminal
from catseye.cli.main import run

if __name__ == "__main__":  # not where its processes load it again
    terminal.FIRST_LINE = math.inf
    run()
"""
LONGEST = 300.0  # s that one command may take
READER_LEFT = 128 + signal.SIGPIPE  # of `grep ... | head -1`, when head ends first: 0 in a shell without pipefail
ANSI = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(?:\x07|\x1b\\)|[@-Z\\-_])")
PROGRESS = re.compile(  # lines of a slow machine: "reducing nights 1 of 2, 10 s, some 10 s left", "adjusting 20"
    r"(?m)^(?:[a-z][^\n:]* \d+(?: of \d+)?(?:, for [^\n]+|, [^\n]+ left)|adjusting \d+)(?:\n|$)"
)
FENCE = re.compile(r"^(?P<fence>`{3,}|:{3,})\{(?P<kind>command(?:-file|-figure)?)\}[ \t]*(?P<argument>.*)$")
OPTION = re.compile(r"^:(?P<name>[a-z-]+):[ \t]*(?P<value>.*)$")


@dataclass(frozen=True)
class Block:
    """One directive of a page, with the line of the page where it begins."""

    line: int
    kind: str
    argument: str
    options: dict[str, str]
    body: str

    @property
    def status(self) -> int:
        """Exit status that its last command should have."""
        return int(self.options.get("status", 0))


@dataclass(frozen=True)
class Outcome:
    """Exit status of a command and the text that it printed."""

    status: int
    output: str


def blocks_of(text: str) -> Iterator[Block]:
    """Directives of a Markdown page in order; those inside a larger fence, which are examples, are left out."""
    lines = text.splitlines()
    number = 0
    while number < len(lines):
        opening = re.match(r"^(`{3,}|:{3,}|~{3,})", lines[number])
        if not opening:
            number += 1
            continue
        end = next((k for k in range(number + 1, len(lines)) if lines[k].rstrip() == opening[1]), len(lines))
        match = FENCE.match(lines[number])
        if match:
            yield _block(number + 1, match, lines[number + 1 : end])
        is_container = opening[1].startswith(":") and not match  # a card or a note: its content is of the page
        number = number + 1 if is_container else end + 1


def _block(line: int, match: re.Match[str], content: list[str]) -> Block:
    """Directive of its opening line and the lines up to its end."""
    options: dict[str, str] = {}
    while content and (option := OPTION.match(content[0])):
        options[option["name"]] = option["value"].strip()
        content = content[1:]
    return Block(line, match["kind"], match["argument"].strip(), options, "\n".join(content).strip("\n"))


def commands_of(body: str) -> list[str]:
    """Commands of a block: one a line, or several lines that end in a backslash."""
    joined = re.sub(r"\\\n", "\\\\\0", body)
    return [line.replace("\0", "\n") for line in joined.split("\n") if line.strip()]


@dataclass
class PageDirectory:
    """Temporary directory in which a page's commands run one after the other."""

    _temporary: tempfile.TemporaryDirectory[str] = field(
        default_factory=lambda: tempfile.TemporaryDirectory(prefix="catseye-page-", ignore_cleanup_errors=True)
    )

    def __post_init__(self) -> None:
        self.path.mkdir()
        programs = self.path.parent / "bin"
        programs.mkdir()
        python = shlex.quote(sys.executable)
        (self.path.parent / "catseye.py").write_text(PROGRAM, encoding="utf-8")
        program = shlex.quote(str(self.path.parent / "catseye.py"))
        for name, line in (("catseye", f'{python} -P {program} "$@"'), ("python", f'{python} "$@"')):
            (programs / name).write_text(f"#!/bin/sh\nexec {line}\n", encoding="utf-8")
            (programs / name).chmod(0o755)

    @property
    def path(self) -> Path:
        """Place where the commands run."""
        return Path(self._temporary.name) / "page"

    def write(self, name: str, text: str) -> Path:
        """Write a file of the page; its name leads nowhere else."""
        path = self.file(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n", encoding="utf-8")
        return path

    def file(self, name: str) -> Path:
        """Path of a file in the directory; ValueError for a name that leads out of it."""
        path = (self.path / name).resolve()
        if not name or not path.is_relative_to(self.path.resolve()):
            raise ValueError(f"{name!r} is not a file of the page's own directory")
        return path

    def run(self, command: str, *, longest_s: float = LONGEST) -> Outcome:
        """Run one command by the shell, with both streams in the order in which a terminal shows them."""
        process = subprocess.Popen(
            ["bash", "-o", "pipefail", "-c", command],
            cwd=self.path,
            env=self._environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            encoding="utf-8",
            errors="replace",
            start_new_session=True,
        )
        try:
            printed, _ = process.communicate(timeout=longest_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            printed, _ = process.communicate()
            return Outcome(-signal.SIGKILL, f"{self._shown(printed)}\n(stopped after {longest_s:g} s)".strip())
        status = 0 if process.returncode == READER_LEFT else process.returncode
        return Outcome(status, self._shown(printed))

    def close(self) -> None:
        """Remove the directory."""
        self._temporary.cleanup()

    def _environment(self) -> dict[str, str]:
        """Environment of this process with our `catseye` first on the path and a terminal of fixed width."""
        search = os.pathsep.join(filter(None, [str(SOURCE), os.environ.get("PYTHONPATH")]))
        path = os.pathsep.join([str(self.path.parent / "bin"), os.environ.get("PATH", os.defpath)])
        terminal = {"COLUMNS": str(WIDTH), "LINES": "40", "NO_COLOR": "1", "TERM": "dumb", "TZ": "UTC"}
        return {**os.environ, **terminal, "PATH": path, "PYTHONPATH": search, "OPENBLAS_NUM_THREADS": "1"}

    def _shown(self, printed: str) -> str:
        """Printed text as a page shows it: no colours, no progress, no overwritten lines, no path of this machine."""
        plain = ANSI.sub("", printed).replace("\r\n", "\n")
        plain = "\n".join(line.rsplit("\r", 1)[-1].rstrip() for line in plain.split("\n"))
        for place in (self.path.resolve(), self.path):
            plain = plain.replace(f"{place}/", "").replace(str(place), ".")
        return PROGRESS.sub("", plain).strip("\n")
