"""What a rod carries: the clamp's force and moment, forces and moments inside, curvature along the rod."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magrod_env._jit import PRESENT
from magrod_env.rod.internal import CLAMPED, PARTS, inner_loads
from magrod_env.rod.layout import SPATIAL
from magrod_env.simulation.rods import Rods


@dataclass(frozen=True, eq=False)
class Reactions:
    """Forces and moments of rods at one time.

    The clamp's force and those of the loads change the momentum of the rod; at rest they balance. What the loads do
    at the clamped node itself, the weight of half an element say, is part of the clamp's force.

    Args:
        clamp_force: that the clamp exerts on the rod, N, world, (num_rods, 3).
        clamp_moment: that it exerts, about the origin, N m, world, (num_rods, 3).
        forces: in each element, of the part towards the tip on the part towards the clamp, N, world, (num_rods, N, 3).
        moments: the same at both ends of each element, about the node there, N m, world, (num_rods, N, 2, 3).
        curvatures: rotation of the section per length in the middle of each element: twist and the two bends,
            1/m, in the frame of the middle section, (num_rods, N, 3).
        strains: (stretch - 1, shear, shear) of each element in that frame, (num_rods, N, 3).
        arc_lengths: of the middles of the elements of the unloaded rod, m, (N,) or (num_rods, N).
    """

    clamp_force: np.ndarray
    clamp_moment: np.ndarray
    forces: np.ndarray
    moments: np.ndarray
    curvatures: np.ndarray
    strains: np.ndarray
    arc_lengths: np.ndarray


def reactions(rods: Rods, damped: bool) -> Reactions:
    """Reactions of all rods; with internal damping its stress is part of the forces inside."""
    static, motion = rods.model.static, rods.motion
    blocks, rows = rods.static_blocks(np.arange(rods.num_rods))
    static.put(rows, motion.positions, motion.quaternions, motion.velocities, motion.momenta)
    elements, width = static.layout.num_elements, rows.shape[2]
    out = np.zeros((len(blocks), (PARTS * elements + CLAMPED) * width))
    inner_loads(blocks, static.layout, static.terms, static.terms.nodal, PRESENT if damped else None, out)
    every = out.reshape(len(blocks), -1, width).transpose(0, 2, 1).reshape(len(blocks) * width, -1)[: rods.num_rods]
    parts, clamped = every[:, :-CLAMPED].reshape(-1, elements, PARTS), every[:, -CLAMPED:]
    force, torque_a, torque_b, gamma, phi = (parts[..., 3 * k : 3 * k + 3] for k in range(5))
    frames = motion.rotations
    moments = np.stack(
        [
            np.einsum("rnij,rnj->rni", frames[:, :-1], torque_a),
            -np.einsum("rnij,rnj->rni", frames[:, 1:], torque_b),
        ],
        axis=2,
    )
    arcs = rods.arc_lengths
    lengths = np.diff(arcs, axis=-1)
    clamp = static.layout.nodes + SPATIAL.inverse_mass
    masses = 1.0 / rows[:, clamp].reshape(-1)[: rods.num_rods]
    return Reactions(
        clamp_force=-force[:, 0] - masses[:, None] * rods.parameters.gravity - clamped[:, :3],
        clamp_moment=-moments[:, 0, 0] - clamped[:, 3:],
        forces=force.copy(),
        moments=moments,
        curvatures=phi / lengths[..., None],
        strains=gamma - (1.0, 0.0, 0.0),
        arc_lengths=0.5 * (arcs[..., 1:] + arcs[..., :-1]),
    )
