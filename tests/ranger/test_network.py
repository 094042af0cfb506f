"""TLS beyond this machine, and owner-only Unix sockets, over real sockets."""

import asyncio
import contextlib
import os
import socket
import ssl
import stat
import subprocess

import pytest

from catseye.errors import InputError
from catseye.ranger import door as door_module
from catseye.ranger import network as network_module
from catseye.ranger.client import SECOND_CLIENT_TID, ZyClient
from catseye.ranger.door import Door, refuse_exposed_port
from catseye.ranger.network import NO_TLS, Sockets, TlsFiles, bound_socket, is_here, socket_path
from catseye.ranger.server import LOOPBACK, ZyServer
from ranger.ranger_scene import ready
from ranger.test_server import Site, run

KEY = "a-key-of-the-site"


def certificate(folder, name, address=f"IP:{LOOPBACK}"):
    """A certificate that vouches for itself, and its key, PEM."""
    made, key = folder / f"{name}.pem", folder / f"{name}.key"
    subject = ("-subj", f"/CN={name}", "-addext", f"subjectAltName={address}")
    asked = ("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2")
    subprocess.run([*asked, *subject, "-keyout", key, "-out", made], check=True, capture_output=True)
    return made, key


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tls")
    return {name: certificate(folder, name) for name in ("ranger", "other")} | {
        "elsewhere": certificate(folder, "elsewhere", "IP:192.0.2.7")
    }


@pytest.fixture
def far(monkeypatch):
    """Every address is another machine's."""
    for module in (network_module, door_module):
        monkeypatch.setattr(module, "is_here", lambda host: False)


class TlsSite(Site):
    def __init__(self, tls, **options):
        super().__init__(door=Door(key=KEY, lease=False, tls=tls), **options)


async def ask_over(site, tls):
    client = await site.client(0, key=KEY, network=Sockets(tls))
    try:
        return (await site.answered(client.ask("VER"))).text
    finally:
        client.close()


def test_connections_beyond_this_machine_use_tls(made, far):
    async def story():
        certificate, key = made["ranger"]
        async with TlsSite(TlsFiles(certificate, key)) as site:
            assert await ask_over(site, TlsFiles(authority=certificate)) == "ZY101, 2.20"
            for wrong in (NO_TLS, TlsFiles(authority=made["other"][0])):
                with pytest.raises(InputError, match="CERTIFICATE_VERIFY_FAILED"):
                    await ask_over(site, wrong)
            await site.until(lambda: not site.server.connections)

    run(story)


def test_certificate_of_another_address_is_rejected(made, far):
    async def story():
        certificate, key = made["elsewhere"]
        async with TlsSite(TlsFiles(certificate, key)) as site:
            with pytest.raises(InputError, match=r"not valid for '127\.0\.0\.1'"):
                await ask_over(site, TlsFiles(authority=certificate))

    run(story)


def test_clear_text_is_ignored_at_a_port_with_tls(made, far):
    async def story():
        certificate, key = made["ranger"]
        async with TlsSite(TlsFiles(certificate, key)) as site:
            reader, writer = await asyncio.open_connection(LOOPBACK, site.server.ports[0])
            writer.write(f"KEY {KEY}\nPS 0\nVER\n".encode())
            said = b""
            with contextlib.suppress(ConnectionResetError):
                said = await site.answered(reader.read())
            assert b"VER" not in said
            assert b"NONCE" not in said
            assert site.head.laser_on()
            writer.close()

    run(story)


def test_old_protocols_are_refused(made):
    certificate, key = made["ranger"]
    for context in (TlsFiles(certificate, key).of_server("192.0.2.7"), NO_TLS.of_client("192.0.2.7")):
        assert context.minimum_version == ssl.TLSVersion.TLSv1_2
    assert NO_TLS.of_client("192.0.2.7").verify_mode == ssl.CERT_REQUIRED
    assert NO_TLS.of_client("192.0.2.7").check_hostname


def test_clear_text_must_be_configured_and_is_logged_once(far, caplog):
    async def story():
        async with TlsSite(TlsFiles(clear=True)) as site:
            network = Sockets(TlsFiles(clear=True))
            for _ in range(2):
                client = await site.client(0, key=KEY, network=network)
                assert (await site.answered(client.ask("VER"))).ok
                client.close()
                await site.until(lambda: not site.server.connections)

    run(story)
    assert (
        sum("connection without TLS" in record.getMessage() for record in caplog.records) == 2
    )  # the server, the client


