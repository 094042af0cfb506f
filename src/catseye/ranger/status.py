"""Status word of a ZY, 32 bits.

Its bit map is open in the sources, but for Auto mode and homed axes being in it. Chosen so that the one word that
survives, 0x00013007, is a ranger at work: Auto mode, both axes homed, both amplifiers on, initialised, and no fault.
"""

from enum import IntFlag


class StatusWord(IntFlag):
    """Bits of STW; unnamed bits are zero."""

    AUTO = 1 << 0
    AZIMUTH_HOMED = 1 << 1
    ELEVATION_HOMED = 1 << 2
    UPDATES = 1 << 3  # ACU is on
    SCANNING = 1 << 4
    SCHEDULED = 1 << 5  # scheduled commands are pending
    STREAMING = 1 << 6  # STM is active
    CLIPPED = 1 << 7  # the last buffer reached the converter's ends
    AZIMUTH_OFF = 1 << 8  # the chip switched the motor off: position error
    ELEVATION_OFF = 1 << 9
    LASER_OFF = 1 << 10
    CLOCK_FREE = 1 << 11  # no time signal
    AZIMUTH_ENABLED = 1 << 12
    ELEVATION_ENABLED = 1 << 13
    SUN_REFUSED = 1 << 14  # the last requested move was refused for the Sun, or the beam is inside its cone
    LATCHED = 1 << 15  # a stop order from outside the lease is latched
    INITIALISED = 1 << 16  # BP, ALPHA, BETA, MO, EZ and D0 have been given


def word_text(status: StatusWord) -> str:
    """Text of the word, as sent.

    >>> word_text(StatusWord.AUTO | StatusWord.INITIALISED)
    '0x00010001'
    """
    return f"0x{int(status):08x}"
