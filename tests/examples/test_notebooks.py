"""The notebooks run from beginning to end, and what they show of numbers and words is what comes out today."""

import ast
import io
import json
import re
from contextlib import redirect_stdout

import pytest

from repository import ROOT

NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))
NUMBER = re.compile(r"[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
CLOSE = 2e-3  # relative: the last digits belong to the machine
SMALL = 2e-3  # below it a number is the machine's


def cells(path):
    """Source and stored text of each code cell; text of a result and of what was printed."""
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] != "code":
            continue
        stored = ""
        for output in cell["outputs"]:
            part = output["text"] if output["output_type"] == "stream" else output["data"]["text/plain"]
            stored += "".join(part)
        yield "".join(cell["source"]), stored


def run(source, names):
    """What a cell prints and shows, as a notebook does: the value of a last line that is an expression."""
    tree, said = ast.parse(source), io.StringIO()
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    with redirect_stdout(said):
        exec(compile(tree, "cell", "exec"), names)
        value = None if last is None else eval(compile(ast.Expression(last.value), "cell", "eval"), names)  # noqa: S307 - ours
    return said.getvalue(), value


def differs(stored, now):
    """The first number or word that is another; None where all are the same."""
    numbers = [[float(x.replace("−", "-")) for x in NUMBER.findall(text)] for text in (stored, now)]
    words = [re.sub(r"\W+", " ", NUMBER.sub("", text)).split() for text in (stored, now)]
    if words[0] != words[1]:
        return next(((a, b) for a, b in zip(*words, strict=False) if a != b), words)
    for a, b in zip(*numbers, strict=True):
        if abs(a - b) > max(CLOSE * abs(a), SMALL):
            return a, b
    return None


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_what_is_stored(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for source, stored in cells(path):
        printed, value = run(source, names)
        shown = stored.removeprefix(printed) if printed and value is not None else stored
        assert differs(stored[: len(printed)] if printed else "", printed) is None, source
        if value is not None and not hasattr(value, "colnames"):
            assert differs(shown, repr(value)) is None, source


def test_there_are_four_and_none_tells_where_it_was_run():
    assert [path.stem for path in NOTEBOOKS] == ["air-and-refractometer", "dish-surface", "one-night", "own-network"]
    for path in NOTEBOOKS:
        text = path.read_text(encoding="utf-8")
        assert "/tmp" not in text
        assert str(ROOT) not in text


def test_a_difference_is_seen():
    assert differs("u 1.0 mm", "u 1.1 mm") == (1.0, 1.1)
    assert differs("good 1.0", "doubtful 1.0") == ("good", "doubtful")
    assert differs("x 12.3450", "x 12.3455") is None
