"""The coordinator's loop on real servers with scripted heads and stub parts."""

import asyncio
from dataclasses import dataclass

import pytest

from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution, SentCommand
from catseye.errors import EstimationError, InputError
from catseye.records.night.live import Happening, LivePosture, LiveShot, LiveWeather
from coordinator.link_scene import COMMANDS, MemoryJournal, run, until
from coordinator.ziy_scene import ListLive, ListPlanner, Site, posture, weather


def of(rows, kind):
    return [row for row in rows if isinstance(row, kind)]


def test_rounds_are_measured_reduced_journalled_and_acknowledged():
    async def story():
        async with Site() as site:
            await until(lambda: site.live.epochs >= 3)
            shots = of(site.journal.rows, AnsweredShot)
            assert [s.shot.number for s in shots] == list(range(1, len(shots) + 1))
            assert {(s.shot.ranger, s.shot.target) for s in shots} == {
                (r, t) for r in site.names for t in ("ZRG", "ZG11", "ZG12")
            }
            assert all(s.shot.samples is not None for s in shots)
            assert all(s.status == ("reference" if s.shot.target == "ZRG" else "used") for s in shots)
            solutions = of(site.journal.rows, EpochSolution)
            assert [s.answer["number"] for s in solutions][:3] == [1, 2, 3]
            used = [n for s in solutions for n in s.answer["used"]]
            assert used == list(range(1, len(used) + 1))  # each shot in one epoch, and in order
            assert site.ziy.intake.acknowledged == site.ziy.intake.numbered
            assert site.published == site.journal.rows
            assert site.planner.states[-1].since_reference["ZY101"] < 10.0
            assert set(site.planner.states[-1].counts) == set(site.names)

    run(story)


def test_ranges_of_an_epoch_stand_behind_its_solution():
    """Stored as a document of their own; an unknown number is null, and the answer has none of it."""
    from catseye.coordinator.journal.entries import Document, ranges_document
    from coordinator.ziy_scene import Answer

    class Ranged(ListLive):
        def solve(self, ticks):
            answer = super().solve(ticks)
            object.__setattr__(answer, "ranges", {"shot": [1, 2], "w": [0.5, float("nan")]})
            return answer

    async def story():
        async with Site(live=Ranged()) as site:
            await until(lambda: site.live.epochs >= 2)
            await until(lambda: any(isinstance(e, EpochSolution) for e in site.published))
            rows = site.journal.rows
            at = next(k for k, row in enumerate(rows) if isinstance(row, EpochSolution))
            assert isinstance(rows[at + 1], Document)
            assert (rows[at + 1].name, rows[at + 1].text) == ("epoch-ranges", '{"shot": [1, 2], "w": [0.5, null]}')
            assert "ranges" not in rows[at].answer
            assert ranges_document(1, Answer(1, 1)) is None

    run(story)


def test_journal_order_is_the_order_of_the_reductions_input():
    async def story():
        async with Site() as site:
            for _ in range(40):
                site.ziy.intake.take(weather())
                await asyncio.sleep(0.13)
            site.ziy.intake.flush()
            fed = [(type(x), x.ticks) for x in site.live.fed]
            rows = [r.shot if isinstance(r, AnsweredShot) else r for r in site.journal.rows]
            kept = [(type(x), x.ticks) for x in rows if isinstance(x, LiveShot | LiveWeather | LivePosture)]
            assert fed == kept
            assert {kind for kind, _ in fed} == {LiveShot, LiveWeather, LivePosture}

    run(story)


