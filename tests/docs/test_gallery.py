"""Gallery of figures: it shows every figure that the package can draw, and each block makes what it names."""

import ast
import re
import sys

import pytest

import catseye
from catseye import FACE
from docs.site_scene import build
from gallery_blocks import GalleryCalls, block_of, blocks_of
from repository import ROOT

PAGE = ROOT / "docs" / "gallery" / "index.md"
BLOCKS = blocks_of(PAGE.read_text(encoding="utf-8"))
PACKAGE = ROOT / "src" / "catseye"
FIGURES = {"Figure", "Svg", "dict[str, Figure]", "dict[str, CaptionedFigure]", "tuple[Svg, dict[str, Any]]"}
STUDIES = {  # figures that no command draws
    "gateways/steering/servo_figures.py: step_figure",
}


def trees(folder):
    for path in sorted((PACKAGE / folder).rglob("*.py")):
        yield path, ast.parse(path.read_text(encoding="utf-8"))


def results_with_figures():
    """Classes of results that draw figures, but for their base."""
    return {
        node.name
        for _, tree in trees("api")
        for node in tree.body
        if isinstance(node, ast.ClassDef) and node.name != "Result"
        if any(isinstance(part, ast.FunctionDef) and part.name == "figures" for part in node.body)
    }


def makers(classes):
    """Public functions by what they return, where that is one of these classes."""
    public = {name for names in FACE.values() for name in names}
    for _, tree in trees("api"):
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and node.name in public and node.returns is not None:
                said = ast.unparse(node.returns)
                for name in classes:
                    if name in said.strip("'\"").split(" | "):
                        yield node.name, name


def drawing_functions():
    """Functions of gateways that return figures, with their code's place."""
    for path, tree in trees("gateways"):
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and node.returns is not None:
                said = ast.unparse(node.returns).strip("'\"").removesuffix(" | None")
                if said in FIGURES:
                    yield f"{path.relative_to(PACKAGE)}: {node.name}"


def called():
    """Public functions that the page's blocks call."""
    return {
        node.func.attr
        for block in BLOCKS
        for node in ast.walk(ast.parse(block.call))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
    }


def test_every_function_whose_result_draws_is_in_the_gallery():
    classes = results_with_figures()
    assert {"NightResult", "FigureResult", "TrendsResult"} <= classes
    assert {name for name, _ in makers(classes)} - called() == set()
    assert {kind for _, kind in makers(classes)} == classes


def test_every_kind_of_plot_is_in_the_gallery():
    assert {name for name in catseye.__all__ if name.startswith("plot_")} <= called()


def test_a_block_without_a_command_or_with_a_bare_line_is_refused():
    assert block_of("catseye.f()", [":command: catseye f", ":as: x", "", "plan = A plan"]).lines == {"plan": "A plan"}
    with pytest.raises(ValueError, match="no command"):
        block_of("catseye.f()", ["plan = A plan"])
    with pytest.raises(ValueError, match=r"'plan' \(expected"):
        block_of("catseye.f()", [":command: catseye f", "plan"])


def test_a_figure_without_a_line_and_a_line_without_a_figure_fail():
    with GalleryCalls() as calls:
        block = block_of("catseye.triplet('triplets/TR01.toml')", [":command: catseye triplet", "TR02 = Another"])
        with pytest.raises(ValueError, match="no line on 'TR01', no figure 'TR02'"):
            calls.figures(block)


def test_a_page_shows_figures_with_their_lines_and_the_report(tmp_path):
    block = "```{gallery} catseye.triplet('triplets/TR01.toml')\n:command: catseye triplet TR01\n\nTR01 = A unit\n```\n"
    app, warnings = build(tmp_path, {"index.md": f"# Page\n\n{block}"}, extensions=("gallery",))
    assert warnings == ""
    html = (tmp_path / "html" / "index.html").read_text(encoding="utf-8")
    assert 'alt="TR01: A unit"' in html
    assert re.search(r'<a [^>]*href="_images/[^"]+\.svg"[^>]*><img', html)
    assert "$ catseye triplet TR01" in html
    assert len(list((tmp_path / "html" / "_images").glob("*.svg"))) == 1
    assert app.statuscode == 0


def test_a_block_that_fails_is_told_with_its_line(tmp_path):
    block = "```{gallery} catseye.triplet('none.toml')\n:command: catseye triplet none.toml\n\nTR01 = A unit\n```\n"
    _, warnings = build(tmp_path, {"index.md": f"# Page\n\n{block}"}, extensions=("gallery",))
    assert "index.md:3: " in warnings
    assert "none.toml" in warnings


def test_the_page_of_chapter_8_draws_its_list():
    """Every item of [PARKER04] chapter 8; a line for each figure."""
    blocks = blocks_of((PAGE.parent / "chapter-8.md").read_text(encoding="utf-8"))
    with GalleryCalls() as calls:
        drawn = [name for block in blocks for name in calls.figures(block)[1]]
    kinds = ["signature", "recording", "correlation", "temperature"]
    sound = [f"ZY103 to ZEG41040L: {kind}" for kind in kinds]
    assert drawn == [
        *("acquired", "night", "slope", "readings", "timing", "readings", "return", "angles", "azimuth", "elevation"),
        *sound,
    ]


@pytest.mark.slow  # a minute: every figure is drawn
def test_the_gallery_enters_every_function_that_draws():
    entered, wanted = set(), set(drawing_functions()) - STUDIES
    places = {str(PACKAGE / text.partition(": ")[0]): text.partition(": ")[0] for text in wanted}

    def watch(frame, event, _argument):
        if event == "call" and frame.f_code.co_filename in places:
            entered.add(f"{places[frame.f_code.co_filename]}: {frame.f_code.co_name}")

    with GalleryCalls() as calls:
        for block in BLOCKS:
            sys.setprofile(watch)
            try:
                calls.figures(block)
            finally:
                sys.setprofile(None)
    assert wanted - entered == set()
