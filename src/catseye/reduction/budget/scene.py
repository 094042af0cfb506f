"""One shot with all quantities of its range, at the best values."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from catseye.constants import MILLIMETRE, SECONDS_PER_DAY
from catseye.errors import InputError
from catseye.records.night.campaign import REFERENCE, Campaign
from catseye.records.site.mirror import Mirror
from catseye.reduction.epoch.air.field import AirField, PathAir
from catseye.reduction.epoch.head import head_corrections, head_unknowns, radian_length
from catseye.reduction.epoch.parameter import Parameter
from catseye.reduction.epoch.ranges import Phases
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.site.places import RangedPoint
from catseye.signal.cycles.whole import fraction, unwrapped_length, whole_cycles
from catseye.signal.drift.reference import drift_at

FELT = 1e-6  # weight of a reference below which it is negligible


@dataclass(frozen=True)
class Assumptions:
    """Uncertainties that no record of a campaign states, with reasons.

    u_frequency                 of the modulation, relative: a rubidium oscillator left alone ages by some parts in 1e10
                                a year
    u_pressure_hpa              of the mean of the barometers: a station's barometer, compared with one standard
    u_humidity_percent          of the mean of the hygrometers: their usual class
    half_width_index_ratio      of the glass over air, rectangular: melts of one glass differ by so much and no sheet
                                names its melt; the makers' index over air or over vacuum (`optics.glass`) lies within
    thermometer_correlation     between any two stations' offsets, -1 to 1: 0 for thermometers never compared
    """

    u_frequency: float = 1e-9
    u_pressure_hpa: float = 0.1
    u_humidity_percent: float = 2.0
    half_width_index_ratio: float = 5e-4
    thermometer_correlation: float = 0.0


@dataclass(frozen=True, eq=False)
class References:
    """Reference shots of one ranger with their weights at one instant.

    In order of time; the weights are those of the electronics' phase.

    shots        (r,) indices into the campaign's shots
    seconds      (r,) after the campaign's first shot
    phasor       (r,) V, complex, free of leakage
    unwrapped    (r,) rad
    u_phase      (r,) rad, of the samples' noise
    weight       (r,) of each phase in the electronics' phase; they sum to 1
    level        (r,) weight of each amplitude in the reference amplitude
    phase        rad, of the electronics
    u_walk       rad, of that phase by the electronics' walk
    """

    shots: np.ndarray
    seconds: np.ndarray
    phasor: np.ndarray
    unwrapped: np.ndarray
    u_phase: np.ndarray
    weight: np.ndarray
    level: np.ndarray
    phase: float
    u_walk: float

    @property
    def amplitude(self) -> float:
        """Amplitude of the cube's return at that instant, V."""
        return float(self.level @ np.abs(self.phasor))


