"""A page about a made-up site, served in a thread: for the tests of the service itself."""

import asyncio
import contextlib
import json
import socket
import threading
import time
import urllib.request

import pytest

from catseye.api.live.address import page_settings
from catseye.errors import ArgumentError, InputError
from repository import ROOT

for package, extra in (("fastapi", "web"), ("uvicorn", "web"), ("websockets", "web"), ("httpx", "test-web")):
    pytest.importorskip(package, reason=f"the extra {extra} is not installed")

from catseye.web.refusals import RefusalLog  # noqa: E402 - after the skip
from catseye.web.service import listening_socket, serve  # noqa: E402
from catseye.web.subject import PageSubject  # noqa: E402

DOCUMENT = ROOT / "docs" / "openapi.json"
TOKEN = "a-Token_of-40-letters-that-nobody-guesses"
MJD = 60_635.125
NUMBERS = ("xx", "xy", "xz", "yy", "yz", "zz")
EPOCH = {
    "number": 3,
    "mjd": MJD,
    "points": 2,
    "shots": 36,
    "rejected": 1,
    "variance_factor": 1.02,
    "degrees_of_freedom": 30,
    "refractivity_ppm": 252.1,
    "verdict": "good",
    "azimuth": 2.5,
    "elevation": 0.8,
}
POSTURE = {"mjd": MJD, "azimuth": 2.5, "elevation": 0.8, "azimuth_rate": 0.0, "elevation_rate": 0.0}
WEATHER = {"station": "WX1", "mjd": MJD, "temperature_c": 4.5, "pressure_hpa": 930.0, "humidity_percent": 60.0}
SHOT = {
    "number": 41,
    "mjd": MJD,
    "ranger": "ZY101",
    "target": "ZEG41040L",
    "status": "good",
    "range": 123.4567,
    "u_range": 5e-5,
    "misfit": 1e-5,
}
SHOTS = {key: [value] for key, value in SHOT.items()}
PROBLEM = {
    "id": "clock",
    "severity": "warning",
    "text": "the clock is not synchronised",
    "since": MJD,
    "acknowledged_by": None,
    "acknowledged_at": None,
    "shelved_by": None,
    "shelved_until": None,
}


def ranger_row(name):
    """A ranger of the made-up site."""
    last = {key: SHOT[key] for key in ("number", "target", "status", "range", "u_range", "misfit")}
    return {
        "name": name,
        "mjd": MJD,
        "state": "ready",
        "word": "ready",
        "sign": "+",
        "trouble": None,
        "shots": 41,
        "failures": 1,
        "stream": None,
        "last": last,
        "next": "ZEG41041L",
    }


