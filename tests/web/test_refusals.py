"""Refusals: wrong tokens, hosts and origins, bodies, paths and manners. Each is logged and changes nothing."""

import contextlib
import http.client
import json
import socket
import subprocess
import time

import pytest

from web.page_scene import TOKEN, sent_raw, served_page

import httpx  # isort: skip - after the skip of the scene
from catseye.web import protocols  # isort: skip
from catseye.web.refusals import MOST_LINES  # isort: skip

BEARER = {"Authorization": f"Bearer {TOKEN}"}
COMMAND = {"command": "MODE", "parameters": ["hold"], "who": "anna"}
MESSAGE = json.dumps(COMMAND).encode()


@pytest.fixture
def page(monkeypatch):
    monkeypatch.setattr(protocols, "REQUEST_SECONDS", 1.5)  # s, so that the tests of slow requests are short
    monkeypatch.setattr(protocols, "MOST_CONNECTIONS", 50)
    with served_page() as page:
        yield page
    assert page.subject.watch.done == []
    assert not any(TOKEN in line or "\n" in line for line in page.log)


def post(page, **options):
    return httpx.post(f"{page.base}/api/commands", **{"json": COMMAND, "timeout": 20.0, **options})


def refused(page, answer, status, reason):
    """One line of JSON with the usual headers, one line in the log, a count."""
    assert answer.status_code == status, answer.text
    assert list(answer.json()) == ["error"]
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert page.counts[reason] == 1
    [line] = page.log
    assert line.startswith("refused ")
    assert f"({status})" in line


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Authorization": "Bearer wrong"},
        {"Authorization": f"Bearer {TOKEN}x"},
        {"Authorization": f"Bearer {TOKEN[:-1]}"},
        {"Authorization": f"Basic {TOKEN}"},
        {"Authorization": "Bearer"},
        {"Authorization": "Bearer \xff\xfe"},
        {"Cookie": f"token={TOKEN}"},
    ],
)
def test_a_command_without_its_token(page, headers):
    encoded = {name: value.encode("latin-1") for name, value in headers.items()}
    answer = post(page, headers=encoded)
    refused(page, answer, 401, "token")
    assert answer.headers["www-authenticate"] == "Bearer"


def test_a_token_in_the_address_is_none_and_is_not_logged(page):
    answer = httpx.post(f"{page.base}/api/commands?token={TOKEN}", json=COMMAND)
    refused(page, answer, 401, "token")


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "", "localhost@evil.example", "[::1", "0"])
def test_another_host(page, host):
    answer = httpx.get(f"{page.base}/api/state", headers={"Host": host})
    refused(page, answer, 403, "host")


def test_another_host_gets_no_page_either(page):
    refused(page, httpx.get(page.base, headers={"Host": "evil.example"}), 403, "host")


@pytest.mark.parametrize("name", ["localhost", "127.0.0.1", "[::1]", "LOCALHOST", "localhost."])
def test_names_of_this_machine_are_accepted_at_any_port(page, name):
    assert httpx.get(f"{page.base}/api/state", headers={"Host": f"{name}:8000"}).status_code == 200


@pytest.mark.parametrize("origin", ["https://evil.example", "null", "http://127.0.0.1:1", "https://127.0.0.1:{port}"])
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_another_origin(page, origin, method):
    headers = {"Origin": origin.format(port=page.port), **BEARER}
    answer = httpx.request(method, f"{page.base}/api/commands", json=COMMAND, headers=headers)
    refused(page, answer, 403, "origin")


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_a_page_of_another_site_that_sends_no_origin(page, site):
    answer = httpx.get(f"{page.base}/api/state", headers={"Sec-Fetch-Site": site})
    refused(page, answer, 403, "origin")


def test_its_own_origin_is_accepted(page):
    answer = httpx.get(f"{page.base}/api/state", headers={"Origin": page.base, "Sec-Fetch-Site": "same-origin"})
    assert answer.status_code == 200
    assert "access-control-allow-origin" not in answer.headers


def test_a_page_without_a_token_takes_no_commands():
    with served_page(token=None) as page:
        answer = post(page, headers=BEARER)
    refused(page, answer, 403, "command")


def test_too_long_a_body(page):
    answer = post(page, content=b"x" * 70_000, headers=BEARER, json=None)
    refused(page, answer, 413, "size")


def test_too_long_a_body_in_chunks(page):
    def chunks():
        for _ in range(70):
            yield b"x" * 1000

    with contextlib.suppress(httpx.WriteError, httpx.ReadError):  # it is cut off while it is sent, perhaps
        post(page, content=chunks(), headers=BEARER, json=None)
    assert page.counts["size"] == 1


