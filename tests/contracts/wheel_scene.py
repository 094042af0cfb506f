"""A wheel of catseye, built from the sources and unpacked where no repository is near."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

from repository import ROOT

RUNNER = """
import json, os, sys
from contextlib import redirect_stdout
from io import BytesIO, TextIOWrapper
from pathlib import Path
import catseye
assert Path(catseye.__file__).is_relative_to(Path(sys.argv[1])), catseye.__file__
from catseye.cli.commands import main
from catseye.cli.terminal import finish
names = {}
for kind, text in json.load(sys.stdin):
    said, start = TextIOWrapper(BytesIO(), encoding='utf-8'), sum(os.times()[:4])
    with redirect_stdout(said):
        if kind == "python":
            exec(text, names)
            status = 0
        else:
            sys.argv = json.loads(text)
            status = finish(main)
    said.flush()
    text = said.buffer.getvalue().decode()
    print(json.dumps({"status": status, "said": text, "seconds": sum(os.times()[:4]) - start}), flush=True)
"""


def built(directory: Path) -> Path:
    """The wheel's file, built into the directory."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(directory)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = directory.glob("*.whl")
    return wheel


def unpacked(wheel: Path, directory: Path) -> Path:
    """The directory, with what an installation of the wheel would put there."""
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(directory)
    return directory


def run_there(where: Path, pieces: list[tuple[str, str]], python: Path, site: Path) -> list[dict]:
    """Results of the pieces, all run in one process: exit status, printed text, seconds of the processor.

    where    directory that they run in
    pieces   ("python", source) or ("catseye", JSON list of a command line)
    python   interpreter
    site     where catseye must come from
    """
    done = subprocess.run(
        [str(python), "-c", RUNNER, str(site)],
        input=json.dumps(pieces),
        cwd=where,
        env={**os.environ, "PYTHONPATH": str(site), "PYTHONWARNINGS": "ignore"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]