class MadeUpWatch:
    """A `SiteWatch` of 18 rangers with the answers of the contract, and a list of what was commanded."""

    def __init__(self):
        self.listeners, self.done, self.connected, self.history = [], [], True, True

    async def run(self):
        while True:
            self.tell("state", self.state())
            await asyncio.sleep(1.0)

    def tell(self, kind, data):
        for listener in self.listeners:
            listener(kind, data)

    def now(self):
        return MJD + 1.0 / 86_400.0

    def state(self, at=None):
        if at is not None and at < 60_000.0:
            raise ArgumentError(f"at = {at:g} is before the history (expected {MJD:g} or later)", "at")
        return {
            "mjd": self.now(),
            "received": MJD,
            "source": "live",
            "connected": self.connected,
            "word": "measuring",
            "mode": "active",
            "round": 7,
            "shots": {"numbered": 42, "acknowledged": 41},
            "clock": "good",
            "disk": "good",
            "journal": "good",
            "lease": None,
            "problems": [PROBLEM],
            "verdict": "good",
            "epoch": EPOCH,
            "posture": POSTURE,
            "weather": [WEATHER],
            "sun": {"azimuth": 1.0, "elevation": -0.5, "cone": 0.17},
            "rangers": [ranger_row(f"ZY{101 + k}") for k in range(18)],
        }

    def site(self):
        return {
            "name": "made up",
            "latitude": 0.67,
            "longitude": -1.39,
            "height": 800.0,
            "time_zone": None,
            "rangers": [{"name": f"ZY{101 + k}", "x": 1.0, "y": 2.0, "z": 3.0, "kind": "ground"} for k in range(18)],
            "targets": {"name": ["ZEG41040L"], "x": [1.0], "y": [2.0], "z": [3.0], "body": ["dish"]},
            "structure": [{"name": "rim", "body": "dish", "x": [0.0, 1.0], "y": [0.0, 1.0], "z": [0.0, 1.0]}],
            "runs": [{"run": 1, "uuid": "u", "started": MJD, "ended": None}],
            "since": MJD,
            "until": MJD,
        }

    def epochs(self, since=None, until=None, limit=200):
        return {"epochs": [EPOCH]}

    def epoch(self, number, run=None, at=None):
        self.known_epoch(number)
        places = {axis: [1.0, 2.0] for axis in "xyz"} | {"covariance": {key: [1e-9, 1e-9] for key in NUMBERS}}
        return EPOCH | {
            "points": {"name": ["A", "B"], "body": ["dish", "dish"], **places, "shots": [18, 18]},
            "beams": {"ranger": ["ZY101"], "target": ["A"], "shot": [41], "w": [0.3]},
            "structure": self.site()["structure"],
            "air": {"name": ["mean"], "value": [252.1], "u": [0.1]},
            "zeros": {"ranger": ["ZY101"], "value": [1e-5], "u": [1e-5]},
            "jitter_mm": {"dish": 0.02},
            "doubts": [],
            "notes": ["a note"],
            "biases": None,
            "pose": None,
            "rejected": [{"shot": 40, "ranger": "ZY101", "target": "A", "reason": "w = 9"}],
        }

    def known_epoch(self, number):
        if number != EPOCH["number"]:
            raise InputError(f"epoch {number} is unknown (expected 1 to 3)")

    def residuals(self, number, run=None, at=None):
        self.known_epoch(number)
        numbers = {key: [0.1] for key in ("mjd", "elevation", "residual", "u", "w")}
        return {"shot": [41], "ranger": ["ZY101"], "target": ["A"], **numbers, "status": ["good"]}

    def series_names(self):
        return {"names": [{"name": "azimuth", "label": "azimuth", "unit": "rad"}]}

    def series(self, names, since=None, until=None, most=2000):
        if unknown := [name for name in names if name != "azimuth"]:
            raise InputError(f"{unknown[0]!r} is not a series (expected azimuth)")
        line = {"name": "azimuth", "label": "azimuth", "unit": "rad", "mjd": [MJD] * most, "value": [2.5] * most}
        return {"names": [line | {"u": None, "low": None, "high": None}], "gaps": 30.0}

    def dropped(self, since=None, until=None, bins=200):
        return {"rangers": ["ZY101"], "bins": [MJD], "good": [[3]], "failed": [[0]]}

    def shots(self, **chosen):
        return SHOTS

    def known_shot(self, number):
        if number != SHOT["number"]:
            raise InputError(f"shot {number} is unknown (expected 1 to 42)")

    def shot(self, number, run=None, at=None):
        self.known_shot(number)
        return SHOT | {
            "text": "good",
            "amplitude_v": 1.1,
            "phase": 0.2,
            "epoch": 3,
            "posture": POSTURE,
            "has_samples": True,
            "correction": [{"name": "vacuum", "value": 123.4, "unit": "m"}],
            "weather": [WEATHER],
            "certificate": {
                "instrument": "ZY101",
                "file": "zy101.toml",
                "valid_from": "2026-01-01",
                "valid_until": None,
            },
        }

    def samples(self, number, run=None, at=None):
        self.known_shot(number)
        return {
            "sample_rate_hz": 1000.0,
            "volts": [0.1, 0.2],
            "fit": {},
            "spectrum": {"frequency_hz": [0.0, 500.0], "amplitude_v": [0.0, 0.1]},
            "harmonics": [{"n": 1, "frequency_hz": 500.0, "amplitude_v": 0.1}],
            "cycle_phase": {"t": [0.0], "phase": [0.2]},
        }

    def point(self, name, since=None, until=None):
        if name != "A":
            raise InputError(f"point {name!r} is unknown (expected A or B)")
        places = {axis: [1.0] for axis in "xyz"} | {"covariance": {key: [1e-9] for key in NUMBERS}}
        return {"name": "A", "body": "dish", "mjd": [MJD], **places, "shots": SHOTS}

    def ranger(self, name, at=None):
        if name != "ZY101":
            raise InputError(f"{name!r} is no ranger of the site")
        empty = {"mjd": [], "line": [], "reply": [], "ok": []}
        own = {"kind": "ground", "station": {}, "zero": None, "servo": None, "certificates": [], "commands": empty}
        return ranger_row(name) | own

    def calibrations(self, at=None):
        row = {"instrument": "ZY101", "kind": "oscillator", "file": "f", "sha256": "0", "valid_from": None}
        return {"instruments": [row | {"valid_until": None, "valid": True, "value": 1.0, "u": 0.1, "unit": "ppm"}]}

    def air(self, epoch=None, run=None, at=None):
        paths = {key: [1.0] for key in ("length", "refractivity_ppm", "u", "temperature_c")}
        return {"paths": {"ranger": ["ZY101"], "target": ["A"], **paths}, "profile": None, "stations": [WEATHER]}

    def comparison(self, first, second, run=None, at=None):
        self.known_epoch(first)
        deltas = {axis: [1e-4] for axis in ("dx", "dy", "dz")} | {"covariance": {key: [1e-9] for key in NUMBERS}}
        return {"name": ["A"], **deltas, "significant": [False], "verdict": "good"}

    def surface(self, epoch=None, run=None, at=None):
        return {
            "points": {"name": ["A"], "x": [1.0], "y": [2.0], "deviation": [1e-4], "u": [1e-5]},
            "actuators": None,
            "zernike": [{"n": 2, "m": 2, "name": "astigmatism", "value": 1e-4, "u": 1e-5}],
            "rms": 1e-4,
            "verdict": "good",
        }

    def events(self, since=None, until=None, severity=None, limit=500):
        return {"mjd": [MJD], "severity": ["note"], "who": ["ZY101"], "kind": ["connected"], "text": ["connected"]}

    async def command(self, name, parameters, who):
        if name == "DROP" and parameters == ["ZY999"]:
            raise InputError("ZY999 is no ranger of the site")
        self.done.append((name, tuple(parameters), who))
        return {"command": name, "values": list(parameters), "at": MJD, "lease_from": None}

    async def parameters(self):
        texts = {"value": "10", "waiting": "none", "legal": "2 to 600", "unit": "s"}
        words = {"changes": "plan", "meaning": "length of a round", "stage": "none", "choices": []}
        row = {"name": "round_s", **texts, **words}
        lock = {"parameters": ["rate_hz", "round_s"], "rule": "a round has a shot of each ranger", "refusal": None}
        return {"parameters": [row], "interlocks": [lock]}

    async def samplers(self):
        return {"samplers": [{"name": "FOCUS", "values": 1, "columns": ["epoch", "along_axis_m", "verdict"]}]}

    async def sampler(self, name, limit=1, at=None):
        if name.upper() != "FOCUS":
            raise InputError(f"{name!a} is not a sampler")
        return {"name": "FOCUS", "mjd": [MJD], "columns": {"epoch": [3.0], "along_axis_m": [None], "verdict": ["good"]}}

    async def console(self, ranger, line, who):
        self.done.append((ranger, line, who))
        return {"replies": [f"OK {line}"]}

    async def acknowledge(self, alarm, who):
        return await self.command("ACK", [alarm], who)

    async def shelve(self, alarm, who, minutes):
        return await self.command("SHELVE", [alarm, str(minutes)], who)

    async def unshelve(self, alarm, who):
        return await self.command("UNSHELVE", [alarm], who)


