"""Monitor and control from outside: a client over TCP, a simulated site in its own process."""

import socket
import time

from catseye.gateways.writers.samplers_fits import read_samplers
from catseye.service.replay import replayed
from cli.living_scene import PATIENCE, smallest_site, started


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Port:
    """A person at the coordinator's port."""

    def __init__(self, port):
        until, self.socket = time.monotonic() + PATIENCE, None
        while self.socket is None:
            try:
                self.socket = socket.create_connection(("127.0.0.1", port), 1.0)
            except OSError:
                assert time.monotonic() < until
        self.socket.settimeout(PATIENCE)
        self.lines = self.socket.makefile("rw", encoding="ascii")

    def close(self):
        self.lines.close()
        self.socket.close()

    def ask(self, line):
        """Bodies of the answers to a line."""
        self.lines.write(f"{line}\nVER\n")
        self.lines.flush()
        found = []
        while not (body := self.lines.readline().rstrip("\n").rpartition("\t")[2]).startswith("VER 1"):
            found += [body] if body else []
        return found

    def wait(self, command, done):
        """Answers to a command, once they are as wanted; the port's own pushes are the clock."""
        until = time.monotonic() + PATIENCE
        while not done(found := self.ask(command)):
            assert time.monotonic() < until, found
            self.lines.readline()
        return found


def values(port, name):
    row = next(row for row in port.ask("PARAMETERS") if row.startswith(f"PARAMETERS 1, {name}, "))
    return row.split(", ")[2:4]


def test_parameters_change_a_running_site_and_replay_repeats_it(tmp_path):
    journal, archive, number = tmp_path / "j.db", tmp_path / "archive", free_port()
    words = ("simulate", smallest_site(), "--minutes", "0.45", "--round-s", "4", "--journal", journal, "--quiet")
    more = ("--port-base", "0", "--port", number, "--archive-samplers", archive, "--archive-every-s", "10")
    with started(*words, *more) as process:
        port = Port(number)
        assert any(row.startswith("LEASE 1, anna") for row in port.ask("LEASE anna"))
        port.ask("SUBSCRIBE POSTURE")
        port.wait("SAMPLER EPOCHS", lambda rows: any(row.startswith("SAMPLER 1, EPOCHS") for row in rows))
        for name, text in (("cycles", "64"), ("air_model", "barrell_sears1963"), ("sun_cone_deg", "4")):
            assert f"SET 1, {name}, {text}" in port.ask(f"SET {name}, {text}")
        refused = [row for row in port.ask("PREPARE") if row.startswith("PREPARE")]
        assert refused == ["PREPARE 0, sun_cone_deg = 4 is below the record's 5 (expected 5 or more)"]
        assert values(port, "cycles") == ["128", "64"]
        locks = [row.split(", ") for row in port.ask("INTERLOCKS")]
        assert {(row[1], row[3].partition(" is")[0]) for row in locks if row[3] != "none"} == {
            ("sun_cone_deg", "sun_cone_deg = 4")
        }
        port.ask("SET sun_cone_deg, 12")
        assert "PREPARE 1, 3" in port.ask("PREPARE")
        assert "START 1, 3" in port.ask("START")
        port.wait("PARAMETERS", lambda rows: any(row.startswith("PARAMETERS 1, cycles, 64, none") for row in rows))
        assert values(port, "air_model") == ["barrell_sears1963", "none"]
        assert "MOVED 1, subreflector, 1.5, mm, anna" in port.ask("MOVED subreflector, 1.5, mm, anna")
        port.ask("REFERENCE NOW")
        port.close()
        process.wait(PATIENCE)
    outcome = replayed(str(journal), None, None, progress=lambda what, done, total: None)
    assert outcome.identical
    assert outcome.epochs >= 3
    tables = [read_samplers(path) for path in sorted(archive.glob("*/*.fits"))]
    assert len(tables) >= 2
    assert [t["MOVES"].columns["VALUE"].values.tolist() for t in tables if "MOVES" in t] == [[1.5]]
    assert {"POSE", "BEAM", "FOCUS", "CORRECTIONS", "HEALTH"} <= set().union(*tables)
