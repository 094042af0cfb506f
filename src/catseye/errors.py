"""Error classes. Each error's text is one line: what, where, value, limit, what to do.

CatseyeError
├── InputError        a file, table or record that cannot be used
│   └── ArgumentError arguments that are invalid or do not fit together
├── ValidityError     a value outside the range of validity of a formula
├── FrameError        transforms or points with mismatched frames
└── EstimationError   an adjustment without a result, raised only when the result is required
"""

from enum import Enum
from typing import Any


class CatseyeError(Exception):
    """Base class of catseye's errors; the command line prints one line and exits with 1."""


class InputError(CatseyeError):
    """File, table or record that cannot be used."""


class ArgumentError(InputError):
    """Arguments that are invalid or do not fit together; a command names its options instead and exits with 2.

    names   of the arguments that the text names
    """

    def __init__(self, text: str, *names: str) -> None:
        super().__init__(text)
        self.names = names


class ValidityError(CatseyeError, ValueError):
    """Value outside the range of validity of a formula.

    mask   bool array of the argument's shape, True where it is outside; None for a single value
    """

    def __init__(self, text: str, mask: Any = None) -> None:
        super().__init__(text)
        self.mask = mask


class FrameError(CatseyeError, ValueError):
    """Transforms or points with mismatched frames."""


class EstimationError(CatseyeError):
    """Adjustment without a result, raised only when the result is required.

    reason   member of an enum of the module that raises; None without one
    data     values that the text names, by name

    >>> EstimationError("pillar number 3 has no distance", pillar=3).data
    {'pillar': 3}
    """

    def __init__(self, text: str, *, reason: Enum | None = None, **data: Any) -> None:
        super().__init__(text)
        self.reason = reason
        self.data = data
