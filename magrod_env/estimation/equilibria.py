"""Equilibria of many rods of one make under loads of their own, in one compiled call."""

import numpy as np

from magrod_env._jit import jit
from magrod_env.rod.layout import GRAVITY
from magrod_env.rod.statics import find_equilibrium


@jit
def find_shapes(block, layout, terms, gravities, fields, positions, quaternions, shares):
    """Equilibria of K rods of one make under gravities (K, 3) m/s^2 and fields (K, 3) T (see `find_equilibrium`)."""
    lanes, gradient = len(terms.lanes), np.zeros(9)
    for k in range(len(fields)):
        for axis in range(3):
            for lane in range(lanes):
                block[(GRAVITY + axis) * lanes + lane] = gravities[k, axis]
        _, shares[k] = find_equilibrium(
            block, layout, terms, None, None, fields[k], gradient, positions[k], quaternions[k]
        )
