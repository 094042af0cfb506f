"""Address of a page: host, port, token, files of TLS, and the settings of its process."""

import os
import secrets
from collections.abc import Sequence
from typing import TYPE_CHECKING

from catseye.api.live.limits import LAST_PORT, within
from catseye.api.reading import place_of
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from catseye.service.page import PageAddress, PageSettings

Place = str | os.PathLike[str] | None
PAGE_HOST = "127.0.0.1"
PAGE_PORT = 5261
TOKEN_BYTES = 24
OF_LOGS = "JOURNAL_STREAM"  # in the environment where a service manager keeps what is printed


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


def page_words(address: "PageAddress") -> str:
    """Line that says where the page is: a link with the token, unless a service manager's log would hold it."""
    return f"page: {address.url() if OF_LOGS in os.environ else address.link()}"


def page_settings(line: str) -> "PageSettings":
    """Settings of the page's process, from the first line of its standard input.

    Raises InputError for anything else.
    """
    from catseye.service.page import read_settings

    return read_settings(line)
