"""What can go wrong, as a tree. Each error's text is one line: what, where, the value, the limit, what to do.

CatseyeError
├── InputError        a file, table or record that cannot be used
│   └── ArgumentError arguments of a call that do not fit together
├── ValidityError     a value outside the range where a formula holds
├── FrameError        transforms or points whose frames do not join
└── EstimationError   an adjustment that gave no answer, raised only when the answer is required
"""

from typing import Any


class CatseyeError(Exception):
    """Anything that catseye refuses; the command line prints its one line and exits with 1."""


class InputError(CatseyeError):
    """A file, table or record that cannot be used."""


class ArgumentError(InputError):
    """Arguments of a call that do not fit together; the command line names its options and exits with 2.

    names   of the arguments that the text names
    """

    def __init__(self, text: str, *names: str) -> None:
        super().__init__(text)
        self.names = names


class ValidityError(CatseyeError, ValueError):
    """A value outside the range where a formula holds.

    mask   bool array of the shape of the argument that was refused, True where it is outside; None for a single value
    """

    def __init__(self, text: str, mask: Any = None) -> None:
        super().__init__(text)
        self.mask = mask


class FrameError(CatseyeError, ValueError):
    """Transforms or points whose frames do not join."""


class EstimationError(CatseyeError):
    """An adjustment that gave no answer, raised only when the answer is required."""
