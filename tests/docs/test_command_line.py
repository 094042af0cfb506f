"""Directives of commands: what is shown, in which order, and how a failure ends the build."""

import re

import pytest

from docs.site_scene import build
from page_commands import Outcome, PageDirectory, blocks_of, commands_of

EXTENSIONS = ("command_line",)
DOT = '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><circle r="4"/></svg>'
PAGE = f"""# Page

```{{command-file}} dot.svg
{DOT}
```

```{{command}}
catseye --version
printf '\\033[1mbold\\033[0m\\n' > a.txt; cat a.txt
seq 5
```

```{{command}}
:lines: 2
seq 4 \\
    8
```

```{{command}}
:status: 3
exit 3
```

```{{command-figure}} dot.svg
:alt: A dot
```
"""


def shown(place, page="index"):
    html = (place / "html" / f"{page}.html").read_text(encoding="utf-8")
    return re.sub(r"<[^>]+>", "", html)


def test_commands_run_in_order_and_are_shown_with_their_output(tmp_path):
    app, warnings = build(tmp_path, {"index.md": PAGE}, extensions=EXTENSIONS)
    assert (app.statuscode, warnings) == (0, "")
    text = shown(tmp_path)
    assert re.search(r"\$ catseye --version\ncatseye \d", text)
    assert "cat a.txt\nbold\n" in text
    assert "$ seq 5\n1\n2\n3\n4\n5\n" in text
    assert "$ seq 4 \\\n    8\n4\n5\n...\n" in text
    assert (tmp_path / "html" / "_images" / "dot.svg").read_text(encoding="utf-8").strip() == DOT


def test_a_reader_that_leaves_early_is_no_failure():
    page = PageDirectory()
    try:
        assert page.run("yes | head -1") == Outcome(0, "y")
        assert page.run("exit 3 | head -1").status == 3
    finally:
        page.close()


@pytest.mark.parametrize(
    ("block", "line", "text"),
    [
        ("```{command}\necho ready\nexit 4\n```", 3, "`exit 4` ended with status 4, expected 0"),
        ("```{command}\n:status: 1\ntrue\n```", 3, "`true` ended with status 0, expected 1"),
        ("```{command}\nfalse | cat\n```", 3, "`false | cat` ended with status 1"),
        ("```{command}\n```", 3, "a command block has no command"),
        ("```{command-figure} a.svg\n:alt: A\n```", 3, "no earlier command of the page wrote it"),
        ("```{command-figure} a.svg\n```", 3, "needs :alt:"),
        ("```{command-file} ../a.txt\na\n```", 3, "is not a file of the page's own directory"),
    ],
)
def test_a_failure_fails_the_build_at_its_line(tmp_path, block, line, text):
    app, warnings = build(tmp_path, {"index.md": f"# Page\n\n{block}\n"}, extensions=EXTENSIONS)
    assert app.statuscode == 1
    assert re.search(rf"index\.md:{line}: ERROR: .*{re.escape(text)}", warnings)


def test_an_incremental_build_runs_changed_and_failed_pages_only(tmp_path):
    log = tmp_path / "log"
    pages = {
        "index.md": "# Index\n\n```{toctree}\nsound\nbroken\n```\n",
        "sound.md": f"# Sound\n\n```{{command}}\necho sound >> {log}\n```\n",
        "broken.md": f"# Broken\n\n```{{command}}\necho broken >> {log}; exit 2\n```\n",
    }
    assert build(tmp_path, pages, extensions=EXTENSIONS)[0].statuscode == 1
    assert build(tmp_path, pages, extensions=EXTENSIONS, fresh=False)[0].statuscode == 1
    assert sorted(log.read_text(encoding="utf-8").split()) == ["broken", "broken", "sound"]
    pages["broken.md"] = "# Broken\n\n```{command}\ntrue\n```\n"
    assert build(tmp_path, pages, extensions=EXTENSIONS, fresh=False)[0].statuscode == 0


def test_blocks_of_a_page_are_those_that_the_build_runs():
    text = (
        f"{PAGE}\n````\n```{{command}}\nan example of a block\n```\n````\n:::{{note}}\n```{{command}}\nls\n```\n:::\n"
    )
    blocks = list(blocks_of(text))
    assert [(b.kind, b.argument, b.status) for b in blocks] == [
        ("command-file", "dot.svg", 0),
        ("command", "", 0),
        ("command", "", 0),
        ("command", "", 3),
        ("command-figure", "dot.svg", 0),
        ("command", "", 0),
    ]
    assert commands_of(blocks[2].body) == ["seq 4 \\\n    8"]
    assert [text.splitlines()[b.line - 1][:10] for b in blocks] == ["```{comman"] * 6


def test_progress_of_a_slow_machine_is_not_shown():
    directory = PageDirectory()
    text = r"adjusting 20\nplan runs 50 of 100, for 2 s\nnights 1 of 2, 10 s, some 10 s left\nline 3 of 4: bad\nrows 12"
    try:
        assert directory.run(f"printf '{text}'").output == "line 3 of 4: bad\nrows 12"
    finally:
        directory.close()


def test_a_command_that_hangs_is_stopped():
    directory = PageDirectory()
    outcome = directory.run("echo begun; sleep 60", longest_s=0.3)
    directory.close()
    assert outcome.status < 0
    assert outcome.output == "begun\n(stopped after 0.3 s)"
