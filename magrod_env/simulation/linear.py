"""Discrete linear models of rods by differences of the simulation's own steps, all in lanes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magrod_env.rod.batch import PLANE_AXES
from magrod_env.rod.equilibrium import Shapes
from magrod_env.rod.stability import ACTIVE
from magrod_env.rotations import compose, quaternions_of_vectors
from magrod_env.simulation.inverse import static_jacobian
from magrod_env.simulation.rods import Rods
from magrod_env.simulation.state import RodState

STEP = 1e-6  # of the differences: rad, of the rod's length, and of these times its first angular frequency
FIELD_STEP = 1e-5  # of EI over moment and length


@dataclass(frozen=True, eq=False)
class LinearModel:
    """x' = A x + B u, y = C x for small deviations of each of num_rods rods over one step.

    x holds the deviations of every node but the clamp's: displacement (m, world) and rotation (rad, body) of node 1,
    of node 2, ..., then velocity (m/s, world) and angular velocity (rad/s, body) of node 1, of node 2, ...; in a plane
    two coordinates and the angle about the axis across it. u is the deviation of the commanded field (T, world) during
    the step, y that of the position (m, world) of the tip, then of the other magnets from the tip inwards.

    Args:
        A: (num_rods, n, n); n = 12 N, in a plane 6 N.
        B: (num_rods, n, 3) 1/T.
        C: (num_rods, 3 T, n) for T tracked points.
        nodes: the tracked points' nodes, (T,).
        duration: s, of the step.
        static_jacobian: derivative of y by a constant field in equilibrium, m/T, (num_rods, 3 T, 3); None for a model
            about a state.
        start, end: states at the beginning and the end of the step without deviations; equal at an equilibrium.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    nodes: tuple[int, ...]
    duration: float
    static_jacobian: np.ndarray | None
    start: RodState
    end: RodState

    @property
    def dynamic_jacobian(self) -> np.ndarray:
        """Derivative of y at the end of one step by the field during it, m/T, (num_rods, 3 T, 3)."""
        return self.C @ self.B


