"""Table cells that are safe to open in other programs."""

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
