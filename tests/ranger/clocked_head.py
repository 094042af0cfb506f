"""A scripted head whose time follows a clock."""

from catseye.geometry.sky.time_tag import PER_DAY, PER_SECOND, TimeTag
from ranger.scripted_head import ScriptedHead


class ClockedHead:
    """Catches up with its clock at each call, then does what a `ScriptedHead` does."""

    def __init__(self, clock, **options):
        self._clock, self._seen = clock, clock.now_ns()
        self.inner = ScriptedHead(**options)
        self.inner.clock = TimeTag(self._seen // PER_DAY, self._seen % PER_DAY)

    def __getattr__(self, name):
        call = getattr(self.inner, name)
        now = self._clock.now_ns()
        if now > self._seen:
            self.inner.advance((now - self._seen) / PER_SECOND)
            self._seen = now
        return call
