"""The rod in PyElastica: its Cosserat rod on a staggered grid, position Verlet.

PyElastica's shear factor 27/28, which the problem does not have, is taken out. Drag is its exact factor on velocities,
once a step, and none on rotation. PyElastica scales stiffness with stretch as for an incompressible material: in
`free_decay` it converges to a rod 0.1 mm from ours. Clamp and loads are operators on PyElastica's memory block, one
call for all rods of a simulator, and the field is tabulated beforehand: that saves much of the Python time of a step.
Its other method, PEFRL, does twice the work a step; at the stable step, errors in space outweigh those in time.
"""

from __future__ import annotations

import math
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from scripts.common.run import whole_steps
from scripts.peers import CONTROL_TIME, PeerRun, Problem, control_steps_per_second, finished, missing
from scripts.peers.pyelastica_rod import CORRECTED, HALF, PLAIN, Setting, at_limit, build, dipoles

if TYPE_CHECKING:
    import elastica

NAME = "PyElastica"


def available() -> str | None:
    """None if PyElastica can run, else why not."""
    return missing("pyelastica", "1.0")


def settings(problem: Problem, quick: bool = False) -> list[Setting]:
    """The best set-ups found, from quick to exact; one if `quick`."""
    if quick:
        return [at_limit(problem, 10, CORRECTED)]
    counts = {PLAIN: (20, 40, 80), HALF: (5, 10, 20, 40, 80), CORRECTED: (5, 10, 20, 40)}
    return [at_limit(problem, n, care) for care, many in counts.items() for n in many]


def run(problem: Problem, setting: Setting, times: np.ndarray, repeats: int = 3) -> PeerRun:
    """The rod at evenly spaced `times` (T,) s from 0."""
    _Rods(problem, setting, 1, times[1] - times[0]).advance(1)  # compiles
    return finished(NAME, setting, problem, times, lambda: _simulate(problem, setting, times), repeats)


