"""Scatter of many simulated runs against what their last epochs claim."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from catseye.verdict import Verdict

BAND = (0.005, 0.995)  # 99 % of all sets of runs lie within, if the claims are right
POINTS = "points"
BEAM = {  # as in the JSON of an epoch -> for people
    "cross_elevation_arcsec": "beam azimuth × cos E",
    "elevation_arcsec": "beam elevation",
    "focus_mm": "focus",
}


@dataclass(frozen=True)
class ScatterRow:
    """Scatter of one quantity over runs, in units of the claimed u.

    quantity   points, or a component of the beam's offset
    runs       that have it
    terms      independent errors: coordinates of all runs, or one a run
    ratio      root of the mean square of errors over their u
    band       in which 99 % of such ratios lie, if the claims are right
    mean       of errors over their u; NaN for points
    """

    quantity: str
    runs: int
    terms: int
    ratio: float
    band: tuple[float, float]
    mean: float

    @property
    def exceeds(self) -> bool:
        """True if errors are larger than claimed."""
        return self.ratio > self.band[1]


def last_epoch(epochs: Sequence[Mapping[str, Any]], reference: int) -> dict[str, Any]:
    """Numbers of the last epoch compared with the truth, for a run's value; empty without one.

    epochs      as in the JSON of a simulation
    reference   number of the reference epoch of the beam's offset: it and earlier ones have none
    """
    compared = [epoch for epoch in epochs if epoch.get("compared")]
    if not compared:
        return {}
    last = compared[-1]
    beam = last.get("beam", {}) if last["number"] > reference else {}
    return {
        "coordinates": 3 * last["compared"],
        "rms_mm": last["rms_mm"],
        "u_mm": last["mean_u_mm"],
        "chi2_per_coordinate": last["chi2_per_coordinate"],
        "beam": {name: part for name, part in beam.items() if _complete(part)},
    }


def scatter_of(values: Sequence[Mapping[str, Any]]) -> tuple[ScatterRow, ...]:
    """Scatter of points and beam over runs of different seeds.

    values   of runs, with what `last_epoch` gave

    Errors of the coordinates of one run are taken together with their joint covariance, so that their chi² is a sum of
    independent squares; runs are independent by their seeds.
    """
    rows = []
    solved = [value for value in values if value.get("coordinates")]
    if solved:
        terms = sum(value["coordinates"] for value in solved)
        square = sum(value["coordinates"] * value["chi2_per_coordinate"] for value in solved)
        rows.append(
            ScatterRow(
                quantity=POINTS,
                runs=len(solved),
                terms=terms,
                ratio=math.sqrt(square / terms),
                band=_band(terms),
                mean=math.nan,
            )
        )
    for name, text in BEAM.items():
        parts = [value["beam"][name] for value in values if name in value.get("beam", {})]
        if errors := [(part["found"] - part["true"]) / part["u"] for part in parts]:
            count = len(errors)
            ratio = math.sqrt(sum(error**2 for error in errors) / count)
            rows.append(
                ScatterRow(
                    quantity=text, runs=count, terms=count, ratio=ratio, band=_band(count), mean=sum(errors) / count
                )
            )
    return tuple(rows)


def scatter_verdict(rows: Sequence[ScatterRow], runs: Verdict) -> Verdict:
    """Verdict on many runs: their own, or doubtful where errors exceed what is claimed.

    runs   verdict on the runs one by one
    """
    worse = [row for row in rows if row.exceeds]
    if not worse or runs.word == "failed":
        return runs
    row = worse[0]
    text = f"errors of {row.quantity} are {row.ratio:.2f} of the claimed u over {row.runs} runs"
    return Verdict("doubtful", f"{text} (expected {row.band[0]:.2f} to {row.band[1]:.2f})")


def scatter_text(row: ScatterRow) -> str:
    """Ratio, band and mean of a row, for people."""
    mean = "" if math.isnan(row.mean) else f", mean {row.mean:+.2f} u"
    low, high = row.band
    return f"{row.ratio:.3f} of the claimed u over {row.runs} runs (99 % band {low:.3f} to {high:.3f}){mean}."


def _complete(part: Mapping[str, Any]) -> bool:
    """True if estimate, u and truth are there."""
    return all(part.get(key) is not None for key in ("found", "u", "true")) and part["u"] > 0.0


def _band(terms: int) -> tuple[float, float]:
    """Band of the root mean square of so many standard normal errors.

    >>> low, high = _band(1000)
    >>> round(low, 3), round(high, 3)
    (0.943, 1.058)
    """
    from scipy.special import gammaincinv

    low, high = (math.sqrt(2.0 * float(gammaincinv(0.5 * terms, share)) / terms) for share in BAND)
    return low, high
