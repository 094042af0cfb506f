"""Parameters and samplers of a coordinator, and of a journal, as a page asks for them."""

import asyncio
import json

import numpy as np
import pytest

from catseye.api.live.watching import watch_journal
from catseye.coordinator.journal.entries import EpochSolution, Run
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.writer import Journal
from catseye.coordinator.samplers.columns import COLUMNS
from catseye.coordinator.samplers.corrections import CorrectionOutput
from catseye.coordinator.samplers.rings import MOVED, PARAMETERS_ACTIVE, Samplers
from catseye.errors import InputError
from catseye.ranger.line import Reply
from catseye.records.night.live import TICKS_PER_DAY, Happening, LivePosture
from catseye.service.watch.samplers import parameters_object, rows_object, sampler_object
from catseye.simulator.clock.world_clock import ManualClock
from cli.living_scene import recorded
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


def entries():
    """All entries of the recorded run."""
    with JournalReader(recorded()) as reader:
        return [entry for _, entry in reader.events(1)]


@pytest.mark.parametrize("name", sorted(set(COLUMNS) - {"HEALTH", "SURFACE", "CORRECTIONS"}))
def test_journal_gives_the_rows_that_the_coordinator_held(name):
    """To the last character: at the run's end, and at the instant of its first epoch."""
    watch, stored = watch_journal(recorded()), entries()
    first = next(entry.ticks for entry in stored if isinstance(entry, EpochSolution) and entry.answer)
    for at in (None, first / TICKS_PER_DAY):
        held = Samplers()
        for entry in stored:
            held.add(entry)
        rows = held.last(name, 4096)
        if at is not None:
            rows = [row for row in rows if float(row[0]) <= at]
        expected = rows_object(name, rows[-300:])
        assert asyncio.run(watch.sampler(name.lower(), 300, at)) == expected
    assert rows or name in ("MOVES", "POSE", "BEAM", "FOCUS")  # the run ends at its reference epoch


def test_journal_gives_the_corrections_with_their_zero_moves_and_switch(tmp_path):
    """Six epochs: the third begins another zero, the fifth was not given, and a move came before the fourth."""
    with JournalReader(recorded()) as reader:
        solved = next(e for e in entries() if isinstance(e, EpochSolution) and e.answer)
        a_run = Run(reader.site(1), reader.run().settings)
        start = reader.run().started
    pose = {"offset": [1e-6, 2e-6, 3e-4], "covariance": (1e-12 * np.eye(3)).tolist(), "dish": None, "feed": None}
    written, step = [], 100_000
    for k in range(1, 7):
        reference = 0 if k < 2 else 2 if k < 4 else 3
        answer = solved.answer | {"number": k, "reference": reference, "pose": pose if k > 2 else None, "doubts": []}
        ticks = start + k * step
        if k == 4:
            written.append(Happening(ticks - 10, "anna", MOVED, "moved", details={"actuator": "focus"}))
        if k in (5, 6):
            switch = {"corrections": "off" if k == 5 else "on"}
            written.append(Happening(ticks - 10, "parameters", PARAMETERS_ACTIVE, "set", "debug", switch))
        written.append(EpochSolution(ticks, answer))
        written.append(LivePosture(ticks + 1, 1.0, 0.5, 0.0, 0.0))
    path = tmp_path / "corrected.db"
    with Journal.open(path, run=a_run, clock=ManualClock(start / TICKS_PER_DAY)) as journal:
        for entry in written:
            journal.append(entry)
        journal.append().result(30.0)
    given = {"on": True}
    output, rows = CorrectionOutput(lambda: given["on"]), []
    for entry in written:
        if isinstance(entry, Happening) and entry.kind == PARAMETERS_ACTIVE:
            given["on"] = entry.details["corrections"] == "on"
        row = output.row(entry)
        rows += [] if row is None else [row]
    watch, held = watch_journal(path), Samplers()
    for entry in written:
        held.add(entry)
    for name in ("BEAM", "FOCUS", "MOVES"):
        assert asyncio.run(watch.sampler(name, 10)) == rows_object(name, held.last(name, 10))
    assert len(held.last("BEAM", 10)) == 4
    every = asyncio.run(watch.sampler("CORRECTIONS", 10))
    assert every == rows_object("CORRECTIONS", rows)
    assert every["columns"]["state"] == ["unknown", "unknown", "given", "given", "off", "given"]
    assert every["columns"]["reference"] == [None, 2.0, 2.0, 3.0, 3.0, 3.0]
    assert every["columns"]["moves"] == [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]
    for k in range(1, 7):  # the zero is known however few are asked for
        at = (start + k * step + 5) / TICKS_PER_DAY
        assert asyncio.run(watch.sampler("CORRECTIONS", 1, at)) == rows_object("CORRECTIONS", rows[k - 1 : k])


def test_journal_gives_the_surface_of_epochs_with_enough_prisms():
    assert asyncio.run(watch_journal(recorded()).sampler("SURFACE", 5))["mjd"] == []  # five prisms


@pytest.mark.parametrize(
    ("name", "limit", "message"),
    [("HEALTH", 1, "not in a journal"), ("GOSSIP", 1, "not a sampler"), ("POSE", 0, "1 to 4096")],
)
def test_journal_refuses_what_it_cannot_give(name, limit, message):
    with pytest.raises(InputError, match=message):
        asyncio.run(watch_journal(recorded()).sampler(name, limit))
