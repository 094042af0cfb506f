"""A night of fewer shots: campaigns cut to some of their targets, which reduce in a third of the time."""

import dataclasses

import numpy as np

PRISMS = ("DP001", "DP005", "DP010", "DP011", "DP012", "DP020", "DP050")  # of the dish
PLATES = ("TR01", "TR04", "TR05", "TR07")  # triplets whose prisms are kept


def with_shots(campaign, rows, **columns):
    """The campaign with some rows of its shots, in that order, and columns replaced."""
    shots, rows = campaign.shots, np.asarray(rows)
    rows = np.flatnonzero(rows) if rows.dtype == bool else rows
    picked = {
        f.name: tuple(getattr(shots, f.name)[k] for k in rows)
        if isinstance(getattr(shots, f.name), tuple)
        else getattr(shots, f.name)[rows]
        for f in dataclasses.fields(shots)
        if getattr(shots, f.name) is not None
    }
    return dataclasses.replace(campaign, shots=dataclasses.replace(shots, **(picked | columns)))


def with_few_targets(campaign, *more):
    """The campaign with shots on the ground's and the arm's targets, all balls, and some prisms."""
    kept = ("Z", *PRISMS, *PLATES, *more)
    return with_shots(campaign, [name.startswith(kept) or name.endswith("-B") for name in campaign.shots.target])
