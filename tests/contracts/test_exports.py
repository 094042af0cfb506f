"""Names of `import catseye` stand in four lists, which are held equal: FACE, __all__, the imports that a type checker
reads, and docs/commands.md.
"""

import ast
import re
from importlib import import_module
from pathlib import Path

import catseye
from repository import ROOT

SOURCE = ast.parse(Path(catseye.__file__).read_text(encoding="utf-8"))


def typed():
    """Names that `if TYPE_CHECKING` imports, by the file of `catseye.api`."""
    [block] = [node for node in SOURCE.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"]
    return {
        node.module.removeprefix("catseye.api."): tuple(alias.name for alias in node.names)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
    }


def imported():
    """Names that the module itself imports and gives on."""
    return {
        alias.name
        for node in SOURCE.body
        if isinstance(node, ast.ImportFrom) and node.module in ("catseye.errors", "catseye.version")
        for alias in node.names
    }


def test_a_type_checker_sees_each_function_where_it_is_loaded_from():
    assert typed() == dict(catseye.FACE)


def test_all_is_the_functions_the_errors_and_the_version():
    functions = {name for names in catseye.FACE.values() for name in names}
    assert sorted(catseye.__all__) == sorted(functions | imported())
    assert len(set(catseye.__all__)) == len(catseye.__all__)
    assert dir(catseye) == sorted(catseye.__all__)


def test_each_function_is_in_its_file():
    for file, names in catseye.FACE.items():
        for name in names:
            assert getattr(import_module(f"catseye.api.{file}"), name).__module__ == f"catseye.api.{file}"


def test_the_page_of_the_commands_names_each_function_and_no_other():
    """In its paragraph on `import catseye`: `name`, `catseye.name` or `catseye.name(...)`."""
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    [paragraph] = [part for part in text.split("\n\n") if part.startswith("A command is one call of `import catseye`")]
    names = set(re.findall(r"`(?:catseye\.)?([a-z]\w*)(?:\([^`]*\))?`", paragraph))
    assert names - {"verdict", "to_table", "to_object"} == {name for names in catseye.FACE.values() for name in names}


def test_names_that_programs_beside_the_package_import_are_there():
    """Studies, benchmarks, tools, examples and the documentation's programs: none runs in these tests as a whole."""
    missing = []
    for folder in ("studies", "benchmarks", "tools", "examples", "docs"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "catseye":
                    module = import_module(node.module)
                    missing += [f"{path.name}: {node.module}.{a.name}" for a in node.names if not is_in(module, a.name)]
    assert missing == []


def is_in(module, name):
    """True for a name of a module, or a module of a package."""
    if hasattr(module, name):
        return True
    try:
        import_module(f"{module.__name__}.{name}")
    except ModuleNotFoundError:
        return False
    return True
