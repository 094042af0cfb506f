"""Commands of people: the lease, refusals in the site's words, consoles."""

import asyncio

import pytest

from catseye.errors import InputError
from catseye.ranger.line import Request
from catseye.service.watch.commands import IDLE, needs_lease
from coordinator.link_scene import run, until
from service.watch.watch_scene import Watched


def test_command_takes_the_lease_keeps_it_and_gives_it_back():
    async def story():
        async with Watched() as site:
            answer = await site.watch.command("drop", ["zy102"], "anna")
            assert (answer["command"], answer["values"], answer["lease_from"]) == ("DROP", ["ZY102"], None)
            assert answer["at"] > 52_889.0
            assert site.ziy.firing.dropped == {"ZY102"}
            assert site.server.holder.name == "anna"
            await asyncio.sleep(1.5)
            assert site.watch.state()["lease"] == "anna (memory port 0)"
            await asyncio.sleep(IDLE - 10.0)
            assert (await site.watch.command("TAKE", ["ZY102"], "anna"))["lease_from"] is None
            await asyncio.sleep(IDLE - 10.0)
            assert site.server.holder is not None
            await until(lambda: site.server.holder is None, 20.0)
            taken = [e.details["holder"] for e in site.published if getattr(e, "kind", "") == "lease"]
            assert [holder.split()[0] for holder in taken] == ["anna", "nobody"]

    run(story)


def test_lease_of_another_is_taken_and_named():
    async def story():
        async with Watched() as site:
            other = await site.client()
            assert (await other.ask("LEASE", "ben")).ok
            assert (await site.watch.command("MODE", ["hold"], "anna"))["lease_from"] == "ben"
            assert site.ziy.mode == "hold"
            assert (await site.watch.command("MODE", ["active"], "carl"))["lease_from"] is None  # the same page's
            assert site.server.holder.name == "carl"
            assert (await other.ask("LEASE", "ben")).ok
            assert (await site.watch.command("MODE", ["hold"], "carl"))["lease_from"] == "ben"

    run(story)


@pytest.mark.parametrize(
    ("name", "parameters", "who", "words"),
    [
        ("DROP", ["ZY999"], "anna", "'ZY999' is not a ranger here"),
        ("MODE", ["lazy"], "anna", "lazy"),
        ("START", [], "anna", "nothing is prepared"),
        ("LEASE", ["anna"], "anna", "is no command to the site"),
        ("BYE", [], "anna", "is no command to the site"),
        ("DROP", ["ZY101\nDROP ZY102"], "anna", "printable"),
        ("DROP", ["ZY101; x"], "anna", "comment"),
        ("DROP", ["ZY101"], "1", "is no name"),
        ("DROP", ["ZY101"], "", "is no name"),
    ],
)
def test_refusal_is_the_sites_own(name, parameters, who, words):
    async def story():
        async with Watched() as site:
            with pytest.raises(InputError, match=words):
                await site.watch.command(name, parameters, who)
            assert not site.ziy.firing.dropped

    run(story)


def test_console_reads_without_a_lease_and_passes_on_a_refusal():
    async def story():
        async with Watched(consoles=("ZY101",)) as site:
            ranger = site.served["ZY101"].ranger
            holder = ranger.lease
            (version,) = (await site.watch.console("ZY101", "VER", "anna"))["replies"]
            assert version.startswith("VER 1, ")
            many = (await site.watch.console("ZY101", "hlp", "anna"))["replies"]
            assert len(" ".join(many)) > 50
            (refusal,) = (await site.watch.console("ZY101", "PS 1", "anna"))["replies"]
            assert refusal.startswith("PS 0, PS needs the lease: ziy-")
            assert ranger.lease == holder
            assert (await site.watch.console("ZY101", "what", "anna"))["replies"] == ["UNKNOWN command WHAT"]
            for line, words in (
                ("LEASE anna", "belongs to the console"),
                ("", "no command"),
                ("1\tVER", "without TID"),
            ):
                with pytest.raises(InputError, match=words):
                    await site.watch.console("ZY101", line, "anna")
            with pytest.raises(InputError, match="has no console here"):
                await site.watch.console("ZY102", "VER", "anna")

    run(story)


def test_console_takes_a_free_lease_for_one_command():
    async def story():
        async with Watched(consoles=("ZY101",), mode="hold", ready=False) as site:
            await site.end()
            ranger = site.served["ZY101"].ranger
            await until(lambda: ranger.lease is None)
            (reply,) = (await site.watch.console("ZY101", "ABV 0, 20000", "anna"))["replies"]
            assert reply.startswith("ABV 1")
            assert ranger.lease is None

    run(story)


@pytest.mark.parametrize(
    ("line", "needed"),
    [
        (("VER", ()), False),
        (("ABV", ("0",)), False),
        (("ABV", ("0", "29000")), True),
        (("PS", ("1",)), True),
        (("PS", ("0",)), False),
        (("STOP", ()), False),
        (("UNLATCH", ("anna",)), False),
        (("NOTHING", ("1",)), False),
    ],
)
def test_commands_that_need_the_lease(line, needed):
    assert needs_lease(Request(*line)) is needed
