"""Present values of a site's parameters, and their activation between two rounds."""

from collections.abc import Callable
from dataclasses import replace
from typing import cast

from catseye.coordinator.control import interlocks, texts
from catseye.coordinator.control.interlocks import SetInterlock
from catseye.coordinator.control.parameters import ClientParameter, Values
from catseye.coordinator.control.registry import ROWS, number_text
from catseye.coordinator.guard.guard import SafetyGuard
from catseye.coordinator.modes import mode_of
from catseye.coordinator.parts import ticks_now
from catseye.coordinator.plan.round import RoundPlanner
from catseye.coordinator.ziy import Coordinator
from catseye.errors import InputError
from catseye.ranger.head import SamplingSettings
from catseye.records.site.keep_out import KeepOutBox, SunCone
from catseye.reduction.live.changes import LiveChange, MotionModel
from catseye.reduction.live.live import Live

OF_THE_ANSWERS = tuple(name for name, row in ROWS.items() if row.changes == "answers")


class SiteControl:
    """Parameters of planner, rangers, reduction, safety and output.

    The values of free texts are kept as they were set; all others are read where they act.
    """

    def __init__(self, ziy: Coordinator, *, planner: RoundPlanner, guard: SafetyGuard, live: Live):
        self._ziy, self._planner, self._guard, self._live = ziy, planner, guard, live
        self._recorded = guard.keep_clear.keep_out
        self._sampling = SamplingSettings()
        self._texts = {"scan_list": "all", "priorities": "none", "target_positions": "none", "keep_out_more": "none"}
        ground = {n: v for n, v in planner.vantages.items() if v.frame == "ground"}
        self._stands = {name: v.station.scan_point for name, v in ground.items()}
        self.parameters = tuple(
            ClientParameter(ROWS[name], moment, self._checks().get(name, lambda text: text))
            for name, moment in self._values().items()
        )

    def _values(self) -> dict[str, Callable[[], str]]:
        def setting(name: str) -> Callable[[], str]:
            return lambda: number_text(getattr(self._planner.settings, name))

        def rule(name: str) -> Callable[[], str]:
            return lambda: number_text(getattr(self._live.settings.reduction, name))

        def text(name: str) -> Callable[[], str]:
            return lambda: self._texts[name]

        return {
            "round_s": setting("period"),
            "rate_hz": lambda: number_text(float(f"{1.0 / self._planner.settings.interval:.9g}")),
            "reference_every_s": setting("reference_every"),
            "benchmark_every_s": setting("benchmark_every"),
            "dish_share": setting("dish_share"),
            "scan_list": text("scan_list"),
            "priorities": text("priorities"),
            "cycles": lambda: str(self._sampling.cycles),
            "samples_per_cycle": lambda: str(self._sampling.samples),
            "if_hz": lambda: str(self._sampling.frequency_hz),
            "filter": lambda: self._live.settings.filter,
            "air_model": lambda: self._live.settings.reduction.air_model,
            "rejection_w": rule("critical"),
            "smallest_return": rule("smallest_return"),
            "target_positions": text("target_positions"),
            "sun_cone_deg": lambda: number_text(self._guard.keep_clear.keep_out.sun.half_angle_deg),
            "keep_out_more": text("keep_out_more"),
            "corrections": lambda: "on" if self._ziy.gives_corrections else "off",
        }

    def _checks(self) -> dict[str, Callable[[str], str]]:
        targets = self._planner.retros

        def listed(text: str) -> str:
            return "all" if texts.scan_list(text, targets) is None else " ".join(text.upper().split())

        def ranked(text: str) -> str:
            texts.priorities(text, targets)
            return "none" if text.lower() == "none" else texts.joined_pairs(text.upper())

        def placed(text: str) -> str:
            return texts.positions_text(texts.positions_mm(text, self._ziy.site.targets))

        def boxed(text: str) -> str:
            self._boxes(text)
            return "none" if text.lower() == "none" else text

        return {"scan_list": listed, "priorities": ranked, "target_positions": placed, "keep_out_more": boxed}

    def _boxes(self, text: str) -> tuple[KeepOutBox, ...]:
        return texts.boxes(text, [box.name for box in self._recorded.box], self._stands)

    def refuse(self, values: Values) -> None:
        """Raise InputError for values that do not fit together, or to the site's state; it names value and limit."""
        for interlock in self.interlocks():
            interlock.refuse(values)

    def interlocks(self) -> tuple[SetInterlock, ...]:
        """Checks of a set, in their order, with the present limits."""
        count, settle = len(self._ziy.links), self._planner.settings.settle
        cone = self._recorded.sun.half_angle_deg
        return (
            SetInterlock(
                ("mode", "dropped"),
                "active mode has a ranger that is not dropped",
                lambda values: interlocks.refuse_all_dropped(values, count),
            ),
            SetInterlock(
                interlocks.OF_SAMPLING,
                "a buffer is within a ranger's limits of length and rate",
                interlocks.refuse_sampling,
            ),
            SetInterlock(
                ("round_s", *interlocks.OF_SAMPLING),
                f"a round holds {interlocks.SHOTS_A_ROUND} shots with {settle:g} s to settle before each",
                lambda values: interlocks.refuse_short_round(values, settle=settle),
            ),
            SetInterlock(("rate_hz", "round_s"), "a round has a shot of each ranger", interlocks.refuse_low_rate),
            SetInterlock(
                (*interlocks.STANDARDS, "round_s"),
                "ZRG and benchmarks are wanted once a round at most",
                interlocks.refuse_frequent_standards,
            ),
            SetInterlock(
                ("mode", *interlocks.OF_SAMPLING),
                "passive mode keeps the sampling: another client commands the rangers",
                lambda values: interlocks.refuse_while_passive(values, self._sampling),
            ),
            SetInterlock(
                ("sun_cone_deg",),
                f"the Sun's cone is the record's {cone:g} deg or more",
                lambda values: interlocks.refuse_smaller_cone(values, cone),
            ),
            SetInterlock(OF_THE_ANSWERS, "a change of answers can be journalled", self._refuse_unjournalled),
        )

    def _refuse_unjournalled(self, values: Values) -> None:
        """Raise InputError for a change of answers while the journal fails."""
        changed = [p.row.name for p in self.parameters if p.row.changes == "answers" and values[p.row.name] != p.now()]
        if changed and self._ziy.intake.trouble is not None:
            raise InputError(f"{changed[0]} changes answers and cannot be journalled: {self._ziy.intake.trouble}")

    def adopt(self, values: Values) -> None:
        """Activate values that `refuse` has not refused; between two rounds."""
        moment = {p.row.name: p.now() for p in self.parameters} | dict(values)
        self._change_answers(values)
        self._sampling = interlocks.sampling_of_values(moment)
        sampled = any(name in values for name in interlocks.OF_SAMPLING)
        for link in self._ziy.links.values():
            link.wanted_sampling = self._sampling if sampled else link.wanted_sampling
        self._planner.settings = replace(
            self._planner.settings,
            period=float(moment["round_s"]),
            interval=1.0 / float(moment["rate_hz"]),
            reference_every=float(moment["reference_every_s"]),
            benchmark_every=float(moment["benchmark_every_s"]),
            dish_share=float(moment["dish_share"]),
            duration=self._sampling.duration,
        )
        self._planner.scan_list = texts.scan_list(moment["scan_list"], self._planner.retros)
        self._planner.priorities = texts.priorities(moment["priorities"], self._planner.retros)
        if "sun_cone_deg" in values or "keep_out_more" in values:
            sun = SunCone(half_angle_deg=float(moment["sun_cone_deg"]), horizon_deg=self._recorded.sun.horizon_deg)
            box = (*self._recorded.box, *self._boxes(moment["keep_out_more"]))
            self._guard.adopt(self._recorded.model_copy(update={"sun": sun, "box": box}))
        self._ziy.gives_corrections = moment["corrections"] == "on"
        self._texts = {name: moment[name] for name in self._texts}

    def _change_answers(self, values: Values) -> None:
        """Change the reduction, journalled at this place."""
        of = {name: values[name] for name in OF_THE_ANSWERS if name in values}
        if not of:
            return
        positions = of.get("target_positions")
        change = LiveChange(
            filter=cast(MotionModel | None, of.get("filter")),
            air_model=of.get("air_model"),
            critical=None if "rejection_w" not in of else float(of["rejection_w"]),
            smallest_return=None if "smallest_return" not in of else float(of["smallest_return"]),
            positions_mm=None if positions is None else texts.positions_mm(positions, self._ziy.site.targets),
        )
        self._ziy.intake.change(ticks_now(self._ziy.clock), change)


def coordinator_parameters(z: Coordinator) -> tuple[ClientParameter, ...]:
    """Parameters of the coordinator itself, active at once."""

    def dropped(text: str) -> str:
        names = [] if text.lower() == "none" else text.upper().split()
        strange = [name for name in names if name not in z.links]
        if strange:
            raise InputError(f"{strange[0][:20]!a} is not a ranger here (expected names with blanks between, or none)")
        return " ".join(sorted(set(names))) or "none"

    def drop(text: str) -> None:
        names = set() if text == "none" else set(text.split())
        for name in z.links:
            if (name in z.firing.dropped) != (name in names):
                (z.drop if name in names else z.take)(name)

    def now_dropped() -> str:
        return " ".join(sorted(z.firing.dropped)) or "none"

    return (
        ClientParameter(
            ROWS["mode"], lambda: z.mode, lambda text: mode_of(text), lambda text: z.set_mode(mode_of(text))
        ),
        ClientParameter(ROWS["dropped"], now_dropped, dropped, drop),
    )
