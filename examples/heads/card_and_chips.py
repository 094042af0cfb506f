"""A real head: an A/D card, two LM628 motion chips, a clock card and switches behind `ranger.head.RangerHead`.

Fill in the drivers below and serve it:

    head = CardAndChips(card, (port_of_azimuth, port_of_elevation), clock, panel)
    asyncio.run(ZyServer(Ranger("ZY101", head, limits=(-21_309, 75_691))).serve())

Nothing here waits. A search for the index and a track go on each time that the server looks at the head, some hundred
times a second; between two looks the chips do their part alone. `catseye help heads` says what every call promises.
"""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from lm628 import EXCESSIVE_ERROR, MOTOR_OFF, ON_TARGET, SEEKS_INDEX, Lm628, Port
from numpy.typing import ArrayLike, NDArray

from catseye.geometry.sky.time_tag import TimeTag
from catseye.ranger.head import Buffer, Homing, SamplingSettings
from catseye.ranger.motion_units import acceleration_integer, velocity_integer

FILTER = (356, 465, 4355, 4096, 3)  # yours will differ: `catseye help studies/servo` says how to find them
ERROR_LIMIT = 5_000  # counts
PACE = velocity_integer(12_000), acceleration_integer(40_000)  # of searches and tracks: counts/s, counts/s^2
TURN = 100_000  # counts
HOMING_TIME = 30.0  # s
SETTLED = 5  # looks in a row at the index to the count
CORRECTION = 8.0  # 1/s: the part of its miss that a track makes good in a second; below 1 over the longest look
NEAR, LEAD = 100.0, 0.2  # counts within which a track is led by speed; s ahead of the line a move to it aims


class Card(Protocol):
    """The A/D card: its trigger is the intermediate frequency's counter."""

    volts_per_code: float

    def begin(self, words: int, rate_hz: float) -> None:
        """Take so many words from the next trigger on, by DMA; what was being taken is given up."""
        ...

    def done(self) -> bool:
        """Whether all words are there."""
        ...

    def read(self) -> ArrayLike:
        """The words, 16 bits with sign."""
        ...


class ClockCard(Protocol):
    """The IRIG-B card."""

    def read(self) -> tuple[int, int]:
        """UTC: Modified Julian Day, nanoseconds of it."""
        ...

    def set(self, day: int, nanoseconds: int) -> None:
        """Set it."""
        ...

    def locked(self) -> bool:
        """Whether it follows its time signal."""
        ...


class Panel(Protocol):
    """Relays and meters."""

    def amplifier(self, axis: int, on: bool) -> None: ...

    def laser(self, on: bool) -> None: ...

    def volts(self) -> dict[str, float]: ...

    def celsius(self) -> float: ...


