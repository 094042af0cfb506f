"""`make docs`: every part runs, and one that fails fails the whole."""

import sys

import pytest

from docs import make_docs


@pytest.fixture
def place(tmp_path, monkeypatch):
    (tmp_path / "conf.py").write_text("", encoding="utf-8")
    monkeypatch.setattr(make_docs, "browser_lacks", lambda: "no chromium")

    def with_parts(*sources):
        named = [(f"part {k}", [sys.executable, "-c", source]) for k, source in enumerate(sources)]
        monkeypatch.setattr(make_docs, "parts", lambda source, built: named)
        return [str(tmp_path), str(tmp_path / "built")]

    return with_parts


def test_all_parts_run_and_the_cost_is_said(place, tmp_path, capsys):
    log = tmp_path / "log"
    line = f"open({str(log)!r}, 'a').write('x')"
    assert make_docs.main(place(line, line)) == 0
    assert log.read_text(encoding="utf-8") == "xx"
    said = capsys.readouterr().out
    assert "SKIPPED: no chromium" in said
    assert "index.html" in said
    assert said.rstrip().endswith("s of processor time")


def test_a_part_that_fails_fails_the_whole_and_stops_no_other(place, tmp_path, capsys):
    log = tmp_path / "log"
    assert make_docs.main(place("raise SystemExit(3)", f"open({str(log)!r}, 'a').write('x')")) == 1
    assert log.is_file()
    assert "docs: part 0 FAILED (status 3)" in capsys.readouterr().err


def test_a_folder_without_settings_is_refused(tmp_path, capsys):
    assert make_docs.main([str(tmp_path), str(tmp_path)]) == 2
    assert "usage" in capsys.readouterr().err
