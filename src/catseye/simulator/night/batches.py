"""Common errors of the targets of one batch."""

from dataclasses import replace

from catseye.constants import MILLIMETRE
from catseye.simulator.night.faults import Planted, Streams
from catseye.simulator.night.structure import U_HEIGHT_MM, Structure, TrueTarget

BATCH = 100  # prisms that an optician grinds and measures together, by serial order: chosen


def in_batches(telescope: Structure, strength: float, streams: Streams, planted: Planted) -> Structure:
    """Telescope with a common glass height error in each batch of prisms.

    In addition to each prism's own error.

    strength   one sigma of it, in the u of the sheets; 0: none
    """
    if strength == 0.0:
        return telescope
    size = planted.gain("calibration") * strength * U_HEIGHT_MM * MILLIMETRE

    def ground(prism: TrueTarget, lot: str, serial: int) -> TrueTarget:
        common = size * float(streams(f"batch/{lot}/{serial // BATCH}").normal())
        return replace(prism, sizes=(prism.sizes[0] + common,))

    dish = [ground(prism, "dish", i) for i, prism in enumerate(telescope.dish)]
    units = []
    for i, unit in enumerate(telescope.triplets):
        left_prism, right_prism, ball = unit.targets
        pair = ground(left_prism, "triplet", 2 * i), ground(right_prism, "triplet", 2 * i + 1)
        units.append(replace(unit, targets=(*pair, ball)))
    return replace(telescope, dish=dish, triplets=units)
