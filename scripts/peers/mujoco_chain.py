"""The rod as a chain of rigid links in MuJoCo.

Link j reaches over (j + 1/2) h ... (j + 3/2) h, h = L / N; the last is half a link, and half a link at the wall does
not move. So each joint sits in the middle of the piece of rod whose strain it carries, with stiffness EI / h, and the
chain is of second order. Links have the inertia of a rigid rod. Three kinds of joint:
- "bending": two hinges (and a third for twist where a magnet's moment is not along the tangent; two hinges do not
  twist, and nothing twists the rod otherwise). Ball joints give the same curves, are slower and need smaller steps.
  No shear and no stretch: the chain converges to the inextensible rod, 2.0 mm from the rod in `free_decay`;
- "all strains": three slides of stiffness EA / h, GA / h before the hinges; converges to the rod;
- "all strains, corrected": also this package's correction, 1 / GA raised by h^2 / (12 EI): the bending inside a link
  under an end load (MacNeal 1978).

Integrators: Euler is semi-implicit, so leapfrog when the velocity starts half a step early, as here; at 0.9 of its
stability limit. "discrete" (new in 2026) is implicit in the springs: any step, first order, damped. RK4 takes hardly
longer steps at four times the cost; without damping implicitfast and implicit are Euler, with more work.

Loads: the torque m x B is a force B |m| / lever on a massless body far out along the moment (lever: 1e5 m, so that the
force itself, below 1e-8 N, is nothing): MuJoCo turns it with the tip inside each step, without Python. Drag -c m v on
all masses is -c M qvel: it multiplies the velocities by exp(-c t), here every 10 ms or less, between rollouts, with a
splitting error of second order. MuJoCo's viscous forces, which can be set up to do the same at every step, gave the
same curves 1.3 times slower.

Also tried: the 1D flex (discrete elastic rod) of MuJoCo 4.0 with edge stiffness, 9.1 mm in `free_decay` with 10 edges
and 1.9 mm with 40: the chain is better at every run time.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scripts.common.run import whole_steps
from scripts.peers import CONTROL_TIME, PeerRun, Problem, control_steps_per_second, finished, missing

if TYPE_CHECKING:
    import mujoco

NAME = "MuJoCo"
LEVER = 1e5  # m
CHUNK = 0.01  # s: longest time between two applications of drag
BENDING, STRAINS, CORRECTED = "bending", "all strains", "all strains, corrected"


@dataclass(frozen=True)
class Setting:
    """links: joints of the chain; joint: one of the three kinds; time_step: longest step, s."""

    links: int
    joint: str
    integrator: str
    time_step: float

    @property
    def label(self) -> str:
        """The kind of set-up."""
        return f"chain, {self.joint}, {self.integrator}"

    @property
    def resolution(self) -> str:
        """Links and step."""
        return f"{self.links} links, <= {1e3 * self.time_step:.3g} ms"


def available() -> str | None:
    """None if MuJoCo can run, else why not."""
    return missing("mujoco", "4.0")


def settings(problem: Problem, quick: bool = False) -> list[Setting]:
    """The best set-ups found, from quick to exact; two if `quick`."""
    if quick:
        return [_at_limit(problem, 5, BENDING), _at_limit(problem, 6, CORRECTED)]
    chosen = [Setting(n, BENDING, "discrete", dt) for n, dt in ((5, 10e-3), (5, 5e-3), (10, 5e-3), (10, 2e-3))]
    chosen += [_at_limit(problem, n, BENDING) for n in (4, 6, 10, 20)]
    chosen += [_at_limit(problem, n, kind) for kind in (STRAINS, CORRECTED) for n in (4, 6, 10, 20, 30)]
    step = _at_limit(problem, 10, BENDING).time_step
    return [*chosen, Setting(10, BENDING, "RK4", step), Setting(10, BENDING, "implicitfast", step)]


def run(problem: Problem, setting: Setting, times: np.ndarray, repeats: int = 3) -> PeerRun:
    """The chain at evenly spaced `times` (T,) s from 0."""
    model = build(problem, setting)
    return finished(NAME, setting, problem, times, lambda: _simulate(problem, setting, model, times), repeats)


def run_batch(problem: Problem, setting: Setting, num_rods: int, threads: int) -> float:
    """Control steps per second of `num_rods` rods together, by `threads` threads."""
    from mujoco import batch

    parts = whole_steps(CONTROL_TIME, CHUNK)
    model = build(problem, setting)
    count = _fit_step(model, setting, CONTROL_TIME / parts)
    rods = batch.Batch(model, num_rods, threads)
    velocity, wrench = rods.bind("qvel"), rods.bind("xfrc_applied")
    kept = math.exp(-problem.drag_rate * CONTROL_TIME / parts)

    def step(k: int) -> None:
        wrench[:] = _wrenches(problem, model, np.array([k * CONTROL_TIME]))
        for _ in range(parts):
            rods.step(nstep=count)
            velocity[:] *= kept

    return control_steps_per_second(num_rods, step, rods.reset)


def build(problem: Problem, setting: Setting) -> mujoco.MjModel:
    """The compiled chain."""
    import mujoco

    return mujoco.MjModel.from_xml_string(_xml(problem, setting))


# ---- the run


def _simulate(problem: Problem, setting: Setting, model: mujoco.MjModel, times: np.ndarray) -> tuple[np.ndarray, float]:
    """Tip (T, 3) m and the wall time (s) of the steps."""
    import mujoco
    from mujoco import rollout

    interval = times[1] - times[0]
    parts = whole_steps(interval, CHUNK)
    count = _fit_step(model, setting, interval / parts)
    data = mujoco.MjData(model)
    chunks = parts * (len(times) - 1)
    late = 0.0 if setting.integrator in ("Euler", "implicitfast") else 0.5
    wrench = _wrenches(problem, model, (np.arange(chunks * count) + late) * model.opt.timestep)
    if not late:  # leapfrog: the velocity belongs to half a step before the position
        data.xfrc_applied[:] = wrench[0]
        mujoco.mj_forward(model, data)
        data.qvel[:] = -0.5 * model.opt.timestep * data.qacc
    wrench = wrench.reshape(chunks, 1, count, -1)
    kept = math.exp(-problem.drag_rate * interval / parts)
    velocity = slice(1 + model.nq, 1 + model.nq + model.nv)
    state = np.empty((1, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    mujoco.mj_getState(model, data, state[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    path, sensors, states = np.empty((1, count, state.shape[1])), np.empty((1, count, 0)), [state]
    chunk = {"control_spec": int(mujoco.mjtState.mjSTATE_XFRC_APPLIED), "nstep": count, "skip_checks": True}
    with rollout.Rollout(nthread=0) as roll:
        start = time.perf_counter()
        for k in range(chunks):
            roll.rollout([model], [data], state, wrench[k], state=path, sensordata=sensors, **chunk)
            state = path[:, -1].copy()
            state[0, velocity] *= kept
            states.append(state)
        wall = time.perf_counter() - start
    return np.array([_tip(model, data, kept_state[0]) for kept_state in states[::parts]]), wall


def _tip(model: mujoco.MjModel, data: mujoco.MjData, state: np.ndarray) -> np.ndarray:
    """Position (3,) m of the free end in a state."""
    import mujoco

    mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    mujoco.mj_kinematics(model, data)
    return data.site("tip").xpos.copy()


def _fit_step(model: mujoco.MjModel, setting: Setting, chunk: float) -> int:
    """Sets the step so that a whole number of them, returned, fills a chunk (s)."""
    count = whole_steps(chunk, setting.time_step)
    model.opt.timestep = chunk / count
    return count


def _wrenches(problem: Problem, model: mujoco.MjModel, at: np.ndarray) -> np.ndarray:
    """Force and torque on every body (times, bodies, 6) at the times `at` (s): the magnets'."""
    wrench = np.zeros((len(at), model.nbody, 6))
    if problem.field is not None:
        field = problem.field_at(at)
        for k, magnet in enumerate(problem.scene.magnets):
            wrench[:, model.body(f"lever{k}").id, :3] = field * (magnet.moment / LEVER)
    return wrench


