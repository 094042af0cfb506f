"""The house stays as it is: small folders, no families of files outside one, and each module stands alone."""

import ast
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from repository import ROOT

PACKAGE = ROOT / "src" / "catseye"
MOST_FILES = 25  # in a folder: more is a filing cabinet
FAMILY = 4  # files of one prefix are a folder


def folders():
    """Folders of ours that hold Python files, each with their stems; a test's without `test_`."""
    for top in (PACKAGE, ROOT / "tests", ROOT / "benchmarks", ROOT / "studies", ROOT / "tools"):
        for folder in (top, *(path for path in top.rglob("*") if path.is_dir() and path.name != "__pycache__")):
            stems = sorted(path.stem.removeprefix("test_") for path in folder.glob("*.py"))
            if stems:
                yield folder.relative_to(ROOT).as_posix(), stems


def families(stems):
    """Prefixes that four files or more share, the file that is the prefix itself included."""
    count = Counter(stem.split("_")[0] for stem in stems if stem != "__init__")
    return sorted(prefix for prefix, number in count.items() if number >= FAMILY)


def test_no_folder_holds_more_than_a_person_oversees():
    assert not {folder: len(stems) for folder, stems in folders() if len(stems) > MOST_FILES}


def test_four_files_of_one_prefix_are_a_folder():
    ours = {folder: found for folder, stems in folders() if (found := families(stems))}
    assert ours == {"benchmarks": ["bench"]}  # a benchmark is named so, as a test is


def test_a_family_is_seen():
    assert families(["live", "live_a", "live_b", "live_c", "lively", "__init__"]) == ["live"]
    assert families(["live", "live_a", "live_b", "lively"]) == []


def test_each_folder_of_the_package_says_what_it_is_and_no_more():
    """An `__init__.py` with a docstring, or doctests, layers and types pass the folder over; and with no import, or it
    makes circles that import-linter does not see, and loads a room into `--help` with its smallest file.
    """
    odd = [
        str(folder)
        for folder in PACKAGE.rglob("*")
        if folder.is_dir()
        and not {"__pycache__", "static"} & set(folder.relative_to(PACKAGE).parts)  # no Python: built by front/
        and not is_docstring(folder / "__init__.py")
    ]
    assert not odd


def is_docstring(path: Path) -> bool:
    """Whether a module is there, and holds its docstring and nothing else."""
    tree = ast.parse(path.read_text(encoding="utf-8")) if path.is_file() else ast.Module([], [])
    return ast.get_docstring(tree) is not None and len(tree.body) == 1


def modules():
    """Path of each module of ours by its name."""
    return {
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): path
        for path in sorted(PACKAGE.rglob("*.py"))
    }


ALONE = """
import importlib, os, sys
import astropy.time, matplotlib.pyplot, numba, pydantic, rich, scipy.optimize, sqlalchemy, typer
broken = []
for name in sys.argv[1:]:
    child = os.fork()
    if not child:
        try:
            importlib.import_module(name)
        except BaseException as problem:
            print(f"{name}: {problem!r}", flush=True)
            os._exit(1)
        os._exit(0)
    broken += [name] if os.waitpid(child, 0)[1] else []
sys.exit(bool(broken))
"""


@pytest.mark.parametrize("which", ["one of every third folder", pytest.param("all", marks=pytest.mark.slow)])
def test_every_module_can_be_imported_alone(which):
    """Each in an interpreter that has loaded libraries, but nothing of ours: a circle hides behind what came before."""
    ours = modules()
    names = list(ours) if which == "all" else list({path.parent: name for name, path in ours.items()}.values())[::3]
    done = subprocess.run([sys.executable, "-c", ALONE, *names], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
