"""Wheel and source archive of a commit: built, compared bit for bit, and looked through."""

import base64
import csv
import hashlib
import io
import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email.parser import BytesParser
from pathlib import Path
from typing import NamedTuple

from packaging.metadata import Metadata
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
HAVING = (  # without which a wheel is incomplete
    "catseye/py.typed",
    "catseye/docs/index.md",
    "catseye/docs/formats/beam.md",
    "catseye/examples/night-01/site.toml",
    "catseye/examples/notebooks/one-night.ipynb",
    "catseye/gateways/writers/static/report.js",
    "catseye/web/static/index.html",
)
IN_SOURCE = ("pyproject.toml", "LICENSE", "README.md", "docs/index.md", "src/catseye/py.typed", "tests/conftest.py")
LACKING = re.compile(r"__pycache__|\.pyc$|/node_modules/|(^|/)\.(venv|git)/|/_build/|^catseye/(tests|front)/")
USERS = ("postgresql", "pdf", "web", "scale")  # extras that add to what catseye does
BOUND = re.compile(r">=\s*([\w.]+)")


class BuildError(Exception):
    """A release that cannot be published, with the reason."""


class Build(NamedTuple):
    """Files of one build, and the sources that they are made of."""

    wheel: Path
    source: Path
    tree: Path


def commit_time(commit: str = "HEAD") -> int:
    """Time of a commit, s since 1970: that of every file in the archives."""
    text = subprocess.run(
        ["git", "log", "-1", "--format=%ct", commit], cwd=ROOT, check=True, capture_output=True, text=True
    )
    return int(text.stdout)


def exported(commit: str, directory: Path) -> Path:
    """Clean copy of a commit: what git has, and nothing else of this folder."""
    directory.mkdir(parents=True)
    packed = subprocess.run(["git", "archive", "--format=tar", commit], cwd=ROOT, check=True, capture_output=True)
    with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
        archive.extractall(directory, filter="data")
    return directory


def built(tree: Path, directory: Path, kind: str, epoch: int) -> Path:
    """File of a build with hatchling.

    tree        sources
    directory   new folder for the file
    kind        "wheel" or "sdist"
    epoch       time of all files, s since 1970
    """
    directory.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(directory)]
    environment = {**os.environ, "SOURCE_DATE_EPOCH": str(epoch)}
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BuildError(f"{kind} cannot be built: {done.stderr.strip()}")
    return max(directory.iterdir(), key=lambda path: path.stat().st_mtime)


def built_twice(commit: str, directory: Path) -> Build:
    """Wheel and source archive, the same from two folders and from the source archive itself.

    directory   new folder; its `dist` holds the files
    """
    epoch = commit_time(commit)
    first, second = (exported(commit, directory / name / "tree") for name in ("first", "second-time-elsewhere"))
    wheel, source = (built(first, directory / "dist", kind, epoch) for kind in ("wheel", "sdist"))
    require_same(wheel, built(second, directory / "again", "wheel", epoch))
    require_same(source, built(second, directory / "again", "sdist", epoch))
    with tarfile.open(source) as archive:
        archive.extractall(directory / "unpacked", filter="data")
    (tree,) = (directory / "unpacked").iterdir()
    require_same(wheel, built(tree, directory / "from-source", "wheel", epoch))
    return Build(wheel, source, first)


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def require_same(one: Path, other: Path) -> None:
    """BuildError where two files differ in name or in a bit."""
    if one.name != other.name:
        raise BuildError(f"two builds have two names: {one.name}, {other.name}")
    if digest(one) != digest(other):
        raise BuildError(f"{one.name}: two builds differ (SHA-256 {digest(one)} and {digest(other)})")


