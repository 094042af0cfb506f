"""Command queues per connection: a reader cannot stall the holder."""

import asyncio

import pytest

from catseye.ranger.client import SECOND_CLIENT_TID
from catseye.ranger.commands import LONGEST_PAGE
from catseye.ranger.door import Door
from catseye.ranger.line import LONGEST_REQUEST, format_reply
from catseye.ranger.ranger import MOST_QUEUED, REPLIES_A_TURN
from catseye.ranger.server import MOST_PENDING_BYTES, MOST_REPLIES, REPLIES_A_SECOND, ClientConnection
from ranger.ranger_scene import ready
from ranger.test_server import FullTransport, Site, run

HOLDER, READER = 0, 1
CUBES = 2266  # of gbt


def with_cubes(told, count=CUBES):
    told.say(f"INI {count}", client=HOLDER)
    for number in range(1, count + 1):
        told.ranger.cubes.place(number, (float(number), 90_000.0, 9_000.0), f"ZG{number}")
    return told


def leased():
    told = ready()
    told.ranger.guarded = True
    told.ranger.receive(HOLDER, "LEASE anna")
    told.turns(1)
    return told


def outgoing(told, turns=1):
    return [out for out in told.turns(turns) if out.reply.command not in ("STW", "LEASE")]


def test_64_listings_of_a_reader_delay_the_holder_by_one_turn():
    """Attack: one packet of 64 COO made the holder's next command wait 23 s and sent him 10 MB."""
    told = with_cubes(leased())
    for k in range(64):
        told.ranger.receive(READER, f"{2000 + k}\tCOO")
    heard = outgoing(told, 10)
    assert {out.client for out in heard} == {READER}
    assert len(heard) <= 10 * REPLIES_A_TURN  # a slice a turn
    for tid in range(1000, 1020):
        told.ranger.receive(HOLDER, f"{tid}\tD0")
        first = outgoing(told)[0]
        assert (first.reply.tid, first.client) == (tid, HOLDER)  # before the reader's slice


def test_holders_long_wait_delays_no_reader_and_keeps_its_order():
    told = leased()
    told.say("AXIS 0, 0", "WTMO 3600", client=HOLDER)
    for line in ("1\tCWT 1", "2\tD0", "3\tACP 0"):
        told.ranger.receive(HOLDER, line)
    told.ranger.receive(READER, "9\tACP 1")
    assert [out.reply.tid for out in outgoing(told, 5)] == [9]
    there = [round(n) for n in told.ranger.cubes.counts(told.ranger.cubes.find(1))]
    told.head.at[:] = told.head.goal[:] = there
    assert [out.reply.tid for out in outgoing(told, 20)] == [1, 2, 3]


@pytest.mark.parametrize("line", ["COO", "SEQ"])
def test_answer_is_a_page_that_names_the_next(line):
    told = with_cubes(ready(), 300)
    told.say("CYC 300", "CMEAS 1, 0", client=HOLDER)
    seen, asked = [], line
    while asked:
        replies = [out for out in ask(told, asked) if out.reply.command == line]
        assert {out.client for out in replies} == {READER}
        values = [out.reply.values for out in replies]
        more = values.pop() if values[-1][0] == "more" else None
        assert len(values) <= LONGEST_PAGE
        assert len(values) == LONGEST_PAGE or more is None
        seen += [int(v[0]) for v in values]
        asked = f"{line} {more[1]}, {LONGEST_PAGE}" if more else None
    assert seen == list(range(0 if line == "COO" else 1, 301))


def ask(told, line):
    told.ranger.receive(READER, line)
    return told.turns(40)


@pytest.mark.parametrize(
    ("line", "bad"), [("COO 0, 129", "1 to 128"), ("SEQ 0, 5", "outside 1"), ("SEQ 999, 5", "999")]
)
def test_invalid_page_is_refused(line, bad):
    told = ready()
    told.say("CMEAS 1, 0", client=HOLDER)
    assert bad in ask(told, line)[0].reply.text


def test_receivers_of_each_reply():
    told = leased()

    def to(client, line):
        heard = told.ranger.receive(client, line) + told.turns(40)
        return {out.client for out in heard if out.reply.command == line.split()[0]}

    for line in ("COO 1", "ACP 0", "STW", "VER", "LATCH", "XYZ", "CYC", "LEASE", "HLP CIL"):
        assert to(READER, line) <= {READER}
    assert to(READER, "CYC 64") == {READER}  # a refusal for want of the lease
    for line in ("CYC 64", "CIL 1", "CMEAS 2, 1", "CIL 77"):
        assert to(HOLDER, line) == {None}  # what is done, both hear
    assert to(HOLDER, "BUF") == {HOLDER}


