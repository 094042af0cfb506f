"""The walkthroughs of docs/howto/add-*.md as written: each change, block by block, in a copy of the repository.

A block of code with a file as its caption is that file; a `diff` changes it. All blocks together pass the tests that
the page names; with any one of them left out, some test fails.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from repository import ROOT

PAGES = sorted((ROOT / "docs" / "howto").glob("add-*.md"))
COPIED = ("src", "tests", "docs", "studies", "examples", "benchmarks")
FILES = ("pyproject.toml", "conftest.py", "CHANGELOG.md", "CONTRIBUTING.md", "README.md", "constraints.txt", "LICENSE")
BLOCK = re.compile(
    r"^```\{code-block\} (\w+)\n:caption: (\S+)\n((?::[a-z-]+:[^\n]*\n)*)(.*?)^```$", re.MULTILINE | re.DOTALL
)
PYTEST = re.compile(r"^\$ \.venv/bin/python -m pytest (.+)$", re.MULTILINE)
MAKER = re.compile(r"^\$ \.venv/bin/python (examples/.+)$", re.MULTILINE)
OPTIONAL = ":class: optional"  # of a block that no test asks for


@dataclass(frozen=True)
class Change:
    """One block of a page: a new file, or lines of one that change."""

    language: str
    file: str
    body: str
    required: bool

    def apply(self, place: Path) -> None:
        path = place / self.file
        if self.language != "diff":
            assert not path.exists(), f"{self.file} is there already"
            path.write_text(self.body, encoding="utf-8")
            return
        text = path.read_text(encoding="utf-8")
        for hunk in self.body.split("@@\n"):
            text = changed(text, hunk, self.file)
        path.write_text(text, encoding="utf-8")


def changed(text, hunk, file):
    """Text after a hunk of a diff without line numbers; one that only adds goes to the end."""
    lines = hunk.splitlines(keepends=True)
    assert all(line[0] in " +-\n" for line in lines), f"{file}: not a diff: {hunk}"
    lines = [f" {line}" if line == "\n" else line for line in lines]
    old = "".join(line[1:] for line in lines if line[0] in " -")
    new = "".join(line[1:] for line in lines if line[0] in " +")
    if not old:
        return text + new
    assert text.count(old) == 1, f"{file} has {text.count(old)} times: {old}"
    return text.replace(old, new)


def changes_of(page):
    """Blocks of a page in its order."""
    text = page.read_text(encoding="utf-8")
    return [
        Change(language, file, body, OPTIONAL not in options) for language, file, options, body in BLOCK.findall(text)
    ]


def copy(place):
    """Copy of what is committed or about to be."""
    for name in COPIED:
        shutil.copytree(
            ROOT / name, place / name, ignore=shutil.ignore_patterns("__pycache__", "_build", ".ipynb_checkpoints")
        )
    for name in FILES:
        shutil.copy(ROOT / name, place / name)
    return place


def run_tests(page, place):
    """Exit status of the tests that a page names, in a copy, and their output; makers of examples run before."""
    text = page.read_text(encoding="utf-8")
    [targets] = PYTEST.findall(text)
    path = os.pathsep.join([str(place / "src"), str(place / "tests"), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": path}
    for maker in MAKER.findall(text):
        subprocess.run([sys.executable, *shlex.split(maker)], cwd=place, env=environment, check=True)
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", *shlex.split(targets)],
        cwd=place,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_block_fits_the_repository_as_it_is(page, tmp_path):
    """Quick: each file is new, each changed line is there once."""
    changes = changes_of(page)
    assert changes
    assert len(changes) == page.read_text(encoding="utf-8").count("\n:caption: ")
    for change in changes:
        assert change.body
        if change.language == "diff":
            path = tmp_path / change.file
            if not path.exists():
                path.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / change.file, path)
        else:
            assert not (ROOT / change.file).exists()
            (tmp_path / change.file).parent.mkdir(parents=True, exist_ok=True)
        change.apply(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_addition_passes_the_tests_that_the_page_names(page, tmp_path):
    place = copy(tmp_path)
    for change in changes_of(page):
        change.apply(place)
    done = run_tests(page, place)
    assert done.returncode == 0, done.stdout[-6000:]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("page", "omitted"),
    [
        pytest.param(page, number, id=f"{page.stem}-{change.file}")
        for page in PAGES
        for number, change in enumerate(changes_of(page))
        if change.required
    ],
)
def test_a_forgotten_place_is_noticed(page, omitted, tmp_path):
    place = copy(tmp_path)
    for number, change in enumerate(changes_of(page)):
        if number != omitted:
            change.apply(place)
    assert run_tests(page, place).returncode in (1, 2, 4)  # failed, not collected, or named tests are missing


@pytest.mark.parametrize(
    ("text", "hunk", "expected"),
    [("a\nb\n", "-a\n+c\n", "c\nb\n"), ("a\nb\n", " a\n+c\n", "a\nc\nb\n"), ("a\n", "+b\n", "a\nb\n")],
)
def test_a_hunk_changes_its_lines(text, hunk, expected):
    assert changed(text, hunk, "f") == expected


@pytest.mark.parametrize("hunk", ["-x\n+c\n", "-a\n+c\n"])
def test_a_hunk_that_fits_nowhere_or_twice_is_refused(hunk):
    with pytest.raises(AssertionError, match=r"f has [02] times"):
        changed("a\na\n", hunk, "f")
