"""One shot at a time: samples to a phase with its status, and at once a range with what is known by then.

The range of `ShotAnswer` is a first one: corrections are those of the line's last epoch, the electronics those of the
last good reference. The epoch's solution uses the phases, not these ranges.
"""

import cmath
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from statistics import median

import numpy as np
from numpy.typing import NDArray

from catseye.constants import SECONDS_PER_DAY, SPEED_OF_LIGHT, TWO_PI
from catseye.records.night.live import LiveShot
from catseye.records.site.folder import REFERENCE
from catseye.records.site.mirror import Mirror
from catseye.records.site.site import Adc
from catseye.reduction.epoch.ranges import BufferDetection, Detections, ShotPhase, why_not
from catseye.reduction.epoch.reason import Reason, ShotStatus
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.signal.detection.buffers import shortest_run
from catseye.signal.detection.cycle_scatter import FEWEST_FOR_BATCHES, variance_across

USUAL_OF = 31  # amplitudes whose median is usual for a ranger's reference, or for its targets
U_UNSEEN_VOLT = 0.01  # each quadrature, of a shot whose samples did not travel; 0.25 V of noise a sample make 0.004
REFERENCE_CHANGE = 0.03  # of the cube's amplitude, beyond which something else is in its return


@dataclass(frozen=True)
class ShotAnswer:
    """What one shot is worth, at once.

    status     what became of it
    reason     why it gives no range, None where it does
    amplitude  V, leakage taken out
    phase      rad, the same, in [0, 2 pi)
    range_     m, from the scan point; NaN where there is none
    u_range    m, noise and drift since the reference
    misfit     m, range less what was predicted
    """

    status: ShotStatus
    reason: Reason | None
    amplitude: float
    phase: float
    range_: float = math.nan
    u_range: float = math.nan
    misfit: float = math.nan

    @property
    def text(self) -> str:
        """Why it gives no range, "" where it does."""
        return str(self.reason or "")

    @classmethod
    def refused(cls, reason: Reason, amplitude: float, phase: float) -> "ShotAnswer":
        """Of a shot that gives no range."""
        return cls(reason.status, reason, amplitude, phase)


@dataclass(frozen=True, eq=False)
class PhasedShot:
    """A shot with its phase, kept for the epoch.

    mjd       of its buffer's middle
    repeats   numbers of those that it stands for
    """

    shot: LiveShot
    mjd: float
    phase: ShotPhase
    repeats: tuple[int, ...] = ()

    @property
    def reason(self) -> Reason | None:
        """Why the shot cannot be used, None where it can."""
        return self.phase.reason

    def left_out(self, reason: Reason) -> "PhasedShot":
        """The same shot, not to be used."""
        return replace(self, phase=replace(self.phase, reason=reason))

    @property
    def numbers(self) -> tuple[int, ...]:
        """Its own number, or those of all repeats that it stands for."""
        return self.repeats or (self.shot.number,)


@dataclass(slots=True)
class SolvedLine:
    """What a line's last epoch made of its range: optical path = index (distance + added), m."""

    index: float
    added: float


@dataclass
class RangerNow:
    """What is known of one ranger between epochs."""

    references: deque[PhasedShot] = field(default_factory=lambda: deque(maxlen=64))
    usual: dict[bool, deque[float]] = field(
        default_factory=lambda: {True: deque(maxlen=USUAL_OF), False: deque(maxlen=USUAL_OF)}
    )


def phased(
    shot: LiveShot, mirror: Mirror, adc: Adc, *, settings: ReductionSettings, usual: float, run: float = 0.0
) -> PhasedShot:
    """The phase of one shot, judged as `catseye reduce` judges it.

    usual   V, amplitude that such shots have; for the text alone
    run     rad a cycle, by which the phase is known to move; taken out before the mean

    Where the samples did not travel the ranger's own amplitude and phase count, their noise a guess (`U_UNSEEN_VOLT`),
    and clipping and dropouts are not seen.
    """
    leaked = mirror.leakage_amplitude_volt * cmath.exp(1j * mirror.leakage_phase_rad)
    buffer = _detection(shot, adc.bits, run, leaked)
    phasor = buffer.raw - leaked
    sampling = shot.cycles, shot.samples_per_cycle
    reason = why_not(buffer, phasor, sampling=sampling, mirror=mirror, settings=settings, usual=usual)
    across = buffer.u_phasor
    if shot.samples is None:
        across = U_UNSEEN_VOLT
    elif shot.cycles >= FEWEST_FOR_BATCHES:  # fewer tell too little of one quadrature's own scatter
        across = math.sqrt(variance_across(buffer.total, buffer.between, shot.cycles, phasor=phasor))
    phase = ShotPhase(
        phasor, buffer.u_phasor, across, buffer.offset, buffer.harmonics, buffer.largest, buffer.wrong or reason
    )
    return PhasedShot(shot, shot.middle_mjd, phase)