def test_commands_are_journalled_with_their_replies():
    async def story():
        async with Site() as site:
            await until(lambda: site.live.epochs >= 2)
            await site.served["ZY102"].stop()  # what is under way there has no reply
            await until(lambda: any(c.ok is None for c in of(site.journal.rows, SentCommand)))
            told = of(site.journal.rows, SentCommand)
        for ranger in site.names:
            mine = [c for c in told if c.ranger == ranger]
            words = [c.line.rpartition("\t")[2].split()[0] for c in mine]
            assert {request.command for request in COMMANDS} <= set(words)  # what it was initialised with
            shots = [s for s in of(site.journal.rows, AnsweredShot) if s.shot.ranger == ranger]
            assert words.count("CMEAS") >= len(shots) > 3
            assert len({c.tid for c in mine}) == len(mine)
            assert not {"VER", "BUF"} & set(words)  # asking is not commanding
        assert [c.ranger for c in told if c.ok is None] == ["ZY102"]
        assert all(len(c.reply) <= 200 for c in told)
        lit = [c for c in told if c.line.endswith("\tPS 1")]
        assert {(c.reply.partition(",")[0], c.ok) for c in lit} == {("1", True)}

    run(story)


def test_cancellation_switches_lasers_off_and_closes_the_journal_within_five_seconds():
    async def story():
        async with Site(ready=False) as site:
            for served in site.served.values():
                served.head.switch_laser(False)
            await until(lambda: all(link.state == "ready" for link in site.ziy.links.values()))
            for served in site.served.values():
                served.light()
            await until(lambda: site.live.shots)
            assert all(served.head.laser_on() for served in site.served.values())
            began = asyncio.get_running_loop().time()
            await site.end()
            assert asyncio.get_running_loop().time() - began < 5.0
            await asyncio.sleep(0.1)
            assert not any(served.head.laser_on() for served in site.served.values())
            assert not any(served.server.connections for served in site.served.values())
            assert site.journal.closed
            assert site.kinds()[-1] == "stopped"
            left = {task.get_coro().__qualname__.split(".")[0] for task in asyncio.all_tasks()}
            assert not left & {"Coordinator", "RangerLink", "FeedClient", "play"}

    run(story)


def test_new_coordinator_measures_within_five_seconds():
    async def story():
        async with Site() as site:
            await until(lambda: site.live.epochs)
            await site.end()
            site.journal, site.live = MemoryJournal(), ListLive()
            began = asyncio.get_running_loop().time()
            site.begin()
            await until(lambda: of(site.journal.rows, AnsweredShot))
            assert asyncio.get_running_loop().time() - began < 5.0
            assert of(site.journal.rows, AnsweredShot)[0].shot.number == 1
            assert not any("made ready" in h.text for h in of(site.journal.rows, Happening))

    run(story)


def test_dead_ranger_delays_no_other_and_comes_back():
    async def story():
        async with Site() as site:
            await until(lambda: site.live.epochs)
            await site.served["ZY102"].stop()
            rounds = site.ziy.round_number
            began = asyncio.get_running_loop().time()
            await until(lambda: site.ziy.round_number >= rounds + 5)
            assert asyncio.get_running_loop().time() - began < 5 * (site.planner.period + 1.0) + 1.0
            assert site.planner.states[-1].ready == ("ZY101",)
            await site.served["ZY102"].start()
            site.served["ZY102"].light()
            await until(lambda: "ZY102" in site.planner.states[-1].ready)

    run(story)


def test_failing_journal_suspends_measuring_until_it_recovers():
    async def story():
        async with Site() as site:
            await until(lambda: site.live.epochs)
            site.journal.broken = "disk is full"
            await asyncio.sleep(2.0)  # shots under way come to their end
            fed, acknowledged = len(site.live.fed), site.ziy.intake.acknowledged
            published = len(site.published)
            fired = {name: s.head.inner.fired for name, s in site.served.items()}
            await asyncio.sleep(30.0)
            assert len(site.live.fed) == fed
            assert site.ziy.intake.acknowledged == acknowledged
            assert len(site.published) == published
            assert {name: s.head.inner.fired for name, s in site.served.items()} == fired
            site.journal.mend()
            epochs = site.live.epochs
            await until(lambda: site.live.epochs >= epochs + 2, 20.0)
            assert site.ziy.intake.acknowledged == site.ziy.intake.numbered
            assert {"journal-away", "journal-away-over"} <= set(site.kinds())
            rows = [r.shot.number for r in site.journal.rows if isinstance(r, AnsweredShot)]
            assert rows == sorted(set(rows)) == list(range(1, rows[-1] + 1))  # none lost, none twice
            assert sorted(map(id, site.published)) == sorted(map(id, site.journal.rows))

    run(story)


