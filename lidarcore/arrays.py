"""The arrays that everything here is made of."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Numbers = TypeVar("Numbers", Array, float)
"""Of functions on arrays that kernels compile for single numbers."""
