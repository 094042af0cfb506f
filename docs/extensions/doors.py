"""Definitions of the package by the doors that reach them: functions of `import catseye`, and commands.

A walk over the source: what a definition names leads to other definitions, through the imports of its file. A method is
reached when its class is and its name is used anywhere that is reached, so that the walk errs towards reached.
"""

import ast
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

Node = tuple[str, str]  # module and name of a definition in it; "" for the statements of the module itself
DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
ACCESSORS = {"property", "cached_property", "classmethod", "staticmethod", "abstractmethod", "override", "wraps"}


@dataclass
class Module:
    """One file of the package.

    name      with dots
    tree      its syntax
    packages  names of all modules and folders of the package
    """

    name: str
    tree: ast.Module
    packages: frozenset[str] = field(repr=False)

    @cached_property
    def imports(self) -> dict[str, Node]:
        """Definition or module ("", as its name) by the name that an import gives it anywhere in the file."""
        found: dict[str, Node] = {}
        for node in _without_type_checking(self.tree):
            if isinstance(node, ast.Import):
                found |= {a.asname: (a.name, "") for a in node.names if a.asname and a.name in self.packages}
            elif isinstance(node, ast.ImportFrom) and node.module in self.packages:
                for alias in node.names:
                    inner = f"{node.module}.{alias.name}"
                    found[alias.asname or alias.name] = (
                        (inner, "") if inner in self.packages else (node.module, alias.name)
                    )
        return found

    @cached_property
    def definitions(self) -> dict[str, ast.AST]:
        """Top-level definitions by name, and methods as Class.method."""
        found: dict[str, ast.AST] = {}
        for node in self.tree.body:
            if isinstance(node, DEFINITIONS):
                found[node.name] = node
                if isinstance(node, ast.ClassDef):
                    found |= {
                        f"{node.name}.{inner.name}": inner for inner in node.body if isinstance(inner, DEFINITIONS)
                    }
        return found

    def statements(self) -> Iterator[ast.AST]:
        """Statements of the module itself, which run when it is imported; decorators and defaults among them."""
        for node in self.tree.body:
            if not isinstance(node, DEFINITIONS):
                yield node


@dataclass
class Uses:
    """Uses of some code.

    nodes       definitions and modules that it names
    attributes  names after a dot, or in `getattr`
    texts       modules that it names in strings, as for `-m` or `import_module`
    """

    nodes: set[Node] = field(default_factory=set)
    attributes: set[str] = field(default_factory=set)
    texts: set[str] = field(default_factory=set)


class Package:
    """The source of a package, and walks through it.

    root   folder that holds the package's folder
    name   the package's
    """

    def __init__(self, root: Path, name: str = "catseye"):
        paths = {_module_name(path, root): path for path in sorted((root / name).rglob("*.py"))}
        packages = frozenset(paths)
        self.paths = paths
        self.modules = {
            module: Module(module, ast.parse(path.read_text(encoding="utf-8")), packages)
            for module, path in paths.items()
        }
        self._uses: dict[Node, Uses] = {}

    def lines(self, module: str) -> int:
        """Number of lines of a module's file."""
        return len(self.paths[module].read_text(encoding="utf-8").splitlines())

    def public(self) -> Iterator[Node]:
        """Public functions and classes at the top level of all modules."""
        for module in self.modules.values():
            yield from ((module.name, name) for name in module.definitions if "." not in name and name[0] != "_")

    def reached(self, starts: Iterable[Node]) -> set[Node]:
        """Definitions, methods and modules that a walk from these reaches."""
        return _Walk(self, starts).seen

    def whole(self, prefix: str) -> set[Node]:
        """All definitions in a module or a folder of modules, with the modules."""
        inside = [m for m in self.modules.values() if m.name == prefix or m.name.startswith(prefix + ".")]
        return {(m.name, name) for m in inside for name in ("", *m.definitions)}

    def uses(self, node: Node) -> Uses:
        """Things used by a definition, or by a module's own statements."""
        if node not in self._uses:
            module = self.modules[node[0]]
            if not node[1]:
                parts: Iterable[ast.AST] = module.statements()
            elif isinstance(found := module.definitions[node[1]], ast.ClassDef):
                parts = [
                    *found.decorator_list,
                    *found.bases,
                    *(n for n in found.body if not isinstance(n, DEFINITIONS)),
                ]
            else:
                parts = [found]
            self._uses[node] = _uses(module, parts)
        return self._uses[node]


