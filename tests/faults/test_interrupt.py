"""Ctrl-C and termination at any time: status, promptness, no traceback, no leftovers."""

import json
import os
import pty
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from catseye.gateways.writers.output import FORMAT
from process_scene import ends_with_us
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"
RUN = "from catseye.cli.main import run; run()"
STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143}
SAID = {  # one line; nothing where the work was done just before
    signal.SIGINT: b"catseye: interrupted by Ctrl-C; nothing half-written is left\n",
    signal.SIGTERM: b"catseye: terminated; nothing half-written is left\n",
}
SOON = 5.0  # s, the contract's
TERM_BIT = 1 << (signal.SIGTERM - 1)  # Python leaves SIGTERM alone, so that catching it shows that we are in charge

pytestmark = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads /proc to know what is caught")


def start(out, *, stderr=subprocess.PIPE, mplconfig=None):
    place = {**os.environ, **({"MPLCONFIGDIR": str(mplconfig)} if mplconfig else {})}
    return subprocess.Popen(
        [sys.executable, "-c", RUN, "reduce", str(NIGHT), "--out", str(out)],
        stdout=subprocess.DEVNULL,
        stderr=stderr,
        env=place,
        preexec_fn=ends_with_us(),
    )


def wait_until_in_charge(process):
    """Until the program has taken the signals over, its first act."""
    status = Path(f"/proc/{process.pid}/status")
    while process.poll() is None:
        caught = next(line for line in status.read_text().splitlines() if line.startswith("SigCgt"))
        if int(caught.split()[1], 16) & TERM_BIT:
            return
        with suppress(subprocess.TimeoutExpired):
            process.wait(timeout=0.001)


def interrupt(process, number):
    """The status, and what the program still said."""
    process.send_signal(number)
    since = time.monotonic()
    _, said = process.communicate(timeout=4 * SOON)
    assert time.monotonic() - since < SOON
    return process.returncode, said


def assert_clean(out, status, number):
    names = [path.name for path in out.parent.iterdir()]
    assert (status, names) in [(STATUS[number], []), (0, ["out"])]


@pytest.mark.parametrize(
    ("moment", "number"),
    [
        *((moment, signal.SIGINT) for moment in (0.0, 0.03, 0.1, 0.4, 2.0)),
        (0.0, signal.SIGTERM),
        (0.5, signal.SIGTERM),
    ],
)
def test_interrupt_at_a_random_time(tmp_path, moment, number):
    out = tmp_path / "out"
    process = start(out)
    wait_until_in_charge(process)
    with suppress(subprocess.TimeoutExpired):
        process.wait(timeout=moment)
    status, said = interrupt(process, number)
    assert said == (SAID[number] if status else b"")
    assert_clean(out, status, number)


@pytest.mark.parametrize("step", ["samples to phases", "adjustment", "writing ranges.csv"])
def test_interrupt_at_every_step(tmp_path, step):
    """The progress line on a terminal tells the step."""
    out = tmp_path / "out"
    ours, theirs = pty.openpty()
    process = start(out, stderr=theirs)
    os.close(theirs)
    seen = read_until(ours, step.encode())
    assert step.encode() in seen
    status, _ = interrupt(process, signal.SIGINT)
    said = seen + read_until(ours, b"Traceback")
    os.close(ours)
    assert b"Traceback" not in said
    assert status == 130
    assert_clean(out, status, signal.SIGINT)


def read_until(stream, wanted):
    seen = b""
    with suppress(OSError):  # how a terminal says that nobody is at its other end
        while wanted not in seen and (more := os.read(stream, 4096)):
            seen += more
    return seen


def test_earlier_output_survives_an_interrupt(tmp_path):
    """In a fresh home, where matplotlib writes its font cache under a lock while the report is made."""
    out, mplconfig = tmp_path / "work" / "out", tmp_path / "mpl"
    out.mkdir(parents=True)
    provenance = {"format": FORMAT, "outputs": {"ranges.csv": ""}}
    (out / "provenance.json").write_text(json.dumps(provenance))
    (out / "ranges.csv").write_text("shot\n1\n")
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    ours, theirs = pty.openpty()
    process = start(out, stderr=theirs, mplconfig=mplconfig)
    os.close(theirs)
    read_until(ours, b"writing report.html")
    status, _ = interrupt(process, signal.SIGINT)
    os.close(ours)
    assert status == 130
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert [path.name for path in out.parent.iterdir()] == ["out"]
    assert not list(mplconfig.rglob("*lock*"))


