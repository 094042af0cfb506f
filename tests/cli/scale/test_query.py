"""`catseye query`: what it says, in which form, and how long one point of a year takes."""

import json
import subprocess
import sys

import pytest

from archive_scene import flip, written_year
from command_scene import command_line


@pytest.fixture(scope="module")
def year(tmp_path_factory):
    place = tmp_path_factory.mktemp("year") / "archive"
    return written_year(place, nights=30, points=15)


@pytest.fixture
def catseye(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return command_line(capsys)


def test_a_point_for_people_and_for_programs(catseye, year, tmp_path):
    status, said, complaint = catseye("query", year.directory, "--point", "ZP00003", "--out", "out")
    assert (status, complaint) == (0, "")
    for words in ("Good: 30 nights", "ZP00003, dish prism", "u_x_mm", "... 6 more rows", "Written to"):
        assert words in said
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        *("date.svg", "elevation.svg", "point.csv", "provenance.json", "result.json", "temperature.svg"),
    ]
    status, said, complaint = catseye("query", year.directory, "--point", "ZP00003", "--json")
    assert (status, complaint) == (0, "")
    assert len(json.loads(said)["point"]) == 30


def test_sql_prints_its_rows(catseye, year):
    status, said, _ = catseye("query", year.directory, "--sql", "SELECT count(*) AS nights FROM nights")
    assert status == 0
    assert said.splitlines()[-2:] == ["nights", "30"]


@pytest.mark.parametrize(
    ("words", "status", "text"),
    [
        (("--point", "nobody"), 1, "point 'nobody' is not in the archive"),
        (("--sql", "COPY points TO 'x.csv'"), 1, "sql has COPY"),
        (("--point", "ZP00003", "--ranger", "ZY101"), 2, "--point and --ranger are several questions"),
        (("--ranger", "ZY101", "--frame", "reflector"), 2, "--frame goes with --point only"),
        (("--sql", "SELECT 1", "--from", "2026-01-01"), 2, "--from does not go with --sql"),
    ],
)
def test_refusals_name_the_options(catseye, year, words, status, text, tmp_path):
    found, said, complaint = catseye("query", year.directory, *words, "--out", "out")
    assert (found, said, complaint.count("\n")) == (status, "", 1)
    assert text in complaint
    assert not list(tmp_path.iterdir())


def test_a_damaged_file_is_named_and_nothing_written(catseye, tmp_path):
    year = written_year(tmp_path / "archive", nights=3, points=15)
    path = year.directory / year.files("points")[1].path
    flip(path, 200)
    status, said, complaint = catseye("query", year.directory, "--point", "ZP00003", "--out", "out")
    assert (status, said) == (1, "")
    assert path.name in complaint
    assert not (tmp_path / "out").exists()


def test_one_point_spares_the_heavy_imports(year):
    code = (
        "import atexit, sys\n"
        "heavy = {'scipy', 'matplotlib', 'astropy', 'pyarrow', 'numba', 'pandas'}\n"
        "atexit.register(lambda: print(sorted(heavy & set(sys.modules)), file=sys.stderr))\n"
        "from catseye.cli.main import run; run()"
    )
    words = ["query", str(year.directory), "--point", "ZP00003", "--json"]
    done = subprocess.run([sys.executable, "-c", code, *words], check=True, capture_output=True, text=True)
    assert done.stderr.strip() == "[]"
    assert len(json.loads(done.stdout)["point"]) == 30