def test_tls_files_come_from_the_environment(made):
    certificate, key = made["ranger"]
    names = {"CATSEYE_TLS_CERTIFICATE": str(certificate), "CATSEYE_TLS_KEY": str(key)}
    assert TlsFiles.of({}) == NO_TLS
    assert TlsFiles.of(names) == TlsFiles(certificate, key)
    assert TlsFiles.of({"CATSEYE_TLS_AUTHORITY": str(certificate), "CATSEYE_CLEAR": "yes"}) == TlsFiles(
        authority=certificate, clear=True
    )
    for bad, why in (
        ({"CATSEYE_TLS_CERTIFICATE": str(certificate)}, "one is missing"),
        ({**names, "CATSEYE_TLS_KEY": "/nowhere"}, "no such file"),
        ({"CATSEYE_CLEAR": "maybe"}, "expected yes or no"),
    ):
        with pytest.raises(InputError, match=why):
            TlsFiles.of(bad)


def test_invalid_tls_files_are_refused_before_listening(made):
    door = Door(key=KEY, tls=TlsFiles(made["ranger"][0], made["other"][1]))
    with pytest.raises(InputError, match=r"feed: CATSEYE_TLS_CERTIFICATE=.* cannot be used"):
        refuse_exposed_port("feed", "192.0.2.7", door)
    with pytest.raises(InputError, match="expected CATSEYE_TLS_CERTIFICATE"):
        refuse_exposed_port("feed", "192.0.2.7", Door(key=KEY))
    for host in ("127.0.0.1", "unix:/run/site"):
        refuse_exposed_port("feed", host, Door())


# Unix sockets ---------------------------------------------------------------------------------------------------------


class UnixSite(Site):
    def __init__(self, folder):
        super().__init__(door=Door())
        self.folder = folder
        self.server = ZyServer(
            self.ranger, f"unix:{folder}", (0, 0), door=self.server.door, clock=lambda: self.now, network=Sockets()
        )

    async def client(self, number=0, **options):
        return await self.answered(
            ZyClient.connect(f"unix:{self.folder}", self.server.ports[number], clock=lambda: self.now, **options)
        )


def test_unix_socket_is_for_its_owner_and_identifies_peers(tmp_path):
    folder = tmp_path / "run"

    async def story():
        async with UnixSite(folder) as site:
            assert site.server.ports == (1, 2)
            assert stat.S_IMODE(folder.stat().st_mode) == 0o700
            for port in site.server.ports:
                assert stat.S_IMODE(socket_path(folder, port).stat().st_mode) == 0o600
            lines = []
            holder = await site.client(0)
            other = await site.client(1, first_tid=SECOND_CLIENT_TID, heard=lines.append)
            assert (await site.answered(holder.ask("LEASE", "anna"))).ok
            await site.until(lambda: any(line.command == "LEASE" for line in lines))
            who = next(line for line in lines if line.command == "LEASE").values[2]
            assert who == f"process {os.getpid()} of user {os.geteuid()}"
            holder.close()
            other.close()
        assert list(folder.iterdir()) == []

    run(story)


def test_socket_of_a_dead_server_is_replaced_and_of_a_live_one_is_not(tmp_path):
    bound, port = bound_socket(tmp_path / "run", 24_110)
    assert port == 24_110
    bound.close()  # killed: the file stays
    assert socket_path(tmp_path / "run", port).is_socket()
    bound, _ = bound_socket(tmp_path / "run", port)
    bound.listen()
    with pytest.raises(OSError, match="already in use"):
        bound_socket(tmp_path / "run", port)
    bound.close()


def test_folder_writable_by_others_is_refused(tmp_path):
    async def story():
        folder = tmp_path / "open"
        folder.mkdir()
        folder.chmod(0o777)
        with pytest.raises(InputError, match="others can write in"):
            await ZyServer(ready().ranger, f"unix:{folder}", (0, 0)).start()

    run(story)


def test_other_files_are_not_taken_for_sockets(tmp_path):
    socket_path(tmp_path, 7).write_text("a file")
    tmp_path.chmod(0o700)
    with pytest.raises(OSError, match="in use"):
        bound_socket(tmp_path, 7)
    assert socket_path(tmp_path, 7).read_text() == "a file"


def test_unix_socket_is_never_open_to_others(tmp_path, monkeypatch):
    bind, modes = socket.socket.bind, []

    def watched(self, at):
        bind(self, at)
        modes.append(stat.S_IMODE(os.stat(at).st_mode))

    monkeypatch.setattr(socket.socket, "bind", watched)
    before = os.umask(0)
    try:
        bound_socket(tmp_path / "run", 9)[0].close()
    finally:
        os.umask(before)
    assert modes == [0o600]


def test_unix_address_is_of_this_machine():
    assert is_here("unix:/run/catseye")
