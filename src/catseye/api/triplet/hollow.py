"""`range_triplets`: range to a hollow target by itself, or the zero-distance phase from a known one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import MILLIMETRE
from catseye.errors import ArgumentError
from catseye.names import NOTES_AIR_MODEL

if TYPE_CHECKING:
    from astropy.table import QTable

    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.triplet.hollow import HollowRange


@dataclass(frozen=True, eq=False, repr=False)
class HollowRangeResult(Result):
    """Range to a hollow target, and the ranger's zero-distance phase; metres, rad.

    distance, u_distance       scan point to the target's corner; u by the phases alone
    zero_phase, u_zero_phase   Phi_Cal, given or found
    cycles, margin             whole half wavelengths; error of the coarse length at which they change
    range_                     everything else: the memo's rule by INT
    """

    distance: float
    u_distance: float
    zero_phase: float
    u_zero_phase: float
    cycles: int
    margin: float
    range_: "HollowRange"

    def passages(self) -> "Sequence[Passage]":
        """Distance, phase, cycles and the memo's rule."""
        from catseye.gateways.triplet.in_use import hollow_words
        from catseye.gateways.writers.passage import Passage

        return [Passage(title, text) for title, text in hollow_words(self.range_)]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye triplets range --json`."""
        from catseye.gateways.triplet.in_use import hollow_object

        return hollow_object(self.range_)

    def tables(self) -> "dict[str, QTable]":
        """`range`: distance and zero-distance phase with their u."""
        columns = {"distance": "m", "u_distance": "m", "zero_phase": "rad", "u_zero_phase": "rad", "margin": "m"}
        return {"range": quantities({key: ([getattr(self, key)], unit) for key, unit in columns.items()})}


@with_units
def range_triplets(
    *,
    phase_rad: Annotated[Any, In("rad", one=True)],
    zrg_rad: Annotated[Any, In("rad", one=True)],
    cal_rad: Annotated[Any, In("rad", one=True)] = None,
    coarse_m: Annotated[Any, In("m", one=True)] = None,
    distance_m: Annotated[Any, In("m", one=True)] = None,
    u_phase_rad: Annotated[Any, In("rad", one=True)] = 0.0,
    u_distance_mm: Annotated[Any, In("mm", one=True)] = 0.0,
    temperature_c: Annotated[Any, In("deg_C", one=True)] = 20.0,
    pressure_hpa: Annotated[Any, In("hPa", one=True)] = 933.0,
    humidity_percent: Annotated[Any, In("percent", one=True)] = 50.0,
    modulation_mhz: Annotated[Any, In("MHz", one=True)] = 1500.0,
    wavelength_um: Annotated[Any, In("um", one=True)] = 0.780,
    air_model: str = NOTES_AIR_MODEL,
) -> HollowRangeResult:
    """Range to a hollow target by itself; or the ranger's zero-distance phase from a known distance.

    phase_rad, zrg_rad   phases of the target and of the ranger's reference, rad, 0 to 2 pi
    cal_rad, coarse_m    zero-distance phase, rad, and coarse length, m: they give the distance
    distance_m           known distance from scan point to corner, m: it gives the zero-distance phase instead
    u_phase_rad          of each phase, rad
    u_distance_mm        of the known distance, mm
    temperature_c, pressure_hpa, humidity_percent   of the air: °C, hPa, %
    modulation_mhz, wavelength_um, air_model        of the ranger: MHz, µm; formula of the index

    Raises ArgumentError unless either cal_rad and coarse_m or distance_m are given, ValidityError for phases and air
    without meaning.

    >>> answer = range_triplets(phase_rad=2.0, zrg_rad=1.0, cal_rad=0.5, coarse_m=18.2)
    >>> round(answer.distance, 4), answer.cycles
    (18.1749, 182)
    """
    from catseye.reduction.triplet.hollow import RangePhases, half_in_air, hollow_range, zero_phase_of

    if (distance_m is None) == (coarse_m is None):
        raise ArgumentError("coarse_m or distance_m, one of the two, is needed", "coarse_m", "distance_m")
    if (distance_m is None) == (cal_rad is None):
        raise ArgumentError(
            "cal_rad is needed with coarse_m, and not with distance_m", "cal_rad", "coarse_m", "distance_m"
        )
    half = half_in_air(
        temperature_c,
        pressure_hpa,
        humidity_percent,
        modulation_hz=modulation_mhz * 1e6,
        wavelength_um=wavelength_um,
        model=air_model,
    )
    phases = RangePhases(phase_rad, zrg_rad, u_phase_rad)
    if distance_m is None:
        range_ = hollow_range(phases, coarse_m, cal_rad, half)
    else:
        range_ = zero_phase_of(phases, distance_m, u_distance_mm * MILLIMETRE, half)
    return HollowRangeResult(
        verdict=range_.verdict,
        distance=range_.distance,
        u_distance=range_.u_distance,
        zero_phase=range_.zero_phase,
        u_zero_phase=range_.u_zero_phase,
        cycles=range_.cycles,
        margin=range_.margin,
        range_=range_,
    )
