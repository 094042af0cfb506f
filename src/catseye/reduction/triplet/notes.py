"""Notes on a triplet's calibration, one line each."""

from collections.abc import Iterator

import numpy as np

from catseye.optics.glass import absolute_index, group_index
from catseye.reduction.triplet.result import TripletReduction

CONSTANT_MM = 0.002  # data sheet against its own height and index
NOTABLE = 0.2e-6  # m
RATIO_TOLERANCE = 5e-5  # of the index ratio: series of BK 7 and air of a laboratory, a tenth of the doubtful difference
ANY_MELT = 2e-3  # of the index ratio: more than the difference of melts of a glass
BK7_UM = (0.37, 1.01)
MERCURY = (640.0, 790.0)  # a barometer's reading in mm of mercury below 1.4 km
HPA_OF_MERCURY = 1.33322


def triplet_notes(reduction: TripletReduction) -> Iterator[str]:
    """Notes on cycles, contradictions, the memo's formulas, glass and sheet."""
    yield from _placements(reduction)
    yield from _memo(reduction)
    yield from _glass(reduction)
    yield from _sheet(reduction)


def _placements(reduction: TripletReduction) -> Iterator[str]:
    for number, status in enumerate(reduction.status, start=1):
        if status not in ("good", "suspect"):
            margin = float(reduction.cycles.margin[number - 1]) * 1e3
            yield f"placement {number}: {status}, margin {margin:.1f} mm: check d_toppl_mm and the phases"
    number_of: dict[tuple[float, ...], int] = {}
    for number, placement in enumerate(reduction.measurement.placement, start=1):
        phases = (
            placement.spacer_mm,
            placement.d_toppl_mm,
            placement.phi_1_rad,
            placement.phi_2_rad,
            placement.phi_bcfp_rad,
        )
        first = number_of.setdefault(phases, number)
        if first != number:
            yield f"placement {number} repeats the phases of placement {first} to the last digit: no new measurement"
    names = [str(k + 1) for k in reduction.suspects]
    remainder = reduction.h_corr_without_suspects
    if names and np.isfinite(remainder):
        yield f"placement {', '.join(names)}: contradicts the others; kept; without: H_corr {remainder * 1e3:+.4f} mm"
    elif names:
        yield f"placements {', '.join(names)} contradict each other: undecided which is wrong; all are kept"
    for number, (step, u) in enumerate(zip(reduction.steps, reduction.u_steps, strict=True), start=1):
        if np.isfinite(step) and abs(step) > 4.0 * u > 0.0:
            yield (
                f"placement {number}: by ranging the stops are {step * 1e6:+.1f} µm (u {u * 1e6:.1f}) off those of the "
                "first placement: check the spacer, the whole cycles and the air"
            )


def _memo(reduction: TripletReduction) -> Iterator[str]:
    cycles, memo = reduction.cycles, reduction.memo
    for k in range(len(reduction.h)):
        slips = [
            f"{name} = {int(theirs[k])} for {int(ours[k])}"
            for name, ours, theirs in (
                ("N_1", cycles.n_1, memo.n_1), ("N_2", cycles.n_2, memo.n_2), ("N_BC", cycles.n_bc, memo.n_bc),
            )
            if np.isfinite(theirs[k]) and theirs[k] != ours[k]
        ]  # fmt: skip
        if slips:
            yield f"placement {k + 1}: the memo's INT rule gives {', '.join(slips)}: a slip of a half wavelength"
        if np.isnan([memo.n_1[k], memo.n_2[k], memo.n_bc[k]]).any():
            yield f"placement {k + 1}: Phi_ZRG + Phi_Cal is far beyond the memo's 3.4b: no N by it; catseye needs none"
    off = memo.h_corr - reduction.h
    if np.any(np.abs(off[np.isfinite(off)]) > NOTABLE):
        worst = float(off[np.nanargmax(np.abs(off))])
        yield f"the memo's series for D_MP (3.19b) would move H_corr by up to {worst * 1e6:+.1f} µm: not used"


