"""Docstrings of catseye as reStructuredText: real ones, and what each rule is for."""

import importlib
import inspect

import pytest

from aligned import Names, paragraphs, prose, restructured, rows, split_names
from docs.site_scene import build
from repository import ROOT

SOURCES = Names(sources=frozenset({"PARKER04"}), floors=frozenset({"atmosphere"}))


def lines_of(what, thing):
    docstrings = pytest.importorskip("docstrings", reason="extra docs is not installed")
    return restructured(inspect.getdoc(thing).split("\n"), docstrings.names_of(what, thing))


def test_parameters_of_a_formula_are_fields_and_its_source_is_a_link():
    from catseye.atmosphere.weather.barometer import temperature_corrected_mmhg

    lines = lines_of("function", temperature_corrected_mmhg)
    assert ":param mercury_c: temperature of mercury and scale, -30 to 60 °C" in lines
    source = next(line for line in lines if line.startswith("Source: "))
    assert source.startswith(
        "Source: :ref:`[PARKER04] <source-parker04>` eq. 1.8 (:ref:`[SMITHSON51] <source-smithson51>`)"
    )
    assert lines[lines.index(source) - 1] == ""
    assert [line for line in lines if line.startswith(">>> ")]


def test_fields_of_a_record_are_attributes_one_a_name():
    from catseye.api.weather import AirResult

    lines = lines_of("class", AirResult)
    text = "the state; relative humidity over liquid water"
    for name in ("temperature_c", "pressure_hpa", "humidity_percent", "wavelength_um"):
        assert f":attribute {name}: {text}" in lines
    assert ":attributetype model: ``str``" in lines
    assert not [line for line in lines if line.startswith(":param")]


def test_a_name_that_ends_in_an_underscore_keeps_it():
    lines = restructured(["First.", "", "range_, u_range   m"], Names(parameters={"range_": "", "u_range": ""}))
    assert lines == ["First.", "", ":param range\\_: m", ":param u_range: m", ""]


def test_a_continued_row_stays_one_field():
    lines = ["x   the first", "    and more", "y   the second"]
    assert rows(lines) == [("x", "the first\nand more"), ("y", "the second")]
    assert restructured(lines, Names(parameters={"x": "float"})) == [
        *(":param x: the first", "    and more", ":type x: ``float``"),
        *(":param y: the second", ""),
    ]


def test_a_block_of_other_words_is_a_list_of_definitions():
    assert restructured(['"waiting"   no answer yet', '"ready"     it fires'], Names()) == [
        *('``"waiting"``', "    no answer yet", '``"ready"``', "    it fires", ""),
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("|x| of a_ and *args", "\\|x\\| of a\\_ and \\*args"),
        ("points (n, 3), weights (n,)", "points ``(n, 3)``, weights ``(n,)``"),
        ("an array (..., 3)", "an array ``(..., 3)``"),
        ("a list (first, second) of words", "a list (first, second) of words"),
        ("see `atmosphere.index.air`", "see :py:obj:`atmosphere.index.air <catseye.atmosphere.index.air>`"),
        ("as `x | y` is", "as ``x | y`` is"),
        ("the `Slew`s of `range_`", "the :py:obj:`Slew <Slew>`\\ s of ``range_``"),
        ("[PARKER04] and [OTHER99]", ":ref:`[PARKER04] <source-parker04>` and [OTHER99]"),
        ("Raises InputError", "Raises :py:obj:`~catseye.errors.InputError`"),
        ("of _private things", "of \\_private things"),
    ],
)
def test_prose(text, expected):
    assert prose(text, SOURCES) == expected


@pytest.mark.parametrize(
    ("key", "names"),
    [
        ("shot, ranger, target", ["shot", "ranger", "target"]),
        ("focal_length, centre (2,), radius", ["focal_length", "centre", "radius"]),
        ("**pages", ["**pages"]),
        ('"waiting"', []),
        ("offset, distance, ...", []),
    ],
)
def test_names_of_a_first_column(key, names):
    assert split_names(key) == names


def test_examples_and_sources_begin_paragraphs():
    text = ["Raises ValidityError.", "Source: [PARKER04] eq. 1.3.", ">>> 1 + 1", "2"]
    assert paragraphs(text) == [text[:1], text[1:2], text[2:]]


def test_annotated_types_lose_what_was_added():
    docstrings = pytest.importorskip("docstrings", reason="extra docs is not installed")
    assert (
        docstrings.without_metadata("Annotated[Sequence[float], In('m', many=True)] | None") == "Sequence[float] | None"
    )
    assert docstrings.type_text("typing.Annotated[typing.Any, In('m')]") == ""
    assert docstrings.type_text("str | os.PathLike[str] | None") == "str | PathLike | None"


def test_modules_of_formulas_pass_strictly(tmp_path):
    """Every docstring of a few modules, and names of `import catseye`, without a warning."""
    folders = ("atmosphere.weather", "geometry.sky", "optics.safety")
    pages = {
        "index.md": "# Index\n\n```{toctree}\n:glob:\n\n*\n```\n",
        "references.md": "# References\n\n```{references}\n```\n",
        "public.md": "# Public\n\n```{public} air save InputError\n```\n",
        **{f"{name}.md": f"# {name}\n\n```{{formulas}} catseye.{name}\n```\n" for name in folders},
    }
    extensions = ("sphinx.ext.autodoc", "docstrings", "python_reference", "references")
    _, warnings = build(tmp_path, pages, extensions=extensions, default_role="code", autodoc_typehints="none")
    assert warnings == ""
    html = (tmp_path / "html" / "atmosphere.weather.html").read_text(encoding="utf-8")
    assert 'id="catseye.atmosphere.weather.humidity.saturation"' in html
    assert 'href="references.html#source-parker04"' in html
    public = (tmp_path / "html" / "public.html").read_text(encoding="utf-8")
    assert 'href="#catseye.api.weather.AirResult"' in public


def test_every_public_name_has_one_entry():
    import catseye

    pages = ROOT / "docs" / "reference" / "python"
    listed = [
        name
        for path in pages.glob("*.md")
        for line in path.read_text(encoding="utf-8").splitlines()
        if line.startswith("```{public} ")
        for name in line.split()[1:]
    ]
    assert sorted(listed) == sorted(set(catseye.__all__) - {"__version__"})


def test_every_folder_of_formulas_has_its_page():
    package = ROOT / "src" / "catseye"
    floors = ("atmosphere", "optics", "signal", "geometry", "estimation")
    folders = {
        ".".join(path.parent.relative_to(package.parent).parts)
        for floor in floors
        for path in (package / floor).rglob("__init__.py")
    }
    pages = (ROOT / "docs" / "reference" / "python" / "formulas").glob("*.md")
    listed = [
        line.split()[1]
        for path in pages
        for line in path.read_text(encoding="utf-8").splitlines()
        if line.startswith("```{formulas} ")
    ]
    assert sorted(listed) == sorted(folders)


def test_modules_of_a_folder_are_those_that_python_finds():
    reference = pytest.importorskip("python_reference", reason="extra docs is not installed")
    modules = reference.modules_of("catseye.geometry.sky")
    assert modules == sorted(modules)
    assert all(importlib.import_module(name) for name in modules)
