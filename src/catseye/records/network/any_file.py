"""Read a network from a file or a folder in any supported format.

folder        points.csv and ranges.csv                  `folder`
.toml         catseye, `format = "catseye-network-1"`    `toml`
.gkf, .xml    GNU Gama                                   `gama`
.dat          STAR*NET                                   `starnet`
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from catseye.estimation.network.model import ObservationNetwork
from catseye.records.files.columns import columns_of_arrays
from catseye.records.files.refusal import refusal, shown
from catseye.records.network.claim import RangeClaim
from catseye.records.network.folder import (
    MORE_POINT_COLUMNS,
    POINT_COLUMNS,
    network_of_tables,
    range_columns,
    read_network_folder,
)
from catseye.records.network.gama import read_gama
from catseye.records.network.plausible import with_lengths_checked
from catseye.records.network.starnet import read_starnet
from catseye.records.network.toml import read_network_toml

READERS = {
    ".toml": read_network_toml,
    ".gkf": read_gama,
    ".xml": read_gama,
    ".dat": read_starnet,
}


def read_network(
    path: Path | str, *, sigma_mm: float | None = None, sigma_ppm: float | None = None, planned: bool = False
) -> ObservationNetwork:
    """Network of a file, by suffix, or of a folder.

    path       a folder with points.csv and ranges.csv, or a file .toml, .gkf, .xml, .dat
    sigma_mm, sigma_ppm   standard uncertainty a + b D of a distance that has none, of a folder or a .dat; what the file
                          says counts where it says something
    planned    True if observed values may be missing in a folder or .toml, for a plan

    Raises InputError, one line, for a file that is missing, of another kind, or that cannot be used.
    """
    network = _read(Path(path), sigma_mm=sigma_mm, sigma_ppm=sigma_ppm, planned=planned)
    return network if planned else with_lengths_checked(network)


def network_of_columns(
    tables: Mapping[str, Mapping[str, Sequence[object]]],
    *,
    sigma_mm: float | None = None,
    sigma_ppm: float | None = None,
    planned: bool = False,
) -> ObservationNetwork:
    """Network of the columns of points.csv and ranges.csv.

    tables     "points" and "ranges": columns by name, texts and numbers in m; nan is blank
    sigma_mm, sigma_ppm, planned   as for `read_network`

    Raises InputError as for a folder.
    """
    claim = RangeClaim.from_options(sigma_mm, sigma_ppm)
    points = columns_of_arrays(tables["points"], "points", POINT_COLUMNS, optional=MORE_POINT_COLUMNS)
    required, optional = range_columns(planned)
    ranges = columns_of_arrays(tables["ranges"], "ranges", required, optional=optional)
    network = network_of_tables(points, ranges, claim, planned=planned)
    return network if planned else with_lengths_checked(network)


def _read(path: Path, *, sigma_mm: float | None, sigma_ppm: float | None, planned: bool) -> ObservationNetwork:
    claim = RangeClaim.from_options(sigma_mm, sigma_ppm)
    if path.is_dir():
        return read_network_folder(path, claim, planned=planned)
    if path.suffix.lower() == ".dat":
        return read_starnet(path, claim)
    if claim:
        raise refusal(path.name, "contains all uncertainties (expected neither sigma_mm nor sigma_ppm)")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        kinds = f"expected a folder with points.csv and ranges.csv, or {' '.join(READERS)}"
        raise refusal(path.name, f"ends in {shown(path.suffix)} ({kinds})")
    return reader(path) if reader is not read_network_toml else read_network_toml(path, planned=planned)
