"""Phase, status and preliminary range of single shots.

The range of `ShotAnswer` uses the corrections of the line's last epoch and the electronics of the last good reference.
The epoch's solution uses the phases, not these ranges.
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

USUAL_OF = 31  # amplitudes in the median that is usual for a ranger's reference, or for its targets
U_UNSEEN_VOLT = 0.01  # each quadrature, of a shot received without samples; 0.25 V of noise a sample make 0.004
REFERENCE_CHANGE = 0.03  # of the cube's amplitude, above which there is a stray reflection in its return


@dataclass(frozen=True)
class ShotAnswer:
    """Immediate result of one shot.

    status     used, reference, or why not
    reason     why it gives no range, None if it does
    amplitude  V, leakage removed
    phase      rad, the same, in [0, 2 pi)
    range_     m, from the scan point; NaN if there is none
    u_range    m, noise and drift since the reference
    misfit     m, range less prediction
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
        """Reason why it gives no range, "" if it does."""
        return str(self.reason or "")

    @classmethod
    def refused(cls, reason: Reason, amplitude: float, phase: float) -> "ShotAnswer":
        """Answer of a shot without a range."""
        return cls(reason.status, reason, amplitude, phase)


@dataclass(frozen=True, eq=False)
class PhasedShot:
    """A shot with its phase, stored for the epoch.

    mjd       of its buffer's middle
    repeats   numbers of the shots joined in it
    """

    shot: LiveShot
    mjd: float
    phase: ShotPhase
    repeats: tuple[int, ...] = ()

    @property
    def reason(self) -> Reason | None:
        """Reason why it cannot be used, None if it can."""
        return self.phase.reason

    def left_out(self, reason: Reason) -> "PhasedShot":
        """The same shot, rejected."""
        return replace(self, phase=replace(self.phase, reason=reason))

    @property
    def numbers(self) -> tuple[int, ...]:
        """Its number, or those of all repeats joined in it."""
        return self.repeats or (self.shot.number,)


@dataclass(slots=True)
class SolvedLine:
    """Corrections of a line: optical path = index (distance + added), m."""

    index: float
    added: float


@dataclass
class RangerHistory:
    """Recent references and amplitudes of one ranger."""

    references: deque[PhasedShot] = field(default_factory=lambda: deque(maxlen=64))
    usual: dict[bool, deque[float]] = field(
        default_factory=lambda: {True: deque(maxlen=USUAL_OF), False: deque(maxlen=USUAL_OF)}
    )


def phased(
    shot: LiveShot, mirror: Mirror, adc: Adc, *, settings: ReductionSettings, usual: float, run: float = 0.0
) -> PhasedShot:
    """Phase of one shot, judged as `catseye reduce` does.

    usual   V, typical amplitude of such shots; for the text only
    run     rad a cycle, predicted change of the phase; removed before the mean

    Without samples the ranger's own amplitude and phase are used, with an assumed noise (`U_UNSEEN_VOLT`); clipping and
    dropouts are then not detected.
    """
    leaked = mirror.leakage_amplitude_volt * cmath.exp(1j * mirror.leakage_phase_rad)
    buffer = _detection(shot, adc.bits, run, leaked)
    phasor = buffer.raw - leaked
    sampling = shot.cycles, shot.samples_per_cycle
    reason = why_not(buffer, phasor, sampling=sampling, mirror=mirror, settings=settings, usual=usual)
    across = buffer.u_phasor
    if shot.samples is None:
        across = U_UNSEEN_VOLT
    elif shot.cycles >= FEWEST_FOR_BATCHES:  # fewer do not determine one quadrature's scatter
        across = math.sqrt(variance_across(buffer.total, buffer.between, shot.cycles, phasor=phasor))
    phase = ShotPhase(
        phasor=phasor,
        u_phasor=buffer.u_phasor,
        u_across=across,
        offset=buffer.offset,
        harmonics=buffer.harmonics,
        largest=buffer.largest,
        reason=buffer.wrong or reason,
    )
    return PhasedShot(shot, shot.middle_mjd, phase)


def _detection(shot: LiveShot, bits: int, run: float, leaked: complex) -> BufferDetection:
    """Detection from samples, or from the ranger's amplitude and phase."""
    if shot.samples is not None and len(shot.samples) != shot.cycles * shot.samples_per_cycle:
        count = f"{len(shot.samples)} samples, but {shot.cycles} cycles of {shot.samples_per_cycle} make"
        wrong = Reason(ShotStatus.WRONG_LENGTH, f"{count} {shot.cycles * shot.samples_per_cycle}")
        return BufferDetection(0j, 0.0, wrong=wrong)
    if shot.samples is not None:
        return _detected(shot, shot.samples, bits, run, leaked)
    if not (math.isfinite(shot.amplitude) and math.isfinite(shot.phase)):
        wrong = Reason(ShotStatus.NO_SAMPLES, "received neither samples nor the ranger's amplitude and phase")
        return BufferDetection(0j, 0.0, wrong=wrong)
    raw = shot.amplitude * complex(math.cos(shot.phase), math.sin(shot.phase))
    return BufferDetection(raw, U_UNSEEN_VOLT, largest=shot.amplitude)