def require_publishable(build: Build, version: str) -> list[str]:
    """Sentences on what was checked; BuildError for the first fault.

    Metadata follow the core metadata specification; each file of the wheel has the size and digest of its record; the
    wheel has documentation, examples and pages, and nothing that only this folder has.
    """
    with zipfile.ZipFile(build.wheel) as archive:
        names = archive.namelist()
        (metadata_name,) = [name for name in names if name.endswith(".dist-info/METADATA")]
        require_metadata(archive.read(metadata_name), version)
        require_record(archive)
        size = sum(each.file_size for each in archive.infolist())
        pages = [each for each in archive.infolist() if each.filename.startswith("catseye/docs/")]
    require_files(names)
    with tarfile.open(build.source) as packed:
        inside = [name.partition("/")[2] for name in packed.getnames()]
        about = packed.extractfile(f"catseye-{version}/PKG-INFO")
        require_metadata(about.read() if about else b"", version)
    lost = [name for name in IN_SOURCE if name not in inside]
    if lost:
        raise BuildError(f"{build.source.name} lacks {', '.join(lost)}")
    if extra := [name for name in inside if LACKING.search(name)]:
        raise BuildError(f"{build.source.name} has {', '.join(extra[:3])}")
    documentation = sum(page.file_size for page in pages)
    packed_sizes = [path.stat().st_size / 1e6 for path in (build.wheel, build.source)]
    return [
        f"{build.wheel.name}: {len(names)} files, {packed_sizes[0]:.1f} MB, {size / 1e6:.1f} MB unpacked",
        f"documentation in it: {len(pages)} pages, {documentation / 1e6:.2f} MB",
        f"{build.source.name}: {len(inside)} entries, {packed_sizes[1]:.1f} MB",
    ]


def require_metadata(content: bytes, version: str) -> None:
    """BuildError where metadata are invalid, of another version, or lack what an index shows."""
    try:
        about = Metadata.from_email(content, validate=True)
    except ExceptionGroup as problem:
        raise BuildError(f"invalid metadata: {'; '.join(map(str, problem.exceptions))}") from problem
    found = {"name": about.name, "version": str(about.version), "license": about.license_expression}
    expected = {"name": "catseye", "version": version, "license": "BSD-3-Clause"}
    if found != expected:
        raise BuildError(f"metadata: {found} (expected {expected})")
    for name in ("summary", "keywords", "classifiers", "requires_python", "description_content_type"):
        if not getattr(about, name):
            raise BuildError(f"metadata: {name} is missing")
    if not BytesParser().parsebytes(content).get_payload():
        raise BuildError("metadata: the description is empty")


def require_record(archive: zipfile.ZipFile) -> None:
    """BuildError where RECORD and the wheel's files differ."""
    (name,) = [each for each in archive.namelist() if each.endswith(".dist-info/RECORD")]
    rows = {path: (mark, size) for path, mark, size in csv.reader(io.StringIO(archive.read(name).decode()))}
    if set(rows) != set(archive.namelist()):
        raise BuildError(f"RECORD lists other files: {sorted(set(rows) ^ set(archive.namelist()))[:3]}")
    for path, (mark, size) in rows.items():
        content = archive.read(path)
        sum_ = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        if path != name and (mark, size) != (f"sha256={sum_}", str(len(content))):
            raise BuildError(f"RECORD: {path} is not as listed")


def require_files(names: list[str]) -> None:
    """BuildError where a wheel lacks a part, or has something of the folder it was built in."""
    if lost := [name for name in HAVING if name not in names]:
        raise BuildError(f"the wheel lacks {', '.join(lost)}")
    if extra := [name for name in names if LACKING.search(name)]:
        raise BuildError(f"the wheel has {', '.join(extra[:3])}")


def requirements(extras: tuple[str, ...] = USERS) -> list[Requirement]:
    """Requirements of catseye and of extras, as pyproject.toml states them."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    texts = [*project["dependencies"], *(text for extra in extras for text in project["optional-dependencies"][extra])]
    return [Requirement(text) for text in texts]


def lowest(required: list[Requirement]) -> list[str]:
    """Lines of a constraints file with the lowest version that each requirement allows; those without a bound are free.

    >>> lowest([Requirement("numpy>=2,<3"), Requirement("rich"), Requirement("psycopg[binary]>=3.1.4")])
    ['numpy==2', 'psycopg==3.1.4']
    """
    bounds: dict[str, str] = {}
    for each in required:
        if bound := BOUND.search(str(each.specifier)):
            bounds[each.name] = max(bounds.get(each.name, "0"), bound[1], key=_parts)
    return [f"{name}=={bound}" for name, bound in bounds.items()]


def _parts(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", text))