@dataclass(frozen=True, eq=False)
class ShotScene:
    """One shot with all quantities of its range.

    row                  of the campaign's shots
    seconds              of the shot, after the campaign's first
    ranger, target       names; `place` is the target's
    a, b                 (3,) m, scan point and target
    phasor               V, the light
    u_phasor, u_across   V, standard uncertainty of a quadrature, the two taken as alike, and of the one that turns it
    references           of its ranger
    field, path          the air, and its mean along the path
    phase                rad in [0, 2 pi), the target's after the electronics', as measured
    cycles, margin       N, and distance of the coarse length from another number, m (vacuum)
    half                 m, half the modulation's wavelength in vacuum
    glass, obliquity     Pc and dPc, m
    incidence            rad, on a prism's face; 0 for others
    head                 m, corrections of the ranger's head beyond zero and leakage
    """

    campaign: Campaign
    settings: ReductionSettings
    assumptions: Assumptions
    row: int
    seconds: float
    ranger: str
    target: str
    place: RangedPoint
    a: np.ndarray
    b: np.ndarray
    phasor: complex
    u_phasor: float
    u_across: float
    references: References
    field: AirField
    path: PathAir
    phase: float
    cycles: int
    margin: float
    half: float
    glass: float
    obliquity: float
    incidence: float
    head: float

    @property
    def mirror(self) -> Mirror:
        return self.campaign.mirror_of(self.ranger).at_modulation(self.modulation_hz)

    @property
    def modulation_hz(self) -> float:
        """Modulation frequency of the shot, Hz."""
        return float(self.campaign.modulation_of(np.array([self.row]))[0])

    @property
    def towards(self) -> np.ndarray:
        """Unit vector from the target to the scan point."""
        return (self.a - self.b) / np.linalg.norm(self.a - self.b)

    @property
    def index(self) -> float:
        return 1.0 + float(self.path.refractivity[0])

    @property
    def leakage(self) -> complex:
        """Leakage subtracted from every phasor of this ranger, V."""
        return complex(self.mirror.leakage_amplitude_volt * np.exp(1j * self.mirror.leakage_phase_rad))

    @property
    def length(self) -> float:
        """Path length in air measured by the phase, m."""
        return float(unwrapped_length(self.cycles, self.phase, self.half)) / self.index

    @property
    def range_(self) -> float:
        """Range from scan point to the target's point, m.

        Source: [PARKER04] eq. 5.18 and 5.19, with the glass and the head's corrections in metres.
        """
        return self.length + self.mirror.d0_mm * MILLIMETRE + self.glass + self.obliquity + self.head


def scene_of(
    campaign: Campaign,
    phases: Phases,
    wrong: Mapping[int, str],
    *,
    row: int,
    ends: tuple[np.ndarray, np.ndarray],
    place: RangedPoint,
    settings: ReductionSettings,
    assumptions: Assumptions | None = None,
) -> ShotScene:
    """Scene of a target shot with a phase and a reference.

    wrong   rejected reference shots by row, from `follow_electronics`
    row     of the campaign's shots
    ends    (3,) m, assumed scan point and target: they determine the air and the whole cycles
    place   the target's

    Raises InputError where the target's face looks away from the ranger: it cannot have returned the light.
    """
    shots = campaign.shots
    ranger, target = shots.ranger[row], shots.target[row]
    a, b = ends
    mirror = campaign.mirror_of(ranger)
    references = references_of(campaign, phases, wrong, row=row)
    field = AirField.of(campaign, settings).on_lines(shots.mjd_utc[[row]], [frozenset((ranger, target))])
    path = field.along(shots.mjd_utc[[row]], a[None], b[None], np.zeros(len(field.names)))
    distance = float(np.linalg.norm(a - b))
    cosine = 1.0 if place.normal is None else float(np.clip(place.normal @ (a - b) / distance, -1.0, 1.0))
    if cosine <= 0.0:
        raise InputError(f"shot {shots.shot[row]}: the face of {target} looks away from {ranger}: no range")
    incidence, obliquity = (0.0, 0.0) if place.normal is None else _obliquity(campaign, place, cosine)
    modulation = campaign.modulation_of(np.array([row]))
    half = float(campaign.half_wavelengths(np.array([row]))[0])
    phase = float(fraction(phases.phase[row], references.phase))
    index = 1.0 + float(path.refractivity[0])
    head = _head(campaign, ranger, b - a, phase, abs(phases.phasor[row]), references.amplitude, index, modulation)
    coarse = index * (distance - place.constant - obliquity - mirror.d0_mm * MILLIMETRE - head)
    cycles, margin = whole_cycles(coarse, phase, half)
    return ShotScene(
        campaign=campaign,
        settings=settings,
        assumptions=assumptions or Assumptions(),
        row=row,
        seconds=_seconds(campaign, row),
        ranger=ranger,
        target=target,
        place=place,
        a=a,
        b=b,
        phasor=complex(phases.phasor[row]),
        u_phasor=float(phases.u_phasor[row]),
        u_across=float(phases.u_across[row]),
        references=references,
        field=field,
        path=path,
        phase=phase,
        cycles=int(cycles),
        margin=float(margin),
        half=half,
        glass=place.constant,
        obliquity=obliquity,
        incidence=incidence,
        head=head,
    )


