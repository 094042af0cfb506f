"""A living site with its page, and a browser."""

import json
import signal
import time
from collections.abc import Iterator

import pytest

from browser.prerequisites import browser, missing
from browser.scene import START_MJD, TOKEN, WIDTHS, LivingSite, Part, Watched, free_port, wait_for

FLAGS = (
    *("--no-sandbox", "--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--disable-quic", "--enable-unsafe-swiftshader"),
)


def pytest_collection_modifyitems(items):
    lacks = missing()
    for item in items:
        if "browser" in item.path.parent.name:
            item.add_marker(pytest.mark.browser)
            if lacks:
                item.add_marker(pytest.mark.skip(reason=f"browser tests: {'; '.join(lacks)}"))


@pytest.fixture(scope="session")
def site(tmp_path_factory) -> Iterator[LivingSite]:
    """The Green Bank site's twin in a November night, whose clock is years from this machine's."""
    where, port = tmp_path_factory.mktemp("site"), free_port()
    offset = str((START_MJD - 40587.0) * 86400.0 - time.time())
    twin = Part(
        (
            *("catseye", "zy", "gbt", "--twin", "--start", str(START_MJD), "--clock-offset-s", offset),
            *("--port-base", "0", "--json"),
        ),
        where / "twin.log",
    )
    twin.start()
    at = twin.addresses()
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
        "rangers": {name: [host, second] for name, (host, _, second) in at["rangers"].items()},
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
        living.start_coordinator()
        living.service.start()
        host, page_port = living.service.addresses()["listening"]
        living.url = f"http://{host}:{page_port}"
        wait_for(lambda: living.get("state")["epoch"])
        yield living
    finally:
        for part in parts:
            if part.process is not None and part.process.returncode is None:
                part.kill(signal.SIGTERM)


@pytest.fixture(scope="session")
def chromium():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as started:
        opened = started.chromium.launch(executable_path=browser(), args=list(FLAGS))
        yield opened
        opened.close()


@pytest.fixture
def watched(chromium):
    """A function that opens pages: `watched(url, width="phone", scheme="dark", root="file:///site")`."""
    contexts = []

    def opened(
        url: str, *, width: str = "laptop", scheme: str = "light", offline: bool = False, root: str | None = None
    ) -> Watched:
        wide, high = WIDTHS[width]
        context = chromium.new_context(
            viewport={"width": wide, "height": high}, color_scheme=scheme, reduced_motion="reduce", offline=offline
        )
        contexts.append(context)
        page = context.new_page()
        watch = Watched(page)
        here = root or url.split("/#")[0].split("?")[0]

        def requested(address: str) -> None:
            host = here.removeprefix("http")
            if not address.startswith(("blob:", "data:", here, f"ws{host}")):
                watch.elsewhere.append(address)

        page.on("console", lambda said: watch.errors.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: watch.errors.append(str(error)))
        page.on("response", lambda came: watch.errors.append(came.url) if came.status >= 400 else None)
        page.on("request", lambda request: requested(request.url))
        page.on("websocket", lambda opened_socket: requested(opened_socket.url))
        page.goto(url)
        return watch

    yield opened
    for context in contexts:
        context.close()
