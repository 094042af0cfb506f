"""Head records: phase of each return, and converter samples."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import assert_never

import numpy as np

from catseye.constants import PPM, SPEED_OF_LIGHT, TWO_PI
from catseye.records.site.retroreflector import GlassForm
from catseye.simulator.night.air import TrueAir
from catseye.simulator.night.expansion import MovingPoints
from catseye.simulator.night.faults import Faults, Planted, Streams
from catseye.simulator.night.glass import GLASS_TO_AIR, ball_delay, prism_delay
from catseye.simulator.night.schedule import MODULATION_HZ, REFERENCE, ScheduledShot
from catseye.simulator.night.structure import TrueTarget, unit
from catseye.simulator.night.warm_lines import WarmLine
from catseye.simulator.night.world import U_LEAKAGE_VOLT, TrueHead

RADIANS_PER_METRE = 2.0 * TWO_PI * MODULATION_HZ / SPEED_OF_LIGHT  # of one-way optical path
VOLT_PER_CODE = 10.0 / 32768.0
SAMPLES_PER_CYCLE, CYCLES = 64, 128
NEIGHBOUR_M = 5.0  # outer scale of stationary eddies: extent of air warmed by the dish's backing structure and panels
DRIFT_RAD_PER_ROOT_HOUR = 0.010
HARMONICS = np.array([0.0020, 0.0003])  # second and third, of the amplitude, their phases any from shot to shot
REFERENCE_VOLT = 6.5
USUAL_VOLT = {  # by place; plate and underside are a triplet's
    "dish": (3.8, 5.4),
    "plate": (4.2, 5.9),
    "underside": (2.1, 3.1),
    "arm": (4.5, 6.2),
    "single": (2.8, 3.8),
}
BENCHMARK_VOLT = (4.4, 5.4)


@dataclass(frozen=True)
class Return:
    """Truth of one shot before sampling."""

    shot: ScheduledShot
    phasor: complex  # V, target, stray and leakage together
    status: str  # 'good', 'blocked' or 'reflected'
    index: float  # group index averaged along the path, its fluctuation included; 1 for a reference shot
    range: float  # one-way optical path over index and glass: the straight distance, m
    phase_error: float  # phase error from a stray reflection, rad


def glass_delay(target: TrueTarget, towards_ranger, *, obliquity: float):
    """Optical path that a target's glass adds one way, air metres.

    `obliquity` scales the effect of the angle.
    """
    match target.kind.glass:
        case GlassForm.NONE:
            return 0.0
        case GlassForm.SPHERES:
            return ball_delay(*target.sizes)
        case GlassForm.SLAB:
            straight = (GLASS_TO_AIR - 1.0 / GLASS_TO_AIR) * target.sizes[0]
            slanted = float(prism_delay(np.asarray(target.sizes[0]), target.normal, towards_ranger))
            return straight + obliquity * (slanted - straight)
        case _:
            assert_never(target.kind.glass)


def electronic_phase(head: TrueHead, seconds, streams: Streams, *, planted: Planted):
    """Phase of the electronics at the ascending shot times.

    A random walk; every third head warms up.
    """
    rng = streams(f"electronics/{head.ranger}")
    start, warms, rise = rng.uniform(0.0, TWO_PI), rng.uniform() < 1.0 / 3.0, rng.uniform(0.010, 0.030)
    rise *= rng.choice((-1.0, 1.0))
    steps = np.sqrt(np.diff(seconds, prepend=seconds[0]) / 3600.0) * rng.normal(size=len(seconds))
    walk = planted.gain("drift") * DRIFT_RAD_PER_ROOT_HOUR * np.cumsum(steps)
    transient = planted.gain("warm_up") * warms * rise * np.exp(-(seconds - seconds[0]) / 300.0)
    return start + walk + transient


@dataclass(frozen=True)
class TunedHead:
    """Head at one modulation frequency: the leakage of its sheet, and the truth.

    phase   rad, of the electronics after that at the usual frequency
    """

    modulation_hz: float
    leakage_amplitude_volt: float
    leakage_phase_rad: float
    true_leakage: complex
    phase: float


def at_frequency(head: TrueHead, modulation_hz: float, streams: Streams, *, planted: Planted) -> TunedHead:
    """Head at one modulation frequency; cables and crosstalk turn the phases of another by any angle."""
    if modulation_hz == MODULATION_HZ:
        return TunedHead(
            modulation_hz, head.leakage_amplitude_volt, head.leakage_phase_rad, head.true_leakage, phase=0.0
        )
    rng = streams(f"head/{head.ranger}/{modulation_hz!r}")
    amplitude = round(head.leakage_amplitude_volt * rng.uniform(0.8, 1.2), 5)
    angle, phase = (float(v) for v in rng.uniform(0.0, TWO_PI, 2))
    miss = planted.gain("calibration") * U_LEAKAGE_VOLT * complex(*rng.normal(size=2))
    leakage = planted.gain("leakage") * (amplitude * np.exp(1j * round(angle, 4)) + miss)
    return TunedHead(modulation_hz, amplitude, round(angle, 4), complex(leakage), phase)


def usual_volt(name: str, draw: float) -> float:
    """Usual amplitude of a return, V, for a path's draw of 0 to 1."""
    if name.startswith("ZBM"):
        low, high = BENCHMARK_VOLT
    else:
        place = {"DP": "dish", "ZY": "arm"}.get(name[:2], "single")
        if name.startswith("TR"):
            place = "underside" if name.endswith("-B") else "plate"
        low, high = USUAL_VOLT[place]
    return low + (high - low) * draw


