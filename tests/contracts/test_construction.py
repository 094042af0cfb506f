"""A dataclass with more than five fields is built by keyword: a field that joins it moves no value into another."""

import ast
from dataclasses import dataclass
from functools import cache

from repository import ROOT

SOURCE = ROOT / "src"
MOST = 5  # fields, and values by position: more are counted off wrongly
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)
INDIRECT = {"map": 1, "starmap": 1, "partial": 1}  # calls that call their first argument


@dataclass(frozen=True)
class Module:
    """A module's tree, its classes, and what its names mean: imports anywhere in it, resolved by no execution."""

    name: str
    tree: ast.Module
    classes: dict[str, ast.ClassDef]
    imports: dict[str, set[tuple[str, str]]]  # local name -> (module, name there); "" is the module itself


def module_of(name, text):
    """One module, read."""
    tree = ast.parse(text)
    imports = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level == 0:
            for alias in node.names:
                imports.setdefault(alias.asname or alias.name, set()).add((node.module, alias.name))
        elif isinstance(node, ast.Import):
            for alias in node.names:
                if alias.asname:
                    imports.setdefault(alias.asname, set()).add((alias.name, ""))
    classes = {node.name: node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}
    return Module(name, tree, classes, imports)


def house(texts):
    """Modules by their dotted name."""
    return {name: module_of(name, text) for name, text in texts.items()}


