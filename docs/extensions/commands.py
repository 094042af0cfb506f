"""Directive of the command line's reference: a command with all that its `--help` knows.

    ```{command-reference} pointing fit
    ```

writes synopsis, examples, every argument and option with type, default and range, exit status and the Python function
of the same name, from the command itself. An option can be linked and searched: `{option}` roles work.
"""

import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar, get_args, get_origin

import typer
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

import catseye
from catseye.cli.commands import app, join_commands
from catseye.cli.completion import words_of

VERBS = ("plot",)  # groups whose name is the verb
NAMES = {"help": "topic"}  # commands whose function has another name
OF_SEVERAL = {"reduce": "reduce_nights", "replay": "replay_journals", "simulate": "simulate_runs"}
TYPES = {bool: "flag", int: "integer", float: "number", str: "text", Path: "path"}
WIDTH = 76  # characters of a synopsis
PROBES = (float("nan"), -1e30, 1e30)  # values that no range holds
EXAMPLE = re.compile(r"\s*(?:(?P<label>[^:]+):\s+)?(?P<command>catseye .+)")
EXPECTED = re.compile(r"expected ([^()]+)\)")
REFUSED = re.compile(r"is not (?:a )?(?:time )?(?:within )?(.+)\.$")


def commands() -> dict[str, Any]:
    """Every command by its words, in the order of `catseye --help`."""
    join_commands()
    return dict(_within(typer.main.get_command(app), ()))


