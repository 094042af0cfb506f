"""Stops: immediate, latched from outside the lease, not undone."""

import asyncio
import logging

import pytest

from catseye.ranger.client import SECOND_CLIENT_TID
from catseye.ranger.commands import stops
from catseye.ranger.door import Door
from catseye.ranger.line import Request, stamp_text
from catseye.ranger.ranger import Ranger
from catseye.ranger.server import MOST_STOPS
from catseye.ranger.status import StatusWord
from ranger.ranger_scene import READY, Told, ready
from ranger.scripted_head import ScriptedHead
from ranger.test_server import OPEN, Site, dark, heard, run

HOLDER, OTHER = 1, 2


def leased(**options):
    """A lit ranger whose lease the first connection has."""
    told = ready(**options)
    told.ranger.guarded = True
    told.ranger.receive(HOLDER, "LEASE anna")
    told.turns(1)
    assert told.head.laser_on()
    return told


def said(told, client, line):
    """What is answered at once, before any turn: replies by command."""
    return {out.reply.command: out.reply for out in told.ranger.receive(client, line)}


def test_holders_wait_does_not_delay_a_stop():
    """Attack: WTMO 3600 and CWT on an axis that is off kept PS 0 waiting for an hour."""
    told = leased()
    told.say("AXIS 0, 0", "WTMO 3600", client=HOLDER)
    told.ranger.receive(HOLDER, "CWT 1")
    told.turns(20)
    assert told.ranger.busy
    assert told.head.laser_on()
    reply = said(told, OTHER, "PS 0")["PS"]
    assert (reply.ok, reply.values[0]) == (True, "0")
    assert not told.head.laser_on()
    assert told.ranger.busy  # her wait goes on


@pytest.mark.parametrize("order", ["PS 0", "STOP", "1000\tps +00", "  STOP", "AXIS 0, 0"])
def test_stop_from_outside_the_lease_is_latched_until_cleared(order):
    told = leased()
    command = order.split("\t")[-1].split()[0].upper()
    lights, moves = command != "AXIS", command != "PS"
    replies = told.ranger.receive(OTHER, order)
    pushed = [out for out in replies if out.reply.command == "LATCH"]
    assert [(out.reply.tid, out.client) for out in pushed] == [(0, None)]
    assert f"{command} from connection 3 which has not the lease" in pushed[0].reply.text
    assert told.ranger.status() & StatusWord.LATCHED
    for line, refused in (("PS 1", lights), ("STT 0", moves), ("CIL 1", moves), ("AXIS 0, 1", moves), ("TRG", lights)):
        text = told.say(line, client=HOLDER)[-1].text
        assert ("by order" in text) == refused, (line, text)
        assert "expected UNLATCH" in text or not refused
    assert "which has not the lease" in said_later(told, OTHER, "LATCH").text
    refused = said_later(told, HOLDER, "UNLATCH anna")
    assert (refused.ok, refused.text) == (
        False,
        "the holder of the lease cannot clear it (expected another connection, or LEASE none first)",
    )
    told.heard.clear()
    assert said_later(told, OTHER, "UNLATCH ben").values == ("none",)
    assert ("none", "cleared by ben at connection 3") in [o.reply.values for o in told.heard]
    assert all(reply.ok for reply in told.say("AXIS 0, 1", "AXIS 1, 1", "PS 1", "CIL 1", client=HOLDER))
    assert told.head.laser_on()
    assert not told.ranger.status() & StatusWord.LATCHED


def said_later(told, client, line):
    told.ranger.receive(client, line)
    command = line.split()[0]
    return next(out.reply for out in told.turns(3) if out.reply.command == command and out.client == client)


@pytest.mark.parametrize("order", ["PS 0", "STOP", "AXIS 0, 0"])
def test_holders_own_stop_is_not_latched(order):
    told = leased()
    told.say(order, client=HOLDER)
    assert told.ranger.latch is None
    assert all(r.ok for r in told.say("AXIS 0, 1", "AXIS 1, 1", "PS 1", client=HOLDER) if r.command != "SAFE")
    assert told.head.laser_on()


