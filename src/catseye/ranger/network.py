"""Connections between servers and clients: real sockets, or a substitute for tests.

A host that begins with `unix:` is a folder, and a port in it the socket PORT.sock, which only its owner may use. The
sockets use TLS for addresses beyond this machine.
"""

import asyncio
import errno
import ipaddress
import logging
import os
import socket
import ssl
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

from catseye.errors import InputError

P = TypeVar("P", bound=asyncio.BaseProtocol)
UNIX = "unix:"
OWNER_ONLY = 0o600
FOLDER_OWNER_ONLY = 0o700
CERTIFICATE, CERTIFICATE_KEY = "CATSEYE_TLS_CERTIFICATE", "CATSEYE_TLS_KEY"  # in the environment
AUTHORITY, CLEAR = "CATSEYE_TLS_AUTHORITY", "CATSEYE_CLEAR"
HANDSHAKE = 5.0  # s
LOG = logging.getLogger(__name__)


class Listener(Protocol):
    """A listening port; `port` is its actual number."""

    port: int

    async def close(self) -> None:
        """Stop listening; open connections are closed by their owner, before."""
        ...


class ConnectionMaker(Protocol):
    """Makes connections between protocols."""

    async def serve(self, factory: Callable[[], asyncio.Protocol], host: str, port: int) -> Listener:
        """Listen, with a new protocol for each connection.

        Raises OSError if the port is not available.
        """
        ...

    async def connect(self, factory: Callable[[], P], host: str, port: int) -> P:
        """A connected protocol.

        Raises OSError if nothing listens there.
        """
        ...


@dataclass(frozen=True)
class TlsFiles:
    """TLS files, PEM, and permission to do without.

    certificate, key   of the listener
    authority          certificate that others' certificates must be signed by; None: the system's
    clear              True for addresses beyond this machine without TLS: behind a private tunnel
    """

    certificate: Path | None = None
    key: Path | None = None
    authority: Path | None = None
    clear: bool = False

    @staticmethod
    def of(environment: Mapping[str, str] = os.environ) -> "TlsFiles":
        """Files from the environment.

        CATSEYE_TLS_CERTIFICATE, CATSEYE_TLS_KEY, CATSEYE_TLS_AUTHORITY and CATSEYE_CLEAR=yes.

        Raises InputError: a missing file, a certificate without its key, another value of CATSEYE_CLEAR.
        """
        files = {name: environment.get(name) for name in (CERTIFICATE, CERTIFICATE_KEY, AUTHORITY)}
        for name, path in files.items():
            if path and not Path(path).is_file():
                raise InputError(f"{name}={path}: no such file (expected PEM)")
        if bool(files[CERTIFICATE]) != bool(files[CERTIFICATE_KEY]):
            raise InputError(f"{CERTIFICATE} and {CERTIFICATE_KEY}: one is missing (expected both, or none)")
        if environment.get(CLEAR, "no") not in ("yes", "no"):
            raise InputError(f"{CLEAR}={environment[CLEAR]!a} (expected yes or no)")
        certificate, key, authority = (Path(path) if path else None for path in files.values())
        return TlsFiles(certificate, key, authority, environment.get(CLEAR) == "yes")

    def of_server(self, host: str) -> ssl.SSLContext | None:
        """Context to listen with; None for an address of this machine only.

        Raises InputError: no certificate, or an unusable one.
        """
        if is_here(host) or self.clear:
            return None
        if self.certificate is None:
            raise InputError(
                f"{host} can be reached by other machines (expected {CERTIFICATE} and {CERTIFICATE_KEY}, "
                f"or {CLEAR}=yes behind a private tunnel)"
            )
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        try:
            context.load_cert_chain(self.certificate, self.key)
        except (OSError, ValueError) as problem:
            raise InputError(f"{CERTIFICATE}={self.certificate}: cannot be used: {problem}") from problem
        return context

    def of_client(self, host: str) -> ssl.SSLContext | None:
        """Context to connect with; None for an address of this machine.

        Raises InputError: an unusable authority.
        """
        if is_here(host) or self.clear:
            return None
        try:
            context = ssl.create_default_context(cafile=self.authority)
        except (OSError, ValueError) as problem:
            raise InputError(f"{AUTHORITY}={self.authority}: cannot be used: {problem}") from problem
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        return context


NO_TLS = TlsFiles()


