"""Nights, reductions and journals that many tests need: made once for all workers, kept by their source and arguments.

They stand in .pytest_cache, which git ignores and `make clean` removes, in a folder named by a hash of all that they
come from: catseye's source, the examples, what the tests themselves set up, the versions of what computes.
"""

import fcntl
import hashlib
import os
import pickle
import shutil
import sys
import time
from collections.abc import Callable
from functools import cache, wraps
from importlib.metadata import version
from pathlib import Path

from repository import ROOT

CACHE = ROOT / ".pytest_cache" / "kept"
LONGEST_UNUSED = 86_400.0  # s: what an older source made goes when a newer one makes something


@cache
def place() -> Path:
    """The folder of this very source."""
    found = hashlib.sha256(repr((sys.version, [version(name) for name in ("numpy", "scipy", "numba")])).encode())
    for tree, pattern in (("src", "*.py"), ("examples", "*"), ("tests", "*_scene.py"), ("tests", "conftest.py")):
        for path in sorted((ROOT / tree).rglob(pattern)):
            if path.is_file() and "__pycache__" not in path.parts:
                found.update(f"{path.relative_to(ROOT)}\0".encode() + hashlib.sha256(path.read_bytes()).digest())
    folder = CACHE / found.hexdigest()[:32]
    if not folder.is_dir():
        for old in CACHE.glob("*"):
            if time.time() - old.stat().st_mtime > LONGEST_UNUSED:
                shutil.rmtree(old, ignore_errors=True)
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def kept(name: str, make: Callable[[Path], object]) -> Path:
    """A file or folder that one worker makes, at the path it is given, while the others wait; whole or not at all."""
    path = place() / name
    if not path.exists():
        with (place() / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not path.exists():
                part = path.with_name(f"{name}.{os.getpid()}.part")
                make(part)
                part.rename(path)
    return path


def named(what: str, *arguments: object) -> str:
    """Name of a thing made with some arguments."""
    return f"{what}-{hashlib.sha256(pickle.dumps(arguments)).hexdigest()[:24]}"


def kept_value(function):
    """The function, its answers kept by its arguments; each caller has one of his own, which he may change."""

    @wraps(function)
    def answer(*arguments, **options):
        def make(path):
            path.write_bytes(pickle.dumps(function(*arguments, **options), pickle.HIGHEST_PROTOCOL))

        path = kept(named(function.__name__, arguments, options), make)
        return pickle.loads(path.read_bytes())  # noqa: S301 - this source's own; no format of ours holds a reduction

    return answer


def compile_once() -> None:
    """A kernel that two workers need is compiled by the first; the second waits and loads what numba kept."""
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.dispatcher import Dispatcher

    compile_here = Dispatcher.compile

    def compile_alone(dispatcher, signature):
        name = f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__qualname__}"
        if name in held:  # a recursion
            return compile_here(dispatcher, signature)
        with global_compiler_lock, (place() / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            held.add(name)
            try:
                return compile_here(dispatcher, signature)
            finally:
                held.discard(name)

    held: set[str] = set()
    Dispatcher.compile = compile_alone


@kept_value
def night_of(seed, **options):
    """A simulated night."""
    from catseye.simulator.night.simulate import simulate_night

    return simulate_night(seed, **options)


def night_directory(seed, **options) -> Path:
    """The campaign of a simulated night, to be read."""
    from catseye.simulator.night.sheets import write_night

    return kept(named("night", seed, options), lambda path: write_night(night_of(seed, **options), path))


@kept_value
def reduction_of(seed, **options):
    """The campaign of a simulated night, reduced with default settings."""
    from catseye.records.night.campaign import read_campaign
    from catseye.reduction.epoch.epoch import reduce_epoch

    return reduce_epoch(read_campaign(night_directory(seed, **options)))


@kept_value
def reduction_of_example():
    """The night that ships with catseye, reduced with default settings."""
    from catseye.records.night.campaign import read_campaign
    from catseye.reduction.epoch.epoch import reduce_epoch

    return reduce_epoch(read_campaign(ROOT / "examples" / "night-01"))


def reduction_directory() -> Path:
    """Everything that `catseye reduce --out` writes of it: to be read, and copied by whoever changes it."""
    from catseye.gateways.epoch.files import write_reduction
    from catseye.gateways.writers.output import atomic_directory

    def make(path):
        with atomic_directory(path, ROOT / "examples" / "night-01") as directory:
            write_reduction(reduction_of_example(), directory)

    return kept("reduction", make)