@pytest.mark.parametrize(
    ("body", "kind"),
    [
        (b"", "application/json"),
        (b"{", "application/json"),
        (b"null", "application/json"),
        (b"[" * 60_000, "application/json"),
        (b'{"command":' * 5000, "application/json"),
        (b'{"command": "MODE", "who": "\xff\xfe"}', "application/json"),
        (b"\xff\xfe" * 100, "application/json"),
        (b"\x00" * 100, "application/json"),
        (b'{"command": "MODE", "parameters": ["a\\nDROP ZY101"], "who": "x"}', "application/json"),
        (b'{"command": "MODE", "parameters": ["\\u0000"], "who": "x"}', "application/json"),
        (b'{"command": "MODE", "parameters": [1e999], "who": "x"}', "application/json"),
        (b'{"command": "QUIT", "parameters": [], "who": "x"}', "application/json"),
        (b'{"command": "MODE", "parameters": [], "who": ""}', "application/json"),
        (b'{"command": "MODE", "parameters": [], "who": "x", "token": "y"}', "application/json"),
        (
            b'{"command": "MODE", "parameters": ' + json.dumps(["a"] * 65).encode() + b', "who": "x"}',
            "application/json",
        ),
        (MESSAGE, "text/plain"),
        (b"command=MODE&who=x", "application/x-www-form-urlencoded"),
    ],
)
def test_a_malformed_body(page, body, kind):
    answer = post(page, content=body, json=None, headers={**BEARER, "Content-Type": kind})
    assert answer.status_code == 422, answer.text
    assert list(answer.json()) == ["error"]
    assert "Traceback" not in answer.text


PATHS = [
    "/../../../../etc/passwd",
    "/..%2f..%2f..%2f..%2fetc/passwd",
    "/%2e%2e/%2e%2e/etc/passwd",
    "/assets/../../service.py",
    "/assets/..%5c..%5cservice.py",
    "/assets/%252e%252e/service.py",
    "//etc/passwd",
    "/static/index.html",
    "/index.html%00.js",
    "/%ff%fe",
    "/api/../../etc/passwd",
    "/api/points/..%2f..%2fservice.py",
]


@pytest.mark.parametrize("path", PATHS)
def test_a_path_that_climbs(page, path):
    connection = http.client.HTTPConnection("127.0.0.1", page.port, timeout=10)
    connection.request("GET", path)
    answer = connection.getresponse()
    body = answer.read()
    assert answer.status == 404
    assert list(json.loads(body)) == ["error"]
    assert b"root:" not in body
    connection.close()


@pytest.mark.parametrize(
    "data",
    [
        b"hello\r\n\r\n",
        b"GET / HTTX/1.1\r\nHost: localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n",
        b"GET /\xff HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + b"x" * 70_000 + b"\r\n\r\n",
        b"POST /api/commands HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n",
        b"POST /api/commands HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\nContent-Length: 6\r\n\r\nhello",
        b"POST /api/commands HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + b"\x00" * 100,
        b"\x00" * 20_000,
    ],
)
def test_no_valid_http(page, data):
    answer, seconds = sent_raw(page.port, data)
    assert seconds < 5.0
    assert answer == b"" or answer.startswith(b"HTTP/1.1 4"), answer
    assert page.counts["malformed"] + page.counts["token"] + page.counts["slow"] + page.counts["size"] >= 1
    assert 1 <= len(page.log) <= 2


@pytest.mark.parametrize(
    ("first", "dribble"),
    [
        (b"GET /api/state HT", b"T"),
        (b"GET /api/state HTTP/1.1\r\nHost: localhost\r\n", b"X: y\r\n"),
        (b"POST /api/commands HTTP/1.1\r\nHost: localhost\r\nContent-Length: 60000\r\n\r\n", b"x"),
    ],
)
def test_a_slow_request_is_cut_off(page, first, dribble):
    began = time.monotonic()
    with socket.create_connection(("127.0.0.1", page.port), timeout=10.0) as sock:
        sock.sendall(first)
        sock.settimeout(0.1)
        with contextlib.suppress(ConnectionError):
            while time.monotonic() - began < 9.0:
                sock.sendall(dribble)
                with contextlib.suppress(TimeoutError):
                    if not sock.recv(65_536):
                        break
    assert time.monotonic() - began < 2.0 * protocols.REQUEST_SECONDS + 2.0
    assert page.counts["slow"] + page.counts["token"] >= 1


def test_a_slow_request_after_a_good_one_is_cut_off(page):
    good = b"GET /api/service HTTP/1.1\r\nHost: localhost\r\n\r\n"
    answer, seconds = sent_raw(page.port, good + b"GET /api/service HT")
    assert answer.startswith(b"HTTP/1.1 200")
    assert seconds < 2.0 * protocols.REQUEST_SECONDS
    assert page.counts["slow"] == 1