class _Walk:
    def __init__(self, package: Package, starts: Iterable[Node]):
        self.package = package
        self.seen: set[Node] = set()
        self._names: set[str] = set()
        self._waiting: dict[str, set[Node]] = {}  # methods of reached classes, and functions of modules loaded by name
        self._next = list(starts)
        while self._next:
            self._enter(self._next.pop())

    def _enter(self, node: Node) -> None:
        module = self.package.modules.get(node[0])
        if node in self.seen or module is None:
            return
        name = node[1]
        if name and name not in module.definitions:  # a constant of the module, or what it imports itself
            self._next.append(module.imports.get(name, (node[0], "")))
            self._next.append((node[0], ""))
            return
        self.seen.add(node)
        self._next.append((node[0], ""))
        if isinstance(module.definitions.get(name), ast.ClassDef):
            self._enter_class(module, name)
        uses = self.package.uses(node)
        self._next += uses.nodes
        for text in uses.texts:
            self._next += self._loaded(text)
        for attribute in uses.attributes - self._names:
            self._names.add(attribute)
            self._next += self._waiting.pop(attribute, ())

    def _enter_class(self, module: Module, name: str) -> None:
        definition = module.definitions[name]
        assert isinstance(definition, ast.ClassDef)
        foreign = any(not self._ours(module, base) for base in definition.bases)
        for inner in definition.body:
            if isinstance(inner, DEFINITIONS):
                at = (module.name, f"{name}.{inner.name}")
                decorators = {ast.unparse(d).partition("(")[0].rpartition(".")[2] for d in inner.decorator_list}
                called = foreign or inner.name.startswith("__") or bool(decorators - ACCESSORS - {"setter"})
                if called or inner.name in self._names:
                    self._next.append(at)
                else:
                    self._waiting.setdefault(inner.name, set()).add(at)

    def _ours(self, module: Module, base: ast.expr) -> bool:
        name = ast.unparse(base).partition("[")[0].partition("(")[0]
        plain = {
            "object",
            "Protocol",
            "NamedTuple",
            "Enum",
            "StrEnum",
            "IntEnum",
            "Generic",
            "ABC",
            "Record",
            "Exception",
        }
        return name in module.imports or name in module.definitions or name in plain

    def _loaded(self, text: str) -> Iterator[Node]:
        """Modules loaded by a name in a string; their functions wait until something uses their names."""
        if text in self.package.modules:
            yield from self.package.whole(text)
        for module in self.package.modules.values():
            if text.endswith(".") and module.name.startswith(text):
                yield (module.name, "")
                for name in module.definitions:
                    if name in self._names:
                        yield (module.name, name)
                    else:
                        self._waiting.setdefault(name, set()).add((module.name, name))


def _module_name(path: Path, root: Path) -> str:
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _without_type_checking(tree: ast.AST) -> Iterator[ast.AST]:
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            waiting += node.orelse
        else:
            waiting += ast.iter_child_nodes(node)


def _uses(module: Module, parts: Iterable[ast.AST]) -> Uses:
    uses = Uses()
    for part in parts:
        for node in _without_type_checking(part):
            if isinstance(node, ast.Name):
                uses.nodes |= _named(module, node.id)
            elif isinstance(node, ast.Attribute):
                uses.attributes.add(node.attr)
                if isinstance(node.value, ast.Name) and (at := module.imports.get(node.value.id)) and not at[1]:
                    uses.nodes.add((at[0], node.attr))
            elif isinstance(node, ast.Call):
                function = ast.unparse(node.func)
                if function.endswith("getattr"):
                    uses.attributes |= set(map(_text, node.args))
                elif function.endswith("import_module") and isinstance(node.args[0], ast.JoinedStr):
                    uses.texts.add(_text(node.args[0].values[0]))
            elif isinstance(node, ast.keyword) and node.arg:
                uses.attributes.add(node.arg)
            elif "." in (text := _text(node)):
                owner, _, name = text.rpartition(".")
                if text in module.packages:
                    uses.texts.add(text)
                elif owner in module.packages and owner != "catseye" and name.isidentifier():
                    uses.nodes.add((owner, name))  # a definition that a table of readers names in full
    return uses


def _text(node: object) -> str:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def _named(module: Module, name: str) -> set[Node]:
    if name in module.definitions:
        return {(module.name, name)}
    return {module.imports[name]} if name in module.imports else set()
