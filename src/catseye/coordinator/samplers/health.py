"""Rows of the sampler HEALTH."""

from catseye.coordinator.link.health import RangerHealth
from catseye.coordinator.samplers.pose_rows import Row, number_word
from catseye.coordinator.samplers.rings import plain
from catseye.ranger.line import stamp_text
from catseye.ranger.status import StatusWord, word_text

MOTORS = (
    (StatusWord.AZIMUTH_ENABLED, StatusWord.AZIMUTH_OFF),
    (StatusWord.ELEVATION_ENABLED, StatusWord.ELEVATION_OFF),
)


def health_row(health: RangerHealth) -> Row:
    """Row of a ranger's health.

    A motor is on, off (its amplifier), or tripped (the chip switched it off for a position error).
    """
    laser = "none" if health.laser is None else "on" if health.laser else "off"
    motors = ("tripped" if health.status & trip else "on" if health.status & on else "off" for on, trip in MOTORS)
    clock = "free" if health.status & StatusWord.CLOCK_FREE else "locked"
    first = (stamp_text(health.ticks), health.ranger, health.state, laser, plain(health.supplies or "none"))
    numbers = map(number_word, (health.temperature_c, *health.errors))
    times = map(number_word, (health.clock_offset, health.round_trip))
    return (*first, *numbers, *motors, clock, *times, word_text(health.status))
