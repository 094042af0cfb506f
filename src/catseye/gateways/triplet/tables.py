"""Table of triplet calibrations: a row per unit."""

from collections.abc import Mapping, Sequence

from catseye.gateways.writers.columns import Column, Table, each
from catseye.reduction.triplet.result import TripletReduction

PAGE = "triplet.md"
Unit = tuple[str, TripletReduction]

TRIPLETS = Table[Sequence[Unit]](
    "triplets.csv",
    PAGE,
    (
        Column("file", "", "sheet", each(lambda t: t[0])),
        Column("triplet", "", "name of the unit", each(lambda t: t[1].measurement.triplet)),
        Column(
            "h_corr_mm",
            "mm",
            "height of the ball's centre over the prisms' mid-point, towards the prism side: the best",
            each(lambda t: 1e3 * t[1].h_corr),
            ".6f",
        ),
        Column("u_h_corr_mm", "mm", "standard uncertainty of `h_corr_mm`", each(lambda t: 1e3 * t[1].u_h_corr), ".6f"),
        Column("l_mpbc_mm", "mm", "that height from the surface plate", each(lambda t: 1e3 * t[1].l_mpbc), ".6f"),
        Column("u_l_mpbc_mm", "mm", "standard uncertainty of `l_mpbc_mm`", each(lambda t: 1e3 * t[1].u_l_mpbc), ".6f"),
        Column(
            "difference_mm",
            "mm",
            "`h_corr_mm` less `l_mpbc_mm`, shared errors removed",
            each(lambda t: 1e3 * t[1].difference),
            ".6f",
        ),
        Column(
            "u_difference_mm",
            "mm",
            "standard uncertainty of the difference",
            each(lambda t: 1e3 * t[1].u_difference),
            ".6f",
        ),
        Column("accepted", "", "`yes` where the unit is accepted", each(lambda t: "yes" if t[1].accepted else "no")),
        Column(
            "conformity_probability",
            "",
            "probability that it is within its tolerance",
            each(lambda t: t[1].conformity_probability),
            ".6f",
        ),
        Column("placements", "", "number of placements", each(lambda t: len(t[1].h))),
        Column("p", "", "p-value of their scatter", each(lambda t: t[1].p), ".6f"),
    ),
)


def triplets_csv(units: Mapping[str, TripletReduction]) -> str:
    """One row per unit, lengths in mm; an empty cell is unknown.

    units   calibrations by the name of their sheet
    """
    return TRIPLETS.csv(list(units.items()))
