"""Every citation has its entry in the bibliography, every entry is cited."""

import re
from functools import cache

from catseye.bibliography import SOURCES
from repository import ROOT

SOURCE_TREE = ROOT / "src" / "catseye"
KEY = re.compile(r"\[([A-Z]{3,}\d{2,3})\]")
BARE = re.compile(r"\b([A-Z]{3,}\d{2,3})\b")


@cache
def cited() -> dict[str, set[str]]:
    """Keys in brackets by where they stand; in this project's source, the bibliography itself left out."""
    found: dict[str, set[str]] = {}
    for path in sorted(SOURCE_TREE.rglob("*.py")):
        if path.name != "bibliography.py":
            for key in KEY.findall(path.read_text(encoding="utf-8")):
                found.setdefault(key, set()).add(path.relative_to(SOURCE_TREE).as_posix())
    return found


def test_every_citation_has_an_entry():
    missing = {key: sorted(where) for key, where in cited().items() if key not in SOURCES}
    assert not missing


def test_every_entry_is_cited():
    between = set(BARE.findall((SOURCE_TREE / "bibliography.py").read_text(encoding="utf-8")))
    bare = set()
    for path in SOURCE_TREE.rglob("*.py"):
        if path.name != "bibliography.py":
            bare |= set(BARE.findall(path.read_text(encoding="utf-8")))
    assert sorted(SOURCES) == sorted(k for k in SOURCES if k in cited() or k in bare)
    assert set(SOURCES) <= between


def test_entries_say_what_they_are():
    for key, source in SOURCES.items():
        assert KEY.fullmatch(f"[{key}]"), key
        assert len(source.title) > 20, key
        assert source.locator, key
        assert source.used, key


def test_the_use_of_both_documents_names_every_package_that_cites_them():
    """A reader of the references finds each formula's package; doors and writers follow from these."""
    for key in ("PARKER04", "GOLDMAN00"):
        named = re.findall(r"`([a-z_.]+)`", SOURCES[key].used)
        modules = [where.removesuffix(".py").replace("/", ".") for where in cited()[key]]
        formulas = [module for module in modules if not module.startswith(("api.", "gateways.", "cli."))]
        assert len(formulas) > 20, key
        lacking = [m for m in formulas if not any(m == name or m.startswith(f"{name}.") for name in named)]
        assert not lacking, f"{key}: name their package in `used`: {', '.join(lacking)}"
