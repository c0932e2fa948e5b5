"""Tables of where the targets of a task are, as the compiled kernels read them."""

from typing import NamedTuple

import numpy as np


class Targets(NamedTuple):
    """Tables of a task.

    ``table`` (A, B, num_tracked, 3) m: a path of A points (B = 1), or a grid of A x B reachable points. ``rate``: path
    points a second, zero for a grid. ``starts``: how many entries of the start table an episode may begin from, evenly
    along the path.
    """

    table: np.ndarray
    rate: float
    starts: int
