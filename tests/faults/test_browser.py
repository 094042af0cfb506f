"""Pages in a real browser try every port: no effect, and each attempt is logged."""

import asyncio
import json
import logging
import shutil
import signal

import pytest

from catseye.clock import SystemClock
from catseye.coordinator.clients.server import ZiyServer
from catseye.ranger.server import LOOPBACK, ZyServer
from catseye.simulator.twin.feed import SiteFeed
from coordinator.ziy_scene import Site
from process_scene import ends_with_us
from ranger.ranger_scene import ready
from simulator.twin.test_feed import World

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
QUIET = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update"),
)
KINDS = ("fetch", "form", "socket", "image")
PATIENCE = 60.0  # s for a browser on a busy machine
PAGE = """<!doctype html><body><script>
const ports = PORTS, who = "WHO", lines = "\\r\\nPS 0\\r\\nD0 999\\r\\nMODE measure\\r\\nDROP ZY101\\r\\nBYE\\r\\n";
for (const port of ports) {
  const at = `127.0.0.1:${port}/${who}-`;
  fetch(`http://${at}fetch`, {method: "POST", mode: "no-cors", body: lines}).catch(() => 0);
  new WebSocket(`ws://${at}socket`);
  new Image().src = `http://${at}image`;
  const frame = document.createElement("iframe"), form = document.createElement("form");
  frame.name = form.target = `f${port}`;
  form.method = "POST"; form.enctype = "text/plain"; form.action = `http://${at}form`;
  const field = document.createElement("textarea");
  field.name = lines; field.value = lines;
  form.append(field); document.body.append(frame, form); form.submit();
}
</script>"""


def page(ports, who):
    return PAGE.replace("PORTS", json.dumps(ports)).replace("WHO", who)


async def origin(text):
    """An HTTP server that answers everything with one page; a browser also connects without ever asking."""

    async def answer(reader, writer):
        try:
            await reader.readuntil(b"\r\n\r\n")
            writer.write(
                b"HTTP/1.1 200 OK\r\nContent-Type: text/html\r\nConnection: close\r\n"
                + f"Content-Length: {len(text)}\r\n\r\n{text}".encode()
            )
            await writer.drain()
        except asyncio.IncompleteReadError:
            pass
        finally:
            writer.close()

    return await asyncio.start_server(answer, LOOPBACK, 0)


async def browse(url, profile, done):
    """Open a page until `done`; the browser and its children end with it."""
    browser = await asyncio.create_subprocess_exec(
        *(BROWSER, *QUIET, f"--user-data-dir={profile}", "--remote-debugging-port=0", url),
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.DEVNULL,
        preexec_fn=ends_with_us(),
    )
    try:
        async with asyncio.timeout(PATIENCE):
            while not done():
                await asyncio.sleep(0.05)
    except TimeoutError:
        return
    finally:
        browser.send_signal(signal.SIGTERM)
        try:
            await asyncio.wait_for(browser.wait(), 10.0)
        except TimeoutError:
            browser.kill()
            await browser.wait()


@pytest.mark.skipif(BROWSER is None, reason="browser tests: no chromium (expected Debian's package chromium)")
def test_browser_pages_change_nothing_and_each_attempt_is_logged(tmp_path, caplog):
    caplog.set_level(logging.WARNING)
    ranger = ready().ranger

    def tries(who, ports):
        return {
            (port, kind)
            for port in ports
            for kind in KINDS
            for record in caplog.records
            if f"port {port}: " in record.getMessage() and f"/{who}-{kind}" in record.getMessage()
        }

    async def story():
        async with Site(mode="hold", ready=False) as site:
            server = ZyServer(ranger, ports=(0, 0))
            coordinator = ZiyServer(site.ziy, port=0)
            feed = SiteFeed("gbt", ["WX1", "WX2"], World(), SystemClock())
            await server.start()
            await coordinator.start()
            await feed.start(LOOPBACK, 0)
            serving = asyncio.ensure_future(server.serve())
            ports = [server.ports[0], feed.port, coordinator.port]
            before = ranger.status(), ranger.d0_mm, site.ziy.mode
            wanted = {(port, kind) for port in ports[1:] for kind in KINDS}
            (tmp_path / "page.html").write_text(page(ports, "file"))
            other = await origin(page(ports, "other"))
            pages = {
                "file": (tmp_path / "page.html").as_uri(),
                "other": f"http://{LOOPBACK}:{other.sockets[0].getsockname()[1]}/",
            }
            for who, url in pages.items():
                caplog.clear()
                await browse(
                    url, tmp_path / who, lambda who=who: tries(who, ports[1:]) == wanted and tries(who, ports[:1])
                )
                assert tries(who, ports[1:]) == wanted
                assert tries(who, ports[:1])
            assert (ranger.status(), ranger.d0_mm, site.ziy.mode) == before
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)
            other.close()
            for each in (server, coordinator, feed):
                await each.stop()

    asyncio.run(story())