def test_full_journal_loses_nothing():
    async def story():
        async with Site() as site:
            await until(lambda: site.live.epochs)
            append, refusals = site.journal.append, []

            def refuse(*items):
                refusals.append(items)
                raise InputError("20000 rows wait")

            site.journal.append = refuse
            await asyncio.sleep(8.0)
            assert refusals
            site.journal.append = append
            await until(lambda: site.ziy.intake.trouble is None)
            await until(lambda: site.ziy.intake.acknowledged == site.ziy.intake.numbered)
            shots = [r.shot.number for r in site.journal.rows if isinstance(r, AnsweredShot)]
            assert shots == list(range(1, site.ziy.intake.numbered + 1))

    run(story)


def test_without_a_posture_tracking_stops_and_fixed_targets_continue(monkeypatch):
    async def story():
        async with Site(planner=ListPlanner(fixed=False)) as site:
            await until(lambda: {s.target for s in site.live.shots} == {"ZRG", "ZG11", "ZG12"})
            monkeypatch.setattr(type(site.ziy), "telescope_known", property(lambda self: False))
            await asyncio.sleep(5.0)
            count = len(site.live.shots)
            await asyncio.sleep(15.0)
            assert {s.target for s in site.live.shots[count:]} == {"ZRG"}

    run(story)


def test_no_round_is_planned_before_the_posture_is_known():
    async def story():
        async with Site(feed=None) as site:
            await asyncio.sleep(5.0)
            assert not site.planner.states
            site.ziy._posed(posture())
            await until(lambda: site.planner.states)

    run(story)


def test_postures_are_thinned_to_ten_a_second():
    async def story():
        async with Site(feed=None, mode="hold", ready=False) as site:
            for _ in range(100):
                site.ziy._posed(posture())
                await asyncio.sleep(0.01)
            assert 9 <= len(of(site.live.fed, LivePosture)) <= 11

    run(story)


def test_hold_suspends_shots_and_active_resumes():
    async def story():
        async with Site() as site:
            await until(lambda: site.live.shots)
            site.ziy.set_mode("hold")
            await asyncio.sleep(2.0)
            count, asked = len(site.live.shots), len(site.guard.asked)
            await asyncio.sleep(10.0)
            assert len(site.live.shots) == count
            assert len(site.guard.asked) == asked
            site.ziy.set_mode("active")
            await until(lambda: len(site.live.shots) > count + 3)

    run(story)


def test_passive_coordinator_uses_other_clients_shots_and_changes_nothing():
    async def story():
        async with Site() as site:
            passive = Site(mode="passive", ready=False)
            passive.served = site.served
            passive.begin()
            await until(lambda: passive.live.epochs >= 2)
            assert not [r for r in passive.guard.asked if r.command not in {"SUN"}]
            assert {s.target for s in passive.live.shots} == {"ZRG", "ZG11", "ZG12"}
            stamps = {(s.ranger, s.ticks): s for s in site.live.shots}
            for shot in passive.live.shots:
                assert shot.samples is None
                assert shot.phase == pytest.approx(stamps[shot.ranger, shot.ticks].phase, abs=1e-7)
            await passive.end()

    run(story)


def test_dropped_ranger_is_excluded_until_taken():
    async def story():
        async with Site() as site:
            await until(lambda: site.live.epochs)
            site.ziy.drop("ZY101")
            await asyncio.sleep(3.0)
            count, commands = len(site.live.shots), len(of(site.journal.rows, SentCommand))
            await asyncio.sleep(10.0)
            assert {s.ranger for s in site.live.shots[count:]} == {"ZY102"}
            assert site.ziy.links["ZY101"].connected
            assert site.served["ZY101"].ranger.lease is None  # left alone: whoever wants it has it
            sent = [c for c in of(site.journal.rows, SentCommand)[commands:] if c.ranger == "ZY101"]
            assert {c.line.split("\t")[-1] for c in sent if "VER" not in c.line and "LEASE" not in c.line} <= {"PS 0"}
            site.ziy.take("ZY101")
            await until(lambda: site.live.shots[-1].ranger == "ZY101")
            with pytest.raises(InputError, match="ZY999"):
                site.ziy.drop("ZY999")

    run(story)


