"""Watch of this machine's clock: steady counter, kernel, rangers' clocks.

The coordinator counts UTC on with a steady counter, so a jump of the machine's UTC affects no stamp; it is seen as a
departure of that UTC from the count. No shots are taken until it is known which of the two is right:

- the rangers' clocks, if most of those with a time signal agree, decide for the count or for the machine's UTC;
- else the kernel, if it reports synchronisation;
- else a step up to a second, as a leap second's, is adopted, and a longer one needs a person's decision.

Adopting is a correction, logged and journalled; no process is restarted for it. A departure below a jump is followed by
slewing. If most rangers contradict count and machine, no ranger's clock is set, and no shots are taken.

Source: [MILLS10] sec. 11.2: clocks are intervals, the most that intersect are right, the shortest count most.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from catseye.clock import KernelSync, SystemClock, kernel_sync
from catseye.coordinator.event_log import EventLog
from catseye.coordinator.link.ranger import RangerLink
from catseye.coordinator.parts import TICKS_PER_SECOND, Clock, ticks_now
from catseye.errors import InputError
from catseye.ranger.status import StatusWord

PERIOD, AT_FIRST = 1.0, 0.1  # s between two checks; until the rangers' clocks have been sampled
JUMP = 0.02  # s: slewing gains 0.5 ms a second, so that a larger departure is a step
SETTLE = 3.0  # s without another jump before one is judged
WAIT = 15.0  # s for the rangers to decide which time is right
SMALL = 1.0 + JUMP  # s: a leap second
AGREE = 0.05  # s within which clocks agree
FRESH = 15.0  # s, how old a ranger's offset may be
LEAST_VOTES = 3
SEE = "(check its time service)"


@dataclass(frozen=True)
class ClockVote:
    """Interval vote of the rangers' clocks on the count, s.

    rangers      number heard
    of_one_mind  largest number of overlapping bounds
    low, high    their overlap
    middle       their mean there, weighted by 1/error²: ahead of the count
    """

    rangers: int = 0
    of_one_mind: int = 0
    low: float = 0.0
    high: float = 0.0
    middle: float = 0.0

    @property
    def counts(self) -> bool:
        """True if enough rangers agree to decide."""
        return self.of_one_mind >= LEAST_VOTES and 2 * self.of_one_mind > self.rangers

    def allows(self, offset: float) -> bool:
        """True if a time so many s ahead of the count may be right."""
        return self.low - AGREE <= offset <= self.high + AGREE

    def __str__(self) -> str:
        return f"{self.of_one_mind} of {self.rangers} rangers' clocks agree"

    @staticmethod
    def of(bounds: Iterable[tuple[float, float]]) -> "ClockVote":
        """Vote of some offsets and their errors.

        >>> vote = ClockVote.of([(0.0, 0.4), (3.0, 0.01), (3.01, 0.01), (2.8, 0.5)])
        >>> vote.of_one_mind, round(vote.middle, 2), vote.counts
        (3, 3.0, True)
        """
        offsets = [(offset, error) for offset, error in bounds if np.isfinite(offset) and np.isfinite(error)]
        if not offsets:
            return ClockVote()
        lows = [offset - error - 0.5 * AGREE for offset, error in offsets]
        highs = [offset + error + 0.5 * AGREE for offset, error in offsets]
        low = max(lows, key=lambda at: sum(lo <= at <= hi for lo, hi in zip(lows, highs, strict=True)))
        members = [k for k, (lo, hi) in enumerate(zip(lows, highs, strict=True)) if lo <= low <= hi]
        high = min(highs[k] for k in members)
        weights = [1.0 / max(offsets[k][1], 1e-4) ** 2 for k in members]
        mean = float(np.average([offsets[k][0] for k in members], weights=weights))
        pad = 0.5 * AGREE
        low, high = min(low + pad, mean), max(high - pad, mean)
        return ClockVote(len(offsets), len(members), low, high, mean)


@dataclass
class _Jump:
    """A jump that is not yet judged.

    The last check before it, ticks; its detection, ticks and s of the counter.
    """

    since: int
    ticks: int
    counted: float


class HostClock:
    """Watch over this machine's clock.

    links    of the rangers, whose clocks vote
    clock    the coordinator's; one that is not a `SystemClock` has no machine's UTC beside it
    kernel   the kernel's synchronisation, None if unknown

    `believed` is True if shots may be taken. `jumped` is called with the first and the last tick between which shots
    are rejected, the last None while that is not over; `corrected` with the gain of the count in s.
    """

    def __init__(
        self,
        links: Mapping[str, RangerLink],
        clock: Clock,
        event_log: EventLog,
        kernel: Callable[[], KernelSync | None] = kernel_sync,
    ):
        self._links, self._clock, self._event_log, self._kernel = links, clock, event_log, kernel
        few = len(links) < LEAST_VOTES
        self._vouched = few or not isinstance(clock, SystemClock)  # rangers agree with the count, or cannot vote
        self.believed = self._vouched
        self._heard = False  # True once the rangers' clocks have decided
        self._outvoted = self._kept = False  # their last vote: neither is right; the count is, not the machine
        self._until: float | None = None  # s of the counter, end of the wait for them at the start
        self.jumped: Callable[[int, int | None], None] = lambda since, until: None
        self.corrected: Callable[[float], None] = lambda seconds: None
        self.sync: KernelSync | None = None
        self._was_synchronised: bool | None = None  # None before the first check
        self._departed = 0.0
        self._looked = ticks_now(clock)
        self._jump: _Jump | None = None
        self._unsettled: str | None = None
        self._off: str | None = None
        self._votes_since = 0  # ticks: older offsets precede a jump

    async def run(self) -> None:
        """Check every second until cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            self.look(loop.time())
            await asyncio.sleep(PERIOD if self.believed or self.trouble else AT_FIRST)

    @property
    def trouble(self) -> str | None:
        """Ongoing problem of this machine's clock; else None."""
        return self._unsettled or self._off

    @property
    def departure(self) -> float:
        """Offset of the machine's UTC from the count at the last check, s."""
        return self._departed

    def look(self, counted: float) -> None:
        """Check once, at a steady counter's time, s."""
        self._until = counted + WAIT if self._until is None else self._until
        if isinstance(self._clock, SystemClock):
            self._ask_kernel()
            self._depart(self._clock.departure(), counted)
        vote = self._vote()
        if len(self._links) >= LEAST_VOTES and isinstance(self._clock, SystemClock):
            self._vouched = vote.counts and vote.allows(0.0)
        if abs(self._departed) <= JUMP:
            self._stay(vote, counted)
        else:
            self._judge(vote, counted)
        self._looked = ticks_now(self._clock)

    def may_set(self, link: RangerLink) -> bool:
        """True if a ranger's clock may be set by this machine's.

        One with a time signal only if most rangers agree with the count, or a machine that starts with a wrong clock
        would set them one by one before they outvote it.
        """
        return self.believed and (self._vouched or bool(link.status & StatusWord.CLOCK_FREE))

    def accept(self) -> float:
        """Adopt the machine's UTC on a person's request; gain of the count, s.

        Raises InputError: it has not departed from the count.
        """
        if abs(self._departed) <= JUMP:
            raise InputError("this machine's clock agrees with the count (expected a jump to accept)")
        return self._correct("accepted by a person")

    # Inside ----------------------------------------------------------------------------------------------------------

    def _ask_kernel(self) -> None:
        """Log the kernel's synchronisation: first, lost, or large error."""
        self.sync = sync = self._kernel()
        if self._was_synchronised is None:
            text = "synchronisation unknown: the kernel reports none (in a container the host may have it)"
            if sync is not None:
                text = f"synchronised by {sync.source}, error {sync.error * 1e3:.3f} ms (at most {sync.most * 1e3:.1f})"
            self._event_log.tell("host-clock", f"this machine's clock: {text}", always=True)
        unsynchronised = (
            "this machine's clock is no longer synchronised according to its kernel (check its time service)"
        )
        over = "this machine's clock is synchronised again according to its kernel"
        free = bool(self._was_synchronised) and sync is None
        self._event_log.standing("host-clock-free", unsynchronised if free else None, over=over)
        self._was_synchronised = bool(self._was_synchronised) or sync is not None
        error = 0.0 if sync is None else sync.error
        text = f"this machine's clock may be {error:.3f} s off according to its kernel (limit {AGREE:g} s)"
        over = f"this machine's clock is within {AGREE:g} s again according to its kernel"
        self._event_log.standing("host-clock-unsure", text if error > AGREE else None, over=over)

    def _depart(self, departed: float, counted: float) -> None:
        """Update the departure; a fast change is a jump."""
        gained = departed - self._departed
        self._departed = departed
        if abs(gained) > JUMP:
            text = (
                f"this machine's clock jumped by {gained:+.3f} s: no shots are taken until it is known which is right"
            )
            details = "(check its time service)"
            self._event_log.tell("host-clock-jump", f"{text} {details}", "alarm", always=True, offset_s=gained)
            since = self._looked if self._jump is None else self._jump.since
            self._jump = _Jump(since, ticks_now(self._clock), counted)
            self._votes_since, self._kept = self._jump.ticks, False
            self.jumped(since, None)

    def _stay(self, vote: ClockVote, counted: float) -> None:
        """Count and machine's UTC agree: check the rangers."""
        if isinstance(self._clock, SystemClock):
            self._clock.slew()
        if self._jump is not None and counted - self._jump.counted < SETTLE:
            self.believed = False
            return
        self._over()
        if not vote.counts:  # unchanged, or at the start a wait for the rangers' clocks
            waited = self._until is None or counted >= self._until
            self.believed = not self._outvoted and (self._heard or self._vouched or waited)
            if not self._outvoted:
                self._stand()
            return
        self.believed = vote.allows(0.0)
        self._outvoted, self._heard = not self.believed, True
        text = (
            f"{vote} that this machine's is {-vote.middle:+.3f} s off: no shots are taken and no clock is set until "
            f"they agree with it {SEE}"
        )
        self._stand(off=None if self.believed else text, offset=-vote.middle)

    def _judge(self, vote: ClockVote, counted: float) -> None:
        """Decide if count or machine's UTC is right after a departure."""
        away, passed = self._departed, WAIT if self._jump is None else counted - self._jump.counted
        count, machine = vote.counts and vote.allows(0.0), vote.counts and vote.allows(away)
        could = sum(link.connected and not link.status & StatusWord.CLOCK_FREE for link in self._links.values())
        unheard = not vote.counts and could >= LEAST_VOTES
        unclear = count and machine and abs(away) > 2.0 * AGREE
        if passed < SETTLE or ((unheard or unclear) and passed < WAIT):
            self.believed = False
            self._stand(unsettled=f"this machine's clock is {away:+.3f} s from the count: no shots are taken meanwhile")
            return
        if not vote.counts and self._kept:  # decided, and silent now
            return
        self._outvoted = vote.counts and not count and not machine
        if machine and (not count or not unclear):
            self._correct(f"{vote} with it")
        elif count and not machine:
            self._over()
            self.believed = self._kept = True
            text = f"{vote} that this machine's is {away:+.3f} s off: measuring continues by the former count"
            self._stand(off=f"{text} {SEE}", offset=away)
        elif vote.counts and not count:
            self.believed = False
            text = f"{vote} that the count is {-vote.middle:+.3f} s off, and this machine's {away - vote.middle:+.3f} s"
            self._stand(off=f"{text}: no shots are taken {SEE}", offset=away)
        else:
            self._judge_alone(away)

    def _judge_alone(self, away: float) -> None:
        """Decide without rangers: by kernel, size of the step, or a person."""
        if self.sync is not None and self.sync.error <= AGREE:
            self._correct(f"the kernel is synchronised by {self.sync.source}")
        elif abs(away) <= SMALL and not self._was_synchronised:
            self._correct("nothing contradicts such a small step")
        else:
            self.believed = False
            text = (
                f"this machine's clock is {away:+.3f} s from the count, and neither rangers nor kernel decide which is "
                "right: no shots are taken (check its time service; CLOCK ACCEPT adopts it)"
            )
            self._stand(off=text, offset=away)

    def _correct(self, why: str) -> float:
        """Adopt the machine's UTC; gain of the count, s."""
        assert isinstance(self._clock, SystemClock)
        since = self._looked if self._jump is None else self._jump.since
        gained = self._clock.correct()
        now_ticks = ticks_now(self._clock)
        self._departed, self._jump, self._votes_since, self.believed = 0.0, None, now_ticks, True
        self._outvoted = self._kept = False
        self.jumped(since + min(0, round(gained * TICKS_PER_SECOND)), now_ticks)
        text = f"the count of UTC is corrected by {gained:+.3f} s to this machine's clock: {why}"
        self._event_log.tell("clock-corrected", text, "warning", always=True, offset_s=gained, why=why)
        self._stand()
        self.corrected(gained)
        return gained

    def _over(self) -> None:
        """End a jump without consequences: shots are accepted from now on."""
        if self._jump is not None:
            self.jumped(self._jump.since, ticks_now(self._clock))
            self._jump = None

    def _stand(self, *, unsettled: str | None = None, off: str | None = None, offset: float = 0.0) -> None:
        """Log ongoing conditions; while unsettled, the former one stays."""
        self._unsettled = unsettled
        self._event_log.standing("host-clock-unsettled", unsettled, "warning")
        if unsettled is not None:
            return
        self._off = off
        over = "this machine's clock and the count of UTC agree again: measuring resumes"
        self._event_log.standing("host-clock-off", off, "alarm", over=over, offset_s=offset)

    def _vote(self) -> ClockVote:
        """Vote of rangers with a time signal and a recent offset.

        Measured after the last jump.
        """
        now_ticks = ticks_now(self._clock)
        return ClockVote.of(
            (link.clock_offset, link.clock_error)
            for link in self._links.values()
            if link.connected and not link.status & StatusWord.CLOCK_FREE and self._fresh(link.clock_seen, now_ticks)
        )

    def _fresh(self, sampled_ticks: int, now_ticks: int) -> bool:
        return self._votes_since <= sampled_ticks and 0 <= now_ticks - sampled_ticks <= FRESH * TICKS_PER_SECOND
