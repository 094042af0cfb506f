"""Too little memory: one line with how much would be needed, status 1, nothing left."""

import os
import re
import resource
import subprocess
import sys

import numpy as np
import pytest

from catseye.cli.terminal import attempt
from catseye.memory import available, is_memory_error, killed_process_message, out_of_memory
from process_scene import ends_with_us

GIB = 2**30


def of_size(count):
    """What numpy raises for an array that no machine has."""
    try:
        np.empty((count, count))
    except MemoryError as problem:
        return problem
    raise AssertionError(count)


def test_an_array_is_told_by_its_size(capfd):
    """10^7 x 10^7 numbers of 8 bytes are 8e14 B: 745 058 GiB."""
    problem = of_size(10**7)

    def work():
        raise problem

    assert attempt(work) == 1
    said = capfd.readouterr().err
    assert said.startswith("catseye: out of memory: an array of 10000000 x 10000000 needs 745058.1 GiB beside ")
    whole = float(re.search(r"at least ([0-9.]+) GiB in all", said)[1])
    used = float(re.search(r"beside ([0-9.]+) GiB in use", said)[1])
    assert whole == pytest.approx(745058.1 + used, abs=0.11)  # two roundings
    assert said.count("\n") == 1


def test_an_error_that_does_not_say_the_size_says_what_was_in_use():
    assert re.match(r"out of memory with [0-9.]+ GiB in use.*: more is needed", out_of_memory(MemoryError()))
    assert killed_process_message("SIGKILL", 3 * GIB).startswith("ended by SIGKILL with 3.0 GiB in use")


def test_a_library_that_finds_no_room_is_memory_and_one_that_is_missing_is_not():
    assert is_memory_error(ImportError("libx.so: failed to map segment from shared object"))
    assert is_memory_error(ImportError("libx.so: cannot allocate memory in static TLS block"))
    assert not is_memory_error(ImportError("No module named 'x'"))
    with pytest.raises(ImportError, match="No module"):
        attempt(lambda: __import__("catseye.no_such_module"))


def limited(mebibytes, *words, code="from catseye.cli.main import run; run()"):
    ask = ends_with_us()

    def limit():
        ask()
        resource.setrlimit(resource.RLIMIT_AS, (mebibytes << 20, mebibytes << 20))

    return subprocess.run(
        [sys.executable, "-c", code, *map(str, words)],
        capture_output=True,
        check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        preexec_fn=limit,
        timeout=120,
    )


def test_llvmlite_that_finds_no_room_is_memory_only_under_a_limit(monkeypatch):
    problem = OSError("Could not find/load shared object file 'libllvmlite.so' from resource location")
    for soft, short in ((900 << 20, True), (resource.RLIM_INFINITY, False)):
        monkeypatch.setattr(resource, "getrlimit", lambda which, soft=soft: (soft, soft))
        assert is_memory_error(problem) is short
    assert not is_memory_error(FileNotFoundError("night.csv"))


@pytest.mark.parametrize("mebibytes", [100, 160, pytest.param(220, marks=pytest.mark.slow), 330])
def test_a_limit_that_is_too_low_ends_in_one_line(tmp_path, mebibytes):
    """From where numpy itself finds no room to where the adjustment does not; night-01 is done with 500 MiB."""
    done = limited(mebibytes, "reduce", "night-01", "--out", tmp_path / "out")
    assert done.returncode == 1
    assert done.stderr.count(b"\n") == 1, done.stderr
    assert b"Traceback" not in done.stderr
    assert b"memory" in done.stderr.lower()
    assert not list(tmp_path.iterdir())


def test_the_limit_is_told():
    code = (
        "import catseye.cli.main as m, sys\n"
        "def work():\n"
        "    import numpy as np\n"
        "    np.ones((20_000, 20_000))\n"
        "m._main = work\n"
        "sys.argv = ['catseye', 'reduce']\n"
        "m.run()"
    )
    done = limited(1024, code=code)
    assert done.returncode == 1
    assert re.fullmatch(
        rb"catseye: out of memory: an array of 20000 x 20000 needs 3\.0 GiB beside 0\.\d GiB in use \(limit 1\.0 GiB, "
        rb"by ulimit -v or prlimit --as\), at least 3\.\d GiB in all \(.*\)\n",
        done.stderr,
    )


def test_available_memory_is_what_the_system_and_its_limits_leave(monkeypatch):
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    everything = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert 0 < available() <= everything
    monkeypatch.setattr(resource, "getrlimit", lambda what: (2**28, soft))
    assert available() <= 2**28
