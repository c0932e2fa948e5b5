"""Random numbers for compiled resets and noise: one 64-bit stream an environment, started from its ``np_random``.

splitmix64 (Steele, Lea and Flood 2014): a counter and a mixing function, so a stream is one number, and every
environment of a batch draws what it would draw alone.
"""

import numpy as np

from magrod_env._jit import jit

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)


@jit
def uniform(streams, i, low, high):
    """A number in [low, high) from stream ``i``."""
    state = streams[i] + _GOLDEN
    streams[i] = state
    z = (state ^ (state >> np.uint64(30))) * _FIRST
    z = (z ^ (z >> np.uint64(27))) * _SECOND
    z = z ^ (z >> np.uint64(31))
    return low + (high - low) * (np.float64(z >> np.uint64(11)) * 2.0**-53)


@jit
def normal(streams, i):
    """A standard normal number from stream ``i`` (Box and Muller)."""
    radius = np.sqrt(-2.0 * np.log(1.0 - uniform(streams, i, 0.0, 1.0)))
    return radius * np.cos(2.0 * np.pi * uniform(streams, i, 0.0, 1.0))
