"""Detection of faults in parts: misfits, weak returns, rejected weather, busy rangers."""

import asyncio

from catseye.reduction.epoch.reason import Reason, ShotStatus
from catseye.reduction.live.live import Live
from coordinator.link_scene import Linked, planned, run, until
from coordinator.ziy_scene import Answer, ListLive, Site, weather
from live_scene import begun

FEW = ("ZY101", "ZY103", "ZY105", "ZY107", "ZY109", "ZY111", "ZY115")


class Misfit(ListLive):
    """Every epoch finds the ranges to one target wrong."""

    def solve(self, ticks):
        wrong = {s.number for s in self.shots if s.target == "ZG12"}
        self.epochs += 1
        used = tuple(n for n in self.pending if n not in wrong)
        rejected = {n: Reason(ShotStatus.REFLECTED, "range +31.000 mm off, w 99.0") for n in self.pending if n in wrong}
        self.pending = []
        return Answer(self.epochs, ticks, used=used, rejected=rejected)


def told(site, kind):
    return [row for row in site.journal.rows if getattr(row, "kind", "") == kind]


def test_line_with_wrong_ranges_is_reported_and_suspended():
    async def story():
        async with Site(live=Misfit()) as scene:
            await until(lambda: told(scene, "line-suspended"))
            first = told(scene, "wrong-range")[0]
            assert (first.details["ranger"], first.details["target"]) in {("ZY101", "ZG12"), ("ZY102", "ZG12")}
            assert "+31.000 mm" in first.text
            assert all(row.details["target"] == "ZG12" for row in told(scene, "wrong-range"))
            await until(lambda: scene.planner.states[-1].suspended)
            assert {target for _, target in scene.planner.states[-1].suspended} == {"ZG12"}
            assert not scene.ziy.firing._unfitted or max(scene.ziy.firing._unfitted) > scene.ziy.intake.numbered - 20

    run(story)


def test_weak_return_is_logged_though_used():
    async def story():
        async with Site() as scene:
            await until(lambda: len(scene.live.shots) > 20)
            assert not told(scene, "weak-return")
            signals = scene.served["ZY101"].head.inner.signals
            ranger = scene.served["ZY101"].ranger
            faint = round(ranger.cubes.counts(ranger.cubes.find("ZG12"))[0])
            signals[faint] = (0.05 * signals[faint][0], signals[faint][1])
            await until(lambda: told(scene, "weak-return"))
            assert told(scene, "weak-return")[0].details["ranger"] == "ZY101"
            assert "5 % of usual" in told(scene, "weak-return")[0].text

    run(story)


def test_rejected_station_is_logged_until_accepted_again():
    class Doubting(ListLive):
        doubt = ""

        def weather(self, read):
            super().weather(read)
            return self.doubt

    async def story():
        async with Site(live=Doubting(), mode="hold", ready=False) as scene:
            for doubt in ("", "WX1 reads 30 C", "WX1 reads 30 C", "", ""):
                scene.live.doubt = doubt
                scene.ziy.intake.take(weather())
                await asyncio.sleep(0.1)
            said = [row for row in scene.journal.rows if getattr(row, "who", "") == "WX1"]
            assert [row.kind for row in said] == ["weather-doubted", "weather-doubted-over"]
            assert said[0].text == "WX1 reads 30 C"

    run(story)


def test_busy_ranger_is_probed_for_its_clock():
    async def story():
        async with Linked(head={"name": "ZY101"}) as (served, link):
            served.head.rate = 1e-3
            begin = asyncio.get_running_loop().time()
            while asyncio.get_running_loop().time() - begin < 12.0:
                await link.fire(planned("ZG11", ahead=0.0))
            assert served.kinds().count("clock-off") >= 1
            assert abs(served.head.offset) < 6e-3  # set every 2 s and when it is 2 ms off: never far

    run(story)


def test_first_epoch_works_without_a_silent_ranger():
    night, live = begun(seed=5)
    night.round(0, rangers=FEW, without=("ZY103",)).into(live)
    answer = live.solve(night.ticks(0))
    assert answer is not None, live.failed
    assert "ZY103" in answer.names


def test_late_station_is_used_once_received():
    night, _ = begun(seed=5, faults=("silent-station WX1 0 15",))
    live = Live(night.world.site)
    for k in range(3):
        night.round(k, rangers=FEW).into(live)
        assert live.solve(night.ticks(k)) is not None, live.failed
    assert {"the air WX1", "the air WX2"} <= set(live.state.names)