def _within(group: Any, words: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _within(command, (*words, name))
        else:
            yield " ".join((*words, name)), command


def functions(words: str) -> list[str]:
    """Names of the Python functions that do a command's work: of one input, and of several."""
    parts = words.split()
    name = NAMES.get(words) or "_".join(parts if parts[0] in VERBS else reversed(parts)).replace("-", "_")
    return [each for each in (name, OF_SEVERAL.get(words)) if each and hasattr(catseye, each)]


def parameters_of(command: Any, kind: str) -> list[Any]:
    """Parameters of a command that `--help` shows, of kind "argument" or "option"."""
    return [each for each in command.params if each.param_type_name == kind and not getattr(each, "hidden", False)]


def synopsis(words: str, command: Any) -> str:
    """Usage of a command, in lines of at most WIDTH characters."""
    pieces = [spelling(each) for each in parameters_of(command, "argument")]
    pieces += [_piece(each) for each in parameters_of(command, "option")]
    lines = [f"catseye {words}"]
    for piece in sorted(pieces, key=lambda piece: piece.startswith("[-")):
        if len(lines[-1]) + 1 + len(piece) > WIDTH:
            lines.append("   ")
        lines[-1] += f" {piece}"
    return "\n".join(lines)


def _piece(option: Any) -> str:
    text = spelling(option).split(", ")[0]
    if is_list(option):
        text += " ..."
    return text if option.required else f"[{text}]"


def spelling(parameter: Any) -> str:
    """A parameter as a person types it: an option with its value, an argument by its name."""
    if parameter.param_type_name == "argument":
        name = parameter.metavar or parameter.name.upper()
        return name if parameter.required or name.startswith("[") else f"[{name}]"
    names = [*parameter.opts, *parameter.secondary_opts]
    if kind_of(parameter) is bool:
        return ", ".join(names)
    words = words_of(parameter.type_descriptor.parameter_info)
    value = parameter.metavar or {int: "N", float: "NUMBER", Path: "FILE"}.get(kind_of(parameter), "TEXT")
    if words:
        value = "WORD"
    return ", ".join(f"{name} {value}" for name in names)


def kind_of(parameter: Any) -> type:
    """Python type of a parameter's value, or of each where there are several."""
    annotation = parameter.type_descriptor.annotation
    return get_args(annotation)[0] if get_origin(annotation) is list else annotation


def is_list(parameter: Any) -> bool:
    """True for an option or argument that takes several values."""
    return get_origin(parameter.type_descriptor.annotation) is list


def range_of(parameter: Any) -> str:
    """Range of a number as words; "" without one."""
    if kind_of(parameter) not in (int, float):
        return ""
    low, high = parameter.min, parameter.max
    if low is not None and high is not None:
        return f"{_number(low)} to {_number(high)}"
    if low is not None or high is not None:
        return f"{_number(low)} or more" if high is None else f"at most {_number(high)}"
    check = parameter.type_descriptor.parameter_info.callback
    if check is None or len(inspect.signature(check).parameters) != 1:
        return ""
    for value in PROBES:
        try:
            check([value] if is_list(parameter) else value)
        except typer.BadParameter as problem:
            if match := EXPECTED.search(problem.message) or REFUSED.search(problem.message):
                words = re.sub(r", for none, nor between (\S+) and (\S+)", r" for none, or \1 to \2", match[1])
                return re.sub(r"e\+0?(\d+)", r"e\1", words)
        except (TypeError, ValueError, OverflowError):
            continue
    return ""


def _number(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:g}"


def facts(parameter: Any) -> list[str]:
    """Type, words, range and default of a parameter, each as a phrase."""
    info = parameter.type_descriptor.parameter_info
    words = words_of(info)
    said = [f"one of {', '.join(words)}" if words else TYPES.get(kind_of(parameter), "text")]
    if is_list(parameter):
        said.append("several" if parameter.param_type_name == "argument" else "may repeat")
    if limits := range_of(parameter):
        said.append(limits)
    if parameter.required:
        said.append("required")
    elif parameter.default not in (None, False, ()) and "[default:" not in (parameter.help or ""):
        said.append(f"default {parameter.default}")
    return said


def help_of(parameter: Any) -> str:
    """Help of a parameter as Markdown, its default as a sentence."""
    text = re.sub(r"\s*\[default: (.+?)\]", r" Default: \1.", parameter.help or "")
    return marked(text)


def marked(text: str) -> str:
    """Plain text as Markdown, pages of docs as links, options as code."""
    text = re.sub(r"([\\`*_\[\]<>$|#~^])", r"\\\1", text)
    text = re.sub(r"(?<![\w-])--[a-z][a-z0-9-]*", r"`\g<0>`", text)
    return re.sub(r"docs/([\w/-]+\.md)", r"[docs/\1](/\1)", text)


def examples(epilog: str) -> tuple[list[str], list[str]]:
    """Commands of an epilog as lines of a terminal, each under its label; and its other sentences."""
    commands_, notes = [], []
    for line in epilog.replace("\b", "").strip("\n").splitlines():
        match = EXAMPLE.match(line)
        if match and "docs/" not in line:
            if match["label"] not in (None, "Example", "Examples"):
                commands_.append(f"# {match['label']}")
            commands_.append(f"$ {match['command']}")
        elif line.startswith("  ") and commands_:
            commands_[-1] += f" \\\n    {line.strip()}"
        elif line.strip():
            notes.append(line.strip())
    return commands_, notes


def markdown(words: str, command: Any) -> str:
    """Reference of a command as MyST Markdown."""
    lines, notes = examples(command.epilog or "")
    parts = [
        marked(command.help or ""),
        _literal(synopsis(words, command), "text"),
        _literal("\n".join(lines), "console"),
    ]
    parts += [marked(note if note.endswith(".") else f"{note}.") for note in notes]
    ends = "[Exit status](/commands.md)"
    if named := functions(words):
        roles = " and, for several, ".join(f"{{py:func}}`catseye.{name}`" for name in named)
        ends = f"In Python: {roles}. {ends}"
    parts.append(f"{ends}: as for every command.")
    parts.append(f"```{{program}} catseye {words}\n```")
    for title, kind in (("Arguments", "argument"), ("Options", "option")):
        if parameters := parameters_of(command, kind):
            parts.append(f"**{title}**")
            parts += [_option(each) for each in parameters]
    return "\n\n".join(parts)


def _literal(text: str, language: str) -> str:
    return f"```{{code-block}} {language}\n{text}\n```"


def _option(parameter: Any) -> str:
    said = "; ".join(marked(phrase) for phrase in facts(parameter))
    return f"```{{option}} {spelling(parameter)}\n{help_of(parameter)}\n*{said[0].upper()}{said[1:]}.*\n```"


class CommandReference(SphinxDirective):
    """Reference of the command that the argument names."""

    required_arguments = 1
    final_argument_whitespace = True
    option_spec: ClassVar = {}

    def run(self) -> list[nodes.Node]:
        """Nodes of the command's reference."""
        known, words = commands(), " ".join(self.arguments[0].split())
        if words not in known:
            raise ExtensionError(f"{self.get_location()}: no command {words!r} (expected one of {', '.join(known)})")
        self.env.note_dependency(inspect.getsourcefile(inspect.unwrap(known[words].callback)) or __file__)
        return self.parse_text_to_nodes(markdown(words, known[words]))


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the directive to Sphinx."""
    app.add_directive("command-reference", CommandReference)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
