"""A safety guard for a whole site, which lets rangers of the feed arm look down at the dish while the Sun is set.

They know no horizon, for they turn with the telescope: where the Sun is said to be, they do not look. Straight down,
which is said of a Sun that is set, is where the dish is.
"""

from catseye.coordinator.guard import SafetyGuard

ALONG_THE_BEAM = (0.0, 0.0, 1.0)  # of the telescope, reflector frame; rangers of the feed arm look the other way


class SiteGuard(SafetyGuard):
    """`SafetyGuard`, but for what rangers of the feed arm are told of a Sun that is set."""

    def sun_vector(self, ranger: str, now_ticks: int) -> tuple[float, float, float]:
        """The unit vector to the Sun in a ranger's own frame; while it is set, one that keeps no beam from its work.

        Raises InputError: a ranger on the feed arm, and no posture, or an old one.
        """
        told = super().sun_vector(ranger, now_ticks)
        riding = self.vantages[ranger].frame == "reflector"
        up = self.keep_clear.counts_at(self.keep_clear.sun(now_ticks))
        return ALONG_THE_BEAM if riding and not up else told
