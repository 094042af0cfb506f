"""Names that users may rely on: functions with parameters, commands with options, results, keys of JSON, columns.

`PYTHONPATH=src:tests python tests/contracts/stable_scene.py` adds what is new to the committed list of this minor
release; it refuses where something would be removed. docs/people/stable.md says what may change, and how.
"""

import inspect
import json
import re
import sys
import tempfile
import tomllib
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO

import typer

import catseye
from catseye.api.result import Result
from catseye.cli.commands import app, join_commands
from contracts.table_scene import tables
from repository import ROOT

MINOR = ".".join(catseye.__version__.split(".")[:2])
LIST = ROOT / "tests" / "vectors" / f"stable-{MINOR}.toml"
WIDTH = 120
KEY = re.compile(r"[a-z][a-z0-9_]*")  # of a name in JSON; others are data, such as names of rangers
WEATHER = "--temperature-c 20 --pressure-hpa 933 --humidity-percent 50"
POINTING = "--monument night-01/monuments/ZY103.toml --mirror night-01/mirrors/ZP103.toml"
OBJECTS = (  # commands, in this order, whose JSON objects are looked at; some seconds in all
    f"air {WEATHER}",
    f"sound {WEATHER}",
    "glass BK7-old --height-mm 38.4",
    "link --distance 120",
    "safety --power-mw 10 --wavelength-um 0.780 --diameter-mm 20 --divergence-mrad 0.05",
    "beam beams/head.toml --distance-m 120",
    f"point {POINTING} --to=0,0,50",
    "pointing predict --azimuth-deg 145.3 --elevation-deg 30 --model published",
    "pointing fit pointing/stars.dat --against published",
    "pointing track --tilts pointing/tilts.csv --harmonics 3",
    "adjust networks/feed-arm.toml",
    "plan networks/ground-ring",
    "triplet triplets/TR01.toml",
    "calibrate linearity calibrations/linearity.csv",
    "refractometer refractometer/path-a.csv",
    "acoustic acoustic/evening-1.wav --sheet acoustic/evening.toml",
    "panels panels/as-found.csv --instrument panels/tool.toml --layout gbt",
    "model displace structural-model/telescope.toml --posture 145,45 --site gbt --points ZEG41040L",
    "model fit structural-model/telescope.toml structure/epochs.csv --free alidade:turn_x",
    "reduce night-01 --out night",
    "explain night-01 120",
    "surface night",
    "pose night --site night-01",
)


def parameters(function):
    """Parameters as they may be written: `name`, `name=` with a default, `*` before those that are keywords only."""
    names, keyword = [], False
    for each in inspect.signature(function).parameters.values():
        if each.kind is each.KEYWORD_ONLY and not keyword:
            keyword = True
            names.append("*")
        star = {each.VAR_POSITIONAL: "*", each.VAR_KEYWORD: "**"}.get(each.kind, "")
        names.append(f"{star}{each.name}{'' if star or each.default is each.empty else '='}")
    return names


def functions():
    """Functions of `import catseye` with their parameters."""
    found = {name: getattr(catseye, name) for name in catseye.__all__}
    return {name: parameters(value) for name, value in found.items() if inspect.isfunction(value)}


def errors():
    """Errors of `import catseye` with the classes by which they may be caught."""
    found = [getattr(catseye, name) for name in catseye.__all__]
    return {
        value.__name__: sorted(base.__name__ for base in value.__mro__[1:] if base is not object)
        for value in found
        if inspect.isclass(value) and issubclass(value, Exception)
    }


def commands():
    """Commands with options and arguments, marked as the head of the list says."""
    join_commands()
    found = {}

    def walk(command, words):
        if hasattr(command, "commands"):
            for name, each in command.commands.items():
                walk(each, [*words, name])
            return
        names = []
        for each in command.params:
            if each.param_type_name == "argument":
                names.append(f"{each.name.upper()}{'...' if each.nargs != 1 else ''}{'' if each.required else '?'}")
            else:
                need = "!" if each.required else ""
                names += [f"{option}{need}" for option in (*each.opts, *each.secondary_opts)]
        found[" ".join(words)] = names

    walk(typer.main.get_command(app), [])
    return found


def results():
    """Result classes with their public attributes beyond those of every result."""

    def subclasses(kind):
        for each in kind.__subclasses__():
            yield each
            yield from subclasses(each)

    for name in catseye.__all__:
        getattr(catseye, name)  # loads the modules
    found = {each.__name__: each for each in subclasses(Result) if each.__module__.startswith("catseye.api")}
    common = _attributes(Result)
    return {"Result": common, **{name: sorted(set(_attributes(each)) - set(common)) for name, each in found.items()}}


def _attributes(kind):
    fields = {name for base in kind.__mro__ for name in vars(base).get("__annotations__", {})}
    return sorted(name for name in {*dir(kind), *fields} if not name.startswith("_"))