def _at_limit(problem: Problem, links: int, joint: str) -> Setting:
    """Semi-implicit Euler at 0.9 of 2 / (highest angular frequency of the straight chain)."""
    import mujoco
    from scipy.linalg import eigh

    model = build(problem, Setting(links, joint, "Euler", 1e-3))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    highest = math.sqrt(eigh(np.diag(model.jnt_stiffness), mass, eigvals_only=True)[-1])
    return Setting(links, joint, "Euler", 1.8 / highest)


# ---- the model


def _xml(problem: Problem, setting: Setting) -> str:
    """The chain in MuJoCo's modelling language; the free end is the site "tip"."""
    rod, links, spacing = problem.scene.rod, setting.links, problem.scene.rod.length / setting.links
    joints = _joints(problem, setting.joint, spacing)
    body = f'<site name="tip" pos="{spacing / 2} 0 0"/>'
    for j in reversed(range(links)):
        size = spacing if j < links - 1 else spacing / 2
        mass, section = rod.mass_per_length * size, rod.rotary_inertia_per_length * size
        across = mass * size**2 / 12 + section
        body = (
            f'<body pos="{spacing if j else spacing / 2} 0 0">{joints}'
            f'<inertial pos="{size / 2} 0 0" mass="{mass}" diaginertia="{2 * section} {across} {across}"/>'
            f"{_magnets(problem, (j + 0.5) * spacing, size)}"
            f"{body}</body>"
        )
    gravity = " ".join(map(str, problem.gravity))
    return (
        f'<mujoco><option timestep="{setting.time_step}" integrator="{setting.integrator}" gravity="{gravity}">'
        '<flag contact="disable" constraint="disable" autoreset="disable"/></option>'
        f"<worldbody>{body}</worldbody></mujoco>"
    )


