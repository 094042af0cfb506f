"""The page as a process: of a journal, of a result, and beside a site, which it never disturbs."""

import json
import os
import re
import signal
import socket
import subprocess
import threading
import time

import pytest

from web import page_scene  # isort: skip - skips where the extra is absent
import httpx  # isort: skip
from catseye.service.page import PROGRAM
from catseye.web import models
from cli.living_scene import ROUNDS, ended, processes_with, recorded, smallest_site, started
from kept_scene import reduction_directory

PATIENCE = 120.0  # s for a site to measure on a busy machine
ADDRESS = re.compile(r"^(?:page: )?(http://127\.0\.0\.1:\d+/)(?:#token=(\S+))?$")


def announced(process):
    """Address and token of the page, from the line that says so."""
    line = process.stdout.readline().rstrip("\n")
    found = ADDRESS.match(line)
    assert found, line
    return found.groups()


def got(base, path, **options):
    answer = httpx.get(f"{base}api/{path}", timeout=60.0, **options)
    assert answer.status_code == 200, answer.text
    return answer.json()


def page_of(process):
    """Id of the page's process, a child of another."""
    [pid] = [pid for pid in processes_with("catseye.web") if parent_of(pid) == process.pid]
    return pid


def parent_of(pid):
    with open(f"/proc/{pid}/stat") as stream:
        return int(stream.read().rpartition(")")[2].split()[1])


def wait_for(condition):
    until = time.monotonic() + PATIENCE
    while not (value := condition()):
        assert time.monotonic() < until
        time.sleep(0.2)
    return value


def test_a_journal_in_a_browser(tmp_path):
    """Every answer about a real journal has the shape of the document."""
    with started("view", recorded(), "--no-browser", home=tmp_path) as process:
        base, token = announced(process)
        assert token is None
        page = page_of(process)
        assert got(base, "service")["kind"] == "journal"
        epochs = models.EpochsJson.model_validate(got(base, "epochs")).epochs
        number = epochs[-1].number
        shots = models.ShotsJson.model_validate(got(base, "shots?limit=50"))
        shot = next(n for n, status in zip(shots.number, shots.status, strict=True) if status == "used")
        names = [each["name"] for each in got(base, "series/names")["names"]]
        point = got(base, f"epochs/{number}")["points"]["name"][0]
        paths = {
            "site": "SiteJson",
            "state": "StateJson",
            "dropped": "DroppedJson",
            "events": "EventsJson",
            f"state?at={epochs[0].mjd}": "StateJson",
            f"epochs/{number}": "EpochJson",
            f"epochs/{number}/residuals": "ResidualsJson",
            "series/names": "SeriesNamesJson",
            f"series?names={','.join(names[:3])}": "SeriesJson",
            f"shots/{shot}": "ShotJson",
            f"shots/{shot}/samples": "SamplesJson",
            f"points/{point}": "PointJson",
            f"rangers/{shots.ranger[0]}": "RangerJson",
            "calibrations": "CalibrationsJson",
            "air": "AirJson",
            f"comparison?first={epochs[0].number}&second={number}": "ComparisonJson",
        }
        for path, shape in paths.items():
            answer = httpx.get(f"{base}api/{path}", timeout=60.0)
            assert answer.status_code == 200, (path, answer.text)
            getattr(models, shape).model_validate_json(answer.content, strict=True)
        assert httpx.post(f"{base}api/commands", json={}).status_code == 403
        status, out, err = ended(process, signal.SIGINT)
    assert (status, out) == (130, "")
    assert err == "page: refused POST /api/commands from 127.0.0.1: this service takes no commands (403)\n"
    assert page not in processes_with("catseye.web")


def test_a_result_in_a_browser(tmp_path):
    with started("view", reduction_directory(), "--no-browser", home=tmp_path) as process:
        base, _ = announced(process)
        assert got(base, "service")["kind"] == "result"
        assert got(base, "report")["format"] == "catseye-report-1"
        status, *_ = ended(process, signal.SIGTERM)
    assert status == 143


def test_what_is_no_result_is_refused_in_one_line(tmp_path):
    (tmp_path / "a.html").write_text("<html></html>")
    for source in (tmp_path / "a.html", tmp_path, tmp_path / "nothing"):
        with started("view", source, "--no-browser", home=tmp_path) as process:
            out, err = process.communicate(timeout=60.0)
        assert (process.returncode, out, err.count("\n")) == (1, "", 1), err
        assert "Traceback" not in err


