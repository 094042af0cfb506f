"""What a reader of a triplet's calibration should know, a line each."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from catseye.reduction.triplet import TripletReduction

CONSTANT_MM = 0.002  # data sheet against its own height and index
NOTABLE = 0.2e-6  # m


def triplet_notes(found: "TripletReduction") -> Iterator[str]:
    """Lines about whole cycles, contradictions, the memo's own formulas, the glass and the sheet."""
    yield from _placements(found)
    yield from _memo(found)
    yield from _glass(found)
    yield from _sheet(found)


def _placements(found: "TripletReduction") -> Iterator[str]:
    for number, status in enumerate(found.status, start=1):
        if status not in ("good", "suspect"):
            margin = float(found.cycles.margin[number - 1]) * 1e3
            yield f"placement {number}: {status}, margin {margin:.1f} mm: check d_toppl_mm and the phases"
    names = [str(k + 1) for k in found.suspects]
    rest = found.h_corr_without_suspects
    if names and np.isfinite(rest):
        yield f"placement {', '.join(names)}: contradicts the others; kept; without: H_corr {rest * 1e3:+.4f} mm"
    elif names:
        yield f"placements {', '.join(names)} contradict each other: nothing says which is wrong; all are kept"
    for number, (step, u) in enumerate(zip(found.steps, found.u_steps, strict=True), start=1):
        if np.isfinite(step) and abs(step) > 4.0 * u > 0.0:
            yield (
                f"placement {number}: by ranging the stops stand {step * 1e6:+.1f} µm (u {u * 1e6:.1f}) from where the "
                "first placement has them: check the spacer, the whole cycles and the air"
            )


def _memo(found: "TripletReduction") -> Iterator[str]:
    own, memo = found.cycles, found.memo
    for k in range(len(found.h)):
        slips = [
            f"{name} = {int(theirs[k])} for {int(ours[k])}"
            for name, ours, theirs in (
                ("N_1", own.n_1, memo.n_1), ("N_2", own.n_2, memo.n_2), ("N_BC", own.n_bc, memo.n_bc),
            )
            if np.isfinite(theirs[k]) and theirs[k] != ours[k]
        ]  # fmt: skip
        if slips:
            yield f"placement {k + 1}: the memo's INT rule gives {', '.join(slips)}: a slip of a half wavelength"
        if np.isnan([memo.n_1[k], memo.n_2[k], memo.n_bc[k]]).any():
            yield f"placement {k + 1}: Phi_ZRG + Phi_Cal is outside the memo's rule 3.4b; ours does not need it"
    off = memo.h_corr - found.h
    if np.any(np.abs(off[np.isfinite(off)]) > NOTABLE):
        worst = float(off[np.nanargmax(np.abs(off))])
        yield f"the memo's series for D_MP (3.19b) would move H_corr by up to {worst * 1e6:+.1f} µm: not used"


def _glass(found: "TripletReduction") -> Iterator[str]:
    if abs(found.air_in_glass) > NOTABLE:
        yield (
            f"if the index ratio belongs to 20 °C, 933 hPa, 50 %, H_corr is {found.air_in_glass * 1e6:+.2f} µm more: "
            "give bk7_group_index to have it follow the air"
        )
    if np.isfinite(found.difference) and abs(found.difference) > 3.0 * found.u_difference:
        yield (
            f"ranging and surface plate differ by {found.difference / found.u_difference:+.1f} u; an index ratio of "
            f"{found.agreeing_ratio:.6f} (u {found.u_agreeing_ratio:.6f}) would join them: compare with other units"
        )
    if found.plate.paint is None:
        yield "no thickness of paint puts all three points within 0.15 mm of the bare top plate"


def _sheet(found: "TripletReduction") -> Iterator[str]:
    m = found.measurement
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
    for number, each in enumerate(m.placement, start=1):
        for humidity in {each.humidity_percent, each.flipped("humidity", "percent")}:
            if 0.0 < humidity < 1.0:
                yield f"placement {number}: humidity {humidity:g} % looks like a share of one: percent is meant"