def run_batch(problem: Problem, setting: Setting, num_rods: int, threads: int) -> float:
    """Control steps per second of `num_rods` rods together, in one memory block; a process each for more `threads`."""
    call = partial(_batch, replace(problem, field=None), setting, num_rods // threads)
    if threads == 1:
        return call()
    with ProcessPoolExecutor(threads, get_context("spawn")) as pool:
        return sum(task.result() for task in [pool.submit(call) for _ in range(threads)])


def _batch(problem: Problem, setting: Setting, num_rods: int) -> float:
    """Control steps per second in this process."""
    rods = _Rods(problem, setting, num_rods, CONTROL_TIME)

    def step(k: int) -> None:
        rods.field[:] = 1e-3 * k  # the field's value costs nothing, its torque does
        rods.advance(rods.count)

    return control_steps_per_second(num_rods, step, lambda: rods.advance(1))


# ---- the run


def _simulate(problem: Problem, setting: Setting, times: np.ndarray) -> tuple[np.ndarray, float]:
    """Tip (T, 3) m and the wall time (s) of the steps."""
    rods = _Rods(problem, setting, 1, times[1] - times[0])
    step = rods.step
    middles = (np.arange(rods.count * (len(times) - 1)) + 0.5) * step
    field = problem.field_at(middles).reshape(len(times) - 1, rods.count, 3)
    tip, wall = [rods.tip()], 0.0
    for table in field:
        rods.field = table[:, None]
        start = time.perf_counter()
        rods.advance(rods.count)
        wall += time.perf_counter() - start
        tip.append(rods.tip())
        if not np.all(np.isfinite(tip[-1])):
            return np.full((len(times), 3), np.nan), wall
    return np.array(tip), wall


class _Rods:
    """A simulator of equal rods; `count` steps of length `step` (s) fill an `interval` (s)."""

    def __init__(self, problem: Problem, setting: Setting, num_rods: int, interval: float) -> None:
        import elastica

        class Simulator(elastica.BaseSystemCollection, elastica.Constraints, elastica.Forcing):
            """No more of PyElastica's modules than the rod needs."""

        self.count = whole_steps(interval, setting.time_step)
        self.step = interval / self.count
        self.stepper, self.simulator = elastica.PositionVerlet(), Simulator()
        self.gravity = problem.gravity
        self.kept = math.exp(-problem.drag_rate * self.step)  # of the velocity after a step
        self.field, self.now = np.zeros((self.count, num_rods, 3)), 0  # T, in the middle of each step of an interval
        self.dipoles = dipoles(problem, setting)
        self.rods = [build(problem, setting) for _ in range(num_rods)]
        for one in self.rods:
            self.simulator.append(one)
        clamp, loads = _operators(self)
        self.simulator.constrain(self.rods[0]).using(clamp)  # they act on the block, that is on all rods
        self.simulator.add_forcing_to(self.rods[0]).using(loads)
        self.block: elastica.MemoryBlockCosseratRod = None  # until all is in place
        self.simulator.finalize()
        (self.block,) = self.simulator.final_systems()
        self.starts = np.array([self.block.start_idx_in_rod_nodes, self.block.start_idx_in_rod_elems], dtype=np.int64)

    def advance(self, count: int) -> None:
        """Steps; the field's table starts anew."""
        self.now = 0
        for _ in range(count):
            self.stepper.step(self.simulator, 0.0, self.step)
            self.now += 1

    def tip(self) -> np.ndarray:
        """Position (3,) m of the first rod's free end."""
        return self.rods[0].position_collection[:, -1].copy()


def _operators(rods: _Rods) -> tuple[type, type]:
    """PyElastica's operators for the clamp with the drag, and for the other loads."""
    import elastica

    class Clamp(elastica.ConstraintBase):
        def constrain_values(self, system: elastica.CosseratRod, time: float) -> None:
            """What does not move stays where it is."""

        def constrain_rates(self, system: elastica.CosseratRod, time: float) -> None:
            if rods.block is not None:
                _hold(rods.block.velocity_collection, rods.block.omega_collection, rods.kept, rods.starts)

    class Loads(elastica.NoForces):
        def apply_forces(self, system: elastica.CosseratRod, time: float = 0.0) -> None:
            _weigh(rods.block.external_forces, rods.block.mass, rods.gravity, rods.starts[0], len(system.mass))

        def apply_torques(self, system: elastica.CosseratRod, time: float = 0.0) -> None:
            block = rods.block
            field = rods.field[rods.now]
            elements, moments, seen, felt = rods.dipoles
            torque, turned = block.external_torques, block.director_collection
            _turn(torque, turned, field, elements, moments, seen, felt, rods.starts[1])

    return Clamp, Loads


@njit(cache=True)
def _hold(velocity, omega, kept, starts):
    velocity *= kept
    for r in range(starts.shape[1]):
        velocity[:, starts[0, r]] = 0.0
        omega[:, starts[1, r]] = 0.0


@njit(cache=True)
def _weigh(force, mass, gravity, starts, count):
    for start in starts:
        for a in range(start, start + count):
            for i in range(3):
                force[i, a] += mass[a] * gravity[i]


@njit(cache=True)
def _turn(torque, directors, field, elements, moments, seen, felt, starts):
    """Adds m x B, field (rods, 3) T; m points as `seen` of two elements say, `felt` of its torque is on each."""
    for r, start in enumerate(starts):
        b = field[r]
        for k in range(len(elements)):
            m0, m1, m2 = 0.0, 0.0, 0.0
            for j in range(2):
                q = directors[:, :, start + elements[k, j]]
                for i in range(3):
                    share = seen[k, j] * moments[k, i]
                    m0, m1, m2 = m0 + share * q[i, 0], m1 + share * q[i, 1], m2 + share * q[i, 2]
            t0, t1, t2 = m1 * b[2] - m2 * b[1], m2 * b[0] - m0 * b[2], m0 * b[1] - m1 * b[0]
            for j in range(2):
                e = start + elements[k, j]
                for i in range(3):
                    turn = directors[i, 0, e] * t0 + directors[i, 1, e] * t1 + directors[i, 2, e] * t2
                    torque[i, e] += felt[k, j] * turn
