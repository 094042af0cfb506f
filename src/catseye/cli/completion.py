"""Completion in a shell: words of options, and names of examples beside the files of a directory."""

import inspect
import re
from collections.abc import Callable, Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, get_args

import typer

EXAMPLES = {  # parameter, or "command parameter" -> patterns of the examples' names that fit it
    "acoustic files": ("acoustic/*.wav",),
    "acoustic sheet": ("acoustic/evening.toml", "acoustic/night.toml"),
    "acoustic weather": ("acoustic/station.csv",),
    "baseline observations": ("baselines/*-observations.csv",),
    "beam file": ("beams/*.toml",),
    "beam train": ("beams/*.toml",),
    "calibrate readings": ("calibrations/{kind}.csv", "calibrations/{kind}-planted.csv"),
    "calibrate sheet": ("calibrations/{kind}.toml", "calibrations/{kind}-planted.toml"),
    "certificate record": ("{kind}s/*.toml",),
    "panels readings": ("panels/as-found.csv",),
    "panels as_left": ("panels/as-left.csv",),
    "fit files": ("pointing/*.dat",),
    "point monument": ("monuments/*.toml",),
    "refractometer readings": ("refractometer/*.csv",),
    "refractometer sheet": ("refractometer/*.toml",),
    "subreflector mount": ("subreflector/*.toml",),
    "triplet files": ("triplets/*.toml",),
    "design site": ("gbt", "designs/*.toml"),
    "acoustic_field stations": ("acoustic/*-stations.csv",),
    "acoustic_field times": ("acoustic/*-times.csv",),
    "acoustic_field sheet": ("acoustic/*-times.toml",),
    "adjust ranges": ("triplets/prism-ranges.csv",),
    "compare angles": ("scans/analyser.csv", "scans/incidence.csv", "scans/rotation.csv"),
    "cycles table": ("cycles/*.csv",),
    "fit scans": ("scans/azimuth.csv", "scans/elevation.csv", "scans/raster.csv"),
    "follow series": ("vibration/*.csv",),
    "identify moves": ("servo/*.csv",),
    "import nodes": ("finite-elements/nodes.csv",),
    "import result": ("finite-elements/*.pch", "finite-elements/elevations.csv"),
    "locate ranges": ("positions/*ranges.csv",),
    "locate stations": ("positions/stations.csv",),
    "movements after": ("movements/after.csv",),
    "movements before": ("movements/before.csv",),
    "movements constraints": ("movements/*.toml",),
    "movements points": ("movements/points.csv",),
    "path stations": ("weather/stations.csv",),
    "phase buffer": ("buffers/*.csv",),
    "reduce ranges": ("triplets/prism-ranges.csv",),
    "search targets": ("scans/targets.csv",),
    "weather table": ("weather/tower.dat", "weather/valley.csv"),
    "weather sheet": ("weather/*.toml",),
    "campaign": ("night-01",),
    "calibrations": ("gbt", "night-01"),
    "heights": ("baselines/*-heights.csv",),
    "instrument": ("panels/tool.toml",),
    "job": ("certificates/*-job.toml",),
    "keep_out": ("keep-out.toml",),
    "laboratory": ("certificates/laboratory.toml",),
    "later": ("networks/*",),
    "layout": ("panels/layout.csv", "gbt"),
    "mirror": ("mirrors/*.toml",),
    "monument": ("monuments/*.toml",),
    "model": ("structural-model/*.toml",),
    "network": ("networks/*",),
    "site": ("gbt", "night-01"),
    "solids": ("solids.toml",),
    "structure": ("structural-model/*.toml",),
    "survey": ("panels/survey.csv",),
    "tilts": ("pointing/*.csv",),
}


def complete(command: str, parameter: inspect.Parameter) -> None:
    """Give a parameter of a command the completion of its words, or of the examples that it takes."""
    patterns = EXAMPLES.get(f"{command} {parameter.name}", EXAMPLES.get(parameter.name))
    for info in get_args(parameter.annotation)[1:]:
        if getattr(info, "autocompletion", True) is not None:
            continue
        if words := words_of(info):
            info.autocompletion = _words(words)
        elif patterns:
            info.autocompletion = _names(patterns)


def words_of(info: Any) -> tuple[str, ...]:
    """Words that an option or argument takes, from its check or from its metavar."""
    words = getattr(info.callback, "words", None) or str(info.metavar or "").split("|")
    return tuple(words) if len(words) > 1 and all(re.fullmatch(r"[A-Za-z][\w-]*", word) for word in words) else ()


def _words(words: tuple[str, ...]) -> Callable[[str], list[str]]:
    def beginning(incomplete: str) -> list[str]:
        return [word for word in words if word.startswith(incomplete)]

    return beginning


def _names(patterns: tuple[str, ...]) -> Callable[[typer.Context, str], list[str]]:
    def beginning(context: typer.Context, incomplete: str) -> list[str]:
        words = {key: value for key, value in context.params.items() if isinstance(value, str)}
        return names(patterns, words, incomplete)

    return beginning


def names(patterns: tuple[str, ...], words: dict[str, str], incomplete: str) -> list[str]:
    """Examples that begin as typed, and files likewise; none without an example, since shells complete files alone.

    patterns   of the examples' names, with {kind} for the value of an argument
    words      values of the arguments before; one that is missing matches anything
    """
    from catseye.api.reading import examples

    filled = [re.sub(r"\{(\w+)\}", lambda match: words.get(match[1]) or "*", pattern) for pattern in patterns]
    bundled = ["gbt", *examples()]  # short for sites/gbt
    fitting = [name for name in bundled if name.startswith(incomplete) and any(fnmatch(name, each) for each in filled)]
    if not fitting:
        return []
    files = set(_files(incomplete))
    return sorted(files.union(name for name in fitting if not {name, f"{name}/"} & files))


def _files(incomplete: str) -> Iterator[str]:
    """Files and folders that begin as typed, each folder with a slash."""
    folder, _, start = incomplete.rpartition("/")
    place = Path(folder or ("/" if incomplete.startswith("/") else "."))
    try:
        for path in place.iterdir():
            if path.name.startswith(start) and (start or not path.name.startswith(".")):
                yield incomplete[: len(incomplete) - len(start)] + path.name + ("/" if path.is_dir() else "")
    except OSError:
        return  # not a folder, or not ours to read: nothing to complete
