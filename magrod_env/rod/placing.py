"""Rods at rest in given poses."""

from magrod_env._jit import jit
from magrod_env.rod.layout import ENERGY, LEAST_COSINE, PLANAR, SPATIAL


@jit
def lay_rods(rows, layout, planar, axes, rods, positions, quaternions):
    """Put ``rods`` (M,) of ``rows`` (num_blocks, rows, L) at rest: ``positions`` (M, num_nodes, 3) m, ``quaternions``
    (M, num_nodes, 4) in space; ``axes``: the world axes of the motion, then the one across.

    The watchdog takes their energy anew.
    """
    width, plane = rows.shape[2], axes[1]
    for m in range(len(rods)):
        block, lane = rods[m] // width, rods[m] % width
        rows[block, LEAST_COSINE, lane] = 1.0
        rows[block, ENERGY, lane] = float("inf")
        for node in range(layout.num_elements + 1):
            if planar is None:
                row = layout.nodes + SPATIAL.size * node
                for k in range(3):
                    rows[block, row + k, lane] = positions[m, node, k]
                for k in range(4):
                    rows[block, row + SPATIAL.rotation + k, lane] = quaternions[m, node, k]
                for k in range(SPATIAL.velocity, SPATIAL.inverse_mass):
                    rows[block, row + k, lane] = 0.0
            else:
                row = layout.nodes + PLANAR.size * node
                rows[block, row, lane] = positions[m, node, 0]
                rows[block, row + 1, lane] = positions[m, node, plane]
                rows[block, row + PLANAR.rotation, lane] = quaternions[m, node, 0]
                turn = quaternions[m, node, 3] if plane == 1 else -quaternions[m, node, 2]
                rows[block, row + PLANAR.rotation + 1, lane] = turn
                for k in range(PLANAR.velocity, PLANAR.inverse_mass):
                    rows[block, row + k, lane] = 0.0
