"""The WebSocket: its first message, bad manners, slow and stuck clients, many clients."""

import contextlib
import json
import socket
import threading
import time

import pytest

from web.listeners import is_cut
from web.page_scene import MJD, TOKEN, sent_raw, served_page

from catseye.web import live, protocols  # isort: skip - after the skip of the scene
from websockets.exceptions import ConnectionClosed  # isort: skip
from websockets.sync.client import connect  # isort: skip

WELCOME = json.dumps({"token": None, "kinds": ["state", "shot"]})
PATIENCE = 15.0  # s


@pytest.fixture
def page():
    with served_page() as page:
        yield page


def opened(page, **options):
    """Connection of a client, for `with`."""
    return connect(f"ws://127.0.0.1:{page.port}/api/live", proxy=None, **options)


@contextlib.contextmanager
def joined(page, first=WELCOME, **options):
    """Client that has sent its first message."""
    with opened(page, **options) as client:
        client.send(first)
        yield client


def received(client, kind):
    """Data of the next message of a kind."""
    while True:
        message = json.loads(client.recv(PATIENCE))
        if message["kind"] == kind:
            return message["data"]


def wait_for(condition, seconds=PATIENCE):
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.02)


def end_of(page, first):
    """Code and reason with which the service ends a WebSocket after a first message."""
    with opened(page) as client:
        if first is not None:
            with contextlib.suppress(ConnectionClosed):  # it may end before it is told anything
                client.send(first)
        drained(client)
    return client.close_code, client.close_reason


def drained(client):
    """Take all until the service ends it."""
    with contextlib.suppress(ConnectionClosed):
        while True:
            client.recv(PATIENCE)


def test_a_client_gets_the_state_at_once_and_then_events(page):
    with joined(page) as client:
        assert received(client, "state")["word"] == "measuring"
        page.tell("posture", {"mjd": MJD})
        page.tell("shot", {"number": 7})
        assert received(client, "shot") == {"number": 7}


@pytest.mark.parametrize(
    ("first", "reason"),
    [
        ("", "invalid first message"),
        ("hello", "invalid first message"),
        ("null", "invalid first message"),
        ("[" * 60_000, "invalid first message"),
        ('{"token": 7}', "invalid first message"),
        ('{"kinds": ["state"], "more": 1}', "invalid first message"),
        ('{"kinds": ["everything"]}', "unknown kind 'everything'"),
        (json.dumps({"kinds": ["state"] * 17}), "invalid first message"),
        (b"\x00\x01", "a binary message"),
        (b"", "a binary message"),
    ],
)
def test_a_bad_first_message(page, first, reason):
    code, text = end_of(page, first)
    assert code == live.POLICY
    assert reason in text
    assert page.counts["websocket"] == 1
    assert not page.subject.feed.clients


def test_no_first_message(page, monkeypatch):
    monkeypatch.setattr(live, "FIRST_SECONDS", 0.5)
    assert end_of(page, None) == (live.POLICY, "no first message within 0.5 s")


def test_a_second_message_ends_it(page):
    with joined(page) as client:
        received(client, "state")
        client.send("{}")
        drained(client)
        assert client.close_reason == "a second message (expected none)"
    wait_for(lambda: not page.subject.feed.clients)


def test_a_huge_message_is_cut_off(page):
    assert end_of(page, "x" * (protocols.LONGEST_MESSAGE + 1))[0] == 1009
    assert not page.subject.feed.clients


def frame(payload, first_byte=0x81):
    """Frame of a client, masked with zeros."""
    size = len(payload)
    length = bytes([0x80 | size]) if size < 126 else bytes([0x80 | 126]) + size.to_bytes(2, "big")
    return bytes([first_byte]) + length + bytes(4) + payload


UPGRADE = (
    "GET /api/live HTTP/1.1\r\nHost: localhost:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


@pytest.mark.parametrize(
    "data",
    [
        frame(b"\xff\xfe"),  # no UTF-8
        frame(b"x", first_byte=0xF1),  # reserved bits
        frame(b"x", first_byte=0x8F),  # an unknown opcode
        b"\x81\x01x",  # not masked
        b"\x81\xff" + b"\x7f" * 8,  # a frame of 9 EB
        frame(b"x" * 1000, first_byte=0x01) + frame(b"x" * 60_000, first_byte=0x00) * 3,  # fragments without an end
    ],
)
def test_frames_that_are_none(page, data):
    with socket.create_connection(("127.0.0.1", page.port), timeout=PATIENCE) as sock:
        sock.sendall(UPGRADE.format(port=page.port).encode())
        assert b" 101 " in sock.recv(4096)
        sock.sendall(data)
        with contextlib.suppress(ConnectionError):
            while sock.recv(65_536):
                continue
    with joined(page) as client:
        assert received(client, "state")
    wait_for(lambda: not page.subject.feed.clients)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("Upgrade:", "Origin: https://evil.example\r\nUpgrade:"),
        ("localhost", "evil.example"),
        ("Upgrade:", "Sec-Fetch-Site: cross-site\r\nUpgrade:"),
    ],
)
def test_a_page_of_another_site(page, old, new):
    answer, _ = sent_raw(page.port, UPGRADE.format(port=page.port).replace(old, new, 1).encode())
    head, _, body = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 403")
    assert b"content-security-policy" in head.lower()
    assert list(json.loads(body)) == ["error"]
    assert not page.subject.feed.clients