def is_here(host: str) -> bool:
    """True for an address reachable only from this machine.

    >>> is_here("127.0.8.3"), is_here("::1"), is_here("localhost"), is_here("unix:/run/site"), is_here("0.0.0.0")
    (True, True, True, True, False)
    """
    if host.startswith(UNIX):
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class Sockets:
    """Connections by TCP, with TLS beyond this machine, or Unix sockets.

    tls   files of both sides
    """

    def __init__(self, tls: TlsFiles = NO_TLS):
        self._tls = tls
        self._warned: set[str] = set()

    def _warn(self, host: str) -> None:
        """Warn once of an address that is used without TLS."""
        if self._tls.clear and not is_here(host) and host not in self._warned:
            self._warned.add(host)
            LOG.warning(
                "%s: connection without TLS (%s=yes): anyone on the network path can read and command", host, CLEAR
            )

    async def serve(self, factory: Callable[[], asyncio.Protocol], host: str, port: int) -> "SocketListener":
        return await self.listen(factory, host, port)

    async def listen(
        self, factory: Callable[[], asyncio.Protocol], host: str, port: int, *, at_once: bool = True
    ) -> "SocketListener":
        """Listen; with `at_once` False the port answers after its server is started."""
        loop = asyncio.get_running_loop()
        if host.startswith(UNIX):
            bound, number = bound_socket(Path(host.removeprefix(UNIX)), port)
            server = await loop.create_unix_server(factory, sock=bound, start_serving=at_once)
            return SocketListener(server, number)
        context = self._tls.of_server(host)
        self._warn(host)
        limit = None if context is None else HANDSHAKE
        server = await loop.create_server(
            factory, host, port, ssl=context, ssl_handshake_timeout=limit, start_serving=at_once
        )
        return SocketListener(server, server.sockets[0].getsockname()[1])

    async def connect(self, factory: Callable[[], P], host: str, port: int) -> P:
        loop = asyncio.get_running_loop()
        if host.startswith(UNIX):
            _, protocol = await loop.create_unix_connection(factory, str(socket_path(host.removeprefix(UNIX), port)))
            return protocol
        context = self._tls.of_client(host)
        self._warn(host)
        limit = None if context is None else HANDSHAKE
        _, protocol = await loop.create_connection(factory, host, port, ssl=context, ssl_handshake_timeout=limit)
        return protocol


class SocketListener:
    """A listening port of a server."""

    def __init__(self, server: asyncio.Server, port: int):
        self.server, self.port = server, port
        self._path = _unix_path(server)

    async def close(self) -> None:
        self.server.close()
        await self.server.wait_closed()
        if self._path is not None:
            self._path.unlink(missing_ok=True)


def socket_path(folder: str | Path, port: int) -> Path:
    """Path of a port's Unix socket in a folder."""
    return Path(folder) / f"{port}.sock"


def bound_socket(folder: Path, port: int) -> tuple[socket.socket, int]:
    """Bound Unix socket for its owner only, and the port; 0: lowest free.

    Raises OSError: already in use, or the folder cannot be made or is writable by others.
    """
    folder.mkdir(mode=FOLDER_OWNER_ONLY, parents=True, exist_ok=True)
    if folder.stat().st_mode & 0o022:
        raise PermissionError(errno.EPERM, f"others can write in {folder}")
    if port == 0:
        port = next(n for n in range(1, 65_536) if not socket_path(folder, n).exists())
    path = socket_path(folder, port)
    _clear_stale(path)
    bound = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        os.fchmod(bound.fileno(), OWNER_ONLY)  # before it has a name, so that it is never open to others
        bound.bind(str(path))
        path.chmod(OWNER_ONLY)
    except OSError:
        bound.close()
        raise
    return bound, port


def _clear_stale(path: Path) -> None:
    """Remove the socket of a dead server.

    Raises OSError if a server listens there.
    """
    if not path.is_socket():
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as trial:
        try:
            trial.connect(str(path))
        except ConnectionRefusedError:
            path.unlink(missing_ok=True)
            return
    raise OSError(errno.EADDRINUSE, "address already in use")


def _unix_path(server: asyncio.Server) -> Path | None:
    """Path of a Unix server's socket."""
    if server.sockets[0].family != socket.AF_UNIX:
        return None
    return Path(server.sockets[0].getsockname())
