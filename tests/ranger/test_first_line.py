"""First line of a connection: read, answered and closed, or closed at once."""

import pytest

from catseye.ranger.first_line import opening_of


@pytest.mark.parametrize(
    "data",
    [
        b"GET / HTTP/1.1\r\n",
        b"POST /x",
        b"get http://a/ HTTP/1.0\n",
        b"OPTIONS * HTTP/1.1\r\n",
        b"PRI * HTTP/2.0\r\n",
        b"CONNECT 127.0.0.1:1 HTTP/1.1\r\n",
        b"Host: a\r\n",
        b"\r\n\r\nPUT / HTTP/1.1\r\n",
        b"\x16\x03\x01\x02\x00",
        b"\x00\x01\x00\x08\x21\x12\xa4\x42",  # STUN, of a browser's WebRTC
        b"\xff\n",
        b"\r\n\x80",
        b"\x7f",
    ],
)
def test_first_bytes_of_browsers_are_recognised(data):
    assert opening_of(data)[0] == "foreign"


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", "waiting"),
        (b"\r\n\n", "waiting"),
        (b"GE", "waiting"),
        (b"VER\n\xff\n", "read"),
        (b"7\t52889.0\tcmeas 1, 17\r\n", "read"),
        (b"XYZ 1\n", "read"),
        (b"VER\xff\n", "unreadable"),
        (b"a;b\n", "unreadable"),
        (b"A" * 1025 + b"\n", "unreadable"),
        (b"A" * 3000, "unreadable"),
    ],
)
def test_other_input_is_read_awaited_or_answered(data, expected):
    assert opening_of(data)[0] == expected


@pytest.mark.parametrize(("line", "expected"), [(b"EHLO a\n", "unreadable"), (b"7\tver\n", "read"), (b"\n", "waiting")])
def test_first_line_needs_a_known_command(line, expected):
    assert opening_of(line, {"VER"})[0] == expected