def test_its_own_page(page):
    with joined(page, origin=page.base) as client:
        assert received(client, "state")


def test_beyond_this_machine_the_first_message_has_the_token(page, monkeypatch):
    import dataclasses

    from catseye.web import service

    policy_of = service.policy_of
    monkeypatch.setattr(service, "policy_of", lambda *given: dataclasses.replace(policy_of(*given), exposed=True))
    with served_page() as exposed:
        for token in (None, "", "wrong", TOKEN + "x", "\u00e9" * 40):
            assert end_of(exposed, json.dumps({"token": token, "kinds": []})) == (
                live.NO_TOKEN,
                "the token is missing or wrong",
            )
        with joined(exposed, json.dumps({"token": TOKEN, "kinds": ["state"]})) as client:
            assert received(client, "state")
        assert not any(TOKEN in line for line in exposed.log)


def test_more_clients_than_there_is_room_for(page, monkeypatch):
    monkeypatch.setattr(live, "MOST_CLIENTS", 2)
    with joined(page) as first, joined(page) as second:
        assert received(first, "state")
        assert received(second, "state")
        assert end_of(page, WELCOME)[0] == live.TOO_MANY


def stuck_socket(page):
    """Client that has been welcomed and then takes nothing."""
    sock = socket.socket()
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    sock.connect(("127.0.0.1", page.port))
    sock.sendall(UPGRADE.format(port=page.port).encode())
    assert b" 101 " in sock.recv(200)
    sock.sendall(frame(WELCOME.encode()))
    return sock


def test_a_stuck_client_loses_events_and_is_cut_off_and_slows_nobody(page, monkeypatch):
    monkeypatch.setattr(protocols, "STUCK_SECONDS", 2.0)
    heard, lags = [], []

    def listen(client):
        with contextlib.suppress(ConnectionClosed):
            while True:
                message = json.loads(client.recv())
                if message["kind"] == "shot":
                    heard.append(time.monotonic() - message["data"]["sent"])
                lags.extend([message] if message["kind"] == "lag" else [])

    with contextlib.closing(stuck_socket(page)) as stuck, joined(page) as client:
        threading.Thread(target=listen, args=(client,), daemon=True).start()
        wait_for(lambda: len(page.subject.feed.clients) == 2)
        count = 0
        until = time.monotonic() + 20.0
        while not page.counts["stuck"]:
            assert time.monotonic() < until
            page.tell("shot", {"sent": time.monotonic(), "filling": "x" * 20_000})
            count += 1
            time.sleep(0.01)
        wait_for(lambda: len(page.subject.feed.clients) == 1)
        wait_for(lambda: len(heard) == count)
        wait_for(lambda: is_cut(stuck))
        assert not lags
        assert max(heard) < 1.0  # s; the queue of the other was full for 2
    assert page.subject.feed.dropped["shot"] > 0


def test_a_slow_client_gets_the_counts_of_what_it_lost(page):
    with contextlib.closing(stuck_socket(page)) as sock:
        wait_for(lambda: page.subject.feed.clients)
        until = time.monotonic() + 20.0
        while page.subject.feed.dropped["shot"] < 5:
            assert time.monotonic() < until
            page.tell("shot", {"filling": "x" * 20_000})
            time.sleep(0.01)
        text = b""
        sock.settimeout(PATIENCE)
        while b'{"kind":"lag","data":{"dropped":{' not in text[-200_000:]:
            part = sock.recv(65_536)
            assert part
            text += part


def test_fifty_clients_get_the_same(page):
    with contextlib.ExitStack() as stack:
        clients = [stack.enter_context(joined(page)) for _ in range(50)]
        wait_for(lambda: len(page.subject.feed.clients) == 50)
        for number in range(20):
            page.tell("shot", {"number": number})
        for client in clients:
            assert [received(client, "shot")["number"] for _ in range(20)] == list(range(20))
    wait_for(lambda: not page.subject.feed.clients)


def test_a_result_has_no_events():
    with served_page(report={"format": "catseye-report-1", "title": "a night"}, token=None) as page:
        assert end_of(page, WELCOME) == (live.NOTHING_LIVE, "a result has no events")
