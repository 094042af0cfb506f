"""Phase of one buffer by three methods, with its harmonics and what they do."""

import math
from dataclasses import dataclass

import numpy as np

from catseye.constants import TWO_PI
from catseye.errors import ArgumentError
from catseye.records.night.buffer import RecordedBuffer
from catseye.signal.cycles.whole import fraction
from catseye.signal.detection.buffers import BufferStatus, Inspection, inspect_buffers
from catseye.signal.detection.harmonics import (
    DISTORTED,
    crossing_shift,
    distorted,
    folded_error,
    kinked_bound,
    relative_harmonics,
)
from catseye.signal.detection.phase import Detection
from catseye.signal.detection.spectral import Tone, strongest_tone
from catseye.signal.detection.zero_crossing import crossing_phase
from catseye.verdict import Verdict

HIGHEST = 10  # order of the harmonics in a result, where n samples a cycle resolve it
AGREED = 4.0  # standard uncertainties of a difference: two methods of good samples differ by more once in 16 000
SPECTRAL = 1.5  # variance of a windowed tone's phase in the middle of a buffer over that of synchronous detection
TONE_HZ = 24.0 * 2.3  # factor of its frequency's variance, see `strongest_tone`
LOUD = 10.0  # standard uncertainties of a phasor: no tone of 65 536 samples of noise is so strong
STRAIGHT = 0.016  # of (2 pi/n)^3 rad: bias of edges on a straight line between two samples
USABLE = (BufferStatus.GOOD, BufferStatus.WEAK, BufferStatus.NO_SCATTER)


@dataclass(frozen=True)
class BufferSampling:
    """Sampling and scale of a buffer.

    samples_per_cycle   n
    cycles              m
    intermediate_hz     Hz
    volts_per_code      V; 1 for samples in volts
    ends                lowest and highest sample of the converter, in the unit of the samples
    """

    samples_per_cycle: int
    cycles: int
    intermediate_hz: float
    volts_per_code: float
    ends: tuple[float, float]

    @property
    def sample_rate_hz(self) -> float:
        """Sampling rate, samples a second."""
        return self.samples_per_cycle * self.intermediate_hz


@dataclass(frozen=True)
class MethodPhase:
    """Phase of a buffer by one method; nan where it gives none.

    name                  synchronous detection, zero crossings or spectrum
    phase, u_phase        rad, at the first sample
    amplitude, u_amplitude   V
    difference            rad, phase less that of synchronous detection
    expected_difference   rad, of that what the harmonics explain
    u_difference          rad, of what they leave; the methods share the samples and their noise
    """

    name: str
    phase: float
    u_phase: float
    amplitude: float
    u_amplitude: float
    difference: float = 0.0
    expected_difference: float = 0.0
    u_difference: float = 0.0

    @property
    def agrees(self) -> bool:
        """True if the difference is what harmonics and noise explain."""
        return abs(self.difference - self.expected_difference) <= AGREED * self.u_difference


@dataclass(frozen=True)
class Harmonic:
    """One harmonic of a buffer.

    order        k
    amplitude    V
    phase        rad, psi of B cos(2 pi k j/n - psi)
    relative     amplitude over the fundamental
    u_relative   its standard uncertainty
    effect       rad, largest error of the phase by synchronous detection
    crossing     rad, shift of the phase by zero crossings that it makes
    """

    order: int
    amplitude: float
    phase: float
    relative: float
    u_relative: float
    effect: float
    crossing: float


