"""Notes on rangers whose shots are distorted."""

from collections.abc import Sequence

import numpy as np

from catseye.signal.detection.harmonics import DISTORTED, kinked_bound

MANY = 6  # rangers with a note each; more share one


def distortion_notes(
    ranger: Sequence[str],
    relative: np.ndarray,
    distorted: np.ndarray,
    *,
    shot: np.ndarray,
    samples_per_cycle: np.ndarray,
) -> list[str]:
    """Rangers with distorted shots, one note each, with the effect on the phase.

    ranger              (n,) names
    relative            (n, 2) second and third harmonic over the fundamental
    distorted           (n,) bool
    shot                (n,) numbers
    samples_per_cycle   (n,)
    """
    names = np.array(ranger)
    notes: dict[str, str] = {}
    for name in sorted(set(names[distorted].tolist())):
        rows = np.flatnonzero((names == name) & distorted)
        top, order = np.unravel_index(int(np.argmax(relative[rows])), (len(rows), 2))
        k = rows[top]
        bound = kinked_bound(relative[k, 0], relative[k, 1], samples_per_cycle[k])
        notes[name] = (
            f"{name}: {len(rows)} of its {int((names == name).sum())} shots are distorted, harmonic {order + 2} of "
            f"shot {int(shot[k])} is {100.0 * relative[k, order]:.1f} % of the return (limit {100.0 * DISTORTED:g} %) "
            f"and turns no phase of synchronous detection, those that fold back up to {1e3 * float(bound):.1g} mrad if "
            f"the wave is clipped; see catseye phase NIGHT --shot {int(shot[k])}"
        )
    if len(notes) <= MANY:
        return list(notes.values())
    listed = ", ".join(list(notes)[:MANY])
    return [
        f"{int(distorted.sum())} shots of {len(notes)} rangers are distorted, a harmonic above {100.0 * DISTORTED:g} % "
        f"of the return: {listed} ..."
    ]
