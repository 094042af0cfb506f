"""Networks from files, example names, arrays or `load`, for `adjust`, `compare` and `plan`."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import numpy as np

from catseye.api.reading import place_of
from catseye.api.units import In, plain, with_units
from catseye.errors import InputError

if TYPE_CHECKING:
    from catseye.estimation.network.model import ObservationNetwork

    NetworkSource: TypeAlias = str | os.PathLike[str] | ObservationNetwork | Mapping[str, Any]

TEXTS = ("point", "role", "from", "to")  # columns of points.csv and ranges.csv that are no lengths
NETWORKS = ".toml, .dat (STAR*NET), .gkf (GNU Gama), or a folder with points.csv and ranges.csv"


@with_units
def network_of(
    network: "NetworkSource",
    sigma_mm: Annotated[Any, In("mm", one=True)],
    sigma_ppm: Annotated[Any, In("ppm", one=True)],
    *,
    planned: bool = False,
) -> "tuple[ObservationNetwork, Path | None]":
    """The network itself and the path it was read from."""
    from catseye.estimation.network.model import ObservationNetwork
    from catseye.records.network.any_file import network_of_columns, read_network

    if isinstance(network, ObservationNetwork):
        return network, None
    if isinstance(network, Mapping):
        tables = _tables_of(network)
        return network_of_columns(tables, sigma_mm=sigma_mm, sigma_ppm=sigma_ppm, planned=planned), None
    path = place_of(network)
    if not path.exists():
        raise InputError(f"{path}: missing (expected {NETWORKS})")
    return read_network(path, sigma_mm=sigma_mm, sigma_ppm=sigma_ppm, planned=planned), path


def _tables_of(network: Mapping[str, Any]) -> dict[str, dict[str, list[Any]]]:
    """Columns of two tables, names and plain numbers in m."""
    strange = sorted(set(network) ^ {"points", "ranges"})
    if strange:
        raise InputError(f"network has the tables {', '.join(map(str, network))} (expected points and ranges)")
    tables = {}
    for table, columns in network.items():
        names = list(getattr(columns, "colnames", columns))
        tables[table] = {name: _cells(columns[name], name, f"adjust: {table}, {name}") for name in names}
        lengths = {name: len(cells) for name, cells in tables[table].items()}
        if len(set(lengths.values())) > 1:
            text = ", ".join(f"{name} {count}" for name, count in lengths.items())
            raise InputError(f"{table} has columns of different lengths: {text}")
    return tables


def _cells(values: Any, name: str, called: str) -> list[Any]:
    """Cells of a column, texts or lengths in m."""
    if name in TEXTS:
        return [str(value).strip() for value in np.asarray(values).tolist()]
    numbers = np.asarray(plain(values, In("m"), called), dtype=float)
    if numbers.ndim != 1:
        raise InputError(f"{called} has the shape {numbers.shape} (expected a column)")
    return numbers.tolist()


def hashes_of(path: Path | None) -> dict[str, str]:
    """SHA-256 of a network's file or tables, by name."""
    from catseye.gateways.network.files import input_hashes

    return {} if path is None else input_hashes(path)
