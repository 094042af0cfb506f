"""A small living site for the commands: Green Bank with few prisms on its dish, and a run of it in virtual time."""

import os
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from catseye.records.site.folder import SiteFolder, site_files
from command_scene import COMMAND, attempt
from kept_scene import kept
from process_scene import ends_with_us
from simulator.living_scene import site

RUN = (sys.executable, "-P", "-c", "from catseye.cli.main import run; run()")
SOON = 5.0  # s, the contract's
FEW = ("ZY101", "ZY102", "ZY103", "ZY104")
ROUNDS = ("--round-s", "5")  # two epochs in some twelve seconds
PATIENCE = 90.0  # s for a process to come up on a machine that is busy


def few_rangers() -> SiteFolder:
    """The small site with four rangers on the ground and one of the feed arm: warmed and planned for in no time."""
    arm = tuple(ranger for ranger in site().feedarm.ranger if ranger.name == "ZY115")
    return replace(
        site(),
        monuments={name: m for name, m in site().monuments.items() if name in FEW},
        feedarm=site().feedarm.model_copy(update={"ranger": arm}),
        benchmarks=tuple(b for b in site().benchmarks if b.ranger in FEW),
    )


def write_site(folder: Path, made: SiteFolder | None = None) -> None:
    """A site's folder, the small one's."""
    for path, text in site_files(made or site()).items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")


def small_site() -> Path:
    return kept("small-site", write_site)


def smallest_site() -> Path:
    return kept("smallest-site", lambda folder: write_site(folder, few_rangers()))


def recorded() -> Path:
    """The journal of 13 s with two epochs, in virtual time, to be read."""

    def record(journal: Path) -> None:
        words = ["simulate", str(small_site()), "--fast", "--minutes", "0.22", *ROUNDS, "--journal", str(journal)]
        assert attempt(lambda: COMMAND.main([*words, "--quiet"], prog_name="catseye")) == 0

    return kept("recorded.db", record)


@contextmanager
def started(*words, home=None, stdin=subprocess.DEVNULL):
    """A command in a process of its own; its temporary files in `home`. Killed at the end if it is there still."""
    place = {**os.environ, "OPENBLAS_NUM_THREADS": "1"} | ({} if home is None else {"TMPDIR": str(home)})
    process = subprocess.Popen(
        [*RUN, *map(str, words)],
        stdin=stdin,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=place,
        preexec_fn=ends_with_us(),
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        if process.stdin is not None and process.stdin.closed:
            process.stdin = None
        process.communicate()


def ended(process, number):
    """Status after a signal, within the contract's time, and what the process still said."""
    process.send_signal(number)
    since = time.monotonic()
    said = process.communicate(timeout=4 * SOON)
    assert time.monotonic() - since < SOON
    return process.returncode, *said


def processes_with(text):
    """Ids of the processes whose command line holds a text, but for this one."""
    found = []
    for folder in Path("/proc").iterdir():
        if folder.name.isdecimal() and int(folder.name) != os.getpid():
            try:
                line = (folder / "cmdline").read_bytes()
                state = (folder / "stat").read_text().rpartition(")")[2].split()[0]
            except OSError:
                continue
            if text.encode() in line and state != "Z":
                found.append(int(folder.name))
    return found
