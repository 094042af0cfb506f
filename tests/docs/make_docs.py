"""Build the documentation strictly, check it, and say where it is and what it cost.

    python tests/docs/make_docs.py docs docs/_build

The build begins anew, so that every command and every cell of every page runs. Then links and anchors, spelling and
terms are checked, and the pages in a browser where Chromium is. Every part runs; one that fails fails the whole.
"""

import importlib.util
import os
import resource
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
BROWSER = ("chromium", "chromium-browser")
PYTEST = (sys.executable, "-m", "pytest", "-n", "0")


def parts(source: Path, built: Path) -> list[tuple[str, list[str]]]:
    """Name and command of each part."""
    site = built / "html"
    sphinx = "--fail-on-warning --keep-going --quiet --fresh-env --jobs 2 --builder html --doctree-dir"
    return [
        ("build", [sys.executable, "-m", "sphinx", *sphinx.split(), str(built / "doctrees"), str(source), str(site)]),
        ("links", [sys.executable, str(source / "extensions" / "site_links.py"), str(site)]),
        ("words", [*PYTEST, "tests/docs/test_words_of_pages.py"]),
    ]


def quiet_kernels(place: Path) -> None:
    """Let the kernels of executed pages report errors alone: nothing leaves this machine."""
    profile = place / "profile_default"
    profile.mkdir(parents=True, exist_ok=True)
    (profile / "ipython_kernel_config.py").write_text("c.IPKernelApp.log_level = 40\n", encoding="utf-8")
    os.environ["IPYTHONDIR"] = str(place)


def browser_lacks() -> str:
    """Reason why the pages cannot be opened in a browser; "" where they can."""
    if not any((Path(place) / name).exists() for place in os.get_exec_path() for name in BROWSER):
        return "no chromium (expected Debian's)"
    if importlib.util.find_spec("playwright") is None:
        return "no playwright (extra test-web)"
    return ""


def run(name: str, command: list[str]) -> bool:
    """Run a part; False and a line where it failed."""
    status = subprocess.run(command, cwd=ROOT, check=False).returncode
    if status:
        sys.stderr.write(f"docs: {name} FAILED (status {status})\n")
    return not status


def main(arguments: list[str]) -> int:
    """Run all parts; exit status 1 if one failed."""
    if len(arguments) != 2 or not Path(arguments[0], "conf.py").is_file():
        sys.stderr.write("usage: make_docs.py SOURCE BUILT, where SOURCE holds conf.py\n")
        return 2
    source, built = (Path(each).resolve() for each in arguments)
    quiet_kernels(built / "ipython")
    good = [run(name, command) for name, command in parts(source, built)]
    lacks = browser_lacks()
    if lacks:
        sys.stdout.write(f"docs: pages in a browser SKIPPED: {lacks}\n")
    else:
        os.environ["CATSEYE_DOCS"] = str(built / "html")
        good.append(run("pages in a browser", [*PYTEST, "-m", "browser", "tests/browser/test_docs.py"]))
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = used.ru_utime + used.ru_stime
    sys.stdout.write(f"docs: {built / 'html' / 'index.html'}, {seconds:.0f} s of processor time\n")
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
