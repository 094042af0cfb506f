"""A user's script, checked by mypy with the package: types are shipped, and the results' fields are known.

Each ignore is needed, or mypy complains of it (`warn_unused_ignores`): a field that is not there is found.
"""

from pathlib import Path
from typing import assert_type

import numpy as np

import catseye


def user_script() -> None:
    night = catseye.reduce("night-01")
    assert_type(night.x, np.ndarray)
    assert_type(night.variance_factor, float)
    assert_type(night.names, tuple[str, ...])
    assert_type(night.verdict.why, str)
    night.coordinates  # type: ignore[attr-defined]  # noqa: B018

    network = catseye.adjust("networks/ground-ring", iterations=9)
    assert_type(network.u, np.ndarray)
    assert_type(catseye.adjust("networks/ground-ring", "networks/ground-ring", points=["A"]).words, tuple[str, ...])

    shot = catseye.explain(Path("night-01"), 120, monte_carlo=0)
    assert_type(shot.u_range, float | None)
    shot.u  # type: ignore[attr-defined]  # noqa: B018

    catseye.air()  # type: ignore[call-arg]
    catseye.reduced  # type: ignore[attr-defined]  # noqa: B018

    assert_type(catseye.simulate(minutes=1.0).seconds, float)
    assert_type(catseye.save(night, "out"), Path)