def _glass(reduction: TripletReduction) -> Iterator[str]:
    if abs(reduction.air_in_glass) > NOTABLE:
        yield (
            f"if the index ratio belongs to 20 °C, 933 hPa, 50 %, H_corr is {reduction.air_in_glass * 1e6:+.2f} µm "
            "more: set bk7_group_index to make it follow the air"
        )
    yield from _against_vacuum(reduction)
    if np.isfinite(reduction.difference) and abs(reduction.difference) > 3.0 * reduction.u_difference:
        text = f"ranging and surface plate differ by {reduction.difference / reduction.u_difference:+.1f} u"
        if abs(reduction.agreeing_ratio - reduction.measurement.bk7_to_air_group_index_ratio) < ANY_MELT:
            text += (
                f"; an index ratio of {reduction.agreeing_ratio:.6f} (u {reduction.u_agreeing_ratio:.6f}) would "
                "reconcile them: compare with other units"
            )
        yield text
    if reduction.plate.paint is None:
        yield "no thickness of paint puts all three points within 0.15 mm of the bare top plate"


def _against_vacuum(reduction: TripletReduction) -> Iterator[str]:
    """Note on a ratio that uses the makers' index of BK 7 as against vacuum.

    The makers' index is against air, so that the air's index was divided out twice.
    """
    m = reduction.measurement
    n, wavelength = m.bk7_to_air_group_index_ratio, m.wavelength_um
    if m.bk7_group_index is not None or not BK7_UM[0] <= wavelength <= BK7_UM[1]:
        return
    eta = float(np.mean(reduction.readings.eta_a))
    if abs(n - float(group_index(wavelength)) / eta) > RATIO_TOLERANCE:
        return
    change = float(absolute_index(wavelength).group) / eta - n
    height, radii = 0.5e-3 * sum(p.height_mm for p in m.prisms), 1e-3 * (m.ball.r1_mm + m.ball.r2_mm)
    h_corr, difference = (height * (1.0 - n**-2) - radii) * change, (height - radii) * change
    yield (
        f"the index ratio {n:.6f} takes the makers' index of BK 7 as against vacuum; it is against air: with "
        f"{n + change:.6f} H_corr would be {h_corr * 1e6:+.0f} µm and the difference {difference * 1e6:+.0f} µm more; "
        "u does not include this"
    )


def _sheet(reduction: TripletReduction) -> Iterator[str]:
    m = reduction.measurement
    n = m.bk7_to_air_group_index_ratio
    if m.right_prism.serial != m.left_prism.serial + 1:
        yield f"serials {m.left_prism.serial} and {m.right_prism.serial} are no pair (figure 3: n and n + 1)"
    for name, prism in zip(("left", "right"), m.prisms, strict=True):
        off = prism.pc_mm + (n - 1.0 / n) * prism.height_mm
        if abs(off) > CONSTANT_MM:
            yield f"the {name} prism's pc_mm is {off * 1e3:+.1f} µm from what its height and the index ratio give"
        off = prism.hrp_mm - prism.height_mm / n
        if abs(off) > CONSTANT_MM:
            yield f"the {name} prism's hrp_mm is {off * 1e3:+.1f} µm from what its height and the index ratio give"
    off = m.ball.pc_b_mm + n * (m.ball.r1_mm + m.ball.r2_mm) - m.ball.r1_mm
    if abs(off) > CONSTANT_MM:
        yield f"the ball's pc_b_mm is {off * 1e3:+.1f} µm from what its radii and the index ratio give"
    for number, placement in enumerate(m.placement, start=1):
        for pressure in sorted({placement.pressure_hpa, placement.flipped("pressure", "hpa")}):
            if MERCURY[0] <= pressure <= MERCURY[1]:
                yield (
                    f"placement {number}: pressure {pressure:g} hPa is air at 2 km and higher: if it was read in mm of "
                    f"mercury, {pressure * HPA_OF_MERCURY:.1f} hPa is meant"
                )
