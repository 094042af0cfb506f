"""Assumptions of a reduction beyond the records, with unit and reason."""

from dataclasses import dataclass

from catseye.constants import DEGREE
from catseye.names import NOTES_AIR_MODEL


@dataclass(frozen=True)
class ReductionSettings:
    """Assumptions of a reduction; defaults are those of the campaign layout's README.

    air_model               name in `catseye.atmosphere.index.air.MODELS`; version 1 of the layout prescribes
                            the notes' model (ciddor_hill1999 moves night-01's feed arm by 12 um)
    critical                |w| above which a shot is rejected; 3.5 rejects one good shot in 2000
    smallest_return         amplitude over its own standard uncertainty below which a shot counts as blocked
    u_thermometer_c         °C, offset of a station thermometer that was not compared with a standard
    u_profile_c             °C, bend: excess over their line half-way between the stations' heights
    u_gradient_c_per_m      °C/m, for a single station height, where no gradient was measured
    surface_minus_air_c     °C, of retroreflectors, for warnings of dew and frost; below zero under a clear sky
    u_normal                rad, each direction, of the normal of a single prism
    u_plate_normal          rad, each direction, of the plate and the axis of a triplet
    u_surface               m, along the normal, of a dish prism off the best paraboloid: some tenths of a millimetre;
                            it only helps to judge shots that contradict each other
    u_position              m, each coordinate, of a typed approximate position: some 15 mm in space
    dense_shots             usable target shots up to which the shared errors of a ranger's shots are one covariance;
                            beyond, they are parameters, see `signal.drift.states`
    most_states             such parameters of the electronics at most, as long as the reference shots themselves are
                            fewer; the weakest modes beyond count as the shots' own errors
    """

    air_model: str = NOTES_AIR_MODEL
    critical: float = 3.5
    smallest_return: float = 5.0
    u_thermometer_c: float = 0.3
    u_profile_c: float = 0.03
    u_gradient_c_per_m: float = 0.02
    surface_minus_air_c: float = 0.0
    u_normal: float = 0.1 * DEGREE
    u_plate_normal: float = 0.3 * DEGREE
    u_surface: float = 0.001
    u_position: float = 0.010
    dense_shots: int = 1500
    most_states: int = 3900
