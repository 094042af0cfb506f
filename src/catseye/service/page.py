"""The page's process: its settings, its address, and the child that serves it."""

import ipaddress
import json
import socket
import ssl
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from catseye.errors import InputError
from catseye.ranger.network import is_here
from catseye.service.child import LineHandler, LiveChild

PROGRAM = (sys.executable, "-P", "-m", "catseye.web")
PACKAGES = ("fastapi", "uvicorn", "websockets", "prometheus_client")  # of the extra `web`
EXTRA = "pip install 'catseye[web]'"
SHORTEST_TOKEN = 16  # characters
Host = tuple[str, int]
PageKind = Literal["site", "journal", "result"]


class PageSettings(BaseModel):
    """Settings of the page's process, which it reads from the first line of its standard input.

    kind          its subject: a living site, a journal, or a finished result
    listen        host and port; port 0: any free one
    token         of commands, beyond this machine of all; None: no commands
    certificate, key   files of TLS, needed beyond this machine
    names         further names and addresses that it is called by
    site, coordinator, rangers, journal   of a site: folder or name, host and port of the coordinator and of each
                  ranger's second port, for its console, place of the journal
    journal       place of a journal
    path          of a result
    """

    model_config = ConfigDict(frozen=True, extra="forbid", hide_input_in_errors=True)

    kind: PageKind
    listen: Host
    token: str | None = Field(default=None, repr=False, min_length=SHORTEST_TOKEN, pattern=r"^[!-~]+$")
    certificate: str | None = None
    key: str | None = None
    names: tuple[str, ...] = ()
    site: str | None = None
    coordinator: Host | None = None
    rangers: dict[str, Host] = {}
    journal: str | None = None
    path: str | None = None

    @model_validator(mode="after")
    def check(self) -> "PageSettings":
        """Refuse an exposed page without token or TLS, and a kind without its subject."""
        host = self.listen[0]
        if not is_here(host) and None in (self.token, self.certificate, self.key):
            raise ValueError(f"{host} can be reached by other machines (expected token, certificate and key)")
        if (self.certificate is None) != (self.key is None):
            raise ValueError("certificate and key: one is missing")
        needed = {"site": self.site and self.coordinator, "journal": self.journal, "result": self.path}
        if needed[self.kind] is None:
            raise ValueError(f"the subject of kind {self.kind} is missing")
        return self


def read_settings(line: str) -> PageSettings:
    """Settings from a line of JSON.

    Raises InputError for anything else.
    """
    try:
        return PageSettings.model_validate_json(line)
    except ValidationError as problem:
        first = problem.errors(include_url=False, include_input=False)[0]
        where = ".".join(map(str, first["loc"])) or "settings"
        raise InputError(f"{where}: {first['msg']}") from None


@dataclass(frozen=True)
class PageAddress:
    """Address of a page, with its token and its files of TLS.

    port      0 for any free one
    names     further names that it is called by
    """

    host: str
    port: int
    token: str | None = field(default=None, repr=False)
    certificate: Path | None = None
    key: Path | None = None
    names: tuple[str, ...] = ()

    @property
    def exposed(self) -> bool:
        """True if other machines can reach it."""
        return not is_here(self.host)

    def url(self) -> str:
        """Address for a browser, without the token."""
        name = reachable(self.host, self.names)
        shown = f"[{name}]" if ":" in name else name
        return f"{'http' if self.certificate is None else 'https'}://{shown}:{self.port}/"

    def link(self) -> str:
        """Address with the token in its fragment, which no browser sends and no server logs."""
        return self.url() if self.token is None else f"{self.url()}#token={self.token}"

    def settings(self, kind: PageKind, **subject: Any) -> PageSettings:
        """Settings of the process that listens there."""
        return PageSettings(
            kind=kind,
            listen=(self.host, self.port),
            token=self.token,
            certificate=None if self.certificate is None else str(self.certificate),
            key=None if self.key is None else str(self.key),
            names=self.names,
            **subject,
        )


def reachable(host: str, names: Sequence[str] = ()) -> str:
    """Name to connect to a listener: its host, or a name of this machine where it listens at all addresses.

    >>> reachable("127.0.0.1"), reachable("0.0.0.0", ["site.example"])
    ('127.0.0.1', 'site.example')
    """
    try:
        wild = ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return host
    return (names[0] if names else socket.gethostname()) if wild else host


def refuse_files(address: PageAddress) -> None:
    """Raise InputError for a certificate or a key that cannot be used; a key with a password is one."""
    if address.certificate is None:
        return
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(address.certificate, address.key, password="")
    except (OSError, ValueError) as problem:
        raise InputError(f"{address.certificate}: certificate or key cannot be used: {problem}") from problem


def missing_packages() -> tuple[str, ...]:
    """Packages of the extra `web` that are not installed."""
    return tuple(name for name in PACKAGES if find_spec(name) is None)


class PageChild:
    """The page in a process of its own, which is restarted when it dies.

    address     where it listens
    settings    of the process, from its address: called at each start
    listening   called with the address when it listens first; a port 0 is the actual one from then on
    warned      called with each line of its log
    """

    def __init__(
        self,
        address: PageAddress,
        settings: Callable[[PageAddress], PageSettings],
        *,
        listening: Callable[[PageAddress], None],
        warned: LineHandler,
    ):
        self.address, self._settings, self._listening, self._warned = address, settings, listening, warned
        self._listened = False
        self.child = LiveChild("page", (), said=self._hear, warned=warned, program=PROGRAM, first_line=self._first_line)

    def _first_line(self) -> str:
        return self._settings(self.address).model_dump_json()

    def _hear(self, line: str) -> None:
        try:
            port = int(json.loads(line)["listening"][1])
        except (ValueError, LookupError, TypeError):
            self._warned(f"printed {line[:80]!a} (expected its address)")
            return
        self.address = replace(self.address, port=port)
        if not self._listened:
            self._listened = True
            self._listening(self.address)
