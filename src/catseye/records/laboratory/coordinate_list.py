"""coord.dat: points of CAL.EQ, one `x y z` in mm per line; `#` begins a comment."""

from pathlib import Path

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import NUMBER, refusal, shown

FARTHEST_MM = 1e7


def read_coordinates(path: Path | str) -> np.ndarray:
    """Points (n, 3), m, of a file; n ≥ 1.

    Raises InputError with file, line and value for anything but three numbers up to 1e7.
    """
    path = Path(path)
    points = []
    for number, line in enumerate(Folder(path.parent).text(path.name).splitlines(), start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        where = f"line {number}, {shown(line.strip())}"
        if len(words) != 3:
            raise refusal(path.name, f"{where} has {len(words)} numbers (expected x y z in mm)")
        for word in words:
            if not NUMBER.fullmatch(word):
                raise refusal(path.name, f"{where}: {shown(word)} is not a number (expected x y z in mm)")
            if not abs(float(word)) <= FARTHEST_MM:
                raise refusal(path.name, f"{where}: {word} mm (expected -1e7 to 1e7)")
        points.append([float(word) for word in words])
    if not points:
        raise refusal(path.name, "has no points (expected lines of x y z in mm)")
    return np.array(points) * MILLIMETRE
