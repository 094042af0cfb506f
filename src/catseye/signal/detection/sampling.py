"""Ranger sampling: response to tones, jitter and moving targets.

This file rests on one sum: the mean of exp(2 pi i x j / n) over a buffer of m cycles of n samples (`buffer_mean`). The
response to a tone, a harmonic, a line in the phase and a moving target follows from it.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import TWO_PI
from catseye.errors import ValidityError
from catseye.signal.detection.frequency_plan import FrequencyPlan, whole_number

BUFFER_SAMPLES = 65_536  # words in one transfer of the converter's board
SAMPLE_RATE_LIMIT_HZ = 100_000.0
INTERMEDIATE_LIMIT_HZ = 10_000.0


@dataclass(frozen=True)
class SamplingPlan:
    """Sampling of a buffer: m cycles of n samples.

    samples_per_cycle    n, at least 3 (two show no phase)
    cycles               m, at least 1; m n at most 65 536, what the converter's board holds
    intermediate_hz      Hz, above 0, at most 10 000; n times it at most 100 000

    A value that breaks a limit raises ValidityError.

    >>> usual = SamplingPlan()
    >>> usual.samples, usual.duration, usual.ranges_per_second()
    (8192, 0.128, 7.8125)
    >>> usual.with_(cycles=1200)
    Traceback (most recent call last):
    catseye.errors.ValidityError: 1200 cycles of 64 samples are 76800, the buffer holds 65536; at most 1024 cycles fit
    """

    samples_per_cycle: int = 64
    cycles: int = 128
    intermediate_hz: float = 1000.0

    def __post_init__(self) -> None:
        n = whole_number("samples a cycle", self.samples_per_cycle, at_least=3)
        m = whole_number("cycles", self.cycles, at_least=1)
        f = float(self.intermediate_hz)
        for name, value in (("samples_per_cycle", n), ("cycles", m), ("intermediate_hz", f)):
            object.__setattr__(self, name, value)  # plain numbers: numpy's narrow integers would overflow in m n
        if not 0.0 < f <= INTERMEDIATE_LIMIT_HZ:
            raise ValidityError(
                f"intermediate frequency {f} Hz is not above 0 and at most {INTERMEDIATE_LIMIT_HZ:g} Hz"
            )
        if n * f > SAMPLE_RATE_LIMIT_HZ:
            raise ValidityError(
                f"{n} samples a cycle at {f:g} Hz are {n * f:g} samples/s, the converter takes "
                f"{SAMPLE_RATE_LIMIT_HZ:g}; at most {SAMPLE_RATE_LIMIT_HZ / n:g} Hz with {n} samples"
            )
        if n * m > BUFFER_SAMPLES:
            most = BUFFER_SAMPLES // n
            advice = f"at most {most} cycles fit" if most else "take fewer samples a cycle"
            raise ValidityError(f"{m} cycles of {n} samples are {n * m}, the buffer holds {BUFFER_SAMPLES}; {advice}")

    def with_(
        self,
        *,
        samples_per_cycle: int | None = None,
        cycles: int | None = None,
        intermediate_hz: float | None = None,
    ) -> "SamplingPlan":
        """Copy with some values changed together.

        Raises ValidityError if that breaks a limit.
        """
        changes = {"samples_per_cycle": samples_per_cycle, "cycles": cycles, "intermediate_hz": intermediate_hz}
        return replace(self, **{name: value for name, value in changes.items() if value is not None})  # type: ignore[arg-type]

    @property
    def samples(self) -> int:
        """Samples of a buffer, m n."""
        return self.samples_per_cycle * self.cycles

    @property
    def sample_rate_hz(self) -> float:
        """Sampling rate, samples a second."""
        return self.samples_per_cycle * self.intermediate_hz

    @property
    def duration(self) -> float:
        """Duration of m cycles, s: the least time between buffers."""
        return self.cycles / self.intermediate_hz

    @property
    def centre(self) -> float:
        """Time from the trigger (first sample) to mid-buffer, s.

        The epoch of a moving phase, it is (m n - 1)/2 sample intervals, half an interval less than half the duration.
        """
        return 0.5 * (self.samples - 1) / self.sample_rate_hz

    def ranges_per_second(self, overhead: float = 0.0) -> float:
        """Upper bound of ranges a second.

        overhead   s a shot, for mirror and arithmetic
        """
        if not 0.0 <= overhead < math.inf:
            raise ValidityError(f"overhead {overhead} s is not 0 or more and finite")
        return 1.0 / (self.duration + overhead)


def buffer_mean(turns: ArrayLike, sampling: SamplingPlan) -> NDArray[np.complex128]:
    """Mean over a buffer of exp(2 pi i x j/n), j = 0 to m n - 1.

    It is the response to a rotation by x turns a cycle.

    turns       x, turns in a cycle of the IF, any, either sign
    sampling    n and m

    It is exp(i pi x (mn - 1)/n) sin(pi m x)/(mn sin(pi x/n)): 1 where n divides x, 0 at other whole x, and of period n.

    Source: sum of a geometric series (the Dirichlet kernel). Good to 1e-15 times the turns in a buffer.

    >>> np.round(np.abs(buffer_mean([0.0, 1.0, 63.0, 64.0, 0.057], SamplingPlan())), 4)
    array([1.   , 0.   , 0.   , 1.   , 0.035])
    """
    n, m = sampling.samples_per_cycle, sampling.cycles
    x = np.asarray(turns, dtype=float)
    x = x - n * np.rint(x / n)  # period n: so the divisor below is never less than 2/pi
    return np.exp(1j * np.pi * x * (m - 1.0 / n)) * np.sinc(m * x) / np.sinc(x / n)


@dataclass(frozen=True, eq=False)
class ToneResponse:
    """Detected response to a tone B cos(2 pi f t - psi).

    Time t counts from the first sample.

    direct    complex: phasor B exp(i psi) is multiplied by this
    image     complex: and its conjugate B exp(-i psi) by this, the tone's other half, at negative frequency
    """

    direct: NDArray[np.complex128]
    image: NDArray[np.complex128]

    def phasor(self, amplitude: ArrayLike, phase: ArrayLike) -> NDArray[np.complex128]:
        """Detected phasor for amplitude B (V) and phase psi (rad)."""
        turned = np.exp(1j * np.asarray(phase, dtype=float))
        return np.asarray(amplitude, dtype=float) * (self.direct * turned + self.image * turned.conj())

    @property
    def bound(self) -> NDArray[np.float64]:
        """Largest phasor magnitude from a tone of unit amplitude."""
        return np.abs(self.direct) + np.abs(self.image)

    def phase_bias_bound(self, relative_amplitude: ArrayLike) -> NDArray[np.float64]:
        """Largest phase change by a tone of relative amplitude `share`, rad.

        pi if the tone is stronger.
        """
        share = self.bound * np.asarray(relative_amplitude, dtype=float)
        return np.where(share < 1.0, np.arcsin(np.minimum(share, 1.0)), np.pi)


def tone_response(sampling: SamplingPlan, frequency_hz: ArrayLike) -> ToneResponse:
    """Exact response of the sums 5.1 and 5.2 to a tone of any frequency.

    The tone may be the signal off its lock, a harmonic, a line or a spur.

    sampling        n, m and IF
    frequency_hz    Hz, any: of the tone as it reaches the converter

    With x = f/IF the phasor is B [exp(i psi) M(1 - x) + exp(-i psi) M(1 + x)], M = `buffer_mean`. Locked (x = 1): B
    exp(i psi) alone. Off by a share d (x = 1 + d): the phase is that in the middle of the buffer, psi - 2 pi d IF
    `centre`; the amplitude falls as sinc(m d); and the image adds a cyclic bias of two periods a turn, for many n at
    most about d/2 rad whatever m (0.8 um of range for d = 1e-4). Harmonic k of a locked signal is a zero unless n
    divides k - 1 or k + 1.

    Source: [PARKER04] eq. 5.1 and 5.2, summed in closed form.

    >>> response = tone_response(SamplingPlan(), [1000.0, 2000.0, 63000.0, 60.0])
    >>> np.round(response.bound, 4)
    array([1.    , 0.    , 1.    , 0.0042])
    """
    x = np.asarray(frequency_hz, dtype=float) / sampling.intermediate_hz
    return ToneResponse(direct=buffer_mean(1.0 - x, sampling), image=buffer_mean(1.0 + x, sampling))


def aliasing_harmonics(samples_per_cycle: int, highest: int) -> list[int]:
    """Harmonics of order 2 to `highest` aliased to the fundamental.

    k n + 1 as it is, k n - 1 with phase reversed.

    samples_per_cycle    n, at least 3
    highest              last order tested

    >>> aliasing_harmonics(16, 50)
    [15, 17, 31, 33, 47, 49]
    """
    n = whole_number("samples a cycle", samples_per_cycle, at_least=3)
    return [k for k in range(2, highest + 1) if k % n in (1, n - 1)]


def modulation_response(sampling: SamplingPlan, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
    """Response of a buffer's phase to a small line in phase.

    The line exp(2 pi i f t) is hum or vibration of the path.

    sampling        n, m and IF
    frequency_hz    Hz, any

    For a line b cos(2 pi f t - psi) of b << 1 rad on the phase the buffer shows b Re(exp(-i psi) response) and, from
    the image at twice the IF, up to about b |response| f/(2 IF) more. A duration of whole periods of the line removes
    it: with 1000 cycles at 1 kHz the 57 Hz of the notes' maser, and 50 and 60 Hz.

    Source: mean of the phase over the samples, first order in b.

    >>> [round(float(abs(modulation_response(SamplingPlan(cycles=m), 57.0))), 4) for m in (128, 1000)]
    [0.035, 0.0]
    """
    return buffer_mean(np.asarray(frequency_hz, dtype=float) / sampling.intermediate_hz, sampling)


def jitter_u_phase(sampling: SamplingPlan, u_trigger: ArrayLike) -> NDArray[np.float64]:
    """Standard uncertainty of phase from independent sample jitter, rad.

    sampling     n, m and IF
    u_trigger    s, standard uncertainty of each sample's time, 0 or more

    With v = (2 pi IF u_trigger)^2 it is sqrt((exp(v) - exp(-v)/2 - 1/2)/mn), about sqrt(3 v/2mn): a sample on a flank,
    where time matters, has the most weight too. For n = 4 it depends on the phase and this is the largest, sqrt(2
    v/mn). A delay common to all samples turns target and reference cube alike and cancels.

    Source: variance of the sum 5.2 over the jitter, phasor noise taken as small against the phasor.

    >>> round(float(jitter_u_phase(SamplingPlan(), 1e-6)) * 1e6, 1)  # microradian, for 1 us at 1 kHz: 1.4 um of range
    85.0
    """
    v = (TWO_PI * sampling.intermediate_hz * np.asarray(u_trigger, dtype=float)) ** 2
    if sampling.samples_per_cycle == 4:
        return np.sqrt(2.0 * np.sinh(v) / sampling.samples)
    return np.sqrt((np.expm1(v) - 0.5 * np.expm1(-v)) / sampling.samples)


@dataclass(frozen=True, eq=False)
class MotionEffect:
    """Effect of a target's motion on one buffer.

    phase_rate              rad/s
    epoch                   s after the trigger: the time to which the phase belongs
    range_since_trigger     m, range at `epoch` less range at the trigger: added to a range at the trigger's time
    range_of_acceleration   m, reading of the buffer less the range at `epoch`, a ((mn)^2 - 1)/24 rate^2
    amplitude_factor        of the amplitude that the same target gives at rest
    phase_bias_bound        rad, largest cyclic bias by the image
    """

    phase_rate: NDArray[np.float64]
    epoch: float
    range_since_trigger: NDArray[np.float64]
    range_of_acceleration: NDArray[np.float64]
    amplitude_factor: NDArray[np.float64]
    phase_bias_bound: NDArray[np.float64]


def motion_effect(
    plan: FrequencyPlan,
    sampling: SamplingPlan,
    *,
    range_rate: ArrayLike,
    acceleration: ArrayLike = 0.0,
    group_index: float = 1.0,
) -> MotionEffect:
    """Epoch, amplitude loss and bias for a moving target.

    plan, sampling    frequencies and buffer
    range_rate        m/s at the middle of the buffer, above 0 as the distance grows
    acceleration      m/s^2 along the line of sight, steady
    group_index       of the path

    A shot's time is its trigger, yet its phase belongs to the middle: 0.64 mm at 10 mm/s for the usual 128 ms. Raises
    ValidityError where the phase turns a cycle or more within the buffer: the sum then vanishes or changes sign.

    Source: [PARKER04] eq. 5.9 in time, through `tone_response`; acceleration to first order, while the phase turns
    little.

    >>> effect = motion_effect(FrequencyPlan(), SamplingPlan(), range_rate=0.010)
    >>> round(effect.epoch, 7), round(float(effect.range_since_trigger), 6), round(float(effect.phase_rate), 4)
    (0.0639922, 0.00064, -0.6288)
    """
    rate = plan.phase_gradient(group_index) * np.asarray(range_rate, dtype=float)
    turns = rate * sampling.duration / TWO_PI
    if np.any(np.abs(turns) >= 1.0):
        raise ValidityError(
            f"the phase turns {float(np.max(np.abs(turns))):.3g} cycles within a buffer of {sampling.duration:g} s; "
            "below 1 it can be detected: take fewer cycles or a higher intermediate frequency"
        )
    response = tone_response(sampling, sampling.intermediate_hz - rate / TWO_PI)
    curve = np.asarray(acceleration, dtype=float) * (sampling.samples**2 - 1) / (24.0 * sampling.sample_rate_hz**2)
    start = np.asarray(range_rate, dtype=float) * sampling.centre - 0.5 * np.asarray(acceleration) * sampling.centre**2
    return MotionEffect(
        phase_rate=rate,
        epoch=sampling.centre,
        range_since_trigger=start,
        range_of_acceleration=curve,
        amplitude_factor=np.abs(response.direct),
        phase_bias_bound=np.arcsin(np.minimum(np.abs(response.image) / np.abs(response.direct), 1.0)),
    )