def test_atomic_steps_are_not_interrupted(tmp_path):
    """The signal arrives inside; the second step is still done, then what was unfinished is undone."""
    code = (
        "import os, signal, sys\n"
        "from pathlib import Path\n"
        "from catseye.interruption import deferred, exit_on_signals, undo_on_interruption\n"
        "exit_on_signals()\n"
        "with undo_on_interruption(Path(sys.argv[1], 'undone').touch):\n"
        "    with deferred():\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "        Path(sys.argv[1], 'second').touch()\n"
        "    Path(sys.argv[1], 'third').touch()\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=False, capture_output=True)
    assert (done.returncode, done.stderr) == (130, b"")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["second", "undone"]


def test_atomic_steps_cannot_delay_an_interrupt_forever():
    code = (
        "import os, signal\n"
        "from catseye import interruption\n"
        "interruption.LONGEST_DEFERRAL = 0.05\n"
        "interruption.exit_on_signals()\n"
        "with interruption.deferred():\n"
        "    os.kill(os.getpid(), signal.SIGTERM)\n"
        "    while True: pass\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, timeout=SOON)
    assert (done.returncode, done.stderr) == (143, b"")


FACTOR = """
import sys
import catseye.cli.main
sys.argv = ["catseye", "reduce"]
def work():
    import numpy as np
    from pathlib import Path
    from scipy.linalg import lapack
    from catseye.gateways.writers.output import atomic_directory
    matrix = np.asfortranarray(np.ones((4000, 4000)) + 4000 * np.eye(4000))
    with atomic_directory(Path(OUT)) as directory:
        (directory / "half.csv").write_text("x")
        print("begun", flush=True)
        while True:  # no bytecode for seconds, were the matrix larger: LAPACK holds the interpreter
            lapack.dpotrf(matrix)
catseye.cli.main._main = work
"""
HELD = "import signal; signal.pthread_sigmask(signal.SIG_BLOCK, (2, 15))\n"  # in the child no handler ever runs


def held(out, code):
    """A run that is inside a factorisation, and no handler of which is ever called: as LAPACK lets none be."""
    text = FACTOR.replace("OUT", repr(str(out))).replace("        print", f"        {code}        print")
    process = subprocess.Popen(
        [sys.executable, "-c", text + "catseye.cli.main.run()"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        preexec_fn=ends_with_us(),
    )
    assert process.stdout.readline() == b"begun\n"
    return process


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_within_a_call_that_runs_no_handler(tmp_path, number):
    """The supervisor ends what cannot hear, and removes what it had half-made."""
    out = tmp_path / "work" / "out"
    out.mkdir(parents=True)
    (out / "provenance.json").write_text(json.dumps({"format": FORMAT, "outputs": {"ranges.csv": ""}}))
    (out / "ranges.csv").write_text("shot\n1\n")
    process = held(out, HELD)
    assert len(list(out.parent.iterdir())) == 2
    assert interrupt(process, number) == (STATUS[number], SAID[number])
    assert [path.name for path in out.parent.iterdir()] == ["out"]
    assert (out / "ranges.csv").read_text() == "shot\n1\n"


def test_killed_run_is_reported_in_one_line(tmp_path):
    """As it does where memory is out: what is killed cannot say or remove anything itself."""
    process = held(tmp_path / "out", "import os, threading; threading.Timer(0.2, os.kill, (os.getpid(), 9)).start()\n")
    _, said = process.communicate(timeout=4 * SOON)
    assert process.returncode == 1
    assert said.startswith(b"catseye: ended by SIGKILL with ")
    assert b"most likely out of memory" in said
    assert said.count(b"\n") == 1
    assert not list(tmp_path.iterdir())


def test_workers_end_with_a_killed_supervisor(tmp_path):
    process = held(tmp_path / "out", "import os; os.write(2, b'%d\\n' % os.getpid())\n")
    worker = int(process.stderr.readline())
    process.kill()
    process.communicate(timeout=SOON)
    until = time.monotonic() + SOON
    while Path(f"/proc/{worker}").exists() and time.monotonic() < until:
        time.sleep(0.01)
    assert not Path(f"/proc/{worker}").exists()
    assert not list(tmp_path.iterdir())


def test_interrupted_rename_of_a_directory_is_undone(tmp_path):
    """What the supervisor heard: begun, and ended where it is done; said in pieces as a pipe may cut them."""
    from catseye.interruption import Unfinished, UnfinishedWork

    place = {name: tmp_path / name for name in ("fresh", "where", "old", "file", "done")}
    for name in ("fresh", "old", "done"):
        place[name].mkdir()
    place["file"].write_text("half")
    told = [
        [True, *map(str, (place["fresh"], place["where"], place["old"]))],
        [True, str(place["file"]), "", ""],
        [True, str(place["done"]), "", ""],
        [False, str(place["done"]), "", ""],
    ]
    text = b"".join(json.dumps(line).encode() + b"\n" for line in told)
    work = UnfinishedWork()
    for k in range(0, len(text), 7):
        work.hear(text[k : k + 7])
    work.undo()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["done", "where"]
    work.undo()  # what is not there is no failure
    assert Unfinished(str(tmp_path / "none"))() is None