def test_streams_measure_one_target_repeatedly():
    async def story():
        async with Site() as site:
            for name in site.names:
                site.ziy.stream(name, "ZG11")
            await asyncio.sleep(5.0)
            count = len(site.live.shots)
            await asyncio.sleep(20.0)
            for name in site.names:
                ticks = [s.ticks for s in site.live.shots[count:] if s.ranger == name]
                rate = (len(ticks) - 1) / ((ticks[-1] - ticks[0]) * 864e-6)  # by their stamps: a count has steps
                assert 7.4 < rate <= 7.82  # 128 ms, and a gap of some ms; after 20 buffers it is begun anew
            assert {s.target for s in site.live.shots[count:]} == {"ZG11"}
            site.ziy.stream("ZY101", None)
            await until(lambda: site.live.shots[-1].target == "ZRG")
            with pytest.raises(InputError, match="NOWHERE"):
                site.ziy.stream("ZY101", "NOWHERE")

    run(story)


def test_repeatedly_blocked_line_is_suspended_and_retried():
    async def story():
        async with Site(("ZY101",), live=ListLive(ZG12="blocked")) as site:
            line = ("ZY101", "ZG12")
            await until(lambda: site.planner.states and line in site.planner.states[-1].suspended)
            blocked = [s for s in site.live.shots if s.target == "ZG12"]
            assert len(blocked) == 3
            assert "line-suspended" in site.kinds()
            del site.live.verdicts["ZG12"]
            await until(lambda: line not in site.planner.states[-1].suspended)
            await until(lambda: site.live.shots[-1].target == "ZG12")

    run(story)


def test_repeatedly_failing_ranger_is_suspended_and_retried():
    async def story():
        async with Site() as site:
            bad = site.ziy.links["ZY101"]
            await until(lambda: site.live.epochs)
            head = site.served["ZY101"].head.inner
            head.start = lambda *_, **__: False
            await until(lambda: "ranger-suspended" in site.kinds())
            begun = len(site.planner.states)
            await asyncio.sleep(8.0)
            assert len(site.planner.states) > begun
            assert all("ZY101" not in state.ready for state in site.planner.states[begun:])
            del head.start
            shots = bad.shots
            await until(lambda: bad.shots > shots + 3, 300.0)

    run(story)


def test_shot_with_an_earlier_stamp_is_rejected():
    async def story():
        async with Site(("ZY101",)) as site:
            await until(lambda: site.live.epochs)
            site.served["ZY101"].head.offset = -0.05
            last = site.live.shots[-1]
            numbered = site.ziy.intake.numbered
            site.ziy.intake.take(last)
            site.ziy.intake.flush()
            assert site.ziy.intake.numbered == numbered
            assert "stamp-not-later" in site.kinds()

    run(story)


def test_errors_of_planner_or_reduction_are_logged_and_the_coordinator_continues():
    async def story():
        async with Site() as site:
            await until(lambda: site.live.epochs)
            right = site.planner.round, site.live.accept

            def cannot(*_):
                raise EstimationError("singular")

            site.live.accept, site.live.failed = lambda job, found: None, "singular"
            await until(lambda: "not-solved" in site.kinds())
            site.planner.round = cannot
            await until(lambda: "not-planned" in site.kinds())
            site.planner.round, site.live.accept = right
            epochs = site.live.epochs
            await until(lambda: site.live.epochs > epochs)

    run(story)


def test_bug_in_a_part_ends_the_coordinator_cleanly():
    async def story():
        async with Site(ready=False) as site:

            def broken(state):
                raise ZeroDivisionError("a mistake in the planner")

            site.planner.round = broken
            with pytest.raises(ZeroDivisionError):
                await asyncio.wait_for(asyncio.shield(site.task), 30.0)
            assert site.journal.closed
            assert not any(link.connected for link in site.ziy.links.values())

    run(story)