def _detected(shot: LiveShot, samples: NDArray[np.int16], bits: int, run: float, leaked: complex) -> BufferDetection:
    """Detection by the compiled form, problems worded by the plain form."""
    from catseye.signal.detection import buffer_kernel as kernel

    n, volts, m = shot.samples_per_cycle, shot.volts_per_code, shot.cycles
    if m < 2:  # a single cycle's noise comes from its overtones: rare, left to the plain form
        return _plainly(samples, n, volts, bits)
    ends = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    moving, stationary = np.zeros(16), np.zeros(8)
    kernel.one_buffer(np.ascontiguousarray(samples), n, ends, run, leaked / volts, moving, stationary)
    out, stand = moving.tolist(), stationary.tolist()
    wrong = None
    if out[kernel.CLIPPED] or out[kernel.DROPPED] or out[kernel.LONGEST] >= shortest_run(n):
        wrong = _plainly(samples, n, volts, bits).wrong
    mean, moments = (out[0:2], out[kernel.TOTAL :]) if run == 0.0 else (stand[0:2], stand[2:])
    return BufferDetection(
        raw=complex(mean[0], mean[1]) * volts + (leaked if run else 0.0),
        u_phasor=math.sqrt((moments[0] + moments[1]) / (2.0 * (m - 1) * m)) * volts,
        offset=out[kernel.OFFSET] * volts,
        harmonics=(out[kernel.SECOND] * volts, out[kernel.SECOND + 1] * volts),
        largest=max(-out[kernel.LOW], out[kernel.HIGH]) * volts,
        clipped=int(out[kernel.CLIPPED]),
        total=[v * volts**2 for v in moments[:3]],
        between=[v * volts**2 for v in moments[3:6]],
        wrong=wrong,
    )


def _plainly(samples: NDArray[np.int16], n: int, volts: float, bits: int) -> BufferDetection:
    """Detection by the campaigns' plain form."""
    one = Detections.empty(1)
    one.put(np.zeros(1, dtype=np.int64), samples[None], n, volts, bits)
    return one.row(0)


def answer(
    row: PhasedShot,
    history: RangerHistory,
    *,
    predicted: Callable[[], float] | None,
    line: Callable[[], SolvedLine],
    d0: float,
    modulation_hz: float,
    walk: float,
) -> ShotAnswer:
    """Immediate answer to one shot.

    history     of its ranger, before this shot
    predicted   distance, m, scan point to target at its middle; None if unknown
    line        the line's corrections
    d0          m, of the internal cube
    walk        rad per root second, of the electronics

    Source: [PARKER04] eq. 5.12 and 5.18: D = ((N - p/2pi) c/2f)/n - (glass, axes, zero) + D0.
    """
    amplitude, phase = abs(row.phase.phasor), math.atan2(row.phase.phasor.imag, row.phase.phasor.real) % TWO_PI
    if row.reason:
        return ShotAnswer.refused(row.reason, amplitude, phase)
    if row.shot.target == REFERENCE:
        usual = history.usual[True]
        level = median(usual) if len(usual) >= 3 else amplitude
        if abs(amplitude / level - 1.0) > REFERENCE_CHANGE:
            text = f"return {amplitude:.3f} V, expected {level:.3f} V from the cube"
            return ShotAnswer.refused(Reason(ShotStatus.BAD_REFERENCE, text), amplitude, phase)
        return ShotAnswer(
            status=ShotStatus.REFERENCE,
            reason=None,
            amplitude=amplitude,
            phase=phase,
            range_=d0,
            u_range=0.0,
            misfit=0.0,
        )
    if not history.references:
        text = "no good shot on the ranger's internal cube yet"
        return ShotAnswer.refused(Reason(ShotStatus.NO_REFERENCE, text), amplitude, phase)
    if predicted is None:
        return ShotAnswer.refused(Reason(ShotStatus.NO_PLACE, "no telescope position received"), amplitude, phase)
    last = history.references[-1]
    half = 0.5 * SPEED_OF_LIGHT / modulation_hz
    share = ((phase - math.atan2(last.phase.phasor.imag, last.phase.phasor.real)) / TWO_PI) % 1.0
    corrections, distance = line(), predicted()
    coarse = corrections.index * (distance + corrections.added)
    optical = (round(coarse / half + share) - share) * half
    range_ = optical / corrections.index - corrections.added
    u_phase = math.hypot(row.phase.u_across / amplitude, last.phase.u_across / max(abs(last.phase.phasor), 1e-9))
    drift = walk * math.sqrt(abs(row.mjd - last.mjd) * SECONDS_PER_DAY)
    u = half / TWO_PI / corrections.index * math.hypot(u_phase, drift)
    return ShotAnswer(
        status=ShotStatus.USED,
        reason=None,
        amplitude=amplitude,
        phase=phase,
        range_=range_,
        u_range=u,
        misfit=range_ - distance,
    )
