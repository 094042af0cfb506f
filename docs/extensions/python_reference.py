"""Directives of the Python reference: `public` for names of `import catseye`, `formulas` for folders of modules.

    ```{public} reduce night
    ```

writes each function and the class of its result with all public attributes and methods;

    ```{formulas} catseye.optics
    ```

a section for each module of the folder, read at build.
"""

import importlib
import inspect
import pkgutil
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from rest_nodes import rest_nodes

OPTIONS = ("   :members:", "   :show-inheritance:")  # of a description


def result_classes(function: Any) -> list[type]:
    """Classes that a function returns, each of a union."""
    returned = inspect.signature(function).return_annotation
    namespace = inspect.unwrap(function).__globals__
    if isinstance(returned, str):
        parts = [namespace.get(part.strip()) for part in returned.split("|")]
    else:
        parts = list(getattr(returned, "__args__", (returned,)))
    return [part for part in parts if inspect.isclass(part) and part.__module__.startswith("catseye.")]


class Public(SphinxDirective):
    """Entries of public names with the classes of their results."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """Descriptions in the order of the names."""
        import catseye
        from catseye.api.result import Figures, Result

        lines: list[str] = []
        written: set[type] = {Result, Figures}  # shown where saving is
        for name in self.arguments[0].split():
            thing = getattr(catseye, name)
            if inspect.isclass(thing):
                lines += [f".. autoexception:: {thing.__module__}.{name}", *OPTIONS, ""]
                continue
            lines += [f".. autofunction:: catseye.{name}", ""]
            for each in result_classes(thing):
                if each not in written and each.__module__.startswith("catseye.api"):
                    written.add(each)
                    lines += [
                        f".. autoclass:: {each.__module__}.{each.__qualname__}",
                        "   :members:",
                        "   :show-inheritance:",
                        "",
                    ]
        return rest_nodes(self, lines)


def modules_of(package: str) -> list[str]:
    """Modules that lie in a folder itself."""
    place = importlib.import_module(package)
    return [f"{package}.{module.name}" for module in pkgutil.iter_modules(place.__path__) if not module.ispkg]


class Formulas(SphinxDirective):
    """Sections of the modules of a folder."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """One section a module, in alphabetical order."""
        package = self.arguments[0]
        place = importlib.import_module(package)
        self.env.note_dependency(place.__file__)
        made: list[nodes.Node] = rest_nodes(self, [f".. automodule:: {package}", "   :no-index:", ""])
        for name in modules_of(package):
            self.env.note_dependency(importlib.import_module(name).__file__)
            short = name.rpartition(".")[2]
            section = nodes.section("", nodes.title("", "", nodes.literal(short, short)), ids=[], names=[name])
            self.set_source_info(section)
            self.state.document.note_implicit_target(section, section)
            section += rest_nodes(self, [f".. automodule:: {name}", *OPTIONS, ""])
            made.append(section)
        return made


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directives."""
    app.add_directive("public", Public)
    app.add_directive("formulas", Formulas)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