def test_bug_in_a_rangers_task_ends_the_coordinator():
    async def story():
        async with Site() as site:
            site.live.place = lambda name, mjd: {}[name]
            site.ziy.stream("ZY101", "ZG11")
            with pytest.raises(KeyError):
                await asyncio.wait_for(asyncio.shield(site.task), 30.0)
            assert site.journal.closed

    run(story)


def test_rounds_without_possible_shots_are_paced():
    async def story():
        for targets, known in (((), True), (("ZG11",), False)):
            async with Site(("ZY101",), planner=ListPlanner(targets=targets, fixed=False)) as site:
                site.ziy.firing._telescope_known = lambda known=known: known
                await asyncio.sleep(2.0)
                begun = len(site.planner.states)
                await asyncio.sleep(10.0)
                assert 30 <= len(site.planner.states) - begun <= 41  # once in 0.25 s

    run(story)


def test_sun_vector_is_sent_every_few_seconds():
    async def story():
        async with Site(("ZY101",)) as site:
            await asyncio.sleep(12.0)
            assert site.served["ZY101"].ranger.sun_vector == (0.0, 0.0, 1.0)
            assert sum(r.command == "SUN" for r in site.guard.asked) >= 2

    run(story)


def test_beam_approached_by_the_sun_is_parked_or_its_laser_switched_off():
    @dataclass(frozen=True)
    class Alarm:
        ranger: str
        within: float
        remedy: str
        cause: str = "sun"
        text: str = "the Sun comes"

    async def story():
        async with Site(("ZY101", "ZY102"), planner=ListPlanner(targets=())) as site:
            head, other = (site.served[name].head for name in site.names)
            site.guard.alarms = [Alarm("ZY101", 500.0, "move"), Alarm("ZY102", 500.0, "dark")]
            await asyncio.sleep(5.0)
            assert (head.actual(0), head.laser_on(), other.laser_on()) == (0, True, True)  # there is time
            site.guard.alarms = [Alarm("ZY101", 30.0, "move")]
            await until(lambda: head.actual(0) == -900)  # ZRG
            assert head.laser_on()
            site.guard.refused = ("CIL",)
            await until(lambda: not head.laser_on(), 10.0)
            site.guard.alarms, site.guard.refused = [Alarm("ZY102", 1.0, "dark")], ("CIL", "PS")
            await asyncio.sleep(6.0)
            assert other.laser_on()  # also this passes the guard, which here refuses
            site.guard.refused = ()
            await until(lambda: not other.laser_on(), 10.0)
            site.guard.alarms = []
            await until(lambda: head.laser_on() and other.laser_on(), 10.0)
            assert "sun-comes" in site.kinds()

    run(story)


def test_streams_without_rounds_continue_with_an_epoch_each_ten_seconds():
    """Buffers of 0.128 s, twenty a pointing, and less than half a buffer lost with each: 2 %."""

    async def story():
        async with Site(("ZY101",)) as site:
            site.ziy.stream("ZY101", "ZG11")
            await until(lambda: site.served["ZY101"].ranger.stream is not None)
            before, epochs = len(site.live.shots), site.live.epochs
            await asyncio.sleep(30.0)
            assert len(site.live.shots) - before >= 0.98 * 30.0 / 0.128
            assert 2 <= site.live.epochs - epochs <= 4

    run(story)


def test_guard_receives_replies_and_postures():
    async def story():
        async with Site(("ZY101",)) as site:
            await until(lambda: site.live.epochs)
            commands = {reply.command for _, reply in site.guard.replies}
            assert {"ACP", "CIL", "CMEAS", "FHM", "STW"} <= commands
            assert site.guard.posture.elevation == pytest.approx(0.5235987756)

    run(story)


def test_failures_of_another_target_do_not_reset_a_line():
    async def story():
        async with Site(("ZY101",), live=ListLive(ZG11="blocked", ZG12="used")) as site:
            states = site.planner.states
            await until(lambda: states and ("ZY101", "ZG11") in states[-1].suspended)
            assert ("ZY101", "ZG12") not in site.planner.states[-1].suspended

    run(story)
