"""The rod in SoRoMoX (JAX): one segment of its geometric variable strain (GVS) model, strains in Legendre polynomials.

SoRoMoX gives inertia, Coriolis and gravity terms of the rod, poses and Jacobians. The magnets are added with these:
a point mass adds m J^T J to the inertia, m x B acts through the rotational rows of the Jacobian. Drag is -c M qd; it
also damps rotation, whose inertia is some 1e-4 of the rest. Two kinds of set-up:
- "bending": few coordinates and large steps; converges to the inextensible rod without shear, 2.0 mm from the rod in
  `free_decay`;
- "all strains": also shear and stretch; converges to the rod, but the shear modes keep the steps short.
Twist is left out unless a magnet's moment is not along the tangent: nothing else twists the rod.

Time: classical Runge-Kutta or leapfrog in one jitted scan, at 0.8 of the stability limit, which binds the adaptive
explicit solvers of Diffrax as well. Compilation takes 10 to 30 s and is not counted. XLA is told not to spread the
small matrices over threads, which doubles the speed on a busy machine; that works only before JAX has started.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scripts.common.run import whole_steps
from scripts.peers import CONTROL_STEPS, CONTROL_TIME, PeerRun, Problem, control_steps_per_second, finished, missing

if TYPE_CHECKING:
    import jax
    from soromox.systems.gvs import GVS

    State = tuple[jax.Array, jax.Array]  # coordinates and velocities

NAME = "SoRoMoX"
RUNGE_KUTTA, LEAPFROG = "Runge-Kutta", "leapfrog"
STABLE = {RUNGE_KUTTA: 2.8, LEAPFROG: 2.0}  # step times highest angular frequency


@dataclass(frozen=True)
class Setting:
    """Orders of the polynomials of bending and of shear and stretch (None: neither); time_step: longest step, s."""

    bending: int
    strains: int | None
    method: str
    time_step: float

    @property
    def label(self) -> str:
        """The kind of set-up."""
        return f"GVS, {'bending' if self.strains is None else 'all strains'}, {self.method}"

    @property
    def resolution(self) -> str:
        """Orders and step."""
        orders = f"{self.bending}" if self.strains is None else f"{self.bending} and {self.strains}"
        return f"order {orders}, <= {1e3 * self.time_step:.3g} ms"


def available() -> str | None:
    """None if SoRoMoX can run, else why not."""
    return missing("soromox", "0.5")


def settings(problem: Problem, quick: bool = False) -> list[Setting]:
    """The best set-ups found, from quick to exact; one if `quick`."""
    if quick:
        return [at_limit(problem, 2, None, LEAPFROG)]
    orders: list[tuple[int, int | None, str]] = [(n, None, RUNGE_KUTTA) for n in (1, 2, 3)]
    orders.insert(1, (2, None, LEAPFROG))
    orders += [(3, 1, LEAPFROG), (5, 2, LEAPFROG)]
    return [at_limit(problem, *each) for each in orders]


def run(problem: Problem, setting: Setting, times: np.ndarray, repeats: int = 3) -> PeerRun:
    """The rod at evenly spaced `times` (T,) s from 0."""
    import jax

    robot = _Robot(problem, setting)
    interval = times[1] - times[0]
    fields = _fields(problem, interval, len(times) - 1, whole_steps(interval, setting.time_step))
    step = interval / fields.shape[1]
    go = jax.jit(lambda state, field: jax.lax.scan(robot.stepper(step), state, field))
    state = robot.at_rest(step, fields[0, 0, 0])
    go(state, fields)[1].block_until_ready()  # compiles

    def simulate() -> tuple[np.ndarray, float]:
        start = time.perf_counter()
        path = go(state, fields)[1].block_until_ready()
        wall = time.perf_counter() - start
        return np.vstack([[problem.scene.rod.length, 0.0, 0.0], robot.tips(path)]), wall

    return finished(NAME, setting, problem, times, simulate, repeats)


def run_batch(problem: Problem, setting: Setting, num_rods: int, threads: int) -> float:
    """Control steps per second of `num_rods` rods together, by `vmap`; XLA decides how many `threads` it uses."""
    import jax
    import jax.numpy as jnp

    robot = _Robot(problem, setting)
    count = whole_steps(CONTROL_TIME, setting.time_step)
    field = jnp.array(_fields(problem, CONTROL_TIME, CONTROL_STEPS, 1)[:, 0, :1])
    chunk = robot.stepper(CONTROL_TIME / count)
    go = jax.jit(jax.vmap(lambda state, b: chunk(state, jnp.broadcast_to(b, (count, 3, 3)))[0], (0, None)))
    state = tuple(jnp.zeros((num_rods, robot.size)) for _ in range(2))
    jax.block_until_ready(go(state, field[0]))  # compiles
    now = state

    def begin() -> None:
        nonlocal now
        now = state

    def step(k: int) -> None:
        nonlocal now
        now = jax.block_until_ready(go(now, field[k]))

    return control_steps_per_second(num_rods, step, begin)


def at_limit(problem: Problem, bending: int, strains: int | None, method: str) -> Setting:
    """A set-up at 0.8 of the largest stable step of the straight rod."""
    from scipy.linalg import eigh

    robot = _Robot(problem, Setting(bending, strains, method, math.inf))
    rest = np.zeros(robot.size)
    inertia, _ = robot.equations(rest, rest, np.zeros(3))
    highest = math.sqrt(eigh(np.array(robot.model.K), np.array(inertia), eigvals_only=True)[-1])
    return Setting(bending, strains, method, 0.8 * STABLE[method] / highest)


def _fields(problem: Problem, interval: float, intervals: int, count: int) -> np.ndarray:
    """Field (intervals, steps, 3, 3) T at the start, middle and end of each of `count` steps of each interval (s)."""
    at = np.arange(2 * intervals * count + 1) * (interval / (2 * count))
    field = problem.field_at(at)
    return np.stack([field[:-1:2], field[1::2], field[2::2]], axis=1).reshape(intervals, count, 3, 3)


class _Robot:
    """SoRoMoX's model of the rod with the magnets' loads; a state is (coordinates, velocities), each (size,)."""

    def __init__(self, problem: Problem, setting: Setting) -> None:
        self.problem, self.method = problem, setting.method
        self.model = _model(problem, setting)
        self.size = self.model.num_velocities

    def equations(self, q: jax.Array, v: jax.Array, field: jax.Array) -> State:
        """Inertia (size, size) and generalised force (size,), magnets and drag included."""
        import jax.numpy as jnp

        inertia, coriolis, weight = self.model.dynamics_terms(q, v)
        force = -coriolis - weight - self.model.K @ q
        for magnet in self.problem.scene.magnets:
            pose, local, local_rate = self.model._jacobian_and_time_derivative_bodyframe_terms(q, v, magnet.position)
            jacobian, rate = self.model._body_jacobian_time_derivative_to_inertial(pose, local, local_rate, v)
            turn, move = jacobian[:3], jacobian[3:]
            inertia = inertia + magnet.mass * move.T @ move
            force = force + magnet.mass * move.T @ (self.problem.gravity - rate[3:] @ v)
            force = force + turn.T @ jnp.cross(pose[:3, :3] @ jnp.asarray(magnet.dipole_moment), field)
        return inertia, force - self.problem.drag_rate * (inertia @ v)

    def acceleration(self, q: jax.Array, v: jax.Array, field: jax.Array) -> jax.Array:
        """Of the coordinates (size,)."""
        import jax.numpy as jnp

        return jnp.linalg.solve(*self.equations(q, v, field))

    def at_rest(self, step: float, field: np.ndarray) -> State:
        """The straight rod; for leapfrog the velocity belongs to half a step (s) earlier."""
        rest = np.zeros(self.size)
        if self.method == RUNGE_KUTTA:
            return rest, rest
        return rest, -0.5 * step * np.array(self.acceleration(rest, rest, field))

    def stepper(self, step: float) -> Callable:
        """(state, fields (steps, 3, 3) T) -> (state, coordinates) after steps of a length (s)."""
        import jax

        advance = self._runge_kutta if self.method == RUNGE_KUTTA else self._leapfrog

        def many(state: State, fields: jax.Array) -> tuple[State, jax.Array]:
            state, _ = jax.lax.scan(lambda now, field: (advance(now, field, step), None), state, fields)
            return state, state[0]

        return many

    def _leapfrog(self, state: State, fields: jax.Array, step: float) -> State:
        q, v = state
        v = v + step * self.acceleration(q, v, fields[0])
        return q + step * v, v

    def _runge_kutta(self, state: State, fields: jax.Array, step: float) -> State:
        q, v = state
        a1 = self.acceleration(q, v, fields[0])
        v2 = v + step / 2 * a1
        a2 = self.acceleration(q + step / 2 * v, v2, fields[1])
        v3 = v + step / 2 * a2
        a3 = self.acceleration(q + step / 2 * v2, v3, fields[1])
        v4 = v + step * a3
        a4 = self.acceleration(q + step * v3, v4, fields[2])
        return q + step / 6 * (v + 2 * v2 + 2 * v3 + v4), v + step / 6 * (a1 + 2 * a2 + 2 * a3 + a4)

    def tips(self, path: jax.Array) -> np.ndarray:
        """Positions (T, 3) m of the free end for coordinates (T, size)."""
        import jax

        return np.array(
            jax.vmap(lambda q: self.model._forward_kinematics(q, self.problem.scene.rod.length)[:3, 3])(path)
        )


def _model(problem: Problem, setting: Setting) -> GVS:
    """One fixed segment along x with the strains that the setting asks for."""
    flags = os.environ.get("XLA_FLAGS", "")
    if "xla_cpu_multi_thread_eigen" not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} --xla_cpu_multi_thread_eigen=false".strip()
    import jax

    jax.config.update("jax_enable_x64", True)
    from soromox.systems.components import JointSpec, LinkSpec
    from soromox.systems.gvs import GVS
    from soromox.systems.gvs.specs import GVSSegment, StrainBasisSpec

    rod, strained = problem.scene.rod, setting.strains is not None
    link = LinkSpec.circular(
        length=rod.length,
        radius=rod.width / 2,
        density=rod.density,
        reference_strain=[0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        young_modulus=rod.youngs_modulus,
        shear_modulus=rod.shear_modulus,
    )
    used, orders = (
        [int(problem.twists), 1, 1, *3 * [int(strained)]],
        [*3 * [setting.bending], *3 * [setting.strains or 0]],
    )
    basis = StrainBasisSpec("legendre", used, orders)
    segment = GVSSegment(link, JointSpec(type="fixed"), basis, num_gauss_points=max(5, setting.bending + 2))
    upright = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])  # unit quaternion, scalar last, and position
    return GVS.from_segments([segment], gravity=problem.gravity, base_pose=upright)