def test_queues_are_per_connection_and_bounded():
    told = leased()
    told.ranger.receive(HOLDER, "WTMO 3600")
    told.ranger.receive(HOLDER, "CWT 2")
    told.turns(2)
    told.head.on[0] = False
    for _ in range(MOST_QUEUED):
        assert told.ranger.receive(HOLDER, "D0") == []
    (refused,) = told.ranger.receive(HOLDER, "D0")
    assert f"{MOST_QUEUED} commands are queued already" in refused.reply.text
    assert told.ranger.receive(READER, "D0") == []
    assert told.ranger.waiting(READER) == 1


def test_new_lease_drops_earlier_commands():
    told = leased()
    told.say("AXIS 0, 0", "WTMO 3600", client=HOLDER)
    for line in ("1001\tCWT 2", "1002\tCYC 32", "1003\tD0"):
        told.ranger.receive(HOLDER, line)
    told.turns(3)
    replies = {out.reply.tid: out for out in told.ranger.receive(READER, "5\tLEASE ben")}
    assert replies[5].reply.values[0] == "ben"
    assert all("dropped: ben has the lease now" in replies[tid].reply.text for tid in (1001, 1002))
    told.ranger.receive(READER, "6\tCYC 16")
    assert {out.reply.tid for out in outgoing(told, 2)} == {6, 1003}
    assert told.ranger.sampling.cycles == 16


@pytest.mark.parametrize("token", ["0" * 32, "anna", "none"])
def test_name_without_its_token_renews_nothing(token):
    told = leased()
    orders, lease = told.ranger.orders, told.ranger.lease
    (reply,) = told.ranger.receive(READER, f"LEASE anna, {token}")
    assert (reply.reply.ok, reply.client) == (False, READER)
    assert (told.ranger.orders, told.ranger.lease) == (orders, lease)
    (reply,) = told.ranger.receive(HOLDER, f"LEASE anna, {lease.token}")
    assert reply.reply.ok
    assert lease.token not in reply.reply.text  # said once
    assert told.ranger.orders == orders + 1


def test_token_is_sent_only_to_the_holder_and_always_new():
    told = leased()
    heard = told.ranger.receive(READER, "LEASE ben") + told.turns(2)
    token = told.ranger.lease.token
    assert {out.client for out in heard if token in out.reply.text} == {READER}
    pushed = [out for out in heard if out.reply.command == "LEASE" and out.client is None]
    assert [(out.but, out.reply.values[:2]) for out in pushed] == [(READER, ("ben", "2"))]
    told.ranger.receive(READER, "LEASE ben")
    assert told.ranger.lease.token != token


# Over the wire --------------------------------------------------------------------------------------------------------


def test_readers_listings_are_rate_limited_and_holders_commands_are_not():
    async def story():
        async with Site(door=Door()) as site:
            holder = await site.client(0)
            reader = await site.client(1, first_tid=SECOND_CLIENT_TID)
            assert (await site.answered(holder.ask("LEASE", "anna"))).ok
            with_cubes(site.told, 1000)
            lines = []
            for _ in range(64):
                reader.request("COO", then=lines.append)
            await site.turns(200, 0.0)
            assert abs(len(lines) - MOST_REPLIES) <= REPLIES_A_TURN  # his budget, and then its rate
            for _ in range(20):
                waiting = asyncio.ensure_future(holder.ask("CYC", 64))
                await site.turns(6, 0.0)
                assert waiting.done()
            before = len(lines)
            site.now += 0.2
            await site.turns(60, 0.0)
            assert abs(len(lines) - before - 0.2 * REPLIES_A_SECOND) <= 2 * REPLIES_A_TURN
            holder.close()
            reader.close()

    run(story)


def test_slow_reader_pauses_its_listing_and_stays_connected():
    async def story():
        async with Site() as site:
            with_cubes(site.told, 1000)
            slow, full = ClientConnection(site.server, 0), FullTransport()
            slow.connection_made(full)
            slow.data_received(b"COO\n" * 300)
            for _ in range(3000):
                site.now += 0.1
                await site.turns(1, 0.0)
            assert not full.cut
            line = LONGEST_REQUEST  # more than a line of COO has
            assert MOST_PENDING_BYTES < full.kept < MOST_PENDING_BYTES + (REPLIES_A_TURN + 2) * line
            slow.connection_lost(None)

    run(story)


def test_full_list_is_sent_page_by_page():
    async def story():
        async with Site() as site:
            with_cubes(site.told, 700)
            client = await site.client()

            async def pass_time():
                while True:
                    site.now += 0.02
                    await asyncio.sleep(0)

            passing = asyncio.ensure_future(pass_time())
            cubes = await site.answered(client.ask_all("COO"))
            passing.cancel()
            assert [int(reply.values[0]) for reply in cubes] == list(range(701))
            client.close()

    run(story)


def test_page_size_is_fixed():
    told = with_cubes(ready(), 4095)
    size = sum(len(format_reply(out.reply)) + 1 for out in ask(told, "COO") if out.client is not None)
    assert size < 2**14