def test_an_idle_connection_ends_without_a_word(page):
    answer, seconds = sent_raw(page.port, b"")
    assert (answer, page.log) == (b"", [])
    assert seconds < 2.0 * protocols.REQUEST_SECONDS


def test_a_client_that_takes_nothing_is_cut_off(page, monkeypatch):
    monkeypatch.setattr(protocols, "STUCK_SECONDS", 1.0)
    request = b"GET /api/series?names=azimuth&most=20000 HTTP/1.1\r\nHost: localhost\r\n\r\n"
    with socket.socket() as sock:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sock.connect(("127.0.0.1", page.port))
        sock.sendall(request * 20)
        until = time.monotonic() + 10.0
        while not page.counts["stuck"] and time.monotonic() < until:
            time.sleep(0.05)
    assert page.counts["stuck"] == 1
    assert httpx.get(f"{page.base}/api/service").status_code == 200


def test_a_thousand_connections(page):
    """Beyond the limit they are closed at once; within a few seconds all others are, and the service answers again."""
    began = time.monotonic()
    socks = []
    try:
        for _ in range(1000):
            sock = socket.socket()
            sock.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                sock.connect(("127.0.0.1", page.port))
            socks.append(sock)
            time.sleep(0.0005)
        until = time.monotonic() + 20.0
        while time.monotonic() < until:
            with contextlib.suppress(httpx.HTTPError):
                if httpx.get(f"{page.base}/api/service", timeout=2.0).status_code == 200:
                    break
        assert time.monotonic() - began < 20.0
    finally:
        for sock in socks:
            sock.close()
    assert page.counts["connections"] >= 900
    assert len(page.log) <= 3 * MOST_LINES  # in some 10 s


def test_the_log_has_a_bounded_rate(page):
    for _ in range(40):
        httpx.get(f"{page.base}/api/state", headers={"Host": "evil.example"})
    assert page.counts["host"] == 40
    assert len(page.log) == MOST_LINES


def test_a_line_break_in_a_path_makes_no_second_line(page):
    httpx.post(f"{page.base}/api/x%0d%0acatseye:%20all%20is%20well%1b%5b31m")
    [line] = page.log
    assert line.isprintable()
    assert len(line) < 300


def test_headers_of_every_answer(page):
    for path in ("/", "/api/state", "/api/nothing", "/metrics", "/api/openapi.json"):
        headers = httpx.get(page.base + path).headers
        assert headers["content-security-policy"] == (
            "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
            "font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["cross-origin-opener-policy"] == headers["cross-origin-resource-policy"] == "same-origin"
        assert "camera=()" in headers["permissions-policy"]
        assert "set-cookie" not in headers
        assert "server" not in headers


@pytest.mark.parametrize("method", ["PUT", "DELETE", "PATCH", "TRACE", "OPTIONS", "BREW"])
def test_another_method(page, method):
    answer = httpx.request(method, f"{page.base}/api/state", headers=BEARER)
    assert answer.status_code in (404, 405)
    assert list(answer.json()) == ["error"]


@pytest.fixture(scope="module")
def certificate(tmp_path_factory):
    """Certificate for localhost and its key."""
    folder = tmp_path_factory.mktemp("tls")
    names = [str(folder / "certificate.pem"), str(folder / "key.pem")]
    command = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj /CN=localhost"
    subprocess.run(
        [*command.split(), "-addext", "subjectAltName=DNS:localhost", "-out", names[0], "-keyout", names[1]],
        check=True,
        capture_output=True,
    )
    return names


def test_beyond_this_machine_reading_needs_tls_and_the_token(certificate):
    import ssl

    keys = {"certificate": certificate[0], "key": certificate[1], "names": ["localhost"]}
    with served_page(host="0.0.0.0", **keys) as page:
        trust = ssl.create_default_context(cafile=certificate[0])
        with httpx.Client(base_url=f"https://localhost:{page.port}", verify=trust) as client:
            assert client.get("/").status_code == 200
            for path in ("/api/state", "/api/service", "/metrics", "/api/openapi.json"):
                assert client.get(path).status_code == 401
                assert client.get(path, headers=BEARER).status_code == 200
            assert client.get("/api/service", headers=BEARER).json()["needs_token"] is True
            assert client.get("/", headers={"Host": "other"}).status_code == 403
        answer, _ = sent_raw(page.port, b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert not answer.startswith(b"HTTP/1.1 2")


@pytest.mark.parametrize("absent", ["token", "certificate", "key"])
def test_beyond_this_machine_it_does_not_listen_without(certificate, absent):
    from catseye.errors import InputError

    keys = {"certificate": certificate[0], "key": certificate[1], "token": TOKEN} | {absent: None}
    with pytest.raises(InputError, match="other machines"), served_page(host="0.0.0.0", **keys):
        pass
