"""Table cells: safe to open in other programs, and aligned for a terminal."""

from collections.abc import Sequence

FORMULA = ("=", "+", "-", "@", "\t", "\r")  # with which a spreadsheet begins to compute


def harmless(text: str) -> str:
    """Text that no spreadsheet evaluates as a formula.

    A leading apostrophe is added where needed; numbers stay.

    >>> harmless("=1+1"), harmless("-0.5"), harmless("ZY101")
    ("'=1+1", '-0.5', 'ZY101')
    """
    if not text.startswith(FORMULA):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table in columns, right-aligned.

    rows   of as many cells each

    >>> aligned([["point", "x"], ["1", "-0.5"]])
    ['point     x', '    1  -0.5']
    """
    width = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.rjust(w) for cell, w in zip(row, width, strict=True)).rstrip() for row in rows]