class CardAndChips:
    """A `RangerHead` of such hardware; see its methods there.

    card    A/D
    ports   of the chips of azimuth and elevation
    clock   UTC
    panel   amplifiers, laser, supplies, thermometer
    """

    def __init__(self, card: Card, ports: Sequence[Port], clock: ClockCard, panel: Panel):
        self._card, self._clock, self._panel = card, clock, panel
        self._chips = [Lm628(port, name) for port, name in zip(ports, ("azimuth", "elevation"), strict=True)]
        self.reset()

    def reset(self) -> None:
        self._taking: tuple[SamplingSettings, TimeTag] | None = None
        self._last: Buffer | None = None
        self._on = [False, False]
        self._homing: list[Homing] = ["never", "never"]
        self._search: list[dict[str, int] | None] = [None, None]
        self._until = [self.now(), self.now()]
        self._track: tuple[tuple[NDArray[np.float64], NDArray[np.float64]], tuple[TimeTag, TimeTag]] | None = None
        for axis, chip in enumerate(self._chips):
            self._panel.amplifier(axis, False)
            chip.reset()
            chip.load_filter(*FILTER)
            chip.stop_on_error(ERROR_LIMIT)
        self.switch_laser(True)

    # Clock ----------------------------------------------------------------------------------------------------------

    def now(self) -> TimeTag:
        day, nanoseconds = self._clock.read()
        return TimeTag(np.asarray(day), np.asarray(nanoseconds))

    def set_clock(self, tag: TimeTag) -> None:
        self._clock.set(int(tag.day), int(tag.nanoseconds))

    def clock_locked(self) -> bool:
        return self._clock.locked()

    # Buffers --------------------------------------------------------------------------------------------------------

    def trigger(self, sampling: SamplingSettings) -> None:
        self._card.begin(sampling.samples * sampling.cycles, sampling.samples * sampling.frequency_hz)
        self._taking, self._last = (sampling, self.now()), None

    def buffer(self) -> Buffer | None:
        self._look()  # a track goes on while the card samples
        if self._taking is not None and self._card.done():
            sampling, begun = self._taking
            codes = np.asarray(self._card.read(), dtype=np.int16)
            self._last, self._taking = Buffer(codes, begun, sampling, self._card.volts_per_code), None
        return self._last

    # Axes -----------------------------------------------------------------------------------------------------------

    def enable(self, axis: int, on: bool) -> None:
        self._panel.amplifier(axis, on)
        self._on[axis] = on

    def enabled(self, axis: int) -> bool:
        return self._on[axis]

    def actual(self, axis: int) -> int:
        self._look()
        return self._chips[axis].actual()

    def desired(self, axis: int) -> int:
        self._look()
        return self._chips[axis].desired()

    def start(self, axis: int, position: int, *, velocity: int, acceleration: int) -> bool:
        if not self._on[axis] or self._homing[axis] == "searching":
            return False
        if self._track is not None:
            self._track = None
            for chip in self._chips:
                chip.stop("abrupt")  # at the speed of a track a mirror stands at once; another acceleration may follow
        return self._chips[axis].move(position, velocity, acceleration)

    def moving(self, axis: int) -> bool:
        self._look()
        return self._track is not None or self._homing[axis] == "searching" or not self._complete(axis)

    def motor_off(self, axis: int) -> bool:
        self._look()
        return self._chips[axis].signals() & (MOTOR_OFF | EXCESSIVE_ERROR) == MOTOR_OFF | EXCESSIVE_ERROR

    def set_filter(self, axis: int, values: tuple[int, int, int, int, int]) -> None:
        self._chips[axis].load_filter(*(values if any(values) else FILTER))  # five zeros: the head's own

    def set_error_limit(self, axis: int, counts: int) -> None:
        self._chips[axis].stop_on_error(counts)

    def stop(self) -> None:
        self._track = None
        for axis, chip in enumerate(self._chips):
            self._search[axis] = None
            if self._homing[axis] == "searching":
                self._homing[axis] = "failed"
            if not self._complete(axis):
                chip.stop("smooth")

    def _complete(self, axis: int) -> bool:
        return bool(self._chips[axis].signals() & (ON_TARGET | MOTOR_OFF))

    def _look(self) -> None:
        """Let searches and the track go on."""
        for axis in (0, 1):
            search = self._search[axis]
            if search is not None:
                self._search_on(axis, search)
        if self._track is not None:
            self._track_on()

    # The search for the index ---------------------------------------------------------------------------------------

    def find_home(self, axis: int) -> None:
        self._track, self._search[axis] = None, None
        self._homing[axis] = "searching" if self._on[axis] else "failed"
        if self._on[axis]:
            if not self._complete(axis):
                self._chips[axis].stop("abrupt")
            self._until[axis] = self.now().after(HOMING_TIME)
            self._search[axis] = {"sense": 1, "returning": 0, "row": 0}
            self._turn(axis, 1)

    def homing(self, axis: int) -> Homing:
        self._look()
        return self._homing[axis]

    def _turn(self, axis: int, sense: int) -> None:
        """A turn at most; a stop on the way trips the error limit."""
        chip = self._chips[axis]
        chip.seek_index()
        chip.move(chip.actual() + sense * TURN, *PACE)

    def _search_on(self, axis: int, search: dict[str, int]) -> None:
        chip = self._chips[axis]
        signals = chip.signals()
        complete = bool(signals & (ON_TARGET | MOTOR_OFF))
        if (self.now() - self._until[axis]).item() > 0:
            self._end_search(axis, "failed")
        elif search["returning"] == 0 and not signals & SEEKS_INDEX:
            chip.move(chip.index(), *PACE)
            search["returning"] = 1
        elif search["returning"] == 0 and complete:
            if search["sense"] < 0 or not signals & MOTOR_OFF:  # both stops, or a whole turn, without a pulse
                self._end_search(axis, "failed")
            else:
                search["sense"] = -1
                self._turn(axis, -1)
        elif search["returning"] and signals & MOTOR_OFF:  # braking beyond the index it met a stop
            chip.move(chip.index(), *PACE)
        elif search["returning"] and complete:
            search["row"] = search["row"] + 1 if chip.actual() == chip.index() else 0
            if search["row"] >= SETTLED:
                chip.define_home()
                self._end_search(axis, "home")

    def _end_search(self, axis: int, how: Homing) -> None:
        self._homing[axis], self._search[axis] = how, None
        if how == "failed":
            self._chips[axis].stop("abrupt")

    # Following ------------------------------------------------------------------------------------------------------

    def follow(self, counts: tuple[NDArray[np.float64], NDArray[np.float64]], when: tuple[TimeTag, TimeTag]) -> bool:
        moves = self._track is None and not all(self._complete(axis) for axis in (0, 1))
        if moves or "searching" in self._homing or not all(self._on):
            return False
        for chip in self._chips:
            if chip.signals() & MOTOR_OFF:
                chip.move(chip.actual(), *PACE)
        self._track = (counts, when)
        self._look()
        return True

    def _track_on(self) -> None:
        """Before the first time wait at its counts; then velocity mode at the line's speed and a part of the miss."""
        if self._track is None:
            return
        (n0, n1), (t0, t1) = self._track
        span, passed = float(t1.seconds_since(t0)), float(self.now().seconds_since(t0))
        rates = (n1 - n0) / span if 0.0 <= passed < span else np.zeros(2)
        line = n0 + min(max(passed / span, 0.0), 1.0) * (n1 - n0)
        if passed >= span:
            self._track = None
        for axis, chip in enumerate(self._chips):
            if chip.signals() & MOTOR_OFF:
                self._track = None  # tripped: a next move clears it, not we
                return
            miss = float(line[axis]) - (chip.desired() + 0.5)  # what is read is rounded down
            if passed < 0.0 or passed >= span:
                chip.move(round(float(line[axis])), *PACE)
            elif abs(miss) > NEAR:
                chip.move(round(float(line[axis] + LEAD * rates[axis])), *PACE)
            else:
                speed = float(rates[axis]) + CORRECTION * miss
                chip.run(velocity_integer(abs(speed)) * (1 if speed >= 0.0 else -1) if abs(speed) > 1.0 else 0, PACE[1])

    # Power ----------------------------------------------------------------------------------------------------------

    def switch_laser(self, on: bool) -> None:
        self._panel.laser(on)
        self._laser = on

    def laser_on(self) -> bool:
        return self._laser

    def supplies(self) -> dict[str, float]:
        return self._panel.volts()

    def enclosure_temperature_c(self) -> float:
        return self._panel.celsius()
