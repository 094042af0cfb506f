"""Parameters and samplers of a coordinator, as a page asks for them."""

import asyncio
import json

import pytest

from catseye.coordinator.samplers.columns import COLUMNS
from catseye.errors import InputError
from catseye.ranger.line import Reply
from catseye.service.watch.samplers import parameters_object, sampler_object
from coordinator.link_scene import run, until
from coordinator.ziy_scene import weather
from service.watch.watch_scene import Watched


def test_parameters_are_set_prepared_and_started_by_commands():
    async def story():
        async with Watched() as site:
            await until(lambda: site.watch.state()["connected"])
            rows = {row["name"]: row for row in (await site.watch.parameters())["parameters"]}
            assert set(rows) == {"mode", "dropped"}  # those of a coordinator without planner and reduction
            assert (rows["mode"]["value"], rows["mode"]["waiting"], rows["mode"]["unit"]) == ("active", "none", "")
            await site.watch.command("SET", ["mode", "hold"], "anna")
            rows = {row["name"]: row for row in (await site.watch.parameters())["parameters"]}
            assert (rows["mode"]["waiting"], rows["mode"]["stage"]) == ("hold", "set")
            assert rows["mode"]["choices"] == ["active", "passive", "hold"]
            assert rows["dropped"]["choices"] == []
            await site.watch.command("DISCARD", [], "anna")
            with pytest.raises(InputError, match="nothing is prepared"):
                await site.watch.command("START", [], "anna")
            await site.watch.command("SET", ["dropped", "ZY101 ZY102"], "anna")
            await site.watch.command("PREPARE", [], "anna")
            await site.watch.command("START", [], "anna")
            assert site.ziy.firing.dropped == {"ZY101", "ZY102"}

    run(story)


def test_interlocks_say_what_they_refuse():
    rows = [("rate_hz round_s", "a round has a shot", text) for text in ("none", "rate_hz = 0.05 gives no shot")]
    locks = parameters_object([], [Reply("INTERLOCKS", True, row, 1, None) for row in rows])["interlocks"]
    assert [lock["parameters"] for lock in locks] == [["rate_hz", "round_s"]] * 2
    assert [lock["refusal"] for lock in locks] == [None, "rate_hz = 0.05 gives no shot"]


def test_samplers_are_columns_of_numbers_and_texts():
    async def story():
        async with Watched() as site:
            await until(lambda: site.live.epochs >= 2)
            site.ziy.intake.take(weather())
            await asyncio.sleep(1.0)
            found = (await site.watch.samplers())["samplers"]
            assert {row["name"]: tuple(row["columns"]) for row in found} == COLUMNS
            values = await site.watch.sampler("weather", 10)
            assert values["columns"]["station"] == ["WX1"]
            assert values["columns"]["temperature_c"] == [10.0]
            assert len(values["mjd"]) == 1
            ranges = await site.watch.sampler("RANGES", 3)
            assert len(ranges["columns"]["number"]) == len(ranges["mjd"]) == 3
            json.dumps(ranges, allow_nan=False)
            assert (await site.watch.sampler("SURFACE", 5))["mjd"] == []
            for name, limit in (("GOSSIP", 1), ("RANGES", 5000), ("a, b", 1)):
                with pytest.raises(InputError):
                    await site.watch.sampler(name, limit)

    run(story)


def test_cut_rows_are_left_out():
    cut = Reply("PARAMETERS", True, ("mode", "hold"), 1, None)
    assert parameters_object([cut], [cut]) == {"parameters": [], "interlocks": []}
    row = Reply("SAMPLER", True, ("FOCUS", "52889.00000000", "3", "2"), 1, None)
    assert sampler_object("FOCUS", [row])["mjd"] == []
    unknown = Reply("SAMPLER", True, ("FOCUS", "52889.00000000", "3", "2", "none", "none", "good"), 1, None)
    columns = sampler_object("FOCUS", [unknown])["columns"]
    assert (columns["epoch"], columns["along_axis_m"], columns["verdict"]) == ([3.0], [None], ["good"])