def test_scan_and_stream_stopped_by_another_client_may_restart():
    told = leased()
    told.say("CIL 1", client=HOLDER)
    told.say("STM 1, 1000", client=HOLDER)
    assert said(told, OTHER, "STM 1, 0")["STM"].ok
    assert told.ranger.stream is None
    told.say("NUM 1", "ORD 1, 1", "SCN 1", client=HOLDER)
    assert said(told, OTHER, "SCN 0")["SCN"].ok
    assert not told.ranger.scanning
    assert told.ranger.latch is None


def test_queued_commands_do_not_light_after_a_stop():
    """Attack: PS 1 waits behind a move, PS 0 passes it, and then the laser is lit for good."""
    told = leased()
    for line in ("CIL 2", "PS 1", "AT 0, 1, 0, PS 1", "AT 60000, 1, 0, PS 1", "D0", "PS 0"):
        told.ranger.receive(HOLDER, line)
    told.say("AT 60000, 1, 0, PS 1", client=HOLDER)
    at = stamp_text(told.ranger.now_ticks() + 10)
    told.ranger.receive(HOLDER, f"2000\t{at}\tPS 1")
    assert told.ranger.receive(HOLDER, "PS 0")[0].reply.ok
    told.turns(400)
    assert not told.head.laser_on()
    assert told.ranger.scheduler.entries == []
    assert told.say("PS 1", client=HOLDER)[-1].ok  # what comes behind it counts


def test_overtaken_commands_are_answered():
    told = leased()
    for line in ("1001\tCIL 2", "1002\tPS 1", "1003\tAXIS 1, 1", "1004\tAXIS 0, 1"):
        told.ranger.receive(HOLDER, line)
    replies = [out.reply for out in told.ranger.receive(HOLDER, "1005\tPS 0")]
    assert [(r.tid, r.ok) for r in replies] == [(1005, True), (1002, False)]
    assert "PS came after it" in replies[1].text
    replies = [out.reply for out in told.ranger.receive(HOLDER, "1006\tAXIS 0, 0")]
    assert [(r.tid, r.ok) for r in replies] == [(1006, True), (1004, False)]


def test_stop_drops_and_answers_running_and_queued_commands():
    told = leased()
    told.say("AT 60000, 5, 1, TRG", client=HOLDER)
    for line in ("1001\tWTMO 3600", "1002\tCWT 2", "1003\tCIL 2", "1004\tD0"):
        told.ranger.receive(HOLDER, line)
    told.turns(5)
    replies = {out.reply.tid: out.reply for out in told.ranger.receive(OTHER, "7\tSTOP")}
    assert replies[7].ok
    assert (replies[1002].ok, replies[1003].ok) == (False, False)
    assert "dropped" in replies[1002].text
    assert 1004 not in replies  # a question is answered all the same
    assert any(out.reply.tid == 1004 and out.reply.ok for out in told.turns(3))
    assert dark(told.head)
    assert not told.ranger.busy
    assert told.ranger.scheduler.entries == []


def test_stop_of_a_dark_ranger_drops_queued_commands():
    told = leased()
    told.say("PS 0", "AXIS 0, 0", "AXIS 1, 0", "WTMO 3600", client=HOLDER)
    for line in ("CWT 2", "AXIS 0, 1", "FHM 0"):
        told.ranger.receive(HOLDER, line)
    told.turns(3)
    told.ranger.receive(OTHER, "STOP")
    told.turns(3)
    assert not told.ranger.busy
    assert dark(told.head)


def test_latch_survives_reset_lease_and_restart(tmp_path):
    told = leased(files=tmp_path)
    told.ranger.receive(OTHER, "PS 0")
    told.say("RST", "LEASE none", client=HOLDER)
    told.ranger.receive(HOLDER, "LEASE anna")
    told.say(*READY[:-1], client=HOLDER)
    assert "by order" in told.say("PS 1", client=HOLDER)[-1].text
    again = Told(files=tmp_path)
    assert again.ranger.latch == told.ranger.latch
    assert again.ranger.status() & StatusWord.LATCHED
    again.ranger.receive(OTHER, "UNLATCH ben")
    again.turns(1)
    assert Told(files=tmp_path).ranger.latch is None
    (tmp_path / "LATCH").write_bytes(b"\xff")
    broken = Told(files=tmp_path).ranger.latch
    assert (broken.light, broken.moves) == (True, True)