def foreign_return(amplitude: float, draws) -> tuple[complex, complex]:
    """Remaining target factor and stray reflection, on the unit phasor.

    Half of the stray reflections replace the target's (path wrong by 1 mm up to nearly half a wavelength),
    half mix with it, at 15 to 60 %, such that the phase is wrong by at least 1 mm.
    """
    replaces, size, where, side = draws
    sign = 1.0 if side < 0.5 else -1.0
    if replaces < 0.5:
        return 0.0, amplitude * (0.4 + 0.7 * size) * np.exp(1j * sign * RADIANS_PER_METRE * (0.001 + 0.045 * where))
    share = 0.15 + 0.45 * size
    # Between 40 and 140 degrees a share of 0.15 or more turns the phase by at least 0.085 rad: 1.3 mm.
    return amplitude, amplitude * share * np.exp(1j * sign * np.radians(40.0 + 100.0 * where))


def neighbouring_residuals(
    independent: Mapping[str, float], ends: np.ndarray, *, rng: np.random.Generator, share: float
) -> dict[str, float]:
    """Correlated residuals of one ranger's lines.

    A share of their variance is in common as exp(-r / 5 m) between their ends.

    independent   target: independent residual, in its standard deviation
    ends          (n, 3) m, of the targets
    """
    alike = np.exp(-np.linalg.norm(ends[:, None] - ends, axis=2) / NEIGHBOUR_M)
    common = np.linalg.cholesky(alike + 1e-9 * np.eye(len(ends))) @ rng.normal(size=len(ends))
    alone = np.array(list(independent.values()))
    return dict(zip(independent, (np.sqrt(1.0 - share) * alone + np.sqrt(share) * common).tolist(), strict=True))


