"""Names that users rely on stay: the committed list of this minor release against what is there now."""

import ast
import re
import warnings
from functools import cache

import pytest

import catseye
from catseye.deprecation import CatseyeDeprecationWarning, warn_deprecated
from contracts.stable_scene import LIST, PARTS, committed, losses
from repository import ROOT

SOURCE = ROOT / "src" / "catseye"
now = cache(lambda part: PARTS[part]())


def test_the_list_is_that_of_this_minor_release():
    assert LIST.is_file(), "begin it: PYTHONPATH=src:tests python tests/contracts/stable_scene.py"
    assert set(committed()) == set(PARTS)


@pytest.mark.parametrize("part", PARTS)
def test_nothing_that_users_rely_on_is_gone(part):
    """Where it should be: docs/people/stable.md has the procedure."""
    assert list(losses({part: committed()[part]}, {part: now(part)})) == []


@pytest.mark.parametrize(
    ("part", "old", "new", "loss"),
    [
        ("functions", ["a", "b=", "*", "c="], ["a=", "b=", "d=", "*", "c=", "e="], None),
        ("functions", ["a", "b="], ["b=", "a="], "positional arguments were a, b"),
        ("functions", ["a", "*", "c="], ["a", "*", "k="], "c is gone"),
        ("functions", ["a", "*", "c="], ["a", "*", "c"], "c is now required"),
        ("functions", ["a", "b="], ["a", "*", "b="], "positional arguments were a, b"),
        ("functions", ["a", "*", "c="], ["a", "n", "*", "c="], "n is now required"),
        ("commands", ["FILE", "--sheet"], ["FILE?", "LATER?", "--sheet", "--out"], None),
        ("commands", ["FILE", "--sheet"], ["FILE", "--page"], "--sheet is gone"),
        ("commands", ["FILE", "--sheet"], ["FILE", "--sheet!"], "--sheet is now required"),
        ("commands", ["FILE", "LATER?"], ["FILE", "LATER"], "LATER is now required"),
        ("commands", ["FILE"], ["FILE", "--site!"], "--site is now required"),
        ("commands", ["FILE..."], ["FILE"], "FILE... is gone"),
        ("commands", ["A", "B"], ["B", "A"], "arguments were A B"),
        ("objects", ["verdict", "points[].name"], ["points[].name", "verdict", "more"], None),
        ("objects", ["verdict"], ["outcome"], "verdict is gone"),
    ],
)
def test_a_loss_is_told_from_an_addition(part, old, new, loss):
    found = list(losses({part: {"it": old}}, {part: {"it": new}}))
    assert found == [] if loss is None else f"{part}: it: {loss}" in found


def test_a_removed_function_is_a_loss():
    assert list(losses({"functions": {"air": []}}, {"functions": {}})) == ["functions: air is gone"]


def test_a_former_name_works_for_one_release_and_warns_where_it_is_used(monkeypatch):
    monkeypatch.setitem(catseye.RENAMED, "air_index", ("air", "99.0"))
    with pytest.warns(CatseyeDeprecationWarning) as caught:
        function = catseye.air_index
    [warning] = caught
    assert function is catseye.air
    assert str(warning.message) == (
        "catseye.air_index is deprecated and will be removed in catseye 99.0: use catseye.air"
    )
    assert warning.filename == __file__
    assert "air_index" not in dir(catseye)


def renamed(*, sigma_mm=None, sigma=None):
    if sigma is not None:
        warn_deprecated("sigma", "sigma_mm", "99.0")
        sigma_mm = sigma
    return sigma_mm


def test_a_former_parameter_works_and_warns_where_it_is_used():
    with pytest.warns(CatseyeDeprecationWarning, match=r"^sigma is deprecated .* 99\.0: use sigma_mm$") as caught:
        assert renamed(sigma=0.1) == 0.1
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert renamed(sigma_mm=0.2) == 0.2


def removals(text):
    """Versions in which names go, of each call of warn_deprecated."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] == "warn_deprecated":
            given = [*node.args[2:3], *(each.value for each in node.keywords if each.arg == "removal")]
            yield from (each.value for each in given if isinstance(each, ast.Constant))


def release(version):
    """Numbers of a version, to compare."""
    return tuple(int(number) for number in re.findall(r"\d+", version)[:2])


def test_nothing_outlives_the_release_that_removes_it():
    due = [version for _, version in catseye.RENAMED.values()]
    for path in SOURCE.rglob("*.py"):
        due += removals(path.read_text(encoding="utf-8"))
    assert [version for version in due if release(version) <= release(catseye.__version__)] == []


def test_a_removal_that_is_due_is_recognised():
    text = "warn_deprecated('a', 'b', '0.10')\nd.warn_deprecated('a', 'b', removal='1.0')\nwarn_deprecated(n, r, v)"
    assert list(removals(text)) == ["0.10", "1.0"]
    assert release("0.9.1") < release("0.10") < release("1.0")
