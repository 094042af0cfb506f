"""`view`, which blocks and is for a program of its own, and the page beside `serve`: addresses, tokens, settings."""

import os
import secrets
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

from catseye.api.limits import LAST_PORT, within
from catseye.api.reading import DATABASES, SQLITE, place_of
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError, InputError

if TYPE_CHECKING:
    from catseye.service.logs import LiveLog
    from catseye.service.page import PageAddress, PageSettings

Place = str | os.PathLike[str] | None
PAGE_HOST = "127.0.0.1"
PAGE_PORT = 5261
TOKEN_BYTES = 24
OF_LOGS = "JOURNAL_STREAM"  # in the environment where a service manager keeps what is printed


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


def page_address(
    host: str | None,
    port: int,
    *,
    certificate: Place,
    key: Place,
    token_file: Place,
    names: Sequence[str],
    commanding: bool,
) -> "PageAddress":
    """Address of a page, its files checked.

    commanding   True for a page that takes commands: it has a token on this machine, too

    Raises ArgumentError: beyond this machine without TLS; InputError: a file that cannot be used.
    """
    from catseye.ranger.door import key_in
    from catseye.ranger.network import UNIX, is_here
    from catseye.service.page import PageAddress, refuse_files

    within("page_port", port, 0, LAST_PORT)
    listened = PAGE_HOST if host is None else host
    if listened.startswith(UNIX):
        raise ArgumentError(f"page_host = {listened!r} is no network address", "page_host")
    if (certificate is None) != (key is None):
        raise ArgumentError("page_certificate and page_key: expected both, or none", "page_certificate", "page_key")
    if not is_here(listened) and certificate is None:
        raise ArgumentError(
            f"page_host = {listened}: other machines can reach it (expected page_certificate and page_key)",
            *("page_host", "page_certificate", "page_key"),
        )
    token = None
    if token_file is not None:
        path = place_of(token_file)
        token = key_in(path, str(path))
    elif commanding or not is_here(listened):
        token = secrets.token_urlsafe(TOKEN_BYTES)
    address = PageAddress(
        host=listened,
        port=port,
        token=token,
        certificate=None if certificate is None else place_of(certificate),
        key=None if key is None else place_of(key),
        names=tuple(names),
    )
    refuse_files(address)
    return address


class SitePage:
    """The page beside a site: where it listens, and its child.

    subject    settings of the page, without the coordinator
    announce   called once with the page's line; None: it was said before
    """

    def __init__(self, address: "PageAddress", subject: dict[str, Any], announce: Callable[[str], None] | None):
        self.address, self._subject, self._announce = address, subject, announce

    async def keep(self, log: "LiveLog", coordinator: tuple[str, int]) -> None:
        """Run the child and restart it whenever it ends, until cancelled.

        log           of the site
        coordinator   its host and port
        """
        from catseye.service.page import PageChild

        def listening(actual: "PageAddress") -> None:
            log.tell("page", "listens", f"browsers connect to {actual.url()}")
            if self._announce is not None:
                self._announce(page_words(actual))

        page = PageChild(
            self.address,
            lambda actual: actual.settings("site", coordinator=coordinator, **self._subject),
            listening=listening,
            warned=lambda line: log.tell("page", "child", line, "warning"),
        )
        await page.child.keep(patient=True)


def site_page(
    subject: dict[str, Any],
    *,
    host: str | None,
    port: int | None,
    certificate: Place,
    key: Place,
    token_file: Place,
    names: Sequence[str],
    announce: Callable[[str], None],
    at_once: bool,
) -> SitePage | None:
    """Page beside a site; None without the packages that it needs, which is announced.

    subject    "site", "journal" and "rangers" by name with their addresses
    port       None for the usual one
    at_once    True to announce the page before it listens: afterwards a screen leaves no place for a line

    Raises ArgumentError and InputError as `page_address`.
    """
    from catseye.service.page import EXTRA, missing_packages

    address = page_address(
        host,
        PAGE_PORT if port is None else port,
        certificate=certificate,
        key=key,
        token_file=token_file,
        names=names,
        commanding=True,
    )
    if missing := missing_packages():
        announce(f"no page: {', '.join(missing)} not installed ({EXTRA})")
        return None
    at_once = at_once and address.port != 0
    if at_once:
        announce(page_words(address))
    rangers = {name: (each.host, each.ports[0]) for name, each in subject["rangers"].items()}
    return SitePage(address, {**subject, "rangers": rangers}, None if at_once else announce)


def page_words(address: "PageAddress") -> str:
    """Line that says where the page is: a link with the token, unless a service manager's log would hold it."""
    return f"page: {address.url() if OF_LOGS in os.environ else address.link()}"


def has_browser() -> bool:
    """True where a browser can be opened: a screen, and its user at it."""
    if "SSH_CONNECTION" in os.environ:
        return False
    return sys.platform in ("darwin", "win32") or any(name in os.environ for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def open_browser(address: str) -> None:
    """Open an address in the user's browser, if there is one."""
    import webbrowser

    webbrowser.open(address)


def page_settings(line: str) -> "PageSettings":
    """Settings of the page's process, from the first line of its standard input.

    Raises InputError for anything else.
    """
    from catseye.service.page import read_settings

    return read_settings(line)
