"""Trials of a built wheel in clean environments: as a stranger installs and uses it."""

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from builds import USERS, Build, BuildError, requirements

OLDEST = (3, 11)
NEWEST_TRIED = 20  # python3.N is looked for up to this N
TOOLS = ("hypothesis", "httpx", "mpmath", "pytest", "pytest-timeout", "pytest-xdist")
MODULES = {  # that an extra brings
    "postgresql": ("psycopg",),
    "pdf": ("typst",),
    "web": ("fastapi", "prometheus_client", "uvicorn", "websockets", "catseye.web.app"),
    "scale": ("blosc2", "distributed", "duckdb", "pyarrow", "pyarrow.dataset"),
}
QUICK = (  # tests that need neither the sources nor a running site
    *("tests/api", "tests/atmosphere", "tests/cli", "tests/geometry", "tests/optics", "tests/records", "tests/signal"),
    *("tests/gateways", "tests/vectors"),
)
LEFT_OUT = ("tests/cli/live", "tests/cli/scale", "tests/api/live", "tests/api/scale")  # sites and clusters: minutes
BESIDE = (
    "tests",
    "examples",
    "docs",
    "benchmarks",
    "studies",
    "pyproject.toml",
    "conftest.py",
    "README.md",
    "constraints.txt",
)
CELLS = """
import json, sys
for path in sys.argv[1:]:
    names = {"__name__": "__main__"}
    for cell in json.load(open(path, encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), path, "exec"), names)
"""