@dataclass(frozen=True, eq=False)
class BufferPhase:
    """Phase, amplitude and distortion of one buffer.

    name          file, and row or shot
    volts         (m n,) V, the samples
    sampling      of the samples
    detection     synchronous detection of them as one buffer; leakage is in it
    methods       by synchronous detection first, then zero crossings, then the spectrum
    harmonics     from the second on
    folded        rad, bound on the phase error by harmonics that cannot be resolved, of a wave with kinks
    frequency_hz, u_frequency_hz   of the strongest tone, Hz
    status        of the samples, with what is wrong
    verdict       whether the phase may be relied on
    """

    name: str
    volts: np.ndarray
    sampling: BufferSampling
    detection: Detection
    methods: tuple[MethodPhase, ...]
    harmonics: tuple[Harmonic, ...]
    folded: float
    frequency_hz: float
    u_frequency_hz: float
    status: str
    verdict: Verdict

    @property
    def largest_harmonic(self) -> Harmonic | None:
        """Largest harmonic; None where none is resolved."""
        return max(self.harmonics, key=lambda h: h.relative, default=None)

    @property
    def fitted(self) -> np.ndarray:
        """Offset and fundamental over one cycle, (n,) V."""
        n = self.sampling.samples_per_cycle
        turn = TWO_PI * np.arange(n) / n
        return float(self.detection.offset) + (complex(self.detection.phasor) * np.exp(-1j * turn)).real

    @property
    def mean_cycle(self) -> np.ndarray:
        """Mean of all cycles, (n,) V."""
        return self.volts.reshape(-1, self.sampling.samples_per_cycle).mean(axis=0)

    def spectrum(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies, Hz, and amplitudes, V, of all bins above zero."""
        size = 2.0 * np.abs(np.fft.rfft(self.volts)) / len(self.volts)
        return np.fft.rfftfreq(len(self.volts), 1.0 / self.sampling.sample_rate_hz)[1:], size[1:]


def buffer_phase(
    buffer: RecordedBuffer,
    *,
    sample_rate_hz: float | None = None,
    intermediate_hz: float | None = None,
    cycles: int | None = None,
    full_scale_volt: float = 10.0,
    bits: int = 16,
) -> BufferPhase:
    """Phase of a buffer by synchronous detection, zero crossings and spectrum.

    buffer            samples
    sample_rate_hz    samples a second; None: 64 a cycle
    intermediate_hz   of the signal, Hz; None: 1000
    cycles            that are taken, from the first on; None: all
    full_scale_volt   of the converter, V; as `bits`, not of a campaign's shot, which says them itself
    bits              of the converter

    Source: [PARKER04] section 5.2. Raises ArgumentError for values that do not fit the samples or each other.
    """
    sampling, samples = _sampled(buffer, sample_rate_hz, intermediate_hz, cycles, full_scale_volt, bits)
    n, m = sampling.samples_per_cycle, sampling.cycles
    orders = tuple(range(2, min(HIGHEST, (n - 1) // 2) + 1))
    observed = inspect_buffers(
        samples[None], n, sampling.volts_per_code, converter_ends=sampling.ends, harmonics=orders or (2,)
    )
    detection = _first(observed.detection)
    volts = samples * sampling.volts_per_code
    methods, shifts = _methods(volts, sampling, detection, orders)
    harmonics = _harmonics(detection, orders, n, shifts)
    tone = strongest_tone(volts, sampling.sample_rate_hz) if m >= 3 and m * n >= 16 else None
    size, hertz = float(detection.amplitude), sampling.intermediate_hz
    u_tone = math.sqrt(TONE_HZ) * float(detection.noise) / size / (m * n) ** 1.5 if size > 0.0 else math.nan
    u_hz = math.hypot(u_tone * sampling.sample_rate_hz / TWO_PI, hertz / m / (2.0 * m) ** 3)
    by_order = {h.order: h.relative for h in harmonics}
    folded = float(kinked_bound(by_order.get(2, 0.0), by_order.get(3, 0.0), n)) if n >= 16 and harmonics else math.nan
    tone_hz = math.nan if tone is None else float(tone.frequency_hz)
    verdict = _verdict(observed, detection, methods, harmonics, folded, tone)
    if verdict.word == "good" and abs(tone_hz - hertz) > AGREED * u_hz:
        verdict = Verdict(
            "doubtful",
            f"tone at {tone_hz:.4f} Hz (u {u_hz:.4f}) instead of {hertz:g}: the target moved, or the samples are not "
            "locked; the phase is that of the buffer's middle",
        )
    return BufferPhase(
        name=buffer.name,
        volts=volts,
        sampling=sampling,
        detection=detection,
        methods=methods,
        harmonics=harmonics,
        folded=folded,
        frequency_hz=tone_hz,
        u_frequency_hz=u_hz,
        status=observed.text(0),
        verdict=verdict,
    )


def _sampled(
    buffer: RecordedBuffer,
    sample_rate_hz: float | None,
    intermediate_hz: float | None,
    cycles: int | None,
    full_scale_volt: float,
    bits: int,
) -> tuple[BufferSampling, np.ndarray]:
    """Sampling by file or arguments, and the samples of whole cycles."""
    if buffer.samples_per_cycle is not None and buffer.intermediate_hz is not None:
        for name, value in (("sample_rate_hz", sample_rate_hz), ("intermediate_hz", intermediate_hz)):
            if value is not None:
                raise ArgumentError(f"{name} = {value:g} and the campaign says it itself (expected one of them)", name)
        n, hertz = buffer.samples_per_cycle, buffer.intermediate_hz
    else:
        hertz = 1000.0 if intermediate_hz is None else intermediate_hz
        if not 0.0 < hertz < math.inf:
            raise ArgumentError(f"intermediate_hz = {hertz} is not above 0", "intermediate_hz")
        rate = 64.0 * hertz if sample_rate_hz is None else sample_rate_hz
        per_cycle = rate / hertz
        if not (math.isfinite(per_cycle) and per_cycle >= 3.0 and abs(per_cycle - round(per_cycle)) < 1e-9 * per_cycle):
            raise ArgumentError(
                f"sample_rate_hz = {rate:g} is {per_cycle:.6g} samples a cycle of intermediate_hz = {hertz:g} "
                "(expected a whole number of at least 3)",
                "sample_rate_hz",
                "intermediate_hz",
            )
        n = round(per_cycle)
    length = len(buffer.samples)
    whole, remainder = divmod(length, n)
    if not whole:
        raise ArgumentError(f"{buffer.name}: {length} samples are less than one cycle of {n}", "sample_rate_hz")
    if cycles is None and remainder:
        raise ArgumentError(
            f"{buffer.name}: {length} samples are {whole} times {n} and {remainder} more: give cycles = {whole} to "
            "leave these out",
            "cycles",
        )
    if cycles is not None and not 1 <= cycles <= whole:
        raise ArgumentError(
            f"cycles = {cycles} is not within 1 to {whole}, the whole cycles of {buffer.name}", "cycles"
        )
    m = whole if cycles is None else cycles
    if not 8 <= bits <= 24:
        raise ArgumentError(f"bits = {bits} is not within 8 to 24", "bits")
    if not 0.0 < full_scale_volt < math.inf:
        raise ArgumentError(f"full_scale_volt = {full_scale_volt} is not above 0", "full_scale_volt")
    resolution = buffer.bits or bits
    step = buffer.volts_per_code or full_scale_volt / 2 ** (resolution - 1)
    ends = (-(2.0 ** (resolution - 1)), 2.0 ** (resolution - 1) - 1.0)
    if not buffer.is_codes:
        return BufferSampling(n, m, hertz, 1.0, (ends[0] * step, ends[1] * step)), buffer.samples[: m * n]
    codes = buffer.samples[: m * n]
    beyond = codes[(codes < ends[0]) | (codes > ends[1])]
    if len(beyond):
        raise ArgumentError(
            f"{buffer.name}: code {int(beyond[0])} is beyond a converter of bits = {resolution}, {ends[0]:.0f} to "
            f"{ends[1]:.0f} (expected more bits, or volts with a decimal point)",
            "bits",
        )
    return BufferSampling(n, m, hertz, step, ends), codes


def _first(detection: Detection) -> Detection:
    """Detection of the only buffer, its fields without that axis."""
    from dataclasses import fields, replace

    scatter = replace(
        detection.scatter, **{f.name: getattr(detection.scatter, f.name)[0] for f in fields(detection.scatter)}
    )
    ours = {f.name: getattr(detection, f.name)[0] for f in fields(detection) if f.name != "scatter"}
    return replace(detection, scatter=scatter, **ours)


def _methods(
    volts: np.ndarray, sampling: BufferSampling, detection: Detection, orders: tuple[int, ...]
) -> tuple[tuple[MethodPhase, ...], dict[int, float]]:
    """Phases by all methods, and the shift of zero crossings by each harmonic."""
    n, m = sampling.samples_per_cycle, sampling.cycles
    size, noise, phase = float(detection.amplitude), float(detection.noise), float(detection.phase)
    u_phase, u_size = float(detection.u_phase), float(detection.u_amplitude)
    first = MethodPhase("synchronous detection", phase, u_phase, size, u_size)
    if not (math.isfinite(phase) and size > 0.0):
        return (first,), {}
    resolved = tuple(k for k in orders if 2 * k < n)
    overtones = [complex(v) for v in np.atleast_1d(detection.overtones)[: len(resolved)]]
    expected, u_expected = crossing_shift(complex(detection.phasor), overtones, resolved)
    if not math.isfinite(expected):  # a wave with other edges
        expected, u_expected = 0.0, math.pi
    shifts = {
        k: crossing_shift(complex(detection.phasor), [wave], [k])[0]
        for k, wave in zip(resolved, overtones, strict=True)
    }
    white = noise / size
    least = white * math.sqrt(2.0 / (n * m))  # of synchronous detection in white noise
    straight = STRAIGHT * (TWO_PI / n) ** 3 / math.sqrt(3.0)
    edges = white * math.sqrt(1.0 / (3.0 * m))
    by_edges = float(crossing_phase(volts, n).phase)
    model = math.hypot(straight, u_expected)
    crossings = MethodPhase(
        name="zero crossings",
        phase=by_edges,
        u_phase=math.hypot(edges, model),
        amplitude=math.nan,
        u_amplitude=math.nan,
        difference=_wrapped(by_edges - phase),
        expected_difference=expected,
        u_difference=math.hypot(math.sqrt(max(edges**2 - least**2, 0.0)), model),
    )
    methods = [first, crossings]
    if m >= 3 and m * n >= 16:  # as many cycles as a window needs
        tone = strongest_tone(volts, sampling.sample_rate_hz)
        at_first = float(fraction(tone.phase_centre + TWO_PI * (n * m - 1) / (2.0 * n), 0.0))
        image = 1.0 / (2.0 * m) ** 3  # of the tone's own image, 2 m bins away, and of its harmonics
        methods.append(
            MethodPhase(
                name="spectrum",
                phase=at_first,
                u_phase=math.hypot(math.sqrt(SPECTRAL) * u_phase, image),
                amplitude=float(tone.amplitude),
                u_amplitude=math.hypot(math.sqrt(SPECTRAL) * u_size, image * size),
                difference=_wrapped(at_first - phase),
                u_difference=math.hypot(math.sqrt(SPECTRAL - 1.0) * max(least, u_phase), image),
            )
        )
    return tuple(methods), shifts


def _wrapped(angle: float) -> float:
    return math.remainder(angle, TWO_PI)


def _harmonics(detection: Detection, orders: tuple[int, ...], n: int, shifts: dict[int, float]) -> tuple[Harmonic, ...]:
    size = float(detection.amplitude)
    if not size > 0.0:
        return ()
    sizes = np.atleast_1d(detection.harmonics)
    relative, u = relative_harmonics(sizes, size, float(detection.u_phasor))
    return tuple(
        Harmonic(
            order=k,
            amplitude=float(sizes[i]),
            phase=float(fraction(np.angle(np.atleast_1d(detection.overtones)[i]), 0.0)),
            relative=float(relative[i]),
            u_relative=float(u),
            effect=float(folded_error(k, relative[i], n)),
            crossing=shifts.get(k, math.nan),
        )
        for i, k in enumerate(orders)
    )


def _verdict(
    seen: Inspection,
    detection: Detection,
    methods: tuple[MethodPhase, ...],
    harmonics: tuple[Harmonic, ...],
    folded: float,
    tone: Tone | None,
) -> Verdict:
    status = BufferStatus(seen.status[0])
    if not math.isfinite(float(detection.phase)) or status in (BufferStatus.STUCK, BufferStatus.NOT_FINITE):
        return Verdict("failed", seen.text(0))
    if float(detection.amplitude) < 5.0 * float(detection.u_phasor):
        text = f"no signal: {float(detection.amplitude):.3g} V, u {float(detection.u_phasor):.2g} V"
        if tone is not None and float(tone.amplitude) > LOUD * float(detection.u_phasor):
            text += (
                f"; the strongest tone, {float(tone.amplitude):.3g} V, is at {float(tone.frequency_hz):.6g} Hz: check "
                "sample rate and intermediate frequency"
            )
        return Verdict("failed", text)
    if status not in USABLE:
        return Verdict("doubtful", seen.text(0))
    if status is BufferStatus.NO_SCATTER and not math.isfinite(float(detection.u_phase)):
        return Verdict("doubtful", seen.text(0))
    pair = [h for h in harmonics if h.order in (2, 3)]
    if pair and bool(distorted([h.relative for h in pair], pair[0].u_relative)):
        worst = max(pair, key=lambda h: h.relative)
        bound = (
            f"a clipped wave's phase may be off by {1e3 * folded:.2g} mrad"
            if math.isfinite(folded)
            else "too few samples a cycle"
        )
        return Verdict(
            "doubtful",
            f"distorted: harmonic {worst.order} is {100 * worst.relative:.2f} % of the fundamental (limit "
            f"{100 * DISTORTED:g} %); {bound}",
        )
    odd = [method for method in methods[1:] if not method.agrees]
    if odd:
        one = odd[0]
        left = one.difference - one.expected_difference
        return Verdict(
            "doubtful",
            f"{one.name} differ by {1e3 * left:.3g} mrad, {abs(left) / one.u_difference:.1f} standard uncertainties",
        )
    return Verdict("good", f"{len(methods)} methods agree within their uncertainties, harmonics are below the limit")