@cache
def catseye():
    """The package's modules."""
    texts = {}
    for path in sorted(SOURCE.rglob("*.py")):
        parts = path.relative_to(SOURCE).with_suffix("").parts
        texts[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path.read_text(encoding="utf-8")
    return house(texts)


def classes_named(modules, module, node):
    """Classes, each with its module, that an expression names where it stands: names, `module.Name`, `Name[T]`."""
    if isinstance(node, ast.Subscript):
        return classes_named(modules, module, node.value)
    if isinstance(node, ast.Name):
        return class_in(modules, module.name, node.id)
    dotted = ast.unparse(node) if isinstance(node, ast.Attribute) else ""
    prefix, _, name = dotted.rpartition(".")
    places = {f"{origin}.{target}" if target else origin for origin, target in module.imports.get(prefix, ())}
    return [one for place in sorted({*places, prefix}) for one in class_in(modules, place, name)]


def class_in(modules, place, name, passed=()):
    """Classes that a name of a module means, followed through its imports to where they are defined."""
    module = modules.get(place)
    if module is None or (place, name) in passed:
        return []
    if name in module.classes:
        return [(module, module.classes[name])]
    return [
        one
        for origin, target in sorted(module.imports.get(name, ()))
        for one in class_in(modules, origin, target, (*passed, (place, name)))
    ]


def is_dataclass(node):
    """True for a class under `@dataclass`, with arguments or without; NamedTuples and pydantic's records are none."""
    makers = (one.func if isinstance(one, ast.Call) else one for one in node.decorator_list)
    return any(ast.unparse(one) in ("dataclass", "dataclasses.dataclass") for one in makers)


def init_fields(modules, module, node):
    """Names of the fields that its constructor takes, those of dataclasses beneath it first."""
    fields = {}
    for base in reversed(node.bases):
        for where, beneath in classes_named(modules, module, base):
            fields.update(dict.fromkeys(init_fields(modules, where, beneath)))
    if not is_dataclass(node):
        return list(fields)
    for line in node.body:
        if not isinstance(line, ast.AnnAssign) or not isinstance(line.target, ast.Name):
            continue
        kind, value = ast.unparse(line.annotation), line.value
        if kind.startswith(("ClassVar", "KW_ONLY")):
            continue
        fields[line.target.id] = None
        options = value.keywords if isinstance(value, ast.Call) else ()
        if any(one.arg == "init" and ast.unparse(one.value) == "False" for one in options):
            del fields[line.target.id]
    return list(fields)


def calls(node, owner=None, within=False):
    """Every call inside a function, with the class that it stands in.

    A call at module level is a row of a table of constants, a few lines beneath the names of its columns: left out.
    """
    for child in ast.iter_child_nodes(node):
        if within and isinstance(child, ast.Call):
            yield owner, child
        inside = within or isinstance(child, FUNCTIONS)
        yield from calls(child, child if isinstance(child, ast.ClassDef) else owner, inside)


def built(modules, module, owner, call):
    """Classes that a call builds, and its arguments: by name, `cls(...)`, `type(self)(...)`, or through `map`."""
    maker, arguments = call.func, call.args
    if arguments and ast.unparse(maker).rpartition(".")[2] in INDIRECT:
        maker, arguments = arguments[0], arguments[1:]
    if owner is not None and ast.unparse(maker) in ("cls", "Self", "type(self)", "self.__class__"):
        return [(module, owner)], arguments
    return classes_named(modules, module, maker), arguments


def by_position(modules):
    """Places where a dataclass with more than five fields is built by position or from `*values`, one line each."""
    for module in modules.values():
        for owner, call in calls(module.tree):
            classes, arguments = built(modules, module, owner, call)
            starred = any(isinstance(one, ast.Starred) for one in arguments)
            through = ast.unparse(call.func).rpartition(".")[2] == "starmap"
            if not (starred or through or len(arguments) > MOST):
                continue
            for where, node in classes:
                if len(init_fields(modules, where, node)) > MOST:
                    yield f"{module.name}:{call.lineno}: {ast.unparse(call.func)} builds {where.name}.{node.name}"


def test_dataclasses_of_more_than_five_fields_are_built_by_keyword():
    assert sorted(by_position(catseye())) == []


PLANTED = {
    "a": """
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

@dataclass(frozen=True)
class Five:
    p: int; q: int; r: int; s: int; t: int
    kinds: ClassVar[int] = 0
    cached: int = field(init=False)

@dataclass
class Six(Five):
    u: int = 0
    t: int = 1

    @classmethod
    def of(cls, row):
        return cls(*row)

    def next(self):
        return type(self)(1, 2, 3, 4, 5, 6)

class Tuple(NamedTuple):
    p: int; q: int; r: int; s: int; t: int; u: int


ROWS = (Six(1, 2, 3, 4, 5, 6), Six(*range(6)))
""",
    "b": """
import a
from functools import partial
from a import Five, Tuple
from a import Six as Half
from c import Six

def build(row):
    Half(1, 2, 3, 4, 5, 6)
    a.Six(*row)
    partial(Half, 1, 2, 3, 4, 5, 6)
    list(map(Half, *row))
    lambda: Half(*row)
    Half(1, 2, 3, 4, 5, u=6)
    Half(p=1, q=2, r=3, s=4, t=5, u=6)
    Six(1, 2, 3, 4, 5, 6)
    Five(*row)
    Tuple(1, 2, 3, 4, 5, 6)
    Unknown(1, 2, 3, 4, 5, 6)
""",
    "c": """
from d import Seven, Again
from dataclasses import dataclass

@dataclass
class Six:
    p: int

def later():
    from a import Six as Half
    return Half(*later()), Seven(1, 2, 3, 4, 5, 6), Again(1, 2, 3, 4, 5, 6)
""",
    "d": """
import dataclasses
from a import Six as Again
from typing import Generic, TypeVar
T = TypeVar("T")

@dataclasses.dataclass
class Base(Generic[T]):
    p: T; q: T; r: T; s: T

@dataclasses.dataclass
class Seven(Base[int]):
    t: int; u: int; v: int = 0
""",
}


def test_planted_places_are_seen():
    found = [line.split(" builds ") for line in by_position(house(PLANTED))]
    assert [(where.partition(":")[0], where.rpartition(" ")[2], name) for where, name in found] == [
        ("a", "cls", "a.Six"),
        ("a", "type(self)", "a.Six"),
        ("b", "Half", "a.Six"),
        ("b", "a.Six", "a.Six"),
        ("b", "partial", "a.Six"),
        ("b", "map", "a.Six"),
        ("b", "Half", "a.Six"),
        ("c", "Half", "a.Six"),
        ("c", "Seven", "d.Seven"),
        ("c", "Again", "a.Six"),
    ]


def test_fields_are_those_of_the_constructor():
    modules = house(PLANTED)
    assert init_fields(modules, modules["a"], modules["a"].classes["Five"]) == list("pqrst")
    assert init_fields(modules, modules["a"], modules["a"].classes["Six"]) == list("pqrstu")
    assert init_fields(modules, modules["d"], modules["d"].classes["Seven"]) == list("pqrstuv")


def test_the_package_has_many_such_classes():
    modules = catseye()
    many = [
        node
        for module in modules.values()
        for node in module.classes.values()
        if len(init_fields(modules, module, node)) > MOST
    ]
    assert len(many) >= 300