def test_invalid_name_does_not_clear_and_a_second_stop_keeps_the_first_text():
    told = leased()
    told.ranger.receive(OTHER, "PS 0")
    assert not said_later(told, OTHER, "UNLATCH 1").ok
    told.ranger.peers[3] = "somebody else"
    told.ranger.receive(3, "STOP")
    latch = told.ranger.latch
    assert (latch.light, latch.moves) == (True, True)
    assert "connection 3" in latch.order


@pytest.mark.parametrize(
    "line", ["PS 1", "PS", "AXIS 0", "AXIS 0, 1", "SCN 1", "STM 1, 5", "STOP 0", "CMEAS 1, 0", "RST"]
)
def test_other_commands_are_not_urgent(line):
    word, _, rest = line.partition(" ")
    assert not stops(Request(word, tuple(part.strip() for part in rest.split(",")) if rest else ()))


def test_scheduled_stop_waits_and_needs_the_lease():
    told = leased()
    at = stamp_text(told.ranger.now_ticks() + 1000)
    assert "needs the lease" in said(told, OTHER, f"2000\t{at}\tPS 0")["PS"].text
    assert said(told, HOLDER, f"1000\t{at}\tPS 0") == {}
    told.turns(10)
    assert told.head.laser_on()
    told.turns(20)
    assert not told.head.laser_on()


def test_no_stamp_clears_a_dark_order_that_is_still_to_come():
    """Attack: UNLATCH with a stamp of a second later, as often as one likes, and no order held for longer."""
    told = leased()
    at = stamp_text(told.ranger.now_ticks() + 1000)
    assert "for now" in said(told, OTHER, f"2000\t{at}\tUNLATCH robot")["UNLATCH"].text
    assert said(told, OTHER, "PS 0")["LATCH"].ok
    told.turns(40)
    assert told.ranger.latch is not None
    late = stamp_text(told.ranger.now_ticks() - 1)
    assert told.say(f"2000\t{late}\tUNLATCH bob", client=OTHER)[0].ok  # late is at once
    assert told.ranger.latch is None


@pytest.mark.parametrize("words", ["LEASE eve", "LEASE none"])
def test_a_lease_is_taken_or_given_back_now_and_not_by_a_stamp_to_come(words):
    told = leased()
    at = stamp_text(told.ranger.now_ticks() + 1000)
    client = HOLDER if words.endswith("none") else OTHER
    reply = said(told, client, f"2000\t{at}\t{words}")["LEASE"]
    assert not reply.ok
    told.turns(40)
    assert told.ranger.lease.name == "anna"


# What lights, and what does not -------------------------------------------------------------------------------------


def test_unhomed_ranger_stays_dark():
    told = Told()
    assert "not homed" in told.one("PS 1").text
    assert not told.head.laser_on()
    told.say(*READY)
    assert told.head.laser_on()
    told.ranger.receive(1, "FHM 0")  # a search goes all the way round
    told.turns(1)
    assert not told.head.laser_on()


@pytest.mark.parametrize("how", ["lost home", "came on by itself"])
def test_light_without_command_or_known_direction_goes_off_in_the_next_turn(how):
    told = ready()
    if how == "lost home":
        told.head.homes[0] = "never"
    else:
        told.say("PS 0")
        told.head.laser = True
    safe = [out.reply for out in told.turns(1) if out.reply.command == "SAFE"]
    assert not told.head.laser_on()
    assert [("laser off" in reply.text, reply.ok) for reply in safe] == [(True, False)]


def test_no_light_after_a_power_cut_of_the_head():
    told = ready()
    told.head.reset()
    told.head.laser = True  # as hardware whose laser comes on with its power
    told.turns(1)
    assert not told.head.laser_on()


def test_laser_at_boot_follows_the_hardware_if_configured():
    told = Told(laser_at_boot=True)
    told.turns(3)
    assert told.head.laser_on()
    assert told.say(*READY)[-1].ok
    told.say("RST")
    assert told.head.laser_on()
    assert told.one("PS 0").ok
    assert not told.head.laser_on()


