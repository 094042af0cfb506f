"""Cells of tables that other programs open."""

FORMULA = ("=", "+", "-", "@", "\t", "\r")  # with which a spreadsheet begins to compute


def harmless(text: str) -> str:
    """A text that no spreadsheet takes for a formula: an apostrophe before one that begins like it; numbers stay.

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