@pytest.mark.parametrize(
    ("line", "words"),
    [("", "no settings"), ("[]\n", "settings"), ("x" * 2_000_000, "no settings"), ('{"kind": "moon"}\n', "kind")],
)
def test_a_page_without_settings_ends(line, words):
    done = subprocess.run(PROGRAM, input=line, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("catseye: ")
    assert words in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_port_that_is_taken_is_named(tmp_path):
    with page_scene.served_page() as page:
        words = ("view", recorded(), "--no-browser", "--page-port", page.port)
        with started(*words, home=tmp_path) as process:
            _, err = process.communicate(timeout=60.0)
    assert process.returncode == 1
    assert err == f"catseye: page: cannot listen at 127.0.0.1 port {page.port}: Address already in use\n"


def test_a_page_ends_with_its_parent(tmp_path):
    with started("view", recorded(), "--no-browser", home=tmp_path) as process:
        announced(process)
        child = page_of(process)
        process.kill()
        process.wait()
        wait_for(lambda: child not in processes_with("catseye.web"))


def shots_of(port):
    """Shots that the coordinator has numbered, from its own port."""
    with socket.create_connection(("127.0.0.1", port), timeout=20.0) as sock, sock.makefile("rw") as stream:
        stream.write("1\tSTATUS\n")
        stream.flush()
        line = next(line for line in stream if "STATUS 1" in line)
    return int(line.split(",")[3])


def base_of_ports():
    """Another one for each process that tests, below the ports that connections get from the system."""
    return 19_000 + 90 * (os.getpid() % 10)


def test_a_page_beside_a_site_shows_it_commands_it_and_never_disturbs_it(tmp_path):
    port = base_of_ports() + 80
    words = ["serve", smallest_site(), "--twin", "--port-base", base_of_ports(), "--port", port, "--page-port", "0"]
    words += ["--start", "60635.125", "--journal", tmp_path / "site.db", "--log-json", *ROUNDS]
    with started(*words, home=tmp_path) as process:
        threading.Thread(target=process.stderr.read, daemon=True).start()
        base, token = announced(process)
        bearer = {"Authorization": f"Bearer {token}"}
        page = page_of(process)
        state = wait_for(lambda: (s := got(base, "state"))["connected"] and s["epoch"] is not None and s)
        models.StateJson.model_validate(state)
        models.EpochJson.model_validate(got(base, f"epochs/{state['epoch']['number']}"))
        models.RangerJson.model_validate(got(base, "rangers/ZY101"))
        assert "catseye_connected 1.0" in httpx.get(f"{base}metrics").text

        def sent(path, body, headers=bearer):
            return httpx.post(f"{base}api/{path}", json={**body, "who": "anna"}, headers=headers, timeout=30.0)

        passive, loud, active = ({"command": "MODE", "parameters": [m]} for m in ("passive", "loudly", "active"))
        assert sent("commands", passive, {}).status_code == 401
        answer = sent("commands", passive)
        assert answer.status_code == 200, answer.text
        models.CommandJson.model_validate(answer.json())
        wait_for(lambda: got(base, "state")["mode"] == "passive")
        assert sent("commands", loud).status_code == 409
        assert sent("commands", active).status_code == 200
        line = sent("console/ZY101", {"line": "VER"})
        assert line.status_code == 200, line.text

        os.kill(page, signal.SIGSTOP)
        before = shots_of(port)
        wait_for(lambda: shots_of(port) > before + 3)
        os.kill(page, signal.SIGKILL)
        before = shots_of(port)
        wait_for(lambda: shots_of(port) > before + 3)
        assert wait_for(lambda: connected_again(base))
        assert page not in processes_with("catseye.web")
        page = page_of(process)
        assert json.dumps(token) not in (tmp_path / "site.db").read_bytes().decode("latin-1")
        process.send_signal(signal.SIGINT)
        began = time.monotonic()
        assert process.wait(timeout=30.0) == 130
        assert time.monotonic() - began < 5.0
        assert token not in process.stdout.read()
    assert page not in processes_with("catseye.web")


def connected_again(base):
    try:
        return got(base, "state")["connected"]
    except httpx.HTTPError:
        return False
