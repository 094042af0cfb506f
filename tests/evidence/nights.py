"""Nights of the simulator with all that nature does, reduced and held against their truth."""

import numpy as np

from nature_scene import CLASSES, chance, chance_of_squares, reduced, tally

FIRST_SEED = {60: 6001, 200: 6101, 400: 6201, 1000: 6301}  # fixed beforehand, those of tests/scatter


def one(seed, prisms, directory):
    """Tally of one night."""
    return tally(*reduced(seed, prisms, directory), seed)


def measured(prisms, count, directory, say):
    """Scatter and fates of so many nights of a size.

    Each class has its mean squared normalised error with the 99 % interval of chance.
    """
    seeds = range(FIRST_SEED[prisms], FIRST_SEED[prisms] + count)
    nights = []
    for seed in seeds:
        nights.append(one(seed, prisms, directory))
        say(f"night {seed} of {prisms} prisms")
    kinds = {kind: dict(zip(("low", "mean", "high"), map(float, chance(nights, kind)), strict=True)) for kind in
             (*CLASSES, "surface")}  # fmt: skip
    low, _, high = chance_of_squares(np.zeros(5 * count))
    kinds["pose"] = {"low": low, "mean": float(np.mean([n["pose"] for n in nights]) / 5.0), "high": high}
    low, mean, high = chance_of_squares(np.concatenate([n["thermometers"] for n in nights]))
    kinds["thermometers"] = {"low": low, "mean": mean, "high": high}
    return {
        "prisms": prisms,
        "seeds": [seeds[0], seeds[-1]],
        "classes": kinds,
        **{key: int(sum(n[key] for n in nights)) for key in ("bad", "right", "good", "lost")},
        "innocent_thermometers_named": int(sum(len(n["named"]) for n in nights)),
        "first_night": {kind: float(value) for kind, value in nights[0]["mean"].items()},
    }
