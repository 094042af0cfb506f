"""The service: a socket, a watch of its subject, and an end with its parent."""

import asyncio
import ipaddress
import json
import logging
import os
import socket
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from catseye.errors import InputError
from catseye.web.access import LOOPBACK_NAMES, AccessPolicy
from catseye.web.app import application
from catseye.web.protocols import PageConfig, PageServer
from catseye.web.refusals import RefusalLog
from catseye.web.subject import PageSubject, subject_of

if TYPE_CHECKING:
    from catseye.api.live.address import PageSettings

SEND_BUFFER = 262_144  # bytes of a connection in the kernel: a client that takes nothing is seen after so many
LONGEST_SETTINGS = 65_536  # bytes
NICE = 5  # on a busy machine the site comes first


def run(settings: "PageSettings") -> None:
    """Serve until standard input ends or a signal comes.

    Raises InputError: a subject that cannot be read, a port that is taken.
    """
    with suppress(OSError):
        os.nice(NICE)
    with listening_socket(*settings.listen) as listener:
        subject = subject_of(settings)
        try:
            asyncio.run(_run(settings, subject, listener))
        finally:
            subject.desk.close()


async def _run(settings: "PageSettings", subject: PageSubject, listener: socket.socket) -> None:
    refusals, ending, loop = RefusalLog(), asyncio.Event(), asyncio.get_running_loop()
    logging.basicConfig(handlers=[OneLineHandler(refusals, loop)], level=logging.WARNING, force=True)
    end_with_stdin(lambda: loop.call_soon_threadsafe(ending.set))

    def listening() -> None:
        sys.stdout.write(json.dumps({"listening": listener.getsockname()[:2]}) + "\n")
        sys.stdout.flush()

    await serve(settings, subject, listener, refusals=refusals, listening=listening, ending=ending)


async def serve(
    settings: "PageSettings",
    subject: PageSubject,
    listener: socket.socket,
    *,
    refusals: RefusalLog,
    listening: Callable[[], None],
    ending: asyncio.Event,
) -> None:
    """Serve a subject on a bound socket.

    listening   called once when clients can connect
    ending      ends it, as do SIGINT and SIGTERM
    """
    app = application(subject, policy_of(settings, subject), refusals)
    config = PageConfig(app, refusals, certificate=settings.certificate, key=settings.key)
    server = PageServer(config, listening)
    parts = [asyncio.ensure_future(server.serve([listener])), asyncio.ensure_future(ending.wait())]
    if subject.watch is not None:
        subject.watch.listeners.append(subject.feed.publish)
        parts.append(asyncio.ensure_future(subject.watch.run()))
    try:
        done, _ = await asyncio.wait(parts, return_when=asyncio.FIRST_COMPLETED)
        for part in done:
            part.result()
    finally:
        server.should_exit = True
        for part in parts[1:]:
            part.cancel()
        await asyncio.gather(*parts, return_exceptions=True)


def policy_of(settings: "PageSettings", subject: PageSubject) -> AccessPolicy:
    """Access that the settings ask for."""
    host = settings.listen[0].lower()
    exposed = not is_loopback(host)
    names = {host, *(name.lower() for name in settings.names)}
    if not exposed:
        names |= LOOPBACK_NAMES
    elif is_wildcard(host):
        names.add(socket.gethostname().lower())
    return AccessPolicy(
        names=frozenset(names),
        token=settings.token,
        exposed=exposed,
        commanding=subject.commands,
        secure=settings.certificate is not None,
    )


def is_loopback(host: str) -> bool:
    """True for an address that only this machine reaches.

    >>> is_loopback("127.0.0.1"), is_loopback("::1"), is_loopback("localhost"), is_loopback("0.0.0.0")
    (True, True, True, False)
    """
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def is_wildcard(host: str) -> bool:
    """True for an address that stands for all of a machine's.

    >>> is_wildcard("0.0.0.0"), is_wildcard("::"), is_wildcard("127.0.0.1")
    (True, True, False)
    """
    with suppress(ValueError):
        return ipaddress.ip_address(host).is_unspecified
    return False


def listening_socket(host: str, port: int) -> socket.socket:
    """Bound socket, not listening yet.

    Raises InputError: an unknown host, a port that is taken.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listener = socket.socket(family, kind, protocol)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
            listener.bind(address)
        except OSError:
            listener.close()
            raise
    except OSError as problem:
        raise InputError(f"cannot listen at {host} port {port}: {problem.strerror or problem}") from problem
    return listener


class OneLineHandler(logging.Handler):
    """Python's logging as single lines at a bounded rate, from any thread.

    refusals   log that bounds the rate
    loop       of that log
    """

    def __init__(self, refusals: RefusalLog, loop: asyncio.AbstractEventLoop):
        super().__init__()
        self._refusals, self._loop = refusals, loop

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage()
        if record.exc_info and record.exc_info[1] is not None:
            text = f"{text}: {type(record.exc_info[1]).__name__}: {record.exc_info[1]}"
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._refusals.say, text)


def first_line() -> str:
    """First line of standard input.

    Raises InputError if it does not end.
    """
    line = b""
    while not line.endswith(b"\n"):
        part = os.read(sys.stdin.fileno(), 1)
        line += part
        if not part or len(line) > LONGEST_SETTINGS:
            raise InputError("no settings on standard input (expected a line of JSON)")
    return line.decode("utf-8", "replace")


def end_with_stdin(end: Callable[[], object]) -> None:
    """Call `end` when standard input ends, from a thread."""

    def wait() -> None:
        with suppress(OSError):
            while os.read(sys.stdin.fileno(), 4096):
                continue
        with suppress(RuntimeError):  # the loop is closed
            end()

    threading.Thread(target=wait, name="stdin", daemon=True).start()