def _joints(problem: Problem, kind: str, spacing: float) -> str:
    """The joints between two links whose middles are `spacing` (m) apart."""
    rod = problem.scene.rod
    bending, shear = rod.bending_stiffness, rod.shear_stiffness
    if kind == CORRECTED:
        shear = 1 / (1 / shear + spacing**2 / (12 * bending))
    axes = ("1 0 0", "0 1 0", "0 0 1")
    found = (
        [] if kind == BENDING else [("slide", axis, k) for axis, k in zip(axes, (rod.axial_stiffness, shear, shear))]
    )
    found += [("hinge", axis, bending) for axis in axes[1:]]
    if problem.twists:
        found.append(("hinge", axes[0], rod.torsional_stiffness))
    return "".join(f'<joint type="{kind}" axis="{axis}" stiffness="{k / spacing}"/>' for kind, axis, k in found)


def _magnets(problem: Problem, start: float, size: float) -> str:
    """The magnets on a link that reaches over `size` from `start` (m): a point mass and a massless lever each."""
    text = ""
    for k, magnet in enumerate(problem.scene.magnets):
        if start < magnet.position <= start + size * (1 + 1e-9):
            out = LEVER * magnet.dipole_moment / magnet.moment
            lever = f'<body name="lever{k}" pos="{out[0]} {out[1]} {out[2]}">{_inertial(0.0, 0.0)}</body>'
            text += f'<body pos="{magnet.position - start} 0 0">{_inertial(magnet.mass, 1e-14)}{lever}</body>'
    return text


def _inertial(mass: float, moment: float) -> str:
    return f'<inertial pos="0 0 0" mass="{mass}" diaginertia="{moment} {moment} {moment}"/>'
