"""Inputs of all commands: paths that may be examples, and their completion in a shell."""

import functools
import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args

import typer
from typer.models import ArgumentInfo, OptionInfo

from catseye.cli.completion import complete
from catseye.cli.terminal import by_options, for_programs
from catseye.errors import ArgumentError

WRITTEN = frozenset(  # options and arguments whose path is made, not read
    {
        "actuators",
        "archive_samplers",
        "blank",
        "certificate",
        "copy",
        "directory",
        "out",
        "page",
        "template",
        "write",
        "write_stars",
    }
)

OUTPUTS = frozenset({"earlier", "epoch", "inputs", "sources"})  # read, and written by a command before


def prepare(app: typer.Typer) -> None:
    """Let every command of an app take examples by name where it reads a path, and complete their words.

    A second call changes nothing.
    """
    for group in [app, *(each.typer_instance for each in app.registered_groups if each.typer_instance is not None)]:
        for command in group.registered_commands:
            callback = command.callback
            if callback is None or hasattr(callback, "__prepared__"):
                continue
            for parameter in inspect.signature(callback).parameters.values():
                complete(command.name or callback.__name__.rstrip("_"), parameter)
            command.callback = _with_examples(callback)


def paths_of(callback: Callable[..., Any]) -> Iterator[str]:
    """Names of a command's parameters that are paths, or lists of paths."""
    for name, parameter in inspect.signature(callback).parameters.items():
        if "Path" in str((get_args(parameter.annotation) or (parameter.annotation,))[0]):
            yield name


def _with_examples(callback: Callable[..., Any]) -> Callable[..., Any]:
    """The command with each path that it reads located: as it stands, or the example of that name."""
    read = [name for name in paths_of(callback) if name not in WRITTEN]

    @functools.wraps(callback)
    def run(**given: Any) -> Any:
        if read:
            from catseye.api.reading import place_of

            for name in read:
                value = given.get(name)
                if isinstance(value, Path):
                    given[name] = place_of(value, output=name in OUTPUTS)
                elif isinstance(value, list):
                    given[name] = [place_of(each, output=name in OUTPUTS) for each in value]
        try:
            with for_programs(bool(given.get("json"))):
                return callback(**given)
        except ArgumentError as problem:  # here the command is known, and how it spells its options
            raise ArgumentError(by_options(str(problem), problem.names, spelled(callback))) from problem

    run.__signature__ = inspect.signature(callback)  # type: ignore[attr-defined]
    run.__prepared__ = True  # type: ignore[attr-defined]
    return run


def spelled(callback: Callable[..., Any]) -> dict[str, str]:
    """Options of a command by their parameters' names, an argument by its name in `--help`."""
    names = {}
    for name, parameter in inspect.signature(callback).parameters.items():
        for info in get_args(parameter.annotation)[1:]:
            if isinstance(info, ArgumentInfo):
                names[name] = info.metavar or name.upper()
            elif isinstance(info, OptionInfo):  # in `Annotated`, the first spelling stands where a default would
                spellings = [each for each in (info.default, *(info.param_decls or ())) if isinstance(each, str)]
                options = [each.split("/")[0] for each in spellings if each.startswith("--")]
                names |= {name: options[0]} if options else {}
    return names
