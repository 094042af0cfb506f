"""A living site with its page, a browser, and what every page must keep to."""

import json
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from browser.prerequisites import browser, missing
from process_scene import ends_with_us

FLAGS = (
    *("--no-sandbox", "--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--disable-quic", "--enable-unsafe-swiftshader"),
)
ROOT = Path(__file__).parents[2]
AXE = ROOT / "front" / "node_modules" / "axe-core" / "axe.min.js"
LONGEST_START = 90.0  # s, beside other work
START_MJD = 60635.125  # 2024-11-21, 03:00 UTC
TOKEN = "a-token-of-the-tests-0123456789abcdef"
WIDTHS = {"laptop": (1440, 900), "phone": (390, 844)}


def pytest_collection_modifyitems(items):
    lacks = missing()
    for item in items:
        item.add_marker(pytest.mark.browser)
        if lacks:
            item.add_marker(pytest.mark.skip(reason=f"browser tests: {'; '.join(lacks)}"))


@dataclass
class Part:
    """A process of the site, which a test may freeze, kill and start again.

    module       of Python that is run, and its arguments
    first_line   sent to its standard input, which stays open
    """

    module: tuple[str, ...]
    log: Path
    first_line: str = ""
    process: subprocess.Popen | None = None

    def start(self) -> str:
        """Start it and return the first line of its standard output."""
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", *self.module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.log.open("a"),
            text=True,
            preexec_fn=ends_with_us(),
        )
        if self.first_line:
            self.process.stdin.write(self.first_line + "\n")
            self.process.stdin.flush()
        return self.process.stdout.readline()

    def kill(self, number: int = signal.SIGKILL) -> None:
        """End it by a signal, frozen or not."""
        with suppress(ProcessLookupError):
            self.process.send_signal(number)
            self.process.send_signal(signal.SIGCONT)
        self.process.wait(15.0)

    @contextmanager
    def frozen(self) -> Iterator[None]:
        self.process.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self.process.send_signal(signal.SIGCONT)


@dataclass
class LivingSite:
    """A twin, its coordinator and the service of its pages, a process each."""

    twin: Part
    coordinator: Part
    service: Part
    port: int  # of the coordinator
    journal: Path
    url: str = ""

    def get(self, path: str) -> dict:
        """Answer of the service, which the pages must show."""
        with urllib.request.urlopen(f"{self.url}/api/{path}", timeout=20.0) as reply:
            return json.load(reply)


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def wait_for(done, seconds: float = LONGEST_START):
    """What `done` returns once it is true."""
    until = time.monotonic() + seconds
    while not (value := done()):
        assert time.monotonic() < until, f"nothing after {seconds:g} s"
        time.sleep(0.1)
    return value


@pytest.fixture(scope="session")
def site(tmp_path_factory) -> Iterator[LivingSite]:
    """The Green Bank site's twin in a November night, whose clock is years from this machine's."""
    where, port = tmp_path_factory.mktemp("site"), free_port()
    offset = str((START_MJD - 40587.0) * 86400.0 - time.time())
    twin = Part(
        (
            *("catseye", "zy", "gbt", "--twin", "--start", str(START_MJD), "--clock-offset-s", offset),
            *("--port-base", "0", "--json", "--leave-with-stdin"),
        ),
        where / "twin.log",
    )
    at = json.loads(twin.start())
    feed_host, feed_port = at["feed"]
    rangers = "".join(
        f'[[ranger]]\nname = "{name}"\nhost = "{host}"\nports = [{first}, {second}]\n'
        for name, (host, first, second) in at["rangers"].items()
    )
    addresses = where / "addresses.toml"
    addresses.write_text(f'format = "catseye-addresses-1"\nfeed = "{feed_host}:{feed_port}"\n\n{rangers}')
    journal = where / "night.db"
    coordinator = Part(
        (
            *("catseye", "ziy", "gbt", "--addresses", str(addresses), "--port", str(port)),
            *("--clock-offset-s", offset, "--journal", str(journal)),
        ),
        where / "coordinator.log",
    )
    settings = {
        "kind": "site",
        "listen": ["127.0.0.1", 0],
        "token": TOKEN,
        "certificate": None,
        "key": None,
        "site": "gbt",
        "coordinator": ["127.0.0.1", port],
        "rangers": {name: [host, first] for name, (host, first, _) in at["rangers"].items()},
        "journal": str(journal),
    }
    living = LivingSite(
        twin=twin,
        coordinator=coordinator,
        service=Part(("catseye.web",), where / "service.log", json.dumps(settings)),
        port=port,
        journal=journal,
    )
    parts = (living.service, living.coordinator, living.twin)
    try:
        start_coordinator(living)
        host, page_port = json.loads(living.service.start())["listening"]
        living.url = f"http://{host}:{page_port}"
        wait_for(lambda: living.get("state")["epoch"])
        yield living
    finally:
        for part in parts:
            if part.process is not None:
                part.kill(signal.SIGTERM)


def start_coordinator(site: LivingSite) -> None:
    """Start the coordinator and wait until its port listens."""
    part = site.coordinator
    part.process = subprocess.Popen(
        [sys.executable, "-P", "-m", *part.module],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=part.log.open("a"),
        preexec_fn=ends_with_us(),
    )

    def listens() -> bool:
        with suppress(OSError), socket.create_connection(("127.0.0.1", site.port), 1.0):
            return True
        return False

    wait_for(listens)


@pytest.fixture(scope="session")
def chromium():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as started:
        opened = started.chromium.launch(executable_path=browser(), args=list(FLAGS))
        yield opened
        opened.close()


@dataclass
class Watched:
    """A page, with its errors and its requests to anywhere else."""

    page: object
    errors: list[str] = field(default_factory=list)
    elsewhere: list[str] = field(default_factory=list)

    def assert_clean(self) -> None:
        assert self.errors == []
        assert self.elsewhere == []

    def axe(self) -> list[str]:
        """Serious and critical findings of axe-core."""
        self.page.evaluate(AXE.read_text())
        found = self.page.evaluate("axe.run()")["violations"]
        return [
            f"{each['id']}: {each['nodes'][0]['html'][:200]}"
            for each in found
            if each["impact"] in ("serious", "critical")
        ]

    def too_wide(self) -> int:
        """Pixels by which the page scrolls sideways."""
        return self.page.evaluate("document.documentElement.scrollWidth - window.innerWidth")


@pytest.fixture
def watched(chromium):
    """A function that opens pages: `watched(url, width="phone", scheme="dark", token=True)`."""
    contexts = []

    def opened(url: str, *, width: str = "laptop", scheme: str = "light", offline: bool = False) -> Watched:
        wide, high = WIDTHS[width]
        context = chromium.new_context(
            viewport={"width": wide, "height": high}, color_scheme=scheme, reduced_motion="reduce", offline=offline
        )
        contexts.append(context)
        page = context.new_page()
        watch = Watched(page)
        here = url.split("/#")[0].split("?")[0]

        def requested(address: str) -> None:
            host = here.removeprefix("http")
            if not address.startswith(("blob:", "data:", here, f"ws{host}")):
                watch.elsewhere.append(address)

        page.on("console", lambda said: watch.errors.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: watch.errors.append(str(error)))
        page.on("request", lambda request: requested(request.url))
        page.on("websocket", lambda opened_socket: requested(opened_socket.url))
        page.goto(url)
        return watch

    yield opened
    for context in contexts:
        context.close()
