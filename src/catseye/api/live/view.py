"""`view`, which blocks and is for a program of its own: a result or a journal in a browser.

It installs handlers of SIGINT and SIGTERM, and is not exported from `catseye`.
"""

import os
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

from catseye.api.live.address import Place, page_address
from catseye.api.reading import DATABASES, SQLITE, place_of
from catseye.api.units import In, with_units
from catseye.errors import InputError

if TYPE_CHECKING:
    from catseye.service.page import PageAddress


@with_units
def view(
    source: "str | os.PathLike[str]",
    *,
    browser: bool = True,
    page_host: str | None = None,
    page_port: Annotated[Any, In("", whole=True)] = None,
    page_certificate: Place = None,
    page_key: Place = None,
    page_token_file: Place = None,
    page_names: Sequence[str] = (),
    announce: Callable[[str], None] = lambda line: None,
    warn: Callable[[str], None] = lambda line: None,
) -> int:
    """Serve a result or a journal to browsers until a signal; its number.

    source         directory or report file of a finished job, or a journal's file or postgresql://USER@HOST/DATABASE
    browser        True to open a browser, where this machine has one and its user is at it
    page_host      address to listen at; None for 127.0.0.1
    page_port      None or 0 for any free one
    page_certificate, page_key   PEM files of TLS, needed beyond this machine
    page_token_file   file of the token, needed for reading beyond this machine; None for a new token
    page_names     further names that the page is called by
    announce       called once with the address
    warn           called with each line of the page's log

    Raises InputError: a source that is no result and no journal, a port that is taken, packages that are missing;
    ArgumentError: invalid arguments.
    """
    from catseye.service.page import EXTRA, PageChild, missing_packages
    from catseye.service.running import LiveRun

    if missing := missing_packages():
        raise InputError(f"a page needs {', '.join(missing)}, not installed here (expected after {EXTRA})")
    subject = page_subject(source)
    address = page_address(
        page_host,
        0 if page_port is None else page_port,
        certificate=page_certificate,
        key=page_key,
        token_file=page_token_file,
        names=page_names,
        commanding=False,
    )

    listened: list[PageAddress] = []

    def listening(at: "PageAddress") -> None:
        listened.append(at)
        announce(at.link())
        if browser and at.token is None and has_browser():
            open_browser(at.url())

    async def work() -> None:
        page = PageChild(
            address,
            lambda at: at.settings(**subject),
            listening=listening,
            warned=lambda line: warn(line) if listened else None,  # why it does not start is raised
        )
        await page.child.keep()

    run: LiveRun[None] = LiveRun(work)
    run.result()
    return run.signal


def page_subject(source: "str | os.PathLike[str]") -> dict[str, Any]:
    """Settings of a page about a journal or a result.

    Raises InputError: nothing is there.
    """
    if str(source).startswith(DATABASES):
        return {"kind": "journal", "journal": str(source)}
    path = place_of(source, output=True)
    if not path.exists():
        raise InputError(f"{path}: missing (expected a result's directory or report, or a journal)")
    if path.is_file():
        with path.open("rb") as stream:
            if stream.read(len(SQLITE)) == SQLITE:
                return {"kind": "journal", "journal": str(path)}
    return {"kind": "result", "path": str(path)}


def has_browser() -> bool:
    """True where a browser can be opened: a screen, and its user at it."""
    if "SSH_CONNECTION" in os.environ:
        return False
    return sys.platform in ("darwin", "win32") or any(name in os.environ for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def open_browser(address: str) -> None:
    """Open an address in the user's browser, if there is one."""
    import webbrowser

    webbrowser.open(address)
