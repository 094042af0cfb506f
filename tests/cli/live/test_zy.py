"""The ranger server: what it refuses, and in a process of its own, what it serves and how it ends."""

import json
import signal
import socket
import subprocess

import pytest

from catseye.ranger.status import StatusWord
from cli.living_scene import PATIENCE, ended, processes_with, small_site, started

HEADS = """
from catseye.errors import InputError
from ranger.scripted_head import ScriptedHead

def card(name):
    if name == "ZY102":
        raise InputError("no card in the slot")
    return ScriptedHead()

def other(name):
    return object()

five = 5
"""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "expected one of --twin and --head"),
        (["--twin", "--head", "a:b"], "expected one of --twin and --head"),
        (["--twin", "--motion", "dance 1 2"], "motion 'dance 1 2': expected fixed AZ EL"),
        (["--twin", "--motion", "track 0 95"], "elevation 95"),
        (["--twin", "--fault", "dead-ranger"], "expected KIND WHOM"),
        (["--twin", "--conditions", "nice"], "'nice' is not one of night, windy-day, dewy-night"),
        (["--twin", "--ports", "5240"], "'5240' is not two ports"),
        (["--twin", "--ports", "5240,65536"], "'5240,65536' is not two ports"),
        (["--twin", "--loopback", "--host", "127.0.0.1"], "--host and --ports say otherwise"),
        (["--twin", "--start", "yesterday"], "yesterday"),
        (["--twin", "--port-base", "99999"], "99999 is not 0 to 65000"),
    ],
)
def test_what_cannot_be_meant_is_wrong_usage(catseye, words, said):
    status, out, err = catseye("zy", "gbt", *words)
    assert (status, out) == (2, "")
    assert said in " ".join(err.split())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nowhere", "--twin"], "nowhere"),
        (["SITE", "ZY999", "--twin"], "ZY999 is no ranger of the site"),
        (["SITE", "--twin", "--ports", "0,0"], "18 rangers cannot share two ports"),
        (["SITE", "--twin", "--fault", "dead-ranger ZY999"], "unknown ranger ZY999"),
        (["SITE", "ZY101", "--head", "nothing_there:card"], "No module named 'nothing_there'"),
        (["SITE", "ZY101", "--head", "nothing"], "expected package.module:factory"),
        (["SITE", "ZY101", "--head", "heads_of_ours:none"], "has no attribute 'none'"),
        (["SITE", "ZY101", "--head", "heads_of_ours:five"], "five is not callable"),
        (["SITE", "ZY101", "--head", "heads_of_ours:other"], "(expected a Head)"),
        (["SITE", "ZY101", "ZY102", "--head", "heads_of_ours:card"], "no head for ZY102: no card in the slot"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_status_1(catseye, tmp_path, monkeypatch, words, said):
    (tmp_path / "heads_of_ours.py").write_text(HEADS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [*__import__("sys").path])
    status, out, err = catseye("zy", *(str(small_site()) if word == "SITE" else word for word in words))
    assert (status, out) == (1, "")
    assert said in " ".join(err.split())


def test_a_port_that_is_taken_is_named(catseye):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        status, _, err = catseye("zy", small_site(), "ZY101", "--twin", "--cold", "--ports", f"{port},0")
    assert status == 1
    assert f"ZY101: 127.0.0.1 port {port} is not available" in err


@pytest.mark.parametrize(
    ("number", "status"), [pytest.param(signal.SIGTERM, 0, marks=pytest.mark.slow), (signal.SIGINT, 130)]
)
def test_it_serves_people_and_ends_clean(tmp_path, number, status):
    """A person's dialogue: a shot on the cube inside, by night."""
    words = ["zy", small_site(), "ZY102", "--twin", "--start", "60635.125", "--port-base", "0", "--json"]
    with started(*words, home=tmp_path) as process:
        at = json.loads(process.stdout.readline())
        host, port, _ = at["rangers"]["ZY102"]
        assert list(at["rangers"]) == ["ZY102"]
        with socket.create_connection((host, port), timeout=PATIENCE) as person:
            lines = person.makefile("rw")
            print("LEASE anna", file=lines, flush=True)
            print("PS 1\nCIL 0", file=lines, flush=True)
            print("CMEAS 2, 0", file=lines, flush=True)
            heard = []
            while not heard or "CMEAS" not in heard[-1]:
                heard.append(lines.readline())
        assert "HELLO This is ZY102" in heard[0]
        command, *values = heard[-1].split("\t")[2].replace(" ", ",", 1).split(",")
        assert (command, values[0].strip()) == ("CMEAS", "1"), heard
        assert 0.1 < float(values[4]) < 10.0  # V: more than the leakage, within the converter
        socket.create_connection(tuple(at["feed"])).close()
        assert ended(process, number) == (status, "", "")
    assert list(tmp_path.iterdir()) == []


def test_a_child_leaves_with_whoever_holds_its_standard_input(tmp_path):
    words = ["zy", small_site(), "ZY102", "--twin", "--cold", "--port-base", "0", "--json", "--leave-with-stdin"]
    with started(*words, home=tmp_path, stdin=subprocess.PIPE) as process:
        assert process.stdout.readline()
        process.stdin.close()
        assert process.wait(timeout=PATIENCE) == 0
    assert list(tmp_path.iterdir()) == []
    assert processes_with(str(tmp_path)) == []


@pytest.mark.parametrize("lit", [False, True])
def test_a_unix_socket_is_served_and_the_laser_is_off_at_boot_unless_asked_for(tmp_path, lit):
    folder = tmp_path / "run"
    words = ["zy", small_site(), "ZY102", "--twin", "--cold", "--host", f"unix:{folder}", "--port-base", "0", "--json"]
    with started(*words, *["--laser-at-boot"] * lit, home=tmp_path) as process:
        host, port, _ = json.loads(process.stdout.readline())["rangers"]["ZY102"]
        assert host == f"unix:{folder}"
        with socket.socket(socket.AF_UNIX) as person:
            person.settimeout(PATIENCE)
            person.connect(str(folder / f"{port}.sock"))
            lines = person.makefile("r")
            heard = [lines.readline() for _ in range(3)]
        assert bool(int(heard[-1].split("0x")[1], 16) & StatusWord.LASER_OFF) is not lit
        _, out, err = ended(process, signal.SIGTERM)
        assert out == ""
        assert ("warning: lasers shine from power-up on (laser at boot)" in err) is lit
    assert list(folder.iterdir()) == []
