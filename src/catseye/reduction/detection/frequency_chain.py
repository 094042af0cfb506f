"""Frequencies of a ranger from its reference to the samples, and what disturbs the phase."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from catseye.atmosphere.index.air import group_refractivity
from catseye.atmosphere.index.wavelength import Sidebands, modulation_wavelength, sidebands
from catseye.errors import ArgumentError, ValidityError
from catseye.signal.detection.frequency_plan import FrequencyPlan
from catseye.signal.detection.sampling import (
    BUFFER_SAMPLES,
    INTERMEDIATE_LIMIT_HZ,
    SAMPLE_RATE_LIMIT_HZ,
    MotionEffect,
    SamplingPlan,
    aliasing_harmonics,
    jitter_u_phase,
    modulation_response,
    motion_effect,
)
from catseye.signal.systematics.leakage import quadrature_range_error, rms_range_error, worst_range_error
from catseye.signal.systematics.multipath import multipath_error
from catseye.verdict import Verdict

LINES_HZ = (50.0, 57.0, 60.0, 100.0, 120.0)  # mains, and [PARKER04] 5.1.1's 57 Hz of the maser
HIGHEST = 130  # order of the folding harmonics that are listed


@dataclass(frozen=True)
class DisturbanceEffect:
    """Effect of a signal of the modulation's own frequency.

    ratio            its amplitude over the signal's
    phase_error      rad, in quadrature
    range_error      m, in quadrature
    worst            m, at the worst of all phases
    rms              m, over random phases
    """

    ratio: float
    phase_error: float
    range_error: float
    worst: float
    rms: float


@dataclass(frozen=True, eq=False)
class FrequencyChain:
    """Frequencies of a ranger, its sampling, and effects on the phase.

    plan, sampling      reference, modulation and oscillator; samples of a buffer
    temperature_c, pressure_hpa, humidity_percent, wavelength_um, air_model   of the light and the air
    group_index         n_g by the derivative of the phase index
    bands               carrier and sidebands, with n_m - 1 of their beat
    half_wavelength     m, in this air: the unambiguous range
    folding             orders of the harmonics that fold onto the fundamental
    lines               response of a buffer's phase to a line in phase, by its frequency, Hz
    disturbance         signal of the same frequency
    multipath           m, range error of that signal as a second path; None where its length is not said
    motion              of a moving target; None where no range rate is said
    u_jitter_phase      rad, of independent jitter of 1 us of each sample's time
    """

    plan: FrequencyPlan
    sampling: SamplingPlan
    temperature_c: float
    pressure_hpa: float
    humidity_percent: float
    wavelength_um: float
    air_model: str
    group_index: float
    bands: Sidebands
    half_wavelength: float
    folding: tuple[int, ...]
    lines: dict[float, float]
    disturbance: DisturbanceEffect
    multipath: float | None
    motion: MotionEffect | None
    u_jitter_phase: float

    @property
    def local_oscillator_hz(self) -> float:
        """Frequency of the local oscillator, Hz."""
        return self.plan.local_oscillator_hz(self.sampling.intermediate_hz)

    @property
    def verdict(self) -> Verdict:
        """Good where the plan keeps the limits of its parts; doubtful where the phase grows with distance."""
        if self.plan.phase_sign > 0:
            return Verdict("doubtful", "the oscillator lies below: the phase grows with distance, against eq. 5.9")
        return Verdict("good", "within the limits of converter, buffer and intermediate frequency")


def frequency_chain(  # noqa: PLR0913 - a plan has so many numbers
    *,
    reference_hz: float,
    multiple: int,
    oscillator: Literal["above", "below"],
    intermediate_hz: float,
    samples_per_cycle: int,
    cycles: int,
    wavelength_um: float,
    temperature_c: float,
    pressure_hpa: float,
    humidity_percent: float,
    air_model: str,
    disturbance: float,
    excess_path: float | None = None,
    range_rate: float | None = None,
    lines_hz: Sequence[float] = LINES_HZ,
) -> FrequencyChain:
    """Frequencies, sidebands, sampling and effects on the phase of one plan.

    reference_hz, multiple, oscillator   as for `FrequencyPlan`
    intermediate_hz, samples_per_cycle, cycles   as for `SamplingPlan`
    wavelength_um     of the light in vacuum, um
    temperature_c, pressure_hpa, humidity_percent   of the air
    air_model         formula of the index
    disturbance       amplitude of a signal of the same frequency over the signal's, 0 to 1
    excess_path       m, by which its path is longer, there and back; None: any
    range_rate        m/s of the target; None: at rest
    lines_hz          Hz, lines in the phase whose response is listed

    Source: [PARKER04] sections 1.2, 5.1.1 and 5.2, eqs. 5.7 to 5.10. Raises ArgumentError for a plan that breaks the
    limits of its parts, ValidityError for air and light outside the model's.
    """
    try:
        plan = FrequencyPlan(reference_hz, multiple, oscillator)
        sampling = SamplingPlan(samples_per_cycle, cycles, intermediate_hz)
    except ValidityError as problem:
        raise ArgumentError(str(problem)) from problem
    if not 0.0 <= disturbance < 1.0:
        raise ArgumentError(f"disturbance = {disturbance} is not within 0 to below 1", "disturbance")
    weather = (temperature_c, pressure_hpa, humidity_percent)
    refractivity = float(group_refractivity(*weather, wavelength_um=wavelength_um, model=air_model))
    bands = sidebands(wavelength_um, plan.modulation_hz, *weather, model=air_model)
    wavelength = float(modulation_wavelength(plan.modulation_hz, 1.0 + refractivity))
    turn = 4.0 * np.pi / wavelength
    in_quadrature = float(quadrature_range_error(disturbance, wavelength))
    path = None
    if excess_path is not None:
        path = float(multipath_error([disturbance], [excess_path], wavelength))
    return FrequencyChain(
        plan=plan,
        sampling=sampling,
        temperature_c=temperature_c,
        pressure_hpa=pressure_hpa,
        humidity_percent=humidity_percent,
        wavelength_um=wavelength_um,
        air_model=air_model,
        group_index=1.0 + refractivity,
        bands=bands,
        half_wavelength=0.5 * wavelength,
        folding=tuple(aliasing_harmonics(sampling.samples_per_cycle, HIGHEST)),
        lines={hz: float(abs(modulation_response(sampling, hz))) for hz in lines_hz},
        disturbance=DisturbanceEffect(
            ratio=disturbance,
            phase_error=in_quadrature * turn,
            range_error=in_quadrature,
            worst=float(worst_range_error(disturbance, wavelength)),
            rms=float(rms_range_error(disturbance, wavelength)),
        ),
        multipath=path,
        motion=None
        if range_rate is None
        else motion_effect(plan, sampling, range_rate=range_rate, group_index=1.0 + refractivity),
        u_jitter_phase=float(jitter_u_phase(sampling, 1e-6)),
    )


def limits() -> dict[str, float]:
    """Limits of the converter and of the intermediate frequency.

    >>> limits()["buffer_samples"]
    65536
    """
    return {
        "buffer_samples": BUFFER_SAMPLES,
        "sample_rate_hz": SAMPLE_RATE_LIMIT_HZ,
        "intermediate_hz": INTERMEDIATE_LIMIT_HZ,
    }
