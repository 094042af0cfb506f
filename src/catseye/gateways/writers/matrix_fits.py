"""A large matrix as a FITS image, row by row, so that it need not be in memory."""

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

BLOCK = 2880  # bytes, in which FITS counts


def matrix_pages(parts: Iterable[np.ndarray], size: int, cards: Mapping[str, tuple[str, str]]) -> Iterator[bytes]:
    """A square matrix of doubles as the primary image of a FITS file.

    parts   rows, some at a time, (k, size)
    size    of the matrix
    cards   further ones of the header: value and comment by keyword
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
