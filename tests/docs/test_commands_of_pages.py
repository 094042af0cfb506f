"""Commands of the pages work as written, one page after the other, in a directory of its own each.

`make docs` runs all of them when it builds; `make test` runs the pages whose commands are quick, `make test-all` the
others.
"""

import pytest

from page_commands import PageDirectory, blocks_of, commands_of
from repository import ROOT

DOCS = ROOT / "docs"
PAGES = {
    path.relative_to(DOCS).as_posix(): text
    for path in sorted(DOCS.rglob("*.md"))
    if "_build" not in path.parts and any(blocks_of(text := path.read_text(encoding="utf-8")))
}
QUICK = ("howto/own-site.md", "index.md")  # of pages whose commands take below 90 s of one core together


def cases():
    for name in PAGES:
        yield pytest.param(name, marks=() if name in QUICK else pytest.mark.slow)


@pytest.mark.parametrize("name", list(cases()))
def test_commands_work_as_written(name):
    directory = PageDirectory()
    try:
        for block in blocks_of(PAGES[name]):
            where = f"{name}:{block.line}"
            if block.kind == "command-file":
                directory.write(block.argument, block.body)
            elif block.kind == "command-figure":
                assert directory.file(block.argument).is_file(), f"{where}: {block.argument} was not written"
                assert block.options.get("alt"), where
            else:
                commands = commands_of(block.body)
                for number, command in enumerate(commands, 1):
                    outcome = directory.run(command)
                    expected = block.status if number == len(commands) else 0
                    assert outcome.status == expected, f"{where}: {command}\n{outcome.output}"
    finally:
        directory.close()


def test_quick_pages_are_there():
    assert set(QUICK) <= set(PAGES)