def _detection(shot: LiveShot, bits: int, run: float, leaked: complex) -> BufferDetection:
    """What a shot's samples hold, or what the ranger itself made of them."""
    if shot.samples is not None and len(shot.samples) != shot.cycles * shot.samples_per_cycle:
        told = f"{len(shot.samples)} samples where {shot.cycles} cycles of {shot.samples_per_cycle} make"
        wrong = Reason(ShotStatus.WRONG_LENGTH, f"{told} {shot.cycles * shot.samples_per_cycle}")
        return BufferDetection(0j, 0.0, wrong=wrong)
    if shot.samples is not None:
        return _detected(shot, shot.samples, bits, run, leaked)
    if not (math.isfinite(shot.amplitude) and math.isfinite(shot.phase)):
        wrong = Reason(ShotStatus.NO_SAMPLES, "neither the buffer came nor what the ranger made of it")
        return BufferDetection(0j, 0.0, wrong=wrong)
    raw = shot.amplitude * complex(math.cos(shot.phase), math.sin(shot.phase))
    return BufferDetection(raw, U_UNSEEN_VOLT, largest=shot.amplitude)


def _detected(shot: LiveShot, samples: NDArray[np.int16], bits: int, run: float, leaked: complex) -> BufferDetection:
    """A buffer, compiled; what is wrong with it in words, by the plain form."""
    from catseye.signal.detection import buffer_kernel as kernel

    n, volts, m = shot.samples_per_cycle, shot.volts_per_code, shot.cycles
    if m < 2:  # a single cycle's noise comes from its overtones: rare, and not here
        return _plainly(samples, n, volts, bits)
    ends = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    moving, standing = np.zeros(16), np.zeros(8)
    kernel.one_buffer(np.ascontiguousarray(samples), n, ends, run, leaked / volts, moving, standing)
    out, stand = moving.tolist(), standing.tolist()
    wrong = None
    if out[kernel.CLIPPED] or out[kernel.DROPPED] or out[kernel.LONGEST] >= shortest_run(n):
        wrong = _plainly(samples, n, volts, bits).wrong
    mean, moments = (out[0:2], out[kernel.TOTAL :]) if run == 0.0 else (stand[0:2], stand[2:])
    return BufferDetection(
        complex(mean[0], mean[1]) * volts + (leaked if run else 0.0),
        math.sqrt((moments[0] + moments[1]) / (2.0 * (m - 1) * m)) * volts,
        out[kernel.OFFSET] * volts,
        (out[kernel.SECOND] * volts, out[kernel.SECOND + 1] * volts),
        max(-out[kernel.LOW], out[kernel.HIGH]) * volts,
        int(out[kernel.CLIPPED]),
        total=[v * volts**2 for v in moments[:3]],
        between=[v * volts**2 for v in moments[3:6]],
        wrong=wrong,
    )


def _plainly(samples: NDArray[np.int16], n: int, volts: float, bits: int) -> BufferDetection:
    """By the form of the campaigns."""
    one = Detections.empty(1)
    one.put(np.zeros(1, dtype=np.int64), samples[None], n, volts, bits)
    return one.row(0)


def answer(
    row: PhasedShot,
    now: RangerNow,
    *,
    predicted: Callable[[], float] | None,
    line: Callable[[], SolvedLine],
    d0: float,
    modulation_hz: float,
    walk: float,
) -> ShotAnswer:
    """What one shot says at once.

    now         of its ranger, before this shot
    predicted   distance, m, scan point to target at its middle; None where nobody knows
    line        what its line's corrections are
    d0          m, of the internal cube
    walk        rad per root second, of the electronics

    Source: [PARKER04] eq. 5.12 and 5.18: D = ((N - p/2pi) c/2f)/n - (glass, axes, zero) + D0.
    """
    amplitude, phase = abs(row.phase.phasor), math.atan2(row.phase.phasor.imag, row.phase.phasor.real) % TWO_PI
    if row.reason:
        return ShotAnswer.refused(row.reason, amplitude, phase)
    if row.shot.target == REFERENCE:
        usual = now.usual[True]
        level = median(usual) if len(usual) >= 3 else amplitude
        if abs(amplitude / level - 1.0) > REFERENCE_CHANGE:
            text = f"return {amplitude:.3f} V where the cube gives {level:.3f} V"
            return ShotAnswer.refused(Reason(ShotStatus.BAD_REFERENCE, text), amplitude, phase)
        return ShotAnswer(ShotStatus.REFERENCE, None, amplitude, phase, d0, 0.0, 0.0)
    if not now.references:
        text = "the ranger has no good shot on its internal cube yet"
        return ShotAnswer.refused(Reason(ShotStatus.NO_REFERENCE, text), amplitude, phase)
    if predicted is None:
        return ShotAnswer.refused(Reason(ShotStatus.NO_PLACE, "the telescope has told no posture"), amplitude, phase)
    last = now.references[-1]
    half = 0.5 * SPEED_OF_LIGHT / modulation_hz
    share = ((phase - math.atan2(last.phase.phasor.imag, last.phase.phasor.real)) / TWO_PI) % 1.0
    corrections, distance = line(), predicted()
    coarse = corrections.index * (distance + corrections.added)
    optical = (round(coarse / half + share) - share) * half
    range_ = optical / corrections.index - corrections.added
    u_phase = math.hypot(row.phase.u_across / amplitude, last.phase.u_across / max(abs(last.phase.phasor), 1e-9))
    drift = walk * math.sqrt(abs(row.mjd - last.mjd) * SECONDS_PER_DAY)
    u = half / TWO_PI / corrections.index * math.hypot(u_phase, drift)
    return ShotAnswer(ShotStatus.USED, None, amplitude, phase, range_, u, range_ - distance)
