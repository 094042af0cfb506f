"""The release's own steps: the same bits twice, and each fault is refused with its reason."""

import re
import shutil
import subprocess
import sys
import zipfile

import pytest
from packaging.requirements import Requirement

import builds
import trials
from builds import BuildError, lowest, require_files, require_metadata, require_record, require_same, requirements
from catseye.version import __version__
from repository import ROOT

EPOCH = 1_700_000_000


def copied(directory):
    """Sources of the wheel in a place of their own."""
    directory.mkdir(parents=True)
    left_out = shutil.ignore_patterns("__pycache__", "_build", ".pytest_cache")
    for name in ("src", "docs", "examples"):
        shutil.copytree(ROOT / name, directory / name, ignore=left_out)
    for name in ("pyproject.toml", "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "LICENSE", ".gitignore"):
        shutil.copy2(ROOT / name, directory / name)
    return directory


@pytest.fixture(scope="module")
def wheels(tmp_path_factory):
    """Wheels of two copies of the sources, built one after the other."""
    place = tmp_path_factory.mktemp("release")
    return [
        builds.built(copied(place / name / "tree"), place / name / "dist", "wheel", EPOCH)
        for name in ("one", "another")
    ]


def test_a_wheel_has_the_same_bits_twice(wheels):
    assert wheels[0].name == f"catseye-{__version__}-py3-none-any.whl"
    require_same(*wheels)


def test_a_wheel_is_complete(wheels):
    with zipfile.ZipFile(wheels[0]) as archive:
        require_record(archive)
        require_files(archive.namelist())
        pages = {name for name in archive.namelist() if name.startswith("catseye/docs/")}
        metadata = archive.read(f"catseye-{__version__}.dist-info/METADATA")
    require_metadata(metadata, __version__)
    written = {
        f"catseye/docs/{path.relative_to(ROOT / 'docs').as_posix()}"
        for path in (ROOT / "docs").rglob("*.md")
        if not path.relative_to(ROOT / "docs").parts[0].startswith("_")
    }
    assert pages == written


def test_another_time_makes_other_bits(wheels, tmp_path):
    tree = wheels[0].parents[1] / "tree"
    with pytest.raises(BuildError, match=r"two builds differ \(SHA-256 \w{64} and \w{64}\)"):
        require_same(wheels[0], builds.built(tree, tmp_path, "wheel", EPOCH + 86_400))


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda text: text.replace(f"Version: {__version__}", "Version: 0.0.1"), r"'version': '0.0.1'.* \(expected"),
        (lambda text: text.replace(f"Version: {__version__}", "Version: next"), "invalid metadata: .*version"),
        (lambda text: text.replace("License-Expression: BSD-3-Clause", "License-Expression: MIT"), "'MIT'"),
        (lambda text: re.sub(r"Summary: .*\n", "", text), "summary is missing"),
        (lambda text: re.sub(r"Classifier: .*\n", "", text), "classifiers is missing"),
        (lambda text: text.partition("\n\n")[0] + "\n\n", "description is empty"),
    ],
)
def test_spoiled_metadata_are_refused(wheels, spoil, reason):
    with zipfile.ZipFile(wheels[0]) as archive:
        text = archive.read(f"catseye-{__version__}.dist-info/METADATA").decode()
    assert spoil(text) != text
    with pytest.raises(BuildError, match=reason):
        require_metadata(spoil(text).encode(), __version__)


@pytest.mark.parametrize("spoil", ["altered", "added"])
def test_a_wheel_that_is_not_as_its_record_is_refused(wheels, tmp_path, spoil):
    path = tmp_path / "spoiled.whl"
    with zipfile.ZipFile(wheels[0]) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            target.writestr(name, content + b"\n" if (spoil, name) == ("altered", "catseye/clock.py") else content)
        if spoil == "added":
            target.writestr("catseye/extra.py", b"")
    with zipfile.ZipFile(path) as archive, pytest.raises(BuildError, match=r"clock\.py is not as|other files: .*extra"):
        require_record(archive)


def test_files_that_lack_or_do_not_belong_are_named():
    names = list(builds.HAVING)
    require_files(names)
    with pytest.raises(BuildError, match=r"lacks catseye/py\.typed"):
        require_files(names[1:])
    with pytest.raises(BuildError, match=r"has catseye/docs/_build/index\.md"):
        require_files([*names, "catseye/docs/_build/index.md"])


def test_the_lowest_versions_are_those_of_the_bounds():
    texts = [
        Requirement(text) for text in ("numpy>=2,<3", "rich", "a>=2.9", "a>=2.10", "p[b]>=3.1.4; python_version>'3'")
    ]
    assert lowest(texts) == ["numpy==2", "a==2.10", "p==3.1.4"]
    names = {line.partition("==")[0] for line in lowest(requirements())}
    assert {"numpy", "scipy", "pyarrow", "uvicorn", "typst", "psycopg"} <= names


def test_the_interpreter_that_runs_this_is_found():
    assert sys.version_info[:3] in trials.pythons()
    assert all(version[:2] >= trials.OLDEST for version in trials.pythons())
    assert trials.version_of(shutil.which("false")) == ()


def test_every_extra_of_users_has_modules_to_import():
    project = builds.requirements(())
    assert project
    assert set(trials.MODULES) == set(builds.USERS)
    assert all((ROOT / name).is_dir() for name in (*trials.QUICK, *trials.LEFT_OUT))


def test_a_command_that_fails_in_a_trial_says_what_it_said(tmp_path):
    trial = trials.Trial.__new__(trials.Trial)
    trial.bin, trial.work, trial.environment = (tmp_path, tmp_path, {})
    script = tmp_path / "broken"
    script.write_text("#!/bin/sh\necho no luck\nexit 3\n", encoding="utf-8")
    script.chmod(0o755)
    with pytest.raises(BuildError, match=r"broken now: exit status 3\nno luck"):
        trial.run("broken", "now")


def test_a_clean_copy_has_what_git_has(tmp_path):
    if not (ROOT / ".git").exists():
        pytest.skip("no repository: a source archive")
    tree = builds.exported("HEAD", tmp_path / "tree")
    listed = subprocess.run(["git", "ls-tree", "-r", "--name-only", "HEAD"], cwd=ROOT, capture_output=True, text=True)
    assert sorted(path.relative_to(tree).as_posix() for path in tree.rglob("*") if path.is_file()) == sorted(
        listed.stdout.splitlines()
    )
    assert builds.commit_time() > EPOCH
