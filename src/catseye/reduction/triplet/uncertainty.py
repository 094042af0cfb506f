"""Uncertainty of each placement of a triplet, and what placements share.

Each input is moved by its standard uncertainty up and down; half the change is its share ([JCGM100] 5.1.4, note 2). An
input common to several placements is moved once, in all of them: heights, sizes of the glass, index ratio, fixture, a
phase that was read once and recorded for several flips.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from catseye.aliases import Array
from catseye.atmosphere.index.air import air
from catseye.records.laboratory.triplet_measurement import TripletMeasurement
from catseye.reduction.triplet.geometry import TripletCycles, TripletLengths, TripletReadings, triplet_lengths

Moves = dict[str, Array]
FEW = 0.1  # of u_phase: coarser steps make two readings agree to the last digit more often than one in 35


@dataclass(frozen=True, eq=False)
class TripletShares:
    """Contributions of q inputs to the outputs of k placements.

    m, one standard uncertainty each.

    groups    (q,) kind of input
    h_corr    (q, k)
    depth     (q, k) of the mid-point below the scan point
    l_mpbc    (q,)
    """

    groups: tuple[str, ...]
    h_corr: Array
    depth: Array
    l_mpbc: Array


def triplet_shares(measurement: TripletMeasurement, readings: TripletReadings, cycles: TripletCycles) -> TripletShares:
    """Contribution of every input to every placement.

    measurement   a measured unit
    readings      its readings
    cycles        whole half wavelengths, fixed

    Source: [JCGM100] 5.1.4 note 2 and eq. F.2.
    """
    inputs = list(_inputs(measurement))
    count = len(measurement.placement)
    names = {name for _, moves in inputs for name in moves}
    stacked = {name: np.zeros((2 * len(inputs), count)) for name in names}
    for row, (_, moves) in enumerate(inputs):
        for name, move in moves.items():
            stacked[name][2 * row] += move
            stacked[name][2 * row + 1] -= move
    moved: TripletLengths = triplet_lengths(readings.moved(stacked), cycles)

    def half(values: Array) -> Array:
        values = np.broadcast_to(values, (2 * len(inputs), count))
        return 0.5 * (values[0::2] - values[1::2])

    return TripletShares(
        groups=tuple(group for group, _ in inputs),
        h_corr=half(moved.h_corr),
        depth=half(moved.depth_mp),
        l_mpbc=half(moved.l_mpbc)[:, 0],
    )


def _inputs(measurement: TripletMeasurement) -> Iterator[tuple[str, Moves]]:
    """Every input once, as (group, joint change).

    The change is by one standard uncertainty.
    """
    yield from _phases(measurement)
    yield from _air(measurement)
    one = np.ones(len(measurement.placement))
    plate, ball, n = measurement.surface_plate, measurement.ball, measurement.bk7_to_air_group_index_ratio
    for name in ("l_1", "l_2", "l_bt"):
        yield "heights", {name: one * plate.u_height_mm * 1e-3}
    yield "l_post", {"l_post": one * plate.u_l_post_mm * 1e-3}
    yield "d_12", {"d_12": one * measurement.u_d12_mm * 1e-3}
    for side, prism in enumerate(measurement.prisms, start=1):
        u = one * prism.u_height_mm * 1e-3
        yield "glass sizes", {f"height_{side}": u, f"hrp_{side}": u / n, f"pc_{side}": -(n - 1.0 / n) * u}
    u = one * ball.u_r_mm * 1e-3
    yield "glass sizes", {"r_1": u, "pc_b": -(n - 1.0) * u}
    yield "glass sizes", {"pc_b": -n * u}
    u = one * measurement.u_bk7_to_air_group_index_ratio
    moves = {"n": u, "pc_b": -(ball.r1_mm + ball.r2_mm) * 1e-3 * u}
    for side, prism in enumerate(measurement.prisms, start=1):
        height = prism.height_mm * 1e-3
        moves |= {f"hrp_{side}": -height / n**2 * u, f"pc_{side}": -(1.0 + 1.0 / n**2) * height * u}
    yield "index ratio", moves
    for name in ("ball_along", "ball_up"):
        yield "ball in the plate", {name: one * measurement.u_lateral_mm * 1e-3}


def _phases(measurement: TripletMeasurement) -> Iterator[tuple[str, Moves]]:
    """Each phase reading once, wherever it is recorded.

    Equal digits are one reading, unless they are so few that a second reading would often show the same: then one
    recorded at the flip counts as a new reading.
    """
    count = len(measurement.placement)
    step = written_step(measurement)
    read: dict[tuple[object, ...], Moves] = {}

    def again(k: int, quantity: str) -> tuple[object, ...]:
        placement = measurement.placement[k]
        coarse = step > FEW * placement.u_phase_rad
        return ("again", k) if coarse and getattr(placement, f"{quantity}_flipped_rad") is not None else ()

    for k, placement in enumerate(measurement.placement):
        place = (placement.spacer_mm, placement.d_toppl_mm)
        written = [
            ("phi_1", (*place, 1, placement.phi_1_rad)),
            ("phi_2", (*place, 2, placement.phi_2_rad)),
            ("phi_bcfp", (*place, 3, placement.phi_bcfp_rad)),
            ("phi_zrg", ("reference", placement.phi_zrg_rad)),
            ("phi_zrg_fp", ("reference", *again(k, "phi_zrg"), placement.flipped("phi_zrg", "rad"))),
            ("phi_cal", ("calibration", placement.phi_cal_rad)),
            ("phi_cal_fp", ("calibration", *again(k, "phi_cal"), placement.flipped("phi_cal", "rad"))),
        ]
        for name, key in written:
            moves = read.setdefault((*key, placement.u_phase_rad), {})
            moves.setdefault(name, np.zeros(count))[k] = placement.u_phase_rad
    for moves in read.values():
        yield "phases", moves


def written_step(measurement: TripletMeasurement) -> float:
    """Last recorded digit of the sheet's phases, rad.

    Of the finest of them.

    measurement   a measured unit
    """
    names = ("phi_1_rad", "phi_2_rad", "phi_bcfp_rad")
    finest = min(Decimal(repr(getattr(p, name))).as_tuple().exponent for p in measurement.placement for name in names)
    return float(10.0 ** int(finest))


def _air(measurement: TripletMeasurement) -> Iterator[tuple[str, Moves]]:
    """Contribution of the weather's readings, each time they were needed.

    A common offset cancels.
    """
    common = {"wavelength_um": measurement.wavelength_um, "model": measurement.air_model}
    count = len(measurement.placement)
    for k, placement in enumerate(measurement.placement):
        before = (placement.temperature_c, placement.pressure_hpa, placement.humidity_percent)
        after = (
            placement.flipped("temperature", "c"),
            placement.flipped("pressure", "hpa"),
            placement.flipped("humidity", "percent"),
        )
        for name, weather in (("eta_a", before), ("eta_a_fp", after)):
            slope = air(*weather, **common).sensitivity
            move = np.zeros(count)
            move[k] = np.sqrt(
                (slope.temperature_c * measurement.u_temperature_c) ** 2
                + (slope.pressure_hpa * measurement.u_pressure_hpa) ** 2
                + (slope.humidity_percent * measurement.u_humidity_percent) ** 2
            )
            yield "air", {name: move}
