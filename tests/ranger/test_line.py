"""Lines of the ZY language: quoted examples, round trips, refusals."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import InputError
from catseye.geometry.sky.time_tag import TimeTag
from catseye.ranger.line import (
    LAST_TID,
    LONGEST_REQUEST,
    Reply,
    Request,
    commands_of_file,
    format_reply,
    format_request,
    next_tid,
    parse_reply,
    parse_request,
    parse_stamp,
    stamp_text,
    tag_of,
    ticks_of,
)

TS = 5288912500000
WORDS = st.text(st.sampled_from("ABCXYZabc019.+-_#:()"), min_size=1, max_size=20)
COMMANDS = st.from_regex(r"[A-Z][A-Z0-9]{0,7}", fullmatch=True)
TIDS = st.integers(0, LAST_TID)
TICKS = st.integers(0, 106_000 * 10**8)

QUOTED_REQUESTS = {
    "ABP 0,29000": Request("ABP", ("0", "29000")),
    "ABP 1,65700": Request("ABP", ("1", "65700")),
    "STT 0": Request("STT", ("0",)),
    "WAI 1": Request("WAI", ("1",)),
    "TRG": Request("TRG"),
    "MPC": Request("MPC"),
    "RAD": Request("RAD"),
    "CMEAS 1, ZG11": Request("CMEAS", ("1", "ZG11")),
    "SFQ 64": Request("SFQ", ("64",)),
    "CYC 1200": Request("CYC", ("1200",)),
    "IFF 2000": Request("IFF", ("2000",)),
    "bye": Request("BYE"),
}
QUOTED_REPLIES = {
    "ABV 1, n, v": ("ABV", True, ("n", "v")),
    "ACU 1, s": ("ACU", True, ("s",)),
    "DST 1, 17, 108453.287": ("DST", True, ("17", "108453.287")),
    "BP 1, 123.400, 645.200, 52332.000": ("BP", True, ("123.400", "645.200", "52332.000")),
    "CIL 1, num, name, x, y, z, az, el": ("CIL", True, ("num", "name", "x", "y", "z", "az", "el")),
    "CMEAS 1, f, id, name, amp, ph, dist": ("CMEAS", True, ("f", "id", "name", "amp", "ph", "dist")),
    "COO 1, n, name, x, y, z": ("COO", True, ("n", "name", "x", "y", "z")),
    "RAD 1, 3.6657776": ("RAD", True, ("3.6657776",)),
    "MAG 1, 2.67": ("MAG", True, ("2.67",)),
    "STW 1, 0x00013007": ("STW", True, ("0x00013007",)),
    "INITZY 1": ("INITZY", True, ()),
    "INITZY 0, message": ("INITZY", False, ("message",)),
    "BYE 1, 5240, Closing Connection": ("BYE", True, ("5240", "Closing Connection")),
    "CONNECT 1, 5240": ("CONNECT", True, ("5240",)),
    "HELLO This is ZY11 ver. 2.20": ("HELLO", None, ("This is ZY11 ver. 2.20",)),
    "UNKNOWN command XYZ": ("UNKNOWN", None, ("command XYZ",)),
}


@pytest.mark.parametrize("line", QUOTED_REQUESTS)
def test_quoted_requests_are_read(line):
    assert parse_request(line) == QUOTED_REQUESTS[line]
    assert parse_request(line.lower()).command == QUOTED_REQUESTS[line].command
    assert parse_request(f"1000\t52889.12500000\t{line}").ticks == TS


@pytest.mark.parametrize("line", QUOTED_REPLIES)
def test_quoted_replies_survive_the_round_trip(line):
    reply = Reply(*QUOTED_REPLIES[line], 1000, TS)
    whole = f"1000\t52889.12500000\t{line}"
    assert parse_reply(whole) == reply
    assert format_reply(reply) == whole


def test_only_a_greeting_may_lack_tid_and_stamp():
    assert parse_reply("HELLO This is ZY11 ver. 2.20").ticks is None
    assert parse_reply("CONNECT 1, 5240").values == ("5240",)
    with pytest.raises(InputError, match="0 tabs"):
        parse_reply("DST 1, 17, 108453.287")


@given(COMMANDS, st.lists(WORDS, max_size=8), TIDS, st.none() | TICKS)
def test_requests_survive_the_round_trip(command, values, tid, ticks):
    request = Request(command, tuple(values), tid, ticks)
    assert parse_request(format_request(request)) == request


@given(COMMANDS.filter(lambda c: c not in ("HELLO", "UNKNOWN")), st.lists(WORDS, max_size=8), TIDS, TICKS)
def test_replies_survive_the_round_trip(command, values, tid, ticks):
    for reply in (Reply(command, True, tuple(values), tid, ticks), Reply(command, False, ("a, b; c",), tid, ticks)):
        assert parse_reply(format_reply(reply)) == reply


@given(TICKS)
def test_stamp_is_exact_and_agrees_with_the_time_tag(ticks):
    assert parse_stamp(stamp_text(ticks)) == ticks == ticks_of(tag_of(ticks))
    assert tag_of(ticks).text(8) == stamp_text(ticks)


@given(st.integers(0, 105_999), st.integers(0, 86_400_000_000_000 - 1))
def test_stamp_is_within_half_a_tick_of_its_instant(day, nanoseconds):
    tag = TimeTag(day, nanoseconds)
    assert abs(int(tag_of(ticks_of(tag)) - tag)) <= 432_000


@given(st.text(max_size=60))
def test_any_line_is_read_or_refused_in_one_line(line):
    for parse in (parse_request, parse_reply):
        said = ""
        try:
            parse(line)
        except InputError as problem:
            said = str(problem)
        assert "\n" not in said
        assert said.isascii()


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("x" * (LONGEST_REQUEST + 1), "too long"),
        ("1\t2\t3\tTRG", "3 tabs"),
        ("-1\tTRG", "TID"),
        (f"{LAST_TID + 1}\tTRG", "TID"),
        ("1000\t1e4\tTRG", "MJD"),
        ("ABP 0,,1", "parameter 2 is empty"),
        ("ABP 0,", "parameter 2 is empty"),
        ("STT 0; STT 1", "comment"),
        ("COO 1, 2, 3, 4, n\xe9", "ASCII"),
        ("ABP 0\r", "ASCII"),
        ("9ABC", "not a command"),
        ("ABP " + ",".join("1" * 33), "33 parameters"),
    ],
)
def test_invalid_requests_are_refused(line, said):
    with pytest.raises(InputError, match=said):
        parse_request(line)


def test_empty_line_is_ignored_and_longest_line_is_read():
    assert parse_request("") is None
    assert parse_request(" \t ") is None
    assert parse_reply("") is None
    assert parse_request("A " + "1" * (LONGEST_REQUEST - 2)) is not None


@pytest.mark.parametrize("value", ["a,b", "a\tb", " a", "", "a;b", "a\n"])
def test_value_with_separators_is_not_sent(value):
    with pytest.raises(InputError):
        format_request(Request("COO", ("1", value)))


def test_comments_and_places_in_a_file():
    found = commands_of_file("; all\nINI 4; places\n\n  coo 1, 0, 0, 0, ZG11\n", "CUBES.INI")
    assert found == [(2, Request("INI", ("4",))), (4, Request("COO", ("1", "0", "0", "0", "ZG11")))]
    with pytest.raises(InputError, match=r"ZY101\.INI line 2: parameter|ZY101\.INI line 2: ABP: parameter 1"):
        commands_of_file("STT 0\nABP ,1\n", "ZY101.INI")


def test_tids_wrap_to_1000():
    assert [next_tid(0), next_tid(999), next_tid(1000), next_tid(LAST_TID - 1), next_tid(LAST_TID)] == [
        1000,
        1000,
        1001,
        LAST_TID,
        1000,
    ]


@pytest.mark.parametrize("letter", ["\x00", "\x1f", "\x7f", "\n", "é"])
@pytest.mark.parametrize("length", [40, 511, 512, 513, 22_000])
def test_unprintable_characters_are_refused_in_any_line(letter, length):
    line = "1000\t52889.12500000\tBUF 1, " + "A" * length
    assert parse_reply(line).values == ("A" * length,)
    assert parse_reply(line[:-1] + "~").values[0].endswith("~")
    with pytest.raises(InputError, match="printable ASCII"):
        parse_reply(line[:-1] + letter + "A")
