"""List of what comes with catseye, with versions and licences: docs/components.md.

Versions are those of constraints.txt and of front/package-lock.json, licences those that the packages state.
`PYTHONPATH=src:tests python tests/contracts/components_scene.py` writes it.
"""

import json
import re
import tomllib
from importlib.metadata import PackageNotFoundError, metadata, requires, version

from repository import ROOT

PAGE = ROOT / "docs" / "components.md"
LOCK = ROOT / "front" / "package-lock.json"
BUILT_IN = ("clsx", "esm-env", "svelte", "uplot")  # what Vite puts into the files; svelte brings the first two
FOR_DEVELOPERS = ("dev", "docs", "test-web")  # extras
REQUIREMENT = re.compile(r"^([A-Za-z0-9._-]+)(?:\[([^\]]*)\])?[^;]*(?:;(.*))?$")  # name, its extras, marker
EXTRA = re.compile(r"extra == ['\"]([^'\"]+)['\"]")
LONGEST = 40  # characters of a licence; some packages state its whole text
CLASSIFIER = "License :: OSI Approved :: "
SPELLED = {  # of packages that state no expression
    "Apache Software License": "Apache-2.0",
    "Apache License 2.0": "Apache-2.0",
    "BSD License": "BSD",
    "MIT License": "MIT",
    "GNU Lesser General Public License v3 (LGPLv3)": "LGPL-3.0-only",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
}
HEAD = """# Components

What comes with catseye, with the versions it is tested with and the licences that each states; a test holds this page
to constraints.txt and front/package-lock.json. catseye itself is BSD-3-Clause.
"""


def normal(name):
    """Name of a package as registries compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def pins():
    """Versions of constraints.txt by normal name, with the name as it is spelled."""
    rows = (line.split("==") for line in (ROOT / "constraints.txt").read_text().splitlines() if "==" in line)
    return {normal(name): (name, version) for name, version in rows}


def project():
    """Direct requirements by extra; "" for those of all."""
    table = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lists = {"": table["dependencies"], **table["optional-dependencies"]}
    return {extra: [normal(REQUIREMENT.match(text)[1]) for text in texts] for extra, texts in lists.items()}


def closure(names, pinned):
    """Those packages and all that they need here."""
    found, waiting = set(), [(name, "") for name in names]
    while waiting:
        name, extras = waiting.pop()
        if (name, extras) in found or name not in pinned:
            continue
        found.add((name, extras))
        for text in requires(name) or ():
            requirement, wanted, marker = REQUIREMENT.match(text).groups()
            own = normal(requirement) in (f"{name}-binary", f"{name}-core")
            if own or set(EXTRA.findall(marker or "")) <= set(extras.split(",")):
                waiting.append((normal(requirement), wanted or ""))
    return {name for name, _ in found}


def installed(name):
    """Version of an installed package, None for one that is not."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def licence(name):
    """Licence that a package states, in few words; "" where it is not installed."""
    try:
        about = metadata(name)
    except PackageNotFoundError:
        return ""
    if about.get("License-Expression"):
        return about["License-Expression"]
    kinds = [c.removeprefix(CLASSIFIER) for c in about.get_all("Classifier") or () if c.startswith(CLASSIFIER)]
    text = kinds[0] if kinds else (about.get("License") or "not stated")
    text = SPELLED.get(text, text)
    return text if len(text) <= LONGEST and "\n" not in text else text.splitlines()[0][:LONGEST]


def wheels():
    """Sections of wheels: title, rows of name, version and licence; each package stands in the first that needs it."""
    pinned, extras, seen = pins(), project(), set()
    sections = []
    users = [extra for extra in extras if extra not in FOR_DEVELOPERS]
    for title, chosen in [
        *(("Needed" if extra == "" else f"Extra `{extra}`", [extra]) for extra in users),
        ("For developers: wheels", list(FOR_DEVELOPERS)),
    ]:
        names = closure([name for extra in chosen for name in extras[extra]], pinned) - seen
        seen |= names
        sections.append((title, [(*pinned[name], licence(name)) for name in sorted(names)]))
    return sections


def modules():
    """Sections of npm packages: those built in, and those that build and check."""
    lock = json.loads(LOCK.read_text(encoding="utf-8"))["packages"]
    rows = sorted(
        {(path.rpartition("node_modules/")[2], row["version"], row["license"]) for path, row in lock.items() if path}
    )
    inside = [row for row in rows if row[0] in BUILT_IN]
    return [
        ("Built into the page and the reports", inside),
        ("For developers: npm", [row for row in rows if row not in inside]),
    ]


def page_text():
    """Text of the page."""
    parts = [HEAD]
    for title, rows in (*wheels(), *modules()):
        lines = "\n".join(f"| {name} | {version} | {stated} |" for name, version, stated in rows)
        parts.append(f"## {title}\n\n| component | version | licence |\n|---|---|---|\n{lines}\n")
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(page_text(), encoding="utf-8")
