"""Events from a ranger's status word, each logged once."""

from collections.abc import Callable

from catseye.coordinator.event_log import EventLog
from catseye.ranger.status import StatusWord

NEEDED = StatusWord.INITIALISED | StatusWord.AZIMUTH_HOMED | StatusWord.ELEVATION_HOMED | StatusWord.AUTO


class StatusWatch:
    """Status words of one ranger.

    lost   called when it cannot measure any more: home or geometry lost
    """

    def __init__(self, ranger: str, event_log: EventLog, lost: Callable[[str], None]):
        self.ranger, self._event_log, self._lost = ranger, event_log, lost
        self.word = StatusWord(0)

    def hear(self, text: str) -> None:
        """Process a new word; an invalid one is logged and ignored."""
        try:
            word = StatusWord(int(text[:12], 16) & 0xFFFFFFFF)
        except ValueError:
            self._event_log.tell("bad-line", f"{self.ranger}: STW {text[:20]!a} is not a status word", "warning")
            return
        before, self.word = self.word, word
        for axis, bit in enumerate((StatusWord.AZIMUTH_OFF, StatusWord.ELEVATION_OFF)):
            text = f"the motor of axis {axis} went off: position error past its limit (check that it turns freely)"
            self._event_log.standing(
                f"motor-off-{axis}", text if word & bit else None, over=f"the motor of axis {axis} is on"
            )
        free = "its clock has no time signal" if word & StatusWord.CLOCK_FREE else None
        self._event_log.standing("clock-free", free, over="its clock follows the time signal")
        if word & StatusWord.CLIPPED and not before & StatusWord.CLIPPED:
            self._event_log.tell(
                "saturated", "its converter is saturated (weaken the return, check the amplifier)", "warning"
            )
        if NEEDED & ~word:
            self._lost(f"{self.ranger} lost home, geometry or Auto mode (status 0x{word:08x})")
