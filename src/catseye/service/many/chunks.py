"""Chunks of a plan's Monte Carlo as units of work."""

import hashlib
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from catseye.aliases import Progress
from catseye.errors import EstimationError
from catseye.reduction.network.plan import Chunk, chunk_object
from catseye.service.many.run import run_many
from catseye.service.many.unit import Unit
from catseye.version import __version__

PROCESS = 180 * 2**20  # bytes of a process with its libraries, and of a batch
MATRICES = 8  # times the covariance of all parameters, 8 k^2 bytes


def run_chunks(
    chunks: Sequence[Chunk],
    *,
    ledger: Path | None = None,
    resume: bool = False,
    processes: int | None = None,
    cluster: str | None = None,
    progress: Progress | None = None,
) -> list[dict[str, Any]]:
    """Sums of chunks, run side by side; in their order.

    Options are those of `run_many`. Raises EstimationError where a chunk fails, StoppedError as `run_many`.
    """
    simulation, _, last = chunks[0][0], *chunks[-1][1:]
    runs = chunks[-1][1] + last
    identity = hashlib.sha256(__version__.encode())
    _add(identity, simulation)
    memory = PROCESS + MATRICES * 8 * len(simulation.moving) ** 2
    units = [
        Unit(
            name=f"runs-{first}-{first + count - 1}",
            work=chunk_object,
            arguments=(simulation, first, count),
            key=identity.hexdigest(),
            memory=memory,
        )
        for simulation, first, count in chunks
    ]

    def tell(what: str, done: int, total: int) -> None:
        if progress is not None:
            progress(what, round(runs * done / max(total, 1)), runs)

    outcomes = run_many(
        units,
        ledger=ledger,
        resume=resume,
        processes=processes,
        cluster=cluster,
        progress=tell,
        task="Monte Carlo runs",
    )
    for outcome in outcomes:
        if outcome.value is None:
            raise EstimationError(f"Monte Carlo {outcome.name}: {outcome.why}")
    return [outcome.value for outcome in outcomes if outcome.value is not None]


def _add(identity: "hashlib._Hash", value: Any) -> None:
    """Add a value, its type and its shape to a hash: arrays, dataclasses, sequences and plain values."""
    identity.update(f"{type(value).__name__} ".encode())
    if isinstance(value, np.ndarray):
        identity.update(f"{value.dtype} {value.shape}".encode() + np.ascontiguousarray(value).tobytes())
    elif is_dataclass(value):
        for field in fields(value):
            _add(identity, getattr(value, field.name))
    elif isinstance(value, tuple | list):
        for each in (len(value), *value):
            _add(identity, each)
    else:
        identity.update(f"{value!r}\n".encode())
