"""Table of commands: complete; counts, numbers and ranges of parameters are checked."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import InputError
from catseye.ranger.commands import COMMANDS, ROWS, schedule_of
from catseye.ranger.handlers.table import HANDLERS
from catseye.ranger.line import Request, parse_request

KNOWN = frozenset(
    [
        "ABA",
        "ABV",
        "ABP",
        "ACP",
        "DSP",
        "ACU",
        "AMP",
        "PHI",
        "DST",
        "AXIS",
        "AZM",
        "ELV",
        "ALPHA",
        "BETA",
        "MO",
        "BP",
        "EZ",
        "CIL",
        "CMEAS",
        "COO",
        "CWT",
        "CYC",
        "SFQ",
        "IFF",
        "D0",
        "ERL",
        "FHM",
        "FKP",
        "FKI",
        "FKD",
        "FIL",
        "FSI",
        "FLT",
        "STT",
        "WAI",
        "TRG",
        "MPC",
        "RAD",
        "MAG",
        "SEQ",
        "INI",
        "NUM",
        "ORD",
        "SCN",
        "STW",
        "VER",
        "STI",
        "RST",
        "PS",
        "INITZY",
        "ENTEMP",
        "BYE",
        "WCNT",
        "WTOL",
        "WTMO",
        "WMD",
    ]
)


def read(line):
    request = parse_request(line)
    return COMMANDS[request.command].read(request)


def test_table_has_every_surviving_command_and_marks_chosen_ones():
    assert len(ROWS) == len(COMMANDS)
    assert {row.name for row in ROWS if not row.chosen} == KNOWN
    for row in ROWS:
        assert len({len(form) for form in row.forms}) == len(row.forms), row.name
        assert row.asks <= {len(form) for form in row.forms}
        assert row.help
        assert row.usage.isascii()


def test_commands_and_handlers_correspond():
    assert set(HANDLERS) == set(COMMANDS)


@pytest.mark.parametrize(
    ("line", "values"),
    [
        ("ABP 0,29000", (0, 29000)),
        ("abp 1,65700", (1, 65700)),
        ("CMEAS 1, ZG11", (1, "ZG11")),
        ("COO 3, 1.5, -2, 0.25, ZG11", (3, 1.5, -2.0, 0.25, "ZG11")),
        ("FLT 1, 32767, 0, 32767, 32767, 255", (1, 32767, 0, 32767, 32767, 255)),
        ("CIL 3, 100, 200", (3, 100.0, 200.0)),
        ("BP 123.400, 645.200, 52332.000", (123.4, 645.2, 52332.0)),
        ("D0 0", (0.0,)),
        ("STI 52889.12500000", (5288912500000,)),
    ],
)
def test_valid_parameters_are_read(line, values):
    assert read(line) == values


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("ABV", "0 parameters do not fit.*ABV axis"),
        ("ABV 2", "axis 2 is outside 0 to 1"),
        ("ABV 0, 1.5", "not a whole number"),
        ("ABV 0, nan", "not a whole number"),
        ("BP nan, 0, 0", "not a number"),
        ("BP inf, 0, 0", "not a number"),
        ("ERL 0, 25001", "25001 is outside 0 to 25000 counts"),
        ("FSI 0, 256", "outside 0 to 255"),
        ("FKP 0, 32768", "outside 0 to 32767"),
        ("CYC 0", "outside 1 to 65536"),
        ("IFF 10001", "outside 1 to 10000 Hz"),
        ("SFQ 2", "outside 3"),
        ("COO 1, 2, 3", "3 parameters do not fit"),
        ("DST 1.5", "not a name"),
        ("COO 1, 0, 0, 0, 7ZG", "not a name"),
        ("TRG 1", "1 parameters do not fit"),
        ("STI now", "not an MJD"),
        ("NG 0.9", "outside 1 to 1.001"),
    ],
)
def test_count_number_and_range_are_checked(line, said):
    with pytest.raises(InputError, match=said):
        read(line)


@given(st.sampled_from(ROWS), st.lists(st.text(st.characters(codec="ascii"), max_size=12), max_size=9))
def test_any_parameters_are_read_or_refused_by_name(row, parameters):
    try:
        values = row.read(Request(row.name, tuple(parameters)))
    except InputError as problem:
        values, said = None, str(problem)
    if values is None:
        assert said.startswith(f"{row.name}: ")
        assert "\n" not in said
    else:
        assert len(values) == len(parameters)


def test_schedule_checks_its_command_at_once():
    assert schedule_of(("52889.5", "3", "0.25", "stt 0")) == (5288950000000, 3, 0.25, Request("STT", ("0",)))
    for parameters, said in (
        (("0", "1", "1", "STT 2"), "axis 2"),
        (("0", "0", "1", "TRG"), "repeats 0"),
        (("0", "1", "-1", "TRG"), "interval_s -1"),
        (("0", "1", "1", "BYE"), "cannot be scheduled"),
        (("0", "1", "1", "XYZ"), "cannot be scheduled"),
        (("0", "1", "1"), "3 parameters"),
    ):
        with pytest.raises(InputError, match=said):
            schedule_of(parameters)
