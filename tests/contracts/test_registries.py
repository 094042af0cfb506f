"""An air model and a kind of retroreflector are a file and a name; no room has a list of its own or compares a name."""

import ast
import re
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

import catseye
from catseye import names
from catseye.atmosphere.index.air import MODELS
from catseye.coordinator.visibility.vantage import SeenRetroreflector, retros_of
from catseye.errors import InputError
from catseye.optics.retroreflector.kinds.registry import HOLLOW, KINDS
from catseye.records.site.folder import read_site
from catseye.records.site.target import GLASS_KEYS, TargetRow
from catseye.reduction.site.places import RangedPoint, places_of
from catseye.reduction.steering.visibility import Retroreflectors, retroreflectors_of
from catseye.simulator.night.faults import Planted, Streams
from catseye.simulator.night.structure import TrueTarget
from catseye.simulator.twin.scene import TwinPlaces
from catseye.simulator.twin.targets import BodyRetroreflector
from repository import ROOT

SOURCE = ROOT / "src" / "catseye"
OTHER_THINGS = {"ball"}  # what a height gauge touches, in `reduction/calibrations/length/height_gauge.py`
UP = np.array([0.0, 0.0, 1.0])
UNREGISTERED = replace(HOLLOW, name="new", label="new cube", has_axis=True)


@pytest.fixture(scope="module")
def site():
    return read_site(ROOT / "examples" / "night-01")


# A file and a name


def test_each_air_model_is_a_file_of_its_name_and_each_such_file_is_registered():
    folder = SOURCE / "atmosphere" / "index"
    files = {path.stem for path in folder.glob("*.py") if "\nMODEL = " in path.read_text("utf-8")}
    files = {stem for stem in files if not stem.endswith("_kernel")}
    assert files == set(names.AIR_MODELS) == set(MODELS)
    assert {path.stem.removesuffix("_kernel") for path in folder.glob("*_kernel.py")} - {"air"} == {
        name for name, model in MODELS.items() if model.is_compiled
    }


def test_each_kind_is_a_file_of_its_name_and_each_such_file_is_registered():
    files = {path.stem for path in (SOURCE / "optics" / "retroreflector" / "kinds").glob("*.py")}
    assert files - {"__init__", "kind", "registry"} == set(names.RETROREFLECTORS) == set(KINDS)
    assert all(KINDS[name].name == name for name in KINDS)


def test_the_defaults_are_models():
    assert {names.AIR_MODEL, names.NOTES_AIR_MODEL} <= set(MODELS)


