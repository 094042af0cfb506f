"""The coordinator against rangers in another process: its log, its port, its journal, its end; and what it refuses."""

import json
import signal
import socket

import pytest

from catseye.coordinator.journal.reader import JournalReader
from catseye.service.journals import checked
from cli.living_scene import PATIENCE, ended, small_site, started


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--feed", "nowhere"], "'nowhere' is not HOST:PORT"),
        (["--feed", "h:1", "--motion-script", "fixed 1 30"], "--feed says otherwise"),
        (["--addresses", "a.toml", "--loopback"], "--loopback says otherwise"),
        (["--mode", "asleep"], "'asleep' is not one of active, passive, hold"),
        (["--port", "70000"], "70000 is not 0 to 65535"),
    ],
)
def test_what_cannot_be_meant_is_wrong_usage(catseye, words, said):
    status, out, err = catseye("ziy", "gbt", *words)
    assert (status, out) == (2, "")
    assert said in " ".join(err.split())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--addresses", "none.toml"], "none.toml"),
        (["--motion-script", "walk"], "is not a readable file"),
        (["--drop", "ZY999"], "drop ZY999: unknown ranger"),
        (["--keep-out", "none.toml"], "none.toml"),
        (["--journal", "mysql://there/db"], "is unusable"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_status_1(catseye, words, said):
    status, out, err = catseye("ziy", small_site(), "--port", "0", *words)
    assert (status, out) == (1, "")
    assert said in err
    assert err.count("\n") == 1


def test_a_port_that_is_taken_is_named(catseye, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        words = ["--port", str(port), "--motion-script", "fixed 145.3 30", "--mode", "hold", "--quiet"]
        status, _, err = catseye("ziy", small_site(), *words, "--journal", tmp_path / "j.db")
    assert status == 1
    assert f"ZIY: 127.0.0.1 port {port} is not available" in err
    assert [path.name for path in tmp_path.iterdir()] == ["j.db"]  # no lock of a writer is left


def test_it_measures_with_rangers_of_another_process_and_ends_clean(tmp_path):
    """One ranger by its address, a known motion, the log for programs; a client asks its port."""
    rangers = ["zy", small_site(), "ZY102", "--twin", "--port-base", "0", "--json", "--start", "60635.125"]
    rangers += ["--clock-offset-s", "0", "--motion", "fixed 145.3 30"]
    with started(*rangers, home=tmp_path) as twin:
        host, first, second = json.loads(twin.stdout.readline())["rangers"]["ZY102"]
        addresses = tmp_path / "where.toml"
        ranger = f'[[ranger]]\nname = "ZY102"\nhost = "{host}"\nports = [{first}, {second}]\n'
        addresses.write_text(f'format = "catseye-addresses-1"\n{ranger}')
        words = ["ziy", small_site(), "--addresses", addresses, "--motion-script", "fixed 145.3 30", "--mode", "hold"]
        words += ["--journal", tmp_path / "night.db", "--port", "0", "--log-json"]
        with started(*words, home=tmp_path) as process:
            told = {}
            while "connected" not in json.dumps(list(told.values())):
                row = json.loads(process.stderr.readline())
                assert {"time_utc", "mjd", "severity", "who", "kind", "text", "details"} == set(row)
                told[row["kind"]] = row["text"]
                if row["kind"] == "listens":
                    break
            port = int(told["listens"].rpartition(" ")[2])
            with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as person:
                lines = person.makefile("rw")
                print("STATUS", file=lines, flush=True)
                heard = [lines.readline() for _ in range(3)]
            assert "HELLO This is ZIY" in heard[0]
            assert heard[2].split("\t")[2].startswith("STATUS 1, hold")
            status, out, _ = ended(process, signal.SIGTERM)
            assert status == 0
            last = out.partition(": head ")[2].partition(" of run 1")[0]
            assert out == f"journal {tmp_path / 'night.db'}: head {last} of run 1\n"
            reports, _ = checked(str(tmp_path / "night.db"), None, [last], None, progress=lambda *_: None)
            assert (reports[0].intact, reports[0].ended, reports[0].heads) == (True, True, 1)
        assert ended(twin, signal.SIGTERM)[0] == 0
    with JournalReader(tmp_path / "night.db") as reader:
        assert reader.run().ended is not None
        assert [kind for _, kind in happenings(reader)][-1] == "stopped"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["night.db", "where.toml"]


def happenings(reader):
    return [(entry.who, entry.kind) for _, entry in reader.events(1, kinds=["happenings"])]
