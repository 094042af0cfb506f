"""Groups of options: on the command line single options, in the command one named tuple.

Named tuples, not dataclasses: a dozen of those would cost `--help` ten milliseconds.
"""

import functools
import inspect
from collections.abc import Callable
from inspect import Parameter
from typing import Any


def grouped(command: Callable[..., None]) -> Callable[..., None]:
    """The command with each group of options in its signature as the group's single options, in the group's place."""
    groups: dict[str, type[Any]] = {}
    parameters: list[Parameter] = []
    for name, parameter in inspect.signature(command).parameters.items():
        group = parameter.annotation
        if hasattr(group, "_field_defaults"):
            groups[name] = group
            parameters += _options_of(group)
        else:
            parameters.append(parameter.replace(kind=Parameter.KEYWORD_ONLY))

    @functools.wraps(command)
    def run(**given: Any) -> None:
        built = {
            name: group(**{option: given.pop(option) for option in group._fields}) for name, group in groups.items()
        }
        command(**given, **built)

    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


def _options_of(group: type[Any]) -> list[Parameter]:
    return [
        Parameter(
            option,
            Parameter.KEYWORD_ONLY,
            default=group._field_defaults.get(option, Parameter.empty),
            annotation=group.__annotations__[option],
        )
        for option in group._fields
    ]