def _obliquity(campaign: Campaign, place: RangedPoint, cosine: float) -> tuple[float, float]:
    """Incidence on a prism's face, rad, and its change of the range constant, m."""
    from catseye.optics.retroreflector.prism import obliquity_correction

    ranging = campaign.site.ranging
    ratio, bends = ranging.bk7_to_air_group_index_ratio, ranging.bk7_to_air_phase_index_ratio
    return float(np.arccos(cosine)), float(obliquity_correction(place.height, ratio, cosine, phase=bends))


def references_of(campaign: Campaign, phases: Phases, wrong: Mapping[int, str], *, row: int) -> References:
    """Good reference shots of a shot's ranger, with their weights.

    Raises InputError where the ranger has none.

    Source: as `follow_electronics`; the weights are those of `drift_at`, which is linear in the phases.
    """
    shots = campaign.shots
    modulation = campaign.modulation_of(np.arange(len(shots)))
    good = [
        k
        for k, (ranger, target) in enumerate(zip(shots.ranger, shots.target, strict=True))
        if ranger == shots.ranger[row]
        and target == REFERENCE
        and not phases.reason[k]
        and k not in wrong
        and modulation[k] == modulation[row]
    ]
    if not good:
        raise InputError(f"shot {shots.shot[row]}: {shots.ranger[row]} has no usable shot on its internal cube")
    rows = np.array(sorted(good, key=lambda k: float(shots.mjd_utc[k])))
    seconds = np.array([_seconds(campaign, k) for k in rows])
    when = np.array([_seconds(campaign, row)])
    walk = walk_of(campaign)
    variance = phases.u_phase[rows] ** 2
    unwrapped = np.unwrap(np.angle(phases.phasor[rows]))
    phase, covariance = drift_at(seconds, unwrapped, variance, time=when, random_walk=walk)
    unit = np.eye(len(rows))
    weight = np.array(
        [drift_at(seconds, unit_vector, variance, time=when, random_walk=walk)[0][0] for unit_vector in unit]
    )
    level = np.array([np.interp(when[0], seconds, unit_vector) for unit_vector in unit])
    return References(
        shots=rows,
        seconds=seconds,
        phasor=phases.phasor[rows],
        unwrapped=unwrapped,
        u_phase=phases.u_phase[rows],
        weight=weight,
        level=level,
        phase=float(phase[0]),
        u_walk=float(np.sqrt(max(covariance[0, 0] - weight**2 @ variance, 0.0))),
    )


def walk_of(campaign: Campaign) -> float:
    """Random walk of the electronics, rad per square root of a second."""
    return campaign.site.ranging.electronic_drift_mrad_per_sqrt_hour * 1e-3 / 60.0


def _seconds(campaign: Campaign, row: int) -> float:
    return float((campaign.shots.mjd_utc[row] - campaign.shots.mjd_utc[0]) * SECONDS_PER_DAY)


def head_columns(campaign: Campaign, ranger: str) -> dict[Parameter, int]:
    """First position of each unknown of a head in the list of all parts."""
    at: dict[Parameter, int] = {}
    first = 0
    for unknown in head_unknowns(campaign, ranger):
        at[unknown.quantity], first = first, first + len(unknown.parts)
    return at


def _head(
    campaign: Campaign,
    ranger: str,
    sight: np.ndarray,
    phase: float,
    amplitude: float,
    reference_amplitude: float,
    index: float,
    modulation_hz: np.ndarray,
) -> float:
    corrections = head_corrections(
        campaign,
        ranger,
        head_columns(campaign, ranger),
        sight=sight[None],
        phase=np.array([phase]),
        amplitude=np.array([amplitude]),
        reference_amplitude=np.array([reference_amplitude]),
        per_radian=radian_length(modulation_hz, np.array([index])),
    )
    return float(corrections.value[0])
