"""A rod bent to a circular arc, for tests of what is drawn."""

import numpy as np

from magrod_env.rendering import Picture

LENGTH = 60e-3
PICTURE = Picture(
    length=LENGTH,
    radius=2e-3,
    magnet_nodes=(-1,),
    magnet_lengths=(4e-3,),
    magnet_radii=(1e-3,),
    magnet_directions=((1.0, 0.0, 0.0),),
    gravity=(0.0, 0.0, -9.81),
    title="Arc",
)
FIELD = np.array([0.0, 8e-3, 6e-3])


def arc(curvature, num_nodes=11, length=LENGTH):
    """A rod bent upwards to a circular arc: nodes (num_nodes, 3) and rotations (num_nodes, 3, 3)."""
    angles = curvature * np.linspace(0.0, length, num_nodes)
    zero, one = np.zeros_like(angles), np.ones_like(angles)
    cosines, sines = np.cos(angles), np.sin(angles)
    nodes = np.stack([sines, zero, 1.0 - cosines], axis=1) / curvature
    rotations = np.stack(
        [
            np.stack([cosines, zero, sines], axis=1),
            np.stack([zero, one, zero], axis=1),
            np.stack([-sines, zero, cosines], axis=1),
        ],
        axis=2,
    )
    return nodes, rotations