def linear_model(
    rods: Rods,
    fields: np.ndarray,
    steps: int,
    time_step: float,
    integrator: str,
    poses: tuple[np.ndarray, np.ndarray] | None,
    state: RodState | None,
    nodes: tuple[int, ...],
) -> LinearModel:
    """Linear models of all rods, about `poses` at rest or about `state`, in fields (num_rods, 3) T."""
    plane, elements, count = rods.plane, rods.model.num_elements, rods.num_rods
    active = np.array(ACTIVE[plane])
    half = len(active) * elements
    scales = _scales(rods)
    base = rods.repeated(np.arange(count))
    if state is None:
        assert poses is not None
        base.lay(np.arange(count), *poses)
        start = base.state()
    else:
        start = state
    deviations = np.zeros((2 * half, elements, 12))
    for k in range(half):
        deviations[k, k // len(active), active[k % len(active)]] = 1.0
        deviations[half + k, k // len(active), 6 + active[k % len(active)]] = 1.0
    each = 1 + 4 * half + 6
    lanes = rods.repeated(np.repeat(np.arange(count), each))
    shifts = np.zeros((each, elements, 12))
    shifts[1 : 1 + 2 * half], shifts[1 + 2 * half : 1 + 4 * half] = deviations * scales, -deviations * scales
    lanes.set_state(_moved(start[np.repeat(np.arange(count), each)], np.tile(shifts, (count, 1, 1))))
    push = np.zeros((each, 3))
    size = FIELD_STEP * rods.model.values.bending / _largest_turning(rods)
    push[1 + 4 * half : each - 3], push[each - 3 :] = size * np.eye(3), -size * np.eye(3)
    commanded = np.repeat(fields, each, axis=0) + np.tile(push, (count, 1))
    lanes.batch.set_field(lanes.acting(commanded))
    lanes.run(steps, time_step, integrator)
    after = lanes.state()
    reached = after[np.arange(count) * each]
    change = _deviation(reached[np.repeat(np.arange(count), each)], after).reshape(count, each, elements, 12)
    columns = change[:, 1 : 1 + 2 * half] - change[:, 1 + 2 * half : 1 + 4 * half]
    sizes = 2.0 * (deviations * scales).reshape(2 * half, -1).sum(axis=1)
    inside = np.concatenate([active, 6 + active])
    ordered = columns[..., inside].reshape(count, 2 * half, elements, 2, -1).transpose(0, 3, 2, 4, 1)
    gains = change[:, 1 + 4 * half : each - 3] - change[:, each - 3 :]
    ordered_gains = gains[..., inside].reshape(count, 3, elements, 2, -1).transpose(0, 3, 2, 4, 1)
    jacobian = None
    if state is None:
        assert poses is not None
        shapes = Shapes(*poses, np.full(count, 2.0), np.zeros(count, bool))
        loads = np.concatenate([rods.acting(fields), np.zeros((count, 9))], axis=1)
        jacobian = static_jacobian(rods, np.arange(count), shapes, loads, nodes).reshape(count, -1, 3)
    return LinearModel(
        A=ordered.reshape(count, 2 * half, 2 * half) / sizes,
        B=ordered_gains.reshape(count, 2 * half, 3) / (2.0 * size),
        C=np.tile(_output(nodes, plane, elements, len(active)), (count, 1, 1)),
        nodes=nodes,
        duration=steps * time_step,
        static_jacobian=jacobian,
        start=start,
        end=reached,
    )


def _largest_turning(rods: Rods) -> float:
    """Moments of the magnets times the length, A m^3."""
    moments = np.linalg.norm(rods.model.values.magnet_moments, axis=1).sum()
    return max(float(moments * rods.model.values.ends[-1]), 1e-300)


def _scales(rods: Rods) -> np.ndarray:
    """Sizes (12,) of the differences of a node's coordinates."""
    length, fast = float(rods.model.values.ends[-1]), 2.0 * np.pi * rods.model.scene.first_frequency
    pose = np.repeat([STEP * length, STEP], 3)
    return np.concatenate([pose, fast * pose])


def _moved(states: RodState, shifts: np.ndarray) -> RodState:
    """States with deviations (K, N, 12) of the free nodes."""
    turns = np.concatenate([np.zeros((len(shifts), 1, 3)), shifts[..., 3:6]], axis=1)
    quaternions = compose(states.quaternions, quaternions_of_vectors(turns))
    whole = np.concatenate([np.zeros((len(shifts), 1, 12)), shifts], axis=1)
    return states.replace(
        positions=states.positions + whole[..., :3],
        quaternions=quaternions,
        velocities=states.velocities + whole[..., 6:9],
        angular_velocities=states.angular_velocities + whole[..., 9:],
    )


def _deviation(origin: RodState, states: RodState) -> np.ndarray:
    """Deviations (K, N, 12) of the free nodes of states from others that are near."""
    inverse = origin.quaternions * (1.0, -1.0, -1.0, -1.0)
    turn = compose(inverse, states.quaternions)
    turn = 2.0 * turn[..., 1:] * np.sign(turn[..., :1])
    parts = (
        states.positions - origin.positions,
        turn,
        states.velocities - origin.velocities,
        states.angular_velocities - origin.angular_velocities,
    )
    return np.concatenate(parts, axis=-1)[:, 1:]


def _output(nodes: tuple[int, ...], plane: str | None, elements: int, each: int) -> np.ndarray:
    """C (3 T, n): the tracked nodes' displacements."""
    rows = np.zeros((len(nodes), 3, 2 * each * elements))
    for k, node in enumerate(nodes):
        for place, axis in enumerate(PLANE_AXES[plane]):
            rows[k, axis, each * (node - 1) + place] = 1.0
    return rows.reshape(3 * len(nodes), -1)
