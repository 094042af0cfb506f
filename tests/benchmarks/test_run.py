"""The run of all scripts: what one yields before it fails is shown, the failure is named, nothing half is written."""

import ast
import sys

import pytest

import guard
import run
import table
from harness import Curve, Row
from repository import ROOT

HEAD = f"""
import sys
sys.path.insert(0, {str(ROOT / "benchmarks")!r})
from harness import Row, main

def rows(quick):
    yield Row(path="sum", what="n", ours_s=1.0, beside={{"numpy": RATIO}}, limit_s=None, spread=0.0)
"""


def script(folder, name, ratio=2.0, rest=""):
    path = folder / f"bench_{name}.py"
    text = HEAD.replace("RATIO", repr(ratio)).replace('"sum"', repr(name))
    path.write_text(text + rest + '\n\nif __name__ == "__main__":\n    main(rows)\n', encoding="utf-8")
    return path


@pytest.fixture
def place(tmp_path, monkeypatch):
    """Folder of scripts, whose page, figure and baseline would be written beside them; the machine is not measured."""
    monkeypatch.setattr(run, "HERE", tmp_path)
    monkeypatch.setattr(table, "PAGE", tmp_path / "page.md")
    monkeypatch.setattr(table, "FIGURE", tmp_path / "figure.svg")
    monkeypatch.setattr(guard, "BASELINE", tmp_path / "baseline.json")
    limits = ("read_bytes_s", "read_by_two_bytes_s", "write_bytes_s", "multiply_adds_s", "roots_s", "flush_s")
    monkeypatch.setattr(run.limits, "measured", lambda: dict.fromkeys(limits, 1e9))
    return tmp_path


def called(monkeypatch, *words):
    monkeypatch.setattr("sys.argv", ["run.py", *words])
    return run.main()


def test_each_script_has_rows_and_uses_the_harness():
    for path in run.scripts():
        tree = ast.parse(path.read_text(encoding="utf-8"))
        functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
        assert [arg.arg for arg in functions["rows"].args.args] == ["quick"], path.name
        assert any(isinstance(n, ast.ImportFrom) and n.module == "harness" for n in tree.body), path.name


def test_a_name_that_no_script_has_is_refused():
    with pytest.raises(SystemExit, match="unknown benchmark nothing"):
        run.scripts(["phase", "nothing"])
    assert [path.name for path in run.scripts(["phase"])] == ["bench_phase.py"]


def test_a_script_that_fails_is_named_and_its_rows_stay(tmp_path):
    found = run.run(script(tmp_path, "bad", rest='    raise ValueError("no such thing")\n'), quick=True)
    assert [row.path for row in found.rows] == ["bad"]
    assert found.why == "status 1: ValueError: no such thing"


def test_a_script_that_does_not_end_is_stopped(tmp_path):
    found = run.run(script(tmp_path, "slow", rest="    import time; time.sleep(600)\n"), quick=True, longest=3.0)
    assert found.why == "still running after 3 s"


def test_a_whole_run_writes_page_and_baseline(place, monkeypatch, capsys):
    script(place, "one")
    script(place, "two", 3.0)
    assert called(monkeypatch, "--write") == 0
    page = (place / "page.md").read_text(encoding="utf-8")
    assert "| one | n | 1 s | numpy **2.0 x** | - | 0 % |" in page
    assert guard.read_baseline() == {"one: n": {"numpy": 2.0}, "two: n": {"numpy": 3.0}}
    assert called(monkeypatch, "--guard") == 0
    assert "2 ratios compared" in capsys.readouterr().out


def test_nothing_is_written_where_a_script_fails(place, monkeypatch, capsys):
    script(place, "one")
    script(place, "two", rest="    sys.exit('lost')\n")
    assert called(monkeypatch, "--write") == 1
    assert "FAILED: bench_two.py: status 1: lost" in capsys.readouterr().out
    assert sorted(path.name for path in place.iterdir()) == ["bench_one.py", "bench_two.py"]


def test_the_guard_fails_on_a_slower_row_after_it_was_measured_again(place, monkeypatch, capsys):
    script(place, "one", 9.0)
    assert called(monkeypatch, "--write") == 0
    script(place, "one", 5.9)
    assert called(monkeypatch, "--guard") == 1
    out = capsys.readouterr().out
    assert out.count("measured again: bench_one.py") == guard.TRIES - 1
    assert "FALLEN: one: n, beside numpy: ratio 5.9, baseline 9" in out


def test_the_guard_forgives_a_row_that_is_good_when_measured_again(place, monkeypatch):
    """A script that is slow the first time it runs."""
    script(place, "one", 9.0)
    assert called(monkeypatch, "--write") == 0
    flag = place / "ran"
    slow = script(place, "one").read_text(encoding="utf-8")
    ratio = f'9.0 if __import__("pathlib").Path({str(flag)!r}).exists() else 1.0'
    slow = slow.replace('{"numpy": 2.0}', f'{{"numpy": {ratio}}}') + f'    open({str(flag)!r}, "w").close()\n'
    (place / "bench_one.py").write_text(slow, encoding="utf-8")
    assert called(monkeypatch, "--guard") == 0
    assert flag.exists()


def test_a_part_of_the_scripts_cannot_overwrite_the_page(place, monkeypatch, capsys):
    script(place, "one")
    with pytest.raises(SystemExit) as ended:
        called(monkeypatch, "--write", "one")
    assert ended.value.code == 2
    assert "--write" in capsys.readouterr().err


def test_the_page_lists_ratios_notes_what_is_missing_and_exponents():
    rows = [
        Row(
            path="sum",
            what="a | b",
            ours_s=0.002,
            beside={"numpy": 0.01, "scipy": 0.001},
            limit_s=0.001,
            spread=0.051,
            note="agree to 1e-9",
            skipped={"gtsam": "not installed"},
        )
    ]
    curves = [
        Curve("sum", "time", "n", (1.0, 10.0), (1.0, 100.0)),
        Curve("sum", "size", "n", (1.0, 10.0), (2.0, 2.0), "GB"),
    ]
    limits = ("read_bytes_s", "read_by_two_bytes_s", "write_bytes_s", "multiply_adds_s", "roots_s", "flush_s")
    text = table.page(rows, curves, limits=dict.fromkeys(limits, 2e9), load=0.5, took=120.0, date="2026-11-27")
    assert "| sum | a / b | 2 ms | numpy **5.0 x**; scipy **0.5 x** | 0.5 | 5 % |" in text
    assert "- sum, a | b: agree to 1e-9." in text
    assert "- gtsam: not installed (sum)." in text
    assert "| sum, time | n | 2.00 ± 0.00 | 2.00 | 1: 1 s | 10: 100 s |" in text
    assert "| sum, size | n | 0.00 ± 0.00 | 0.00 | 1: 2 GB | 10: 2 GB |" in text
    assert "The run took 2.0 minutes" in text
    assert sys.executable not in text


def test_the_figure_is_the_same_each_time(tmp_path):
    curves = [
        Curve("sum", "time", "n", (1.0, 10.0), (1.0, 100.0)),
        Curve("sum", "size", "n", (1.0, 10.0), (2.0, 2.5), "GB"),
    ]
    drawn = []
    for lines in (curves, curves, curves[:1]):
        table.draw(lines, tmp_path / "figure.svg")
        drawn.append((tmp_path / "figure.svg").read_bytes())
    assert drawn[0] == drawn[1] != drawn[2]