class Page:
    """A page served in a thread: its address, its subject, lines and counts of its log."""

    def __init__(self, port, subject, log, counts, loop):
        self.port, self.subject, self.log, self.counts, self.loop = port, subject, log, counts, loop

    @property
    def base(self):
        return f"http://127.0.0.1:{self.port}"

    def tell(self, kind, data):
        """Let the site tell an event."""
        self.loop.call_soon_threadsafe(self.subject.watch.tell, kind, data)


@contextlib.contextmanager
def served_page(*, watch=None, report=None, token=TOKEN, host="127.0.0.1", **keys):
    """A page about a made-up site, or about a report, on a free port."""
    kind = "result" if report is not None else "site"
    own = {"path": "here"} if kind == "result" else {"site": "gbt", "coordinator": ["127.0.0.1", 1]}
    settings = page_settings(json.dumps({"kind": kind, "listen": [host, 0], "token": token, **own, **keys}))
    watch = None if kind == "result" else watch or MadeUpWatch()
    subject = PageSubject(kind, "made up", watch, report, commands=watch is not None and token is not None)
    log, started, inside = [], threading.Event(), {}

    async def story():
        ending = asyncio.Event()
        inside.update(loop=asyncio.get_running_loop(), ending=ending, log=RefusalLog(log.append))
        await serve(settings, subject, listener, refusals=inside["log"], listening=started.set, ending=ending)

    with listening_socket(*settings.listen) as listener:
        port = listener.getsockname()[1]
        thread = threading.Thread(target=lambda: asyncio.run(story()), daemon=True)
        thread.start()
        assert started.wait(20.0)
        try:
            yield Page(port, subject, log, inside["log"].counts, inside["loop"])
        finally:
            inside["loop"].call_soon_threadsafe(inside["ending"].set)
            thread.join(10.0)
            subject.desk.close()
            assert not thread.is_alive()


def sent_raw(port, data, *, limit=15.0):
    """All that a server answers to bytes, until it closes; and the seconds until then."""
    began = time.monotonic()
    with socket.create_connection(("127.0.0.1", port), timeout=limit) as sock:
        with contextlib.suppress(ConnectionError):
            sock.sendall(data)
        answer = b""
        with contextlib.suppress(ConnectionError):
            while part := sock.recv(65_536):
                answer += part
    return answer, time.monotonic() - began


def document():
    """OpenAPI document of the service."""
    with served_page() as page, urllib.request.urlopen(f"{page.base}/api/openapi.json") as answer:
        return json.load(answer)


if __name__ == "__main__":
    DOCUMENT.write_text(json.dumps(document(), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