def test_initialisation_files_cannot_light(tmp_path):
    (tmp_path / "CUBES.INI").write_text("INI 4\nPS 1\n")
    (tmp_path / "ZY101.INI").write_text("")
    (tmp_path / "zp.INI").write_text("")
    told = ready(files=tmp_path)
    told.say("PS 0")
    assert "PS is not allowed in an initialisation file" in told.say("INITZY")[-1].text
    assert not told.head.laser_on()


@pytest.mark.parametrize("order", ["CMEAS 2, 1", "STM 1, 50"])
@pytest.mark.parametrize("again", [False, True])
def test_buffer_during_which_the_laser_went_off_is_rejected(order, again):
    told = leased()
    told.say("CIL 1", client=HOLDER)
    told.ranger.receive(HOLDER, order)
    told.turns(2, 0.02)
    told.ranger.receive(OTHER, "PS 0")
    if again:  # lit before the buffer ends
        told.ranger.set_latch(None)
        told.ranger.switch_laser(True)
    reply = [out.reply for out in told.turns(10, 0.02) if out.reply.command == "CMEAS"][-1]
    assert (reply.ok, "went off" in reply.text) == (False, True)


# Over the wire ------------------------------------------------------------------------------------------------------


def test_stop_behind_a_thousand_lines_is_executed_at_once():
    async def story():
        async with Site(door=OPEN) as site:
            _, writer = await site.typed(0)
            await site.until(lambda: 0 in site.server.connections)
            writer.write(b"WTMO 3600\nAXIS 0, 0\nCWT 1\n" + b"1000\tD0\n" * 3000 + b"ps 0\r\n")
            await site.until(lambda: not site.head.laser_on())
            assert len(site.server.connections[0].unread) > 20_000
            assert b"ps" not in site.server.connections[0].unread
            writer.close()

    run(story)


def test_flood_of_stops_is_rate_limited_and_none_is_lost():
    async def story():
        async with Site(door=OPEN) as site:
            reader, writer = await site.typed(0)
            for _ in range(3):
                await site.answered(reader.readline())
            writer.write(b"PS 0\n" * 500)
            await site.turns(2)
            connection = site.server.connections[0]
            assert connection.stops_left < 1.0
            said = 0
            while said < 500:
                site.now += 0.1
                line = await site.answered(reader.readline())
                said += b"PS 1, 0" in line
            assert said > MOST_STOPS
            writer.close()

    run(story)


def test_stop_from_outside_is_logged_with_its_peer(caplog):
    caplog.set_level(logging.WARNING)

    async def story():
        async with Site(door=Door()) as site:
            lines = []
            holder = await site.client(0, heard=lines.append)
            other = await site.client(1, first_tid=SECOND_CLIENT_TID)
            assert (await site.answered(holder.ask("LEASE", "anna"))).ok
            assert (await site.answered(holder.ask("PS", 1))).ok
            assert (await site.answered(other.ask("PS", 0))).ok
            pushed = await heard(site, lines, "LATCH")
            assert "from 127.0.0.1 port " in pushed.text
            assert pushed.text in caplog.text
            holder.close()
            other.close()

    run(story)


def test_stops_are_answered_within_a_few_turns_under_load():
    """No clock: each is answered by the `receive` that brings it, so by the next read of the loop."""

    async def story():
        async with Site(door=OPEN) as site:
            busy = await site.client(0)
            other = await site.client(1, first_tid=SECOND_CLIENT_TID)
            for _ in range(64):
                busy.request("COO")
            await site.turns(3)
            for state in (1, 0) * 20:
                site.now += 0.05
                waiting = asyncio.ensure_future(other.ask("PS", state))
                await site.turns(8)
                assert waiting.done()
                assert site.head.laser_on() == bool(state)
            busy.close()
            other.close()

    run(story)


def test_ranger_is_dark_at_power_up():
    head = ScriptedHead()
    assert head.laser_on()
    Ranger("ZY101", head, limits=(-30_000, 80_000))
    assert not head.laser_on()