def keys(value, path=""):
    """Keys of a JSON object with their paths, two deep: `points[].name`; names that are data are left out."""
    if isinstance(value, list):
        for each in value[:1]:
            yield from keys(each, f"{path}[]")
    elif isinstance(value, dict):
        for key, each in value.items():
            if KEY.fullmatch(key):
                inner = f"{path}.{key}" if path else key
                yield inner
                if "." not in inner:
                    yield from keys(each, inner)


def objects():
    """Keys of the JSON object of each command of `OBJECTS`."""
    join_commands()
    command, found = typer.main.get_command(app), {}
    with tempfile.TemporaryDirectory() as place, chdir(place):
        for line in OBJECTS:
            text, notes = StringIO(), StringIO()
            with redirect_stdout(text), redirect_stderr(notes):
                command.main([*line.split(), "--json"], prog_name="catseye", standalone_mode=False)
            found[line] = list(dict.fromkeys(keys(json.loads(text.getvalue()))))
    return found


def columns():
    """Columns of each table that catseye writes, by its page and file."""
    return {f"{table.page} {table.file}": [column.name for column in table.columns] for table in tables()}


PARTS = {
    "functions": functions,
    "errors": errors,
    "commands": commands,
    "results": results,
    "objects": objects,
    "columns": columns,
}


def committed():
    """The list as it is committed; empty without a file."""
    return tomllib.loads(LIST.read_text(encoding="utf-8")) if LIST.is_file() else {}


def lines(names):
    """Array of TOML, lines of at most WIDTH characters."""
    row, rows = "   ", []
    for name in names:
        cell = f" {json.dumps(name)},"
        if len(row) + len(cell) > WIDTH:
            rows.append(row)
            row = "   "
        row += cell
    return "\n".join(["[", *rows, row, "]"]) if names else "[]"


def losses(old, now):
    """Names of a list that are not there now, or that a user can no longer write as before; one line each."""
    for part, entries in old.items():
        for name, names in entries.items():
            if name not in now[part]:
                yield f"{part}: {name} is gone"
                continue
            compare = {"functions": _calls_lost, "commands": _options_lost}.get(part, _names_lost)
            yield from (f"{part}: {name}: {loss}" for loss in compare(names, now[part][name]))


def _names_lost(old, now):
    yield from (f"{name} is gone" for name in old if name not in now)


def _calls_lost(old, now):
    def positional(names):
        return [name.rstrip("=") for name in (names[: names.index("*")] if "*" in names else names)]

    required = {name for name in now if name.isidentifier()}
    there = {name.rstrip("=") for name in now}
    yield from (f"{name.rstrip('=')} is gone" for name in old if name.rstrip("=") not in {*there, "*"})
    yield from (f"{name} is now required" for name in sorted(required - set(old)))
    if positional(now)[: len(positional(old))] != positional(old):
        yield f"positional arguments were {', '.join(positional(old))}"


def _options_lost(old, now):
    def arguments(names):
        return [name.rstrip("?") for name in names if not name.startswith("-")]

    optional = {name.rstrip("!?") for name in now if name.endswith("?") or (name.startswith("-") and name[-1] != "!")}
    required = {name.rstrip("!") for name in now} - optional - {name for name in now if name.endswith("?")}
    there, former = {name.rstrip("!?") for name in now}, {name.rstrip("!?") for name in old}
    needed = {name.rstrip("!") for name in old if name.endswith("!") or (not name.startswith("-") and name[-1] != "?")}
    yield from (f"{name} is gone" for name in sorted(former - there))
    yield from (f"{name} is now required" for name in sorted(required - needed))
    if arguments(now)[: len(arguments(old))] != arguments(old):
        yield f"arguments were {' '.join(arguments(old))}"


def page_text(now):
    """Text of the list."""
    text = [
        f"# Names that users may rely on in releases {MINOR}.x, and one minor release beyond their deprecation.",
        "# Written by tests/contracts/stable_scene.py; a name that is removed fails tests/contracts/test_stable.py.",
        "# functions: name= has a default, names after * are keywords. commands: --option! and FILE are required,",
        "# FILE? is not, ... takes several. objects: keys of --json. columns: of the tables in docs/formats.",
    ]
    for part, entries in now.items():
        text.append(f"\n[{part}]")
        text += [f"{json.dumps(name)} = {lines(entries[name])}" for name in sorted(entries)]
    return "\n".join(text) + "\n"


def surface():
    """All that may be relied on, as it is now."""
    return {part: made() for part, made in PARTS.items()}


if __name__ == "__main__":
    now = surface()
    if gone := list(losses(committed(), now)):
        sys.exit("\n".join(gone))
    LIST.write_text(page_text(now), encoding="utf-8")
    sys.stdout.write(f"{LIST} written\n")
