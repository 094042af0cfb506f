"""Types that many rooms name: an array of doubles, and a function that is called with progress."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Progress: TypeAlias = Callable[[str, int, int], None]  # step, done, of how many; 0 where that is unknown
