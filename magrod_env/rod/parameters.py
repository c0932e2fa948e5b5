"""What may differ from rod to rod of a batch, beside its motion: factors of the nominal rod, gravity, drag, damping."""

from typing import NamedTuple

import numpy as np

from magrod_env._jit import jit
from magrod_env.rod.layout import DAMPING, DRAG, GRAVITY, SPIN_DRAG
from magrod_env.rod.mesh import RodValues, write_constants


class RodParameters(NamedTuple):
    """Parameters of K rods."""

    modulus: np.ndarray  # (K,) factor of every stiffness
    density: np.ndarray  # (K,) factor of the rod's mass and rotary inertia; magnets keep their mass
    moment: np.ndarray  # (K,) factor of the magnets' moments
    magnet_shift: np.ndarray  # (K,) m, of every magnet but one at the tip
    gravity: np.ndarray  # (K, 3) m/s^2
    drag: np.ndarray  # (K,) 1/s
    spin_drag: np.ndarray  # (K,) 1/s
    internal_damping: np.ndarray  # (K,) s


@jit
def varied(values, parameters, rod, axes):
    """Values of one rod, its magnets' moments in the axes of its motion first: ``axes`` is their order."""
    ends = values.ends.copy()
    for segment in range(len(ends) - 1):
        ends[segment] += parameters.magnet_shift[rod]
    moments = np.zeros_like(values.magnet_moments)
    for k in range(3):
        moments[:, k] = values.magnet_moments[:, axes[k]] * parameters.moment[rod]
    stiff, heavy = parameters.modulus[rod], parameters.density[rod]
    return RodValues(
        ends,
        values.axial * stiff,
        values.shear * stiff,
        values.bending * stiff,
        values.torsion * stiff,
        values.mass_per_length * heavy,
        values.rotary * heavy,
        values.polar * heavy,
        values.magnet_masses,
        moments,
    )


@jit
def write_parameters(rows, layout, counts, values, planar, nodal, axes, parameters, rods, lanes):
    """Write the constants of ``rods`` (M,) into ``lanes`` (M,) of ``rows`` (num_blocks, rows, L); their motion stays.

    ``axes``: the world axes of the motion, then the one across; (0, 1, 2) in space. In a plane gravity's part across it
    is left out.
    """
    width = rows.shape[2]
    for m in range(len(rods)):
        rod, block, lane = rods[m], lanes[m] // width, lanes[m] % width
        write_constants(rows[block], lane, layout, counts, varied(values, parameters, rod, axes), planar, nodal)
        for k in range(3):
            rows[block, GRAVITY + k, lane] = parameters.gravity[rod, axes[k]]
        if planar is not None:
            rows[block, GRAVITY + 2, lane] = 0.0
        rows[block, DRAG, lane] = parameters.drag[rod]
        rows[block, SPIN_DRAG, lane] = parameters.spin_drag[rod]
        rows[block, DAMPING, lane] = parameters.internal_damping[rod]
