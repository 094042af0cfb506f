"""A release: `make release` runs this. docs/people/release.md says what is done with the result.

Wheel and source archive are built twice from a clean copy of HEAD, compared, looked through, and copied into dist/.
Both are tried in clean environments on the oldest and the newest Python on PATH; with `--lower-bounds` the wheel on the
oldest, with the lowest versions that pyproject.toml allows. Exit status 1 with the reason where something fails.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from builds import ROOT, Build, BuildError, built_twice, digest, lowest, require_publishable, requirements
from trials import attempted, pythons, say, timed


def arguments() -> argparse.Namespace:
    """Options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build-only", action="store_true", help="Build, compare and look through; no environments.")
    parser.add_argument(
        "--lower-bounds", action="store_true", help="Lowest allowed versions on the oldest Python only."
    )
    parser.add_argument("--python", action="append", metavar="PATH", help="Interpreter to try; may repeat.")
    return parser.parse_args()


def version_of_tree() -> str:
    """Version that src/catseye/version.py states."""
    names: dict[str, str] = {}
    exec((ROOT / "src" / "catseye" / "version.py").read_text(encoding="utf-8"), names)  # ours, a line
    return names["__version__"]


def require_described(version: str) -> None:
    """BuildError where the changelog has no section of this version, or HEAD is not what lies here."""
    if f"\n## {version}\n" not in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"):
        raise BuildError(f"CHANGELOG.md has no section '## {version}'")
    if f'\nversion: "{version}"\n' not in (ROOT / "CITATION.cff").read_text(encoding="utf-8"):
        raise BuildError(f'CITATION.cff has not version: "{version}"')
    status = subprocess.run(
        ["git", "status", "--porcelain", "--untracked-files=no"], cwd=ROOT, check=True, capture_output=True, text=True
    )
    if status.stdout:
        raise BuildError(f"uncommitted changes:\n{status.stdout}commit them: a release is a commit")


def built_release(place: Path, version: str) -> Build:
    """Wheel and source archive in dist/, with their digests told."""
    with timed("built twice, and from the source archive: the same bits"):
        build = built_twice("HEAD", place / "build")
    for sentence in require_publishable(build, version):
        say(f"  {sentence}")
    dist = ROOT / "dist"
    dist.mkdir(exist_ok=True)
    wheel, source = (Path(shutil.copy2(path, dist)) for path in (build.wheel, build.source))
    for path in (wheel, source):
        say(f"  {digest(path)}  {path.relative_to(ROOT)}")
    return Build(wheel, source, build.tree)


def trials(options: argparse.Namespace, build: Build, place: Path, version: str) -> list[bool]:
    """Outcome of each environment."""
    found = pythons()
    names = {number: ".".join(map(str, number)) for number in found}
    say(f"Pythons found: {', '.join(names.values())}")
    paths = options.python or [found[min(found)], *([found[max(found)]] if len(found) > 1 else [])]
    if options.lower_bounds:
        constraints = place / "lowest.txt"
        constraints.write_text("\n".join(lowest(requirements())) + "\n", encoding="utf-8")
        say("Lowest versions: " + " ".join(constraints.read_text(encoding="utf-8").split()))
        return [attempted(paths[0], build, place / "lowest", version, constraints=constraints)]
    return [attempted(path, build, place / f"trial-{n}", version) for n, path in enumerate(paths)]


def main() -> int:
    """Exit status of the release."""
    options, version = arguments(), version_of_tree()
    say(f"catseye {version}")
    with tempfile.TemporaryDirectory(prefix="catseye-release-") as name:
        try:
            require_described(version)
            build = built_release(Path(name), version)
        except BuildError as problem:
            say(f"FAILED: {problem}")
            return 1
        outcomes = [] if options.build_only else trials(options, build, Path(name), version)
    say("Ready: dist/" if all(outcomes) else "FAILED: not to be published")
    return 0 if all(outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