def test_the_names_import_nothing_but_typing():
    tree = ast.parse((SOURCE / "names.py").read_text("utf-8"))
    imports = [ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert [text.split()[1] for text in imports] == ["typing"]


def test_the_page_of_a_sites_files_lists_the_kinds_and_their_axes():
    page = (ROOT / "docs" / "formats" / "site.md").read_text("utf-8").partition("## Kinds of `[[target]]`")[2]
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \| (.*?) \|$", page, re.MULTILINE)
    assert [name for name, _, _ in rows] == list(names.SINGLE_RETROREFLECTORS)
    for name, keys, incidence in rows:
        axis, glass = KINDS[name].has_axis, KINDS[name].glass is not HOLLOW.glass
        assert ("`normal`" in keys, incidence) == (axis, "judged" if axis else "not judged"), name
        assert all((f"`{key}`" in keys) == glass for key in GLASS_KEYS), name


@pytest.mark.parametrize(("function", "argument"), [(catseye.air, "model"), (catseye.acoustic, "air_model")])
def test_the_documentation_of_air_lists_every_model(function, argument):
    listed = re.search(rf"^ +{argument} +(\w.*)$", function.__doc__, re.MULTILINE)
    assert re.findall(r"\w*\d{4}\w*", listed[1]) == list(names.AIR_MODELS)


# No name is compared


def compared(tree, words):
    """Lines where one of the words is compared, matched, or keys a table beside another of them."""
    for node in ast.walk(tree):
        texts = []
        if isinstance(node, ast.Compare):
            texts = [node.left, *node.comparators]
            texts += [
                inner for side in texts if isinstance(side, ast.Tuple | ast.List | ast.Set) for inner in side.elts
            ]
        elif isinstance(node, ast.MatchValue):
            texts = [node.value]
        elif isinstance(node, ast.Dict):
            texts = [key for key in node.keys if key is not None]
            texts = texts if sum(isinstance(t, ast.Constant) and t.value in words for t in texts) > 1 else []
        elif isinstance(node, ast.Subscript) and ast.unparse(node.value) == "Literal":
            texts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        for text in texts:
            if isinstance(text, ast.Constant) and isinstance(text.value, str) and text.value in words:
                yield f"line {text.lineno}: {text.value}"


@pytest.mark.parametrize(
    ("words", "registry"),
    [
        (names.RETROREFLECTORS, ("names.py", "optics/retroreflector/kinds/registry.py")),
        (names.AIR_MODELS, ("names.py",)),
    ],
    ids=["retroreflectors", "air models"],
)
def test_no_name_is_compared_outside_the_registry(words, registry):
    found = {}
    for path in sorted(SOURCE.rglob("*.py")):
        place = path.relative_to(SOURCE).as_posix()
        if place not in registry:
            found[place] = list(compared(ast.parse(path.read_text("utf-8")), set(words)))
    gauge = found.pop("reduction/calibrations/length/height_gauge.py")
    assert {text.rpartition(" ")[2] for text in gauge} <= OTHER_THINGS
    assert {place: texts for place, texts in found.items() if texts} == {}


def test_such_comparisons_are_seen():
    for text in ("k == 'prism'", "k.kind != 'ball'", "k in ('hollow', 'x')", "'prism' == k", "Literal['prism', 'x']"):
        assert list(compared(ast.parse(text), {"prism", "ball", "hollow"})), text
    assert list(compared(ast.parse("{'prism': 1, 'ball': 2}"), {"prism", "ball"}))
    assert list(compared(ast.parse("match k:\n  case 'prism': pass"), {"prism"}))
    assert not list(compared(ast.parse("values['prism']; {'prism': 1}; f('prism')"), {"prism", "ball"}))


def test_the_simulator_knows_kinds_from_the_records_and_no_formula_of_them():
    for path in (SOURCE / "simulator").rglob("*.py"):
        text = path.read_text("utf-8")
        assert "range_constant(" not in text and ".acceptance" not in text, path.name  # noqa: PT018
        assert "catseye.optics" not in text, path.name


# A kind with an axis keeps it in every room


def retroreflector_in(room, kind, axis):
    """One retroreflector of a kind in a room."""
    point = np.zeros(3)
    return {
        "reduction": lambda: RangedPoint("T", kind, point, axis),
        "coordinator": lambda: SeenRetroreflector("T", kind, "ground", point, axis, 0.01, "structure"),
        "visibility": lambda: Retroreflectors.with_axes(("T",), (kind,), point[None], (axis,)),
        "twin": lambda: BodyRetroreflector(kind, "ground", point, axis, (), (1.0, 2.0)),
        "night": lambda: TrueTarget("T", kind, "ground", point, point, axis, axis),
    }[room]()


@pytest.mark.parametrize("kind", [*KINDS.values(), UNREGISTERED], ids=lambda kind: kind.name)
@pytest.mark.parametrize("room", ["reduction", "coordinator", "visibility", "twin", "night"])
def test_no_room_takes_a_kind_without_its_axis_or_with_one_that_it_lacks(room, kind):
    right, wrong = (UP, None) if kind.has_axis else (None, UP)
    retroreflector_in(room, kind, right)
    for bad in (wrong, np.full(3, np.nan)):
        with pytest.raises(InputError, match=r"axis (is missing|.* is invalid) \(expected"):
            retroreflector_in(room, kind, bad)


GLASS = {"material": "BK7", "height_mm": 38.1, "u_height_mm": 0.002, "hrp_mm": 24.9, "pc_mm": -33.2}


def row_of(name, **changes):
    """Row of targets.toml of a kind, with the keys that it needs."""
    kind = KINDS[name]
    values = {"name": "NEW1", "type": name, "frame": "alidade", "position_mm": (1000.0, -2000.0, 30_000.0)}
    values |= GLASS if kind.glass is not HOLLOW.glass else {}
    values |= {"normal": (0.6, 0.0, -0.8)} if kind.has_axis else {}
    return TargetRow(**(values | changes))


@pytest.mark.parametrize("name", names.SINGLE_RETROREFLECTORS)
def test_a_record_lacks_no_axis_that_its_kind_has(name):
    row_of(name)
    wrong = None if KINDS[name].has_axis else (0.0, 0.0, 1.0)
    with pytest.raises(ValueError, match=r"normal (is missing|.* belongs to a kind with an axis) "):
        row_of(name, normal=wrong)


def test_a_record_of_each_kind_has_its_glass_or_none():
    for name in names.SINGLE_RETROREFLECTORS:
        for key in GLASS_KEYS:
            value = None if getattr(row_of(name), key) is not None else GLASS[key]
            with pytest.raises(ValueError, match=key):
                row_of(name, **{key: value})


@pytest.mark.parametrize("name", names.SINGLE_RETROREFLECTORS)
def test_a_single_target_has_the_same_place_axis_and_kind_in_every_room(site, name):
    """From the record through reduction, coordinator, visibility and simulator, with nothing drawn."""
    row = row_of(name)
    held = replace(site, targets=site.targets | {row.name: row})
    place, seen = places_of(held)[row.name], retros_of(held)[row.name]
    table = retroreflectors_of(held)
    at = table.names.index(row.name)
    true = TwinPlaces(held, streams=Streams(1), planted=Planted()).retros[row.name]
    assert {place.kind, seen.kind, table.kinds[at], true.kind} == {KINDS[name]}
    if not KINDS[name].has_axis:
        assert (place.axis, seen.axis, true.facing) == (None, None, None)
        assert np.isnan(table.axes[at]).all()
        return
    own = np.array(row.normal)
    turn = place.axis @ own  # the same cosine about the alidade's axis
    assert np.linalg.norm(place.axis) == pytest.approx(1.0)
    assert place.axis[2] == pytest.approx(own[2])
    assert turn == pytest.approx(table.axes[at] @ own)
    assert seen.axis == pytest.approx(own)
    assert np.degrees(np.arccos(np.clip(true.facing @ own, -1.0, 1.0))) < 1.0  # 0.1 deg of tilt is drawn


def test_a_triplets_ball_faces_away_from_its_prisms_in_every_room(site):
    triplet = next(iter(site.triplets.values()))
    left, ball = triplet.left_prism.target, triplet.ball.target
    places, seen, table = places_of(site), retros_of(site), retroreflectors_of(site)
    true = TwinPlaces(site, streams=Streams(1), planted=Planted()).retros
    axes = dict(zip(table.names, table.axes, strict=True))
    for axis_of in (lambda n: places[n].axis, lambda n: seen[n].axis, axes.get, lambda n: true[n].facing):
        assert axis_of(ball) == pytest.approx(-axis_of(left))
    assert places[ball].normal is None  # its range does not depend on the incidence


@pytest.mark.parametrize("name", KINDS)
def test_each_kind_has_a_constant_an_acceptance_and_a_curve(name):
    kind = KINDS[name]
    sizes = {"none": (), "slab": (0.0381,), "spheres": (0.05, 0.0965)}[kind.glass.value]
    n, step = 1.527, 1e-6
    constant = kind.range_constant(n, *sizes)
    assert constant <= 0.0
    assert 0.0 < kind.acceptance.limit < np.pi / 2
    assert kind.acceptance.why
    labels = [curve.label for one in KINDS.values() for curve in one.curves]
    assert kind.curves
    assert len(set(labels)) == len(labels)
    assert kind.u_range_constant(n, 0.0) == 0.0
    if kind.glass.value == "spheres":  # each radius by differences; they err independently
        slopes = [kind.range_constant(n, 0.05 + step, 0.0965), kind.range_constant(n, 0.05, 0.0965 + step)]
        expected = np.hypot(*((slope - constant) / step for slope in slopes))
        assert kind.u_range_constant(n, 1.0) == pytest.approx(expected, rel=1e-6)


def test_a_kind_that_is_unknown_is_refused_with_those_that_are_known():
    registry = import_module("catseye.optics.retroreflector.kinds.registry")
    with pytest.raises(InputError, match=f"'new' is unknown \\(expected one of {', '.join(KINDS)}\\)"):
        registry.kind_named("new")
