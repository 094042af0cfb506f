"""The tables of columns on the pages of docs/formats, and their definitions in the package.

`PYTHONPATH=src:tests python tests/contracts/table_scene.py` writes the pages anew.
"""

import importlib
import inspect
import pkgutil
import re
import sys

import catseye
from catseye.gateways.writers.columns import Table
from catseye.records.files.record import Record
from repository import ROOT

PAGES = ROOT / "docs" / "formats"
HEAD = "| column | unit | meaning |"


def modules(*rooms):
    """Every module of some rooms of the package."""
    for room in rooms:
        package = importlib.import_module(f"{catseye.__name__}.{room}")
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            yield importlib.import_module(found.name)


def tables():
    """Every table that the package can write, once."""
    found = {
        id(value): value for module in modules("gateways") for value in vars(module).values() if type(value) is Table
    }
    return sorted(found.values(), key=lambda table: (table.page, table.file))


def records():
    """Records that are a row of a table: its file -> the record."""
    found = {}
    for module in modules("records"):
        for value in vars(module).values():
            if inspect.isclass(value) and issubclass(value, Record):
                match = re.match(r"Row of ([a-z_]+\.csv)\b", value.__doc__ or "")
                if match:
                    found[match[1]] = value
    return found


def section(page, file):
    """First and last line of the section whose heading names a file, or None."""
    lines = page.splitlines()
    for first, line in enumerate(lines):
        if line.startswith("#") and f"`{file}`" in line:
            end = next((k for k in range(first + 1, len(lines)) if lines[k].startswith("#")), len(lines))
            return first, end
    return None


def described(page, file):
    """Table of columns in a file's section, as it stands; None without one."""
    where = section(page, file)
    if where is None:
        return None
    lines = page.splitlines()[slice(*where)]
    if HEAD not in lines:
        return None
    first = lines.index(HEAD)
    end = next((k for k in range(first, len(lines)) if not lines[k].startswith("|")), len(lines))
    return "".join(f"{line}\n" for line in lines[first:end])


def rewritten(page, table):
    """Page with the table's columns in its section, in place of those there or at the section's end."""
    old = described(page, table.file)
    if old is not None:
        return page.replace(old, table.markdown(), 1) if page.count(old) == 1 else _within(page, table, old)
    lines = page.splitlines()
    _, end = section(page, table.file)
    while not lines[end - 1].strip():
        end -= 1
    return "\n".join([*lines[:end], "", *table.markdown().splitlines(), *lines[end:]]) + "\n"


def _within(page, table, old):
    first, _ = section(page, table.file)
    lines = page.splitlines(keepends=True)
    head, tail = "".join(lines[:first]), "".join(lines[first:])
    return head + tail.replace(old, table.markdown(), 1)


if __name__ == "__main__":
    for table in tables():
        path = PAGES / table.page
        page = path.read_text(encoding="utf-8")
        if section(page, table.file) is None:
            sys.stdout.write(f"{path}: no heading names `{table.file}`\n")
        elif (new := rewritten(page, table)) != page:
            path.write_text(new, encoding="utf-8")
            sys.stdout.write(f"{path}: `{table.file}` written\n")
