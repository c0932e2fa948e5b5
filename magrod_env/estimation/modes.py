"""The slow part of a rod's motion: the coordinates that an update of a filter may change.

A rod has fast modes that no camera follows and that nothing damps: stretch, shear, the spin of its light sections. An
update that moves them by what chance correlates leaves a little ringing at every frame, which adds up until the members
come apart. Updates therefore act on amplitudes of a few smooth shapes, and of the slowest modes' rates
(docs/ensemble_filter.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magrod_env.estimation.coordinates import nodes_of
from magrod_env.rod.layout import AXIAL, BENDING, ELEMENT_ROWS, LENGTH, SHEAR, TILT, TORSION
from magrod_env.rod.stability import ACTIVE
from magrod_env.simulation import Simulation


@dataclass(frozen=True)
class SlowModes:
    """Shapes and rates with amplitudes, for a rod of N elements.

    `shapes` (num_shapes, 6 N) are changes of strain, (phi, gamma) element by element; `dual` (num_shapes, 6 N) reads
    their amplitudes from strains, orthogonally in the elastic energy. `rates` (num_rates, N, 6) are rates of strain.
    """

    shapes: np.ndarray
    dual: np.ndarray
    rates: np.ndarray
    inertia: np.ndarray  # (N, 6) masses and moments of inertia of the free nodes

    def motions(self, strains: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """Velocities and angular velocities (K, num_rates, N, 6) of the free nodes that unit rates give to rods of
        strains (K, N, 6).
        """
        count, modes = len(strains), len(self.rates)
        both = np.empty((count, modes, len(lengths), 12))
        both[..., :6] = strains[:, None]
        both[..., 6:] = self.rates
        _, _, velocities, spins = nodes_of(both.reshape(count * modes, -1, 12), lengths)
        return np.concatenate([velocities[:, 1:], spins[:, 1:]], axis=-1).reshape(count, modes, -1, 6)

    def amplitudes(self, motions: np.ndarray, motion: np.ndarray) -> np.ndarray:
        """Amplitudes (K, num_rates) of `motions` (K, num_rates, N, 6) in a motion (K, N, 6), orthogonally in the
        kinetic energy.
        """
        count, modes = motions.shape[:2]
        weighted = (motions * self.inertia).reshape(count, modes, -1)
        matrix = weighted @ np.swapaxes(motions.reshape(count, modes, -1), 1, 2)
        return np.linalg.solve(matrix, weighted @ motion.reshape(count, -1, 1))[..., 0]


def slow_modes(simulation: Simulation, num_modes: int) -> SlowModes:
    """The `num_modes` slowest modes of the straight rod without field, as rates and as shapes, and as further shapes
    those that torques at the magnets hold, which modes describe badly.
    """
    static, elements = simulation.rods.model.static, simulation.num_elements
    stiffness, inertia = static.linearise(None)
    active = np.ravel(6 * np.arange(elements)[:, None] + ACTIVE[simulation.plane])
    inner, root = stiffness[np.ix_(active, active)], 1.0 / np.sqrt(inertia[active])
    _, vectors = np.linalg.eigh(root[:, None] * inner * root)
    modes = root[:, None] * vectors[:, :num_modes]
    magnets = np.array(simulation.magnet_nodes, int)
    turning = [k for k in ACTIVE[simulation.plane] if k >= 3]
    torqued = np.ravel(6 * (magnets[:, None] - 1) + turning)
    held = np.linalg.solve(inner, np.eye(6 * elements)[active][:, torqued])
    rows = static.column
    first = static.layout.elements + ELEMENT_ROWS * np.arange(elements)
    lengths, torsion, bending = rows[first + LENGTH], rows[first + TORSION], rows[first + BENDING]
    axial = rows[first + AXIAL] * lengths
    shear = lengths / (1.0 / rows[first + SHEAR] + 1.0 / rows[first + TILT])  # of the straight element
    weights = np.sqrt(np.stack([torsion, bending, bending, axial, shear, shear], axis=1).ravel())

    def strained(columns: np.ndarray) -> np.ndarray:
        nodes = np.zeros((6 * (elements + 1), columns.shape[1]))
        nodes[6 + active] = columns
        return _linear_strains(nodes.reshape(elements + 1, 6, -1), lengths)

    every = weights[:, None] * strained(np.concatenate([modes, held], axis=1))
    left, sizes, _ = np.linalg.svd(every / np.linalg.norm(every, axis=0), full_matrices=False)
    left = left[:, sizes > 1e-3]
    size = np.sqrt(weights[1] ** 2)
    return SlowModes(
        shapes=size * left.T / weights,
        dual=left.T * weights / size,
        rates=strained(modes / np.abs(modes).max(axis=0)).T.reshape(-1, elements, 6),
        inertia=inertia.reshape(elements, 6),
    )


def _linear_strains(nodes: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Changes of strain (6 N, K) of a straight rod from displacements and turns (N + 1, 6, K) of its nodes."""
    moved, turned = nodes[:, :3], nodes[:, 3:]
    middle = 0.5 * (turned[1:] + turned[:-1])
    stretch = np.diff(moved, axis=0) / lengths[:, None, None]
    stretch[:, 1] -= middle[:, 2]  # a section that turns about z sees the chord fall behind along y
    stretch[:, 2] += middle[:, 1]
    return np.concatenate([np.diff(turned, axis=0), stretch], axis=1).reshape(6 * len(lengths), -1)
