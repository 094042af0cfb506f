"""Every line of the README that a reader would type works from a fresh wheel, where no repository is near."""

import json
import re
import shlex
import subprocess
import sys
import venv

import pytest

from contracts.wheel_scene import built, run_there, unpacked
from repository import ROOT

NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))
SERVING = ("serve", "view")  # until Ctrl-C: tests/cli/live and tests/browser try them
LONGEST = 60.0  # s of the processor that a line may take without having said so beforehand
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def pieces():
    """Commands and Python blocks in the order of the page: ("catseye", JSON of its words) or ("python", source)."""
    found = [
        (match.start(), "catseye", json.dumps(shlex.split(match[1])))
        for match in re.finditer(r"(?m)(?:^    \$ |`)(catseye [a-z][^`\n]*)", TEXT)
        if match[1].split()[1] not in SERVING
    ]
    found += [(m.start(), "python", m[1]) for m in re.finditer(r"(?ms)^```python\n(.*?)^```", TEXT)]
    return [(kind, text) for _, kind, text in sorted(found)]


def cells(path):
    """Source of each code cell of a notebook."""
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            yield "".join(cell["source"])


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    return built(tmp_path_factory.mktemp("dist"))


def refused(ran):
    """Lines that failed or took longer than a reader waits unwarned."""
    return [
        (text, each)
        for (_, text), each in zip(pieces(), ran, strict=True)
        if each["status"] or each["seconds"] > LONGEST
    ]


def test_the_page_is_a_screen_and_a_half_with_a_picture_and_lines_to_type():
    assert len(TEXT) < 7000
    assert "](docs/" in TEXT
    kinds = [kind for kind, _ in pieces()]
    assert kinds.count("catseye") >= 9
    assert kinds.count("python") == 1


@pytest.fixture(scope="module")
def ran(wheel, tmp_path_factory):
    """What each piece of the page did, and `catseye demo` after them, in one process that knows the wheel alone."""
    place = tmp_path_factory.mktemp("reader")
    site = unpacked(wheel, place / "site")
    (place / "work").mkdir()
    demo = ("catseye", json.dumps(["catseye", "demo"]))
    return run_there(place / "work", [*pieces(), demo], sys.executable, site)


def test_every_line_works_from_a_wheel(ran):
    assert refused(ran[:-1]) == []


def test_what_the_page_shows_of_the_demo_is_what_it_says(ran):
    """The lines under `make demo`, word for word."""
    shown = re.search(r"(?ms)^    \$ make demo\n(.*?)\n\n", TEXT)
    said = " ".join(ran[-1]["said"].split())
    for line in " ".join(shown[1].split()).split(" ... "):
        assert line in said


@pytest.mark.slow
def test_every_line_works_where_the_wheel_was_installed(wheel, tmp_path):
    environment = tmp_path / "venv"
    venv.create(environment, with_pip=True)
    python = environment / "bin" / "python"
    constraints = ROOT / "constraints.txt"
    subprocess.run([python, "-m", "pip", "install", "-q", "--constraint", constraints, f"{wheel}[scale]"], check=True)
    (tmp_path / "work").mkdir()
    (site,) = (environment / "lib").glob("python*/site-packages")
    assert refused(run_there(tmp_path / "work", pieces(), python, site)) == []
    notebooks = [("python", source) for path in NOTEBOOKS for source in cells(path)]
    (tmp_path / "notebooks").mkdir()
    assert [each for each in run_there(tmp_path / "notebooks", notebooks, python, site) if each["status"]] == []
    weather = "--temperature-c 20 --pressure-hpa 933 --humidity-percent 50"
    shown = subprocess.run(
        [environment / "bin" / "catseye", "air", *weather.split()],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert "group index" in shown.stdout
