"""Warning for names that a later release removes: docs/people/stable.md has the procedure."""

import warnings


class CatseyeDeprecationWarning(FutureWarning):
    """Use of a name that a later release removes.

    A FutureWarning, which Python shows by default, in a script, a notebook and a command alike.
    """


def warn_deprecated(name: str, replacement: str, removal: str, stacklevel: int = 2) -> None:
    """Warn that a name is deprecated.

    name          as the user writes it
    replacement   what to write instead
    removal       version without the name
    stacklevel    as in `warnings.warn`: 1 is the line that calls this function, 2 the line that called its caller

    A test of the contracts fails when the package reaches `removal` and the name is still there.
    """
    text = f"{name} is deprecated and will be removed in catseye {removal}: use {replacement}"
    warnings.warn(text, CatseyeDeprecationWarning, stacklevel=stacklevel + 1)
