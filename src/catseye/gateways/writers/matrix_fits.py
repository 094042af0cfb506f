"""Large matrix as a FITS image, written row by row to save memory."""

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

BLOCK = 2880  # bytes of a FITS block


def matrix_pages(parts: Iterable[np.ndarray], size: int, cards: Mapping[str, tuple[str, str]]) -> Iterator[bytes]:
    """Square matrix of doubles as the primary image of a FITS file.

    parts   blocks of rows, each (k, size)
    size    number of rows and columns
    cards   additional header cards: value and comment by keyword
    """
    from astropy.io import fits

    header = fits.Header()
    header["SIMPLE"], header["BITPIX"], header["NAXIS"] = True, -64, 2
    header["NAXIS1"], header["NAXIS2"] = size, size
    for key, (value, comment) in cards.items():
        header[key] = value, comment
    yield header.tostring().encode("ascii")
    for part in parts:
        yield np.ascontiguousarray(part, dtype=">f8").tobytes()
    yield bytes(-8 * size * size % BLOCK)
