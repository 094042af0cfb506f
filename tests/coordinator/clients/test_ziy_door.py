"""Access to the coordinator's port: places, keys, first bytes, idle, partial answers."""

import asyncio
import logging

import pytest

from catseye.coordinator.clients.server import LINES_A_SLICE, MOST_CLIENTS, MUTE, ZiyServer
from catseye.ranger.door import Door, answer_to
from catseye.ranger.entrance import MOST_PENDING, PATIENCE, SLOWED
from catseye.records.night.live import LivePosture
from coordinator.clients.test_ziy_server import Served
from coordinator.link_scene import network, run, until

KEY = "a-key-of-the-site"


class Locked(Served):
    """A coordinator in hold whose port asks for a key."""

    def __init__(self, **door):
        super().__init__(mode="hold", ready=False)
        self.door = Door(**{"key": KEY} | door)

    async def __aenter__(self):
        await super().__aenter__()
        await self.server.stop()
        self.server = ZiyServer(self.ziy, port=0, network=network(), door=self.door)
        await self.server.start()
        return self


def words(raw):
    return [line.split("\t")[-1].split()[0] for line in raw.got.decode().splitlines() if line]


def test_unauthenticated_peers_are_few_and_occupy_no_place():
    """Attack: 64 sockets that never gave the key kept everybody out."""

    async def story():
        async with Locked() as site:
            strangers = [await site.raw() for _ in range(MOST_CLIENTS + 4)]
            await asyncio.sleep(0.1)
            assert sum(not each.gone for each in strangers) <= MOST_PENDING
            assert not strangers[-1].gone
            client = await site.client(key=KEY)
            assert (await client.ask("STATUS")).ok
            assert len(site.server.clients) == 1
            await asyncio.sleep(PATIENCE + 1.0)
            assert all(each.gone for each in strangers)
            assert b"LINE 0, the site's key is expected first" in strangers[-1].got
            assert (await client.ask("STATUS")).ok

    run(story)


def test_clients_that_never_say_a_line_keep_nobody_out():
    """Attack: 64 sockets that said nothing kept an operator out for an hour."""

    async def story():
        async with Served(mode="hold", ready=False) as site:
            reader = await site.raw()
            reader.transport.write(b"SUBSCRIBE\n")
            mute = [await site.raw() for _ in range(MOST_CLIENTS - 1)]
            await asyncio.sleep(1.0)
            late = await site.raw()
            await asyncio.sleep(0.1)
            assert b"CONNECT 0" in late.got
            await asyncio.sleep(MUTE)
            client = await site.client()
            assert (await client.ask("STATUS")).ok
            assert not reader.gone
            assert sum(each.gone for each in mute) == 1
            assert b"and another wants this place" in next(each for each in mute if each.gone).got

    run(story)


@pytest.mark.parametrize("right", [True, False])
def test_key_is_proved_not_sent_and_a_wrong_one_is_answered_late(right, caplog):
    async def story():
        async with Locked() as site:
            raw = await site.raw()
            await until(lambda: raw.got)
            nonce = raw.got.decode().split()[-1]
            began = asyncio.get_running_loop().time()
            raw.transport.write(f"KEY {answer_to(nonce, KEY if right else KEY[::-1])}\nVER\n".encode())
            await until(lambda: len(words(raw)) >= 2, step=0.01)
            late = asyncio.get_running_loop().time() - began
            if right:
                await until(lambda: len(words(raw)) == 5)
                assert words(raw) == ["NONCE", "KEY", "HELLO", "CONNECT", "VER"]
                assert late < 0.1
            else:
                assert words(raw) == ["NONCE", "LINE"]
                assert SLOWED <= late < SLOWED + 1.0
                assert "wrong keys: 1, the last of memory port 0" in caplog.text

    run(story)


@pytest.mark.parametrize(
    ("first", "answered"),
    [(b"\x00\x01\x00\x08\x21\x12\xa4\x42", False), (b"\x16\x03\x01", False), (b"EHLO mail\nMODE active\n", True)],
)
def test_connection_with_a_foreign_first_line_is_closed_and_logged(first, answered, caplog):
    caplog.set_level(logging.WARNING)

    async def story():
        async with Served(mode="hold", ready=False) as site:
            raw = await site.raw()
            await until(lambda: len(words(raw)) == 2)
            raw.transport.write(first)
            await until(lambda: raw.gone, 1.0)
            assert words(raw)[2:] == ["LINE"] * answered
            assert site.ziy.mode == "hold"
            assert f"ZIY: port {site.server.port}: memory port 0" in caplog.text
            assert "closed" in caplog.text

    run(story)


def test_silent_client_is_closed_and_one_with_keep_alives_is_not():
    async def story():
        async with Locked(idle=300.0) as site:
            mute, alive = await site.client(key=KEY), await site.client(key=KEY)
            for _ in range(20):
                await asyncio.sleep(20.0)
                alive.check()  # an empty line each minute
            assert mute.closed.done()
            assert not alive.closed.done()
            assert len(site.server.clients) == 1

    run(story, 600.0)


def test_long_answer_is_sent_in_parts_without_delaying_others():
    async def story():
        async with Served(mode="hold", ready=False) as site:
            for k in range(2000):
                for _ in site.server.board.samplers.add(LivePosture(5288900000000 + k, 1.0, 0.5)):
                    pass
            greedy, other = await site.raw(), await site.client()
            await until(lambda: len(words(greedy)) == 2)
            greedy.transport.write(b"SAMPLER POSTURE, 2000\nVER\n")
            await until(lambda: b"SAMPLER" in greedy.got, step=0.001)
            assert len(words(greedy)) <= 2 + 2 * LINES_A_SLICE
            assert (await other.ask("STATUS")).ok
            assert words(greedy)[-1] == "SAMPLER"  # it still comes
            await until(lambda: words(greedy)[-1] == "VER", 5.0)
            assert words(greedy)[2:] == ["SAMPLER"] * 2000 + ["VER"]  # whole, and what was sent behind it last

    run(story)


def test_client_may_disconnect_during_its_answer():
    async def story():
        async with Served(mode="hold", ready=False) as site:
            for k in range(2000):
                for _ in site.server.board.samplers.add(LivePosture(5288900000000 + k, 1.0, 0.5)):
                    pass
            greedy = await site.raw()
            greedy.transport.write(b"SAMPLER POSTURE, 2000\n")
            await until(lambda: b"SAMPLER" in greedy.got, step=0.001)
            greedy.transport.close()
            await until(lambda: not site.server.clients, 2.0)
            assert (await (await site.client()).ask("STATUS")).ok

    run(story)


def test_lease_belongs_to_a_connection_with_its_token():
    async def story():
        async with Served(mode="hold", ready=False) as site:
            anna, other, ben = await site.client(), await site.client(), await site.client()
            token = (await anna.ask("LEASE", "anna")).values[-1]
            assert not (await other.ask("MODE", "active")).ok  # who says the same name is not the holder
            for wrong in ("0" * 32, "anna"):
                assert not (await other.ask("LEASE", "anna", wrong)).ok
            assert not (await other.ask("MODE", "active")).ok
            assert (await other.ask("LEASE", "anna", token)).ok  # the same program, connected again
            assert (await other.ask("MODE", "hold")).ok
            assert not (await anna.ask("MODE", "active")).ok
            anna.close()
            await asyncio.sleep(0.1)
            assert (await ben.ask("LEASE")).values == ("anna", "memory port 0")
            other.close()
            await asyncio.sleep(0.1)
            assert (await ben.ask("LEASE")).values == ("none",)
            assert not (await ben.ask("LEASE", "anna", token)).ok

    run(story)