def returns_of_ranger(
    head: TrueHead,
    shots: list[ScheduledShot],
    *,
    points: MovingPoints,
    targets: dict[str, TrueTarget],
    air: TrueAir | WarmLine,
    faults: Faults,
    planted: Planted,
    streams: Streams,
) -> list[Return]:
    """Returns of one ranger, shot by shot."""
    seconds = np.array([s.seconds for s in shots])
    phase_e = electronic_phase(head, seconds, streams, planted=planted)
    rng = streams(f"returns/{head.ranger}")
    paths = {name: streams(f"air/{head.ranger}/{name}").normal() for name in targets}
    if air.neighbours > 0.0:
        independent = {name: paths[name] for name in sorted({s.target for s in shots} & targets.keys())}
        ends = np.array([points.points[name] for name in independent])
        rng_of_lines = streams(f"air/{head.ranger}/neighbours")
        paths |= neighbouring_residuals(independent, ends, rng=rng_of_lines, share=air.neighbours)
    fluctuation = np.array([paths.get(s.target, 0.0) for s in shots]) * air.conditions.index_fluctuation_ppm * PPM
    flicker = 1.0 + planted.gain("scintillation") * 0.022 * rng.normal(size=len(shots))
    fate, foreign = rng.uniform(size=len(shots)), rng.uniform(size=(len(shots), 4))
    scan = points.at([head.ranger] * len(shots), seconds)
    ends = points.at([head.ranger if s.target == REFERENCE else s.target for s in shots], seconds)
    index = air.path_index(scan, ends, seconds) + planted.gain("index_fluctuation") * fluctuation
    end_index = air.index_at(ends, seconds)
    volt = {name: usual_volt(name, streams(f"path/{head.ranger}/{name}").uniform()) for name in targets}
    weak = faults.weak_amplitude if head.ranger == faults.weak_ranger else 1.0
    oscillator = 1.0 + planted.modulation_ppm.get(head.ranger, 0.0) * PPM
    tuned = {hz: at_frequency(head, hz, streams, planted=planted) for hz in {s.modulation_hz for s in shots}}

    returns = []
    for i, shot in enumerate(shots):
        tune = tuned[shot.modulation_hz]
        per_metre = RADIANS_PER_METRE * oscillator * (shot.modulation_hz / MODULATION_HZ)
        electronics = phase_e[i] + tune.phase
        if shot.target == REFERENCE:
            unit_phasor = np.exp(1j * (electronics - per_metre * end_index[i] * head.true_d0))
            phasor = REFERENCE_VOLT * unit_phasor + tune.true_leakage
            returns.append(
                Return(shot=shot, phasor=complex(phasor), status="good", index=1.0, range=head.true_d0, phase_error=0.0)
            )
            continue
        away = scan[i] - ends[i]
        distance = float(np.linalg.norm(away))
        glass = glass_delay(targets[shot.target], unit(away), obliquity=planted.gain("obliquity"))
        path = index[i] * distance + end_index[i] * glass
        unit_phasor = np.exp(1j * (electronics - per_metre * path))
        amplitude = volt[shot.target] * weak * flicker[i]
        status, remaining, strange = "good", complex(amplitude), 0j
        if fate[i] < faults.fraction_blocked:
            status, remaining = "blocked", 0j
        elif fate[i] > 1.0 - faults.fraction_reflected:
            status = "reflected"
            remaining, strange = foreign_return(amplitude, foreign[i])
        error = float(np.angle(remaining + strange)) if status == "reflected" else 0.0
        phasor = unit_phasor * (remaining + strange) + tune.true_leakage
        returns.append(
            Return(
                shot=shot,
                phasor=complex(phasor),
                status=status,
                index=float(index[i]),
                range=distance,
                phase_error=error,
            )
        )
    return returns


def sampled_frames(head: TrueHead, returns: list[Return], streams: Streams, *, planted: Planted) -> np.ndarray:
    """Converter codes (shots, samples), int16, of one head's shots.

    With harmonics, offset, noise, rounding and clipping.
    """
    rng = streams(f"samples/{head.ranger}")
    offset, spread = rng.uniform(-0.25, 0.25), rng.uniform(0.165, 0.245)  # V
    phasor = np.array([r.phasor for r in returns])[:, None]
    phases = streams(f"harmonics/{head.ranger}").uniform(0.0, TWO_PI, (len(returns), len(HARMONICS)))
    harmonics = np.abs(phasor) * HARMONICS * np.exp(1j * phases)
    turn = np.exp(-1j * TWO_PI * np.arange(SAMPLES_PER_CYCLE) / SAMPLES_PER_CYCLE)
    cycle = offset + np.real(phasor * turn + harmonics[:, :1] * turn**2 + harmonics[:, 1:] * turn**3)  # A cos(j - phi)
    volts = rng.standard_normal((len(returns), CYCLES, SAMPLES_PER_CYCLE), dtype=np.float32)
    volts *= np.float32(planted.gain("noise") * spread / VOLT_PER_CODE)
    volts += (cycle / VOLT_PER_CODE).astype(np.float32)[:, None, :]
    np.rint(volts, out=volts)
    np.clip(volts, -32768.0, 32767.0, out=volts)
    return volts.astype(np.int16).reshape(len(returns), CYCLES * SAMPLES_PER_CYCLE)
