"""A living site with its pages, a process each, and a page that is watched."""

import json
import os
import re
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

from process_scene import ends_with_us

ROOT = Path(__file__).parents[2]
AXE = ROOT / "front" / "node_modules" / "axe-core" / "axe.min.js"
PICTURES = os.environ.get("CATSEYE_PICTURES")  # directory for a screenshot of each page that is opened
LONGEST_START = 90.0  # s, beside other work
START_MJD = 60635.125  # 2024-11-21, 03:00 UTC
TOKEN = "a-token-of-the-tests-0123456789abcdef"
WIDTHS = {"laptop": (1440, 900), "phone": (390, 844)}


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

    def start(self) -> None:
        with self.log.open("a") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", *self.module],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
                preexec_fn=ends_with_us(),
            )
        if self.first_line:
            self.process.stdin.write(self.first_line + "\n")
            self.process.stdin.flush()

    def addresses(self) -> dict:
        """First line of its standard output, an object."""
        return json.loads(self.process.stdout.readline())

    def kill(self, number: int = signal.SIGKILL) -> None:
        """End it by a signal, frozen or not."""
        with suppress(ProcessLookupError):
            self.process.send_signal(number)
            self.process.send_signal(signal.SIGCONT)
        self.process.wait(15.0)
        self.process.stdin.close()
        self.process.stdout.close()

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

    def start_coordinator(self) -> None:
        """Start the coordinator and wait until its port listens."""
        self.coordinator.start()

        def listens() -> bool:
            with suppress(OSError), socket.create_connection(("127.0.0.1", self.port), 1.0):
                return True
            return False

        wait_for(listens)

    def get(self, path: str) -> dict:
        """Answer of the service, which the pages must show."""
        with urllib.request.urlopen(f"{self.url}/api/{path}", timeout=20.0) as reply:
            return json.load(reply)

    def command(self, name: str, *parameters: str) -> None:
        """Command by the service, whose lease the pages use, too."""
        body = json.dumps({"command": name, "parameters": parameters, "who": "anna"}).encode()
        headers = {"Authorization": f"Bearer {TOKEN}", "Content-Type": "application/json"}
        with urllib.request.urlopen(urllib.request.Request(f"{self.url}/api/commands", body, headers), timeout=20.0):
            pass


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def wait_for(done, seconds: float = LONGEST_START):
    """Value of `done` once it is true."""
    until = time.monotonic() + seconds
    while not (value := done()):
        assert time.monotonic() < until, f"nothing after {seconds:g} s"
        time.sleep(0.1)
    return value


@dataclass
class Watched:
    """A page, with its errors and its requests to anywhere else."""

    page: object
    errors: list[str] = field(default_factory=list)
    elsewhere: list[str] = field(default_factory=list)

    def assert_clean(self) -> None:
        assert not self.errors, self.errors
        assert not self.elsewhere, self.elsewhere

    def axe(self, *, preload: bool = True) -> list[str]:
        """Serious and critical findings of axe-core.

        preload   False: style sheets are not asked for once more, which a browser refuses for files
        """
        self.page.evaluate(AXE.read_text())
        found = self.page.evaluate("preload => axe.run({ preload })", preload)["violations"]
        return [
            f"{each['id']}: {each['nodes'][0]['html'][:200]}"
            for each in found
            if each["impact"] in ("serious", "critical")
        ]

    def settle(self) -> None:
        """Wait until nothing says that it is loading."""
        wait_for(lambda: not re.search("[Ll]oading|on (its|their) way", self.page.inner_text("main")), 20.0)

    def picture(self, name: str) -> None:
        """Screenshot for people, where they want one."""
        if PICTURES:
            self.page.screenshot(path=f"{PICTURES}/{name}.png", full_page=True)

    def too_wide(self) -> int:
        """Pixels by which the page scrolls sideways."""
        return self.page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