def say(text: str) -> None:
    """Print a line at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


@contextmanager
def timed(what: str) -> Iterator[None]:
    """Say a step and how long it took."""
    start = time.monotonic()
    yield
    say(f"  {what}: {time.monotonic() - start:.0f} s")


def version_of(python: str | Path) -> tuple[int, ...]:
    """Version of an interpreter, () where it does not run."""
    code = "import sys; print(*sys.version_info[:3])"
    done = subprocess.run([str(python), "-c", code], capture_output=True, text=True, check=False)
    return tuple(map(int, done.stdout.split())) if done.returncode == 0 else ()


def pythons() -> dict[tuple[int, ...], str]:
    """Interpreters on PATH that catseye is for, by version: the one that runs this among them."""
    names = [sys.executable, *(f"python3.{minor}" for minor in range(OLDEST[1], NEWEST_TRIED))]
    paths = [path for name in names if (path := shutil.which(name))]
    interpreters = {
        version: path for path in reversed(paths) if (version := version_of(path)) and version[:2] >= OLDEST
    }
    return dict(sorted(interpreters.items()))


class Trial:
    """A new environment with nothing of the repository, and a folder to work in."""

    def __init__(self, python: str, place: Path, constraints: Path | None = None) -> None:
        """python: interpreter; place: new folder; constraints: file for pip, if any."""
        self.place, self.constraints = place, constraints
        self.work = place / "work"
        self.work.mkdir(parents=True)
        subprocess.run([python, "-m", "venv", str(place / "venv")], check=True)
        self.bin = place / "venv" / "bin"
        own = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
        self.environment = {key: value for key, value in os.environ.items() if key not in own}
        self.environment |= {
            "MPLBACKEND": "Agg",
            "OPENBLAS_NUM_THREADS": "1",
            "PATH": f"{self.bin}:{os.environ['PATH']}",
        }

    def run(self, *command: str | Path, where: Path | None = None) -> str:
        """Output of a command; BuildError where it fails."""
        done = subprocess.run(
            [str(self.bin / str(command[0])), *map(str, command[1:])],
            cwd=where or self.work,
            env=self.environment,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            tail = "\n".join((done.stdout + done.stderr).strip().splitlines()[-40:])
            raise BuildError(f"{' '.join(map(str, command))}: exit status {done.returncode}\n{tail}")
        return done.stdout

    def install(self, *what: str | Path, options: tuple[str, ...] = ()) -> None:
        """Install with pip."""
        limits = ["--constraint", str(self.constraints)] if self.constraints else []
        command = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", *limits, *options]
        self.run("python", *command, *map(str, what))

    def size_mb(self) -> float:
        """Size of what is installed, MB on disk."""
        folders = (self.place / "venv" / "lib").rglob("*")
        return sum(path.stat().st_size for path in folders if path.is_file() and "__pycache__" not in path.parts) / 1e6

    def use(self, version: str) -> None:
        """Use catseye as its README says: version, documentation, demo."""
        if (text := self.run("catseye", "--version")) != f"catseye {version}\n":
            raise BuildError(f"catseye --version says {text!r} (expected {version})")
        if "formats/beam" not in self.run("catseye", "help"):
            raise BuildError("catseye help lists no formats")
        if "# Conventions" not in json.loads(self.run("catseye", "help", "conventions", "--json"))["text"]:
            raise BuildError("catseye help conventions shows no page")
        shutil.rmtree(self.work / "demo-night-01", ignore_errors=True)
        if "Verdict       Good" not in self.run("catseye", "demo"):
            raise BuildError("catseye demo is not good")
        if not (self.work / "demo-night-01" / "report.html").is_file():
            raise BuildError("catseye demo wrote no report")

    def run_notebooks(self) -> int:
        """Number of notebooks that ran to their end, each in a folder of its own."""
        self.run("catseye", "examples", "mine")
        paths = sorted((self.work / "mine" / "notebooks").glob("*.ipynb"))
        for path in paths:
            place = self.place / "notebooks" / path.stem
            place.mkdir(parents=True)
            self.run("python", "-c", CELLS, path, where=place)
        return len(paths)

    def add_extras(self, wheel: Path) -> dict[str, float]:
        """MB on disk that each extra adds, one after the other; what each brings is imported."""
        sizes = {}
        for extra in USERS:
            before = self.size_mb()
            self.install(f"{wheel}[{extra}]")
            for module in MODULES[extra]:
                self.run("python", "-c", f"import {module}")
            sizes[extra] = self.size_mb() - before
        return sizes

    def run_tests(self, sources: Path, *, warnings: str | None = None) -> str:
        """Last line of the quick tests, which import the installed catseye; BuildError with those that fail.

        sources    clean copy of what was built, whose tests run
        warnings   action for all warnings; None: those of pyproject.toml
        """
        tree = self.place / "tree"
        tree.mkdir()
        for name in BESIDE:
            copy = shutil.copytree if (sources / name).is_dir() else shutil.copy2
            copy(sources / name, tree / name)
        tools = [str(requirement) for requirement in requirements(("dev",)) if requirement.name in TOOLS]
        self.install(*tools)
        place = Path(self.run("python", "-c", "import catseye; print(catseye.__file__)", where=tree).strip())
        if not place.is_relative_to(self.place / "venv"):
            raise BuildError(f"the tests would import {place}, not the wheel")
        left_out = [f"--ignore={name}" for name in LEFT_OUT]
        options = ["-n", "2", "--dist", "worksteal", "--tb=short", "-rfE", *(("-W", warnings) if warnings else ())]
        said = self.run("python", "-m", "pytest", *options, *left_out, *QUICK, where=tree)
        return said.strip().splitlines()[-1]


def tried(python: str, build: Build, place: Path, version: str, *, constraints: Path | None = None) -> None:
    """Try wheel and source archive with an interpreter; BuildError for the first fault."""
    trial = Trial(python, place, constraints)
    with timed("wheel installed"):
        empty = trial.size_mb()
        trial.install(build.wheel)
    say(f"  catseye and what it needs: {trial.size_mb() - empty:.0f} MB on disk")
    with timed("version, documentation, demo"):
        trial.use(version)
    with timed("notebooks"):
        count = trial.run_notebooks()
    say(f"  {count} notebooks ran to their end")
    with timed("extras"):
        sizes = trial.add_extras(build.wheel)
    say("  extras, in this order: " + ", ".join(f"{extra} {size:.0f} MB" for extra, size in sizes.items()))
    with timed("quick tests of the installed wheel"):
        summary = trial.run_tests(build.tree, warnings="default" if constraints else None)
    say(f"  {summary}")
    if constraints is None:
        with timed("source archive in its place, version, documentation, demo"):
            trial.run("python", "-m", "pip", "uninstall", "--quiet", "--yes", "catseye")
            trial.install(build.source, options=("--no-deps",))
            trial.use(version)


def attempted(python: str, build: Build, place: Path, version: str, *, constraints: Path | None = None) -> bool:
    """True if the trial with an interpreter succeeded; print the reason of a failure."""
    say(f"Python {'.'.join(map(str, version_of(python)))}:")
    try:
        tried(python, build, place, version, constraints=constraints)
    except (BuildError, subprocess.CalledProcessError) as problem:
        say(f"  FAILED: {problem}")
        return False
    return True
