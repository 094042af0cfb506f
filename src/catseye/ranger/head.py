"""Hardware interface of a ranger: buffer, axes, power, temperature, clock.

No call may block: a buffer, a move and a search for the index are started, and polled later. The server polls each
head in its own loop. Axis 0 is azimuth, 1 elevation. A real head is an A/D card, a motion chip for each axis and
a clock card behind these methods; tests/ranger/head_conformance.py is the conformance test of all heads.
"""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from catseye.errors import ValidityError
from catseye.geometry.sky.time_tag import TimeTag

LARGEST_BUFFER = 65_536  # samples: the converter's DMA buffer
FASTEST_SAMPLING_HZ = 100_000
HIGHEST_IF_HZ = 10_000
FEWEST_SAMPLES = 3  # of a cycle: fewer have no phase
Homing = Literal["never", "searching", "home", "failed"]


@dataclass(frozen=True)
class SamplingSettings:
    """Sampling of a buffer: `SFQ`, `CYC`, `IFF`.

    samples        of a cycle, at least 3
    cycles         at least 1; samples times cycles at most 65 536
    frequency_hz   intermediate frequency, 1 to 10 000; times samples at most 100 000

    Raises ValidityError outside these. Source: [CREAGER02] limits of the converter.

    >>> SamplingSettings().duration
    0.128
    """

    samples: int = 64
    cycles: int = 128
    frequency_hz: int = 1000

    def __post_init__(self) -> None:
        n, m, f = self.samples, self.cycles, self.frequency_hz
        if n < FEWEST_SAMPLES or m < 1 or not 1 <= f <= HIGHEST_IF_HZ:
            raise ValidityError(
                f"{n} samples, {m} cycles, {f} Hz (expected at least {FEWEST_SAMPLES}, at least 1, 1 to "
                f"{HIGHEST_IF_HZ} Hz)"
            )
        if n * m > LARGEST_BUFFER:
            raise ValidityError(f"{m} cycles of {n} samples are {n * m} words (expected at most {LARGEST_BUFFER})")
        if n * f > FASTEST_SAMPLING_HZ:
            raise ValidityError(
                f"{n} samples at {f} Hz are {n * f} samples a second (expected at most {FASTEST_SAMPLING_HZ})"
            )

    @property
    def duration(self) -> float:
        """Duration of a buffer, s."""
        return self.cycles / self.frequency_hz


@dataclass(frozen=True, eq=False)
class Buffer:
    """Samples of one shot.

    samples          (m n,) int16, codes of the converter
    triggered        time of the first sample
    sampling         settings
    volts_per_code   V
    """

    samples: NDArray[np.int16]
    triggered: TimeTag
    sampling: SamplingSettings
    volts_per_code: float


class RangerHead(Protocol):
    """The hardware of one ranger."""

    def now(self) -> TimeTag:
        """UTC of the head's clock, monotonic unless set."""
        ...

    def set_clock(self, tag: TimeTag) -> None:
        """Set the clock to a number of ticks."""
        ...

    def clock_locked(self) -> bool:
        """True if the clock follows its time signal."""
        ...

    def trigger(self, sampling: SamplingSettings) -> None:
        """Start taking a buffer; one under way is abandoned."""
        ...

    def buffer(self) -> Buffer | None:
        """Last complete buffer; None before the first and during one."""
        ...

    def enable(self, axis: int, on: bool) -> None:
        """Switch the amplifier of an axis; off at boot."""
        ...

    def enabled(self, axis: int) -> bool:
        """True if the amplifier is on."""
        ...

    def actual(self, axis: int) -> int:
        """Encoder position of the axis, counts."""
        ...

    def desired(self, axis: int) -> int:
        """Desired position by the profile, counts."""
        ...

    def start(self, axis: int, position: int, *, velocity: int, acceleration: int) -> bool:
        """Start a trapezoidal move in the motion chip's integers; False if impossible."""
        ...

    def follow(self, counts: tuple[NDArray[np.float64], NDArray[np.float64]], when: tuple[TimeTag, TimeTag]) -> bool:
        """Track counts (2,) linearly between two times; False if impossible."""
        ...

    def moving(self, axis: int) -> bool:
        """True if a profile, or a search for the index, is under way."""
        ...

    def motor_off(self, axis: int) -> bool:
        """True if the chip switched the motor off: position error past its limit.

        The next move clears it.
        """
        ...

    def set_filter(self, axis: int, values: tuple[int, int, int, int, int]) -> None:
        """Set the filter: kp, ki, kd, integration limit, derivative interval."""
        ...

    def set_error_limit(self, axis: int, counts: int) -> None:
        """Set the position error past which the motor goes off."""
        ...

    def find_home(self, axis: int) -> None:
        """Start the search for the index, which becomes zero."""
        ...

    def homing(self, axis: int) -> Homing:
        """State of the last search."""
        ...

    def stop(self) -> None:
        """Stop both axes and abandon what is under way."""
        ...

    def switch_laser(self, on: bool) -> None:
        """Switch the laser's power on or off."""
        ...

    def laser_on(self) -> bool:
        """True if the laser is on."""
        ...

    def supplies(self) -> dict[str, float]:
        """Power supplies by name, V."""
        ...

    def enclosure_temperature_c(self) -> float:
        """Temperature in the enclosure, NaN if unknown."""
        ...

    def reset(self) -> None:
        """Reset to the state at power-on.

        Amplifiers off, nothing homed, no buffer, laser as the hardware has it.
        """
        ...
