"""Copies of the examples bundled with catseye."""

import shutil
from pathlib import Path

from catseye.errors import InputError
from catseye.gateways.writers.output import new_directory
from catseye.records.files.examples import SKIPPED, example, examples_directory


def copy_example(name: str, directory: Path) -> tuple[Path, ...]:
    """Copy a folder of examples atomically; the files written.

    name        as for `example`, or "" for all
    directory   new or empty

    Raises InputError where the directory is not empty or cannot be written.
    """
    root = example(name) if name else examples_directory()
    if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
        raise InputError(f"{directory}: exists and is not empty (expected a new or an empty folder)")
    with new_directory(directory) as fresh:

        def copied(source: str, target: str) -> None:
            try:
                shutil.copy2(source, target)
            except OSError as problem:  # copytree would collect these in a list
                place = directory / Path(target).relative_to(fresh)
                raise InputError(f"{place}: cannot be written: {problem.strerror or problem}") from problem

        ignored = shutil.ignore_patterns(*SKIPPED)
        shutil.copytree(root, fresh, ignore=ignored, copy_function=copied, dirs_exist_ok=True)
    return tuple(sorted(path for path in directory.rglob("*") if path.is_file()))
