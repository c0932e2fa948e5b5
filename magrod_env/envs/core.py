"""The batch of rods that every environment is: actions in, arrays out; the single environment is a batch of one."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from gymnasium.utils import seeding

from magrod_env import _checks
from magrod_env._jit import PRESENT, Bound
from magrod_env.envs.commanding import add_travel, write_commands
from magrod_env.envs.estimates import Estimates
from magrod_env.envs.observation import ObservationLayout
from magrod_env.envs.observing import Episodes, Optics, Outcome, Scales, View, observe_blocks, observe_some
from magrod_env.envs.resetting import Making, Spread, begin_episodes, copy_starts, new_draws, vary_rods, write_fields
from magrod_env.envs.settings import Camera, Randomization
from magrod_env.envs.tasks.task import Reward, Task
from magrod_env.envs.workspace import Workspace
from magrod_env.magnetics import Actuator, UniformCoils
from magrod_env.rod.batch import PLANE_AXES
from magrod_env.rod.equilibrium import Shapes
from magrod_env.scene import Scene
from magrod_env.simulation.model import RodModel
from magrod_env.simulation.resolution import Resolution
from magrod_env.simulation.rods import Rods
from magrod_env.simulation.scene_values import check_plane
from magrod_env.simulation.simulation import SAFETY

REWARD_TERMS = ("tracking", "precision", "effort", "smoothness")
OBSERVE = ("camera", "state", "estimate")
MOST_STEPS = 1_000_000  # of the physics in a control step: some seconds of wall time
PREVIEW = (0.04, 0.1, 0.2)  # s ahead


class SteeringCore:
    """Rods, coils, camera and task of ``num_envs`` environments. Not a Gymnasium class: arrays in, arrays out.

    Args: see ``magrod_env.envs.single.MagRodEnv``.
    """

    def __init__(
        self,
        scene: Scene,
        task: Task,
        workspace: Workspace,
        reward: Reward,
        *,
        num_envs: int,
        resolution: Resolution,
        precision: str,
        plane: str | None,
        coils: UniformCoils,
        actuator: Actuator,
        control_rate: float,
        camera: Camera,
        observe: str,
        randomization: Randomization,
        num_threads: int | None,
    ) -> None:
        check_plane(scene, plane)
        if plane is not None and set(coils.axes) - set(plane):
            raise ValueError(f"axes must lie in the plane {plane!r}, but got {coils.axes!r}: choose axes of the plane.")
        self.scene, self.task, self.workspace, self.num_envs = scene, task, workspace, num_envs
        self.reward = reward
        self.num_elements, self.resolution = resolution.num_elements, resolution
        self.plane, self.precision, self.observe = plane, precision, observe
        self.coils, self.actuator, self.camera, self.randomization = coils, actuator, camera, randomization
        self.control_rate = control_rate
        self.control_time = 1.0 / self.control_rate
        self.model = RodModel(
            scene,
            self.num_elements,
            axial_softening=resolution.axial_softening,
            rotary_scaling=resolution.rotary_scaling,
        )
        self.rods = Rods(
            self.model,
            num_rods=num_envs,
            precision=precision,
            plane=plane,
            slew=actuator.slew_limit is not None,
            lag=actuator.lag is not None,
            turned=actuator.slew_limit is not None and randomization.active,
            num_threads=num_threads,
        )
        self.batch = self.rods.batch
        self._observe_some = Bound(observe_some)
        self._write_commands, self._add_travel = Bound(write_commands), Bound(add_travel)
        self._begin_episodes, self._copy_starts = Bound(begin_episodes), Bound(copy_starts)
        self._vary_rods, self._write_fields = Bound(vary_rods), Bound(write_fields)
        self._choose_steps(resolution.time_step)
        self._set_up_coils()
        self._set_up_arrays()
        self._set_up_starts()
        self.estimation: Estimates | None = None  # what writes the observations again, where one is put in

    # ---- set-up

    def _choose_steps(self, time_step: float | None) -> None:
        """Physics steps in a control step: no longer than the bound of the stiffest, lightest rod that may be drawn."""
        spread, ends = self.randomization, self.model.values.ends
        shift = spread.magnet_position
        if shift > 0.0 and np.diff([0.0, *ends]).min() <= 2.0 * shift:
            raise ValueError(
                f"magnet_position of the randomization must leave every magnet on its part of the rod, but got "
                f"{shift!r} m: give less than half the distance between the magnets."
            )
        model = self.model.spread(
            modulus=1.0 + spread.modulus,
            density=1.0 - spread.density,
            moment=1.0 + spread.remanence,
            shift=shift,
        )
        strongest = float(np.linalg.norm(self.coils.limit)) * (1.0 + spread.field_gain)
        if time_step is None:
            step = SAFETY * model.working_time_step(strongest, self.plane)
        else:
            step = _checks.number("time_step", time_step, above=0.0, advice="give it in seconds")
            bound = model.stable_time_step(strongest, self.plane)
            if step > bound:
                raise ValueError(
                    f"time_step must be at most {bound:.3g} s, the stability bound in the coils' strongest field, "
                    f"but got {step:.3g} s: lower it, or num_elements, or leave it None."
                )
        if not self.control_time <= MOST_STEPS * step:
            raise ValueError(
                f"time_step must be at least {self.control_time / MOST_STEPS:.3g} s, a {MOST_STEPS:,}th of a control "
                f"step, but is {step:.3g} s: raise it, or control_rate, or choose a rod that allows longer steps."
            )
        self.num_steps = math.ceil(self.control_time / step - 1e-9)
        self.time_step = self.control_time / self.num_steps

    def _set_up_coils(self) -> None:
        half = 0.5 * self.time_step
        lag, slew, dead = self.actuator.lag, self.actuator.slew_limit, self.actuator.dead_time
        self.blend = 0.0 if lag is None else -math.expm1(-half / lag)
        self.largest_change = 0.0 if slew is None else slew * half
        late = 0 if dead is None else round(dead / self.time_step)  # physics steps by which a command is late
        self.late_controls, self.late_steps = divmod(late, self.num_steps)
        self.follows = lag is not None or slew is not None
        self._coil_axes = np.array(["xyz".index(letter) for letter in self.coils.axes])
        self._limits = np.array(self.coils.limit)

    def _set_up_arrays(self) -> None:
        envs, tracked = self.num_envs, len(self.workspace.tracked_nodes)
        camera, control = self.camera, self.control_time
        every = 1 if camera.rate is None else self.control_rate / camera.rate
        if abs(every - round(every)) > 1e-6 or every < 1:
            raise ValueError(
                f"rate of the camera must divide the control rate {self.control_rate:g} Hz, but got {camera.rate!r}: "
                "choose a whole fraction of it."
            )
        delay = 0 if camera.delay is None else round(camera.delay / control)
        self.optics = Optics(camera.noise or 0.0, round(every), delay, round(every) * control)
        self.scales = Scales(
            length=self.scene.rod.length,
            limits=self._limits,
            coils=self._coil_axes,
            tracking=self.reward.tracking * self.scene.rod.length,
            precision=self.reward.precision,
            effort=self.reward.effort,
            smoothness=self.reward.smoothness,
        )
        path = self.task.targets.rate > 0.0
        self.preview = np.array(PREVIEW if path else ())
        self.full = PRESENT if self.observe == "state" else None
        self.observation = ObservationLayout.of(
            num_tracked=tracked,
            length=self.scene.rod.length,
            axes=self.coils.axes,
            preview=tuple(self.preview),
            num_nodes=self.num_elements if self.full else 0,
            plane=self.plane,
        )
        self.observation_size = self.observation.size
        self.episodes = Episodes(
            streams=np.zeros(envs, np.uint64),
            steps=np.zeros(envs, np.int64),
            place=np.zeros((envs, 2)),
            frames=np.zeros((envs, delay + 1, tracked, 3)),
            seen=np.zeros((envs, 2, tracked, 3)),
            action=np.zeros((envs, self.coils.num_axes)),
            mixing=np.tile(np.eye(3), (envs, 1, 1)),
            unmixing=np.tile(np.eye(3), (envs, 1, 1)),
        )
        turned = self.batch.terms.turned is not None  # then the kernel mixes, behind the slew limit
        self._command_mixing = np.tile(np.eye(3), (envs, 1, 1)) if turned else self.episodes.mixing
        self.commands = np.zeros((self.late_controls + 2, envs, 3))  # the newest first
        self._field_before = np.zeros((envs, 3))
        self._starts = np.zeros(envs, np.int64)
        self._draws = new_draws(envs)
        self.nodes = self.workspace.tracked_nodes
        self.plane_axes = PLANE_AXES[self.plane]
        self.view = View(
            layout=self.batch.layout,
            axes=self.plane_axes,
            nodes=self.nodes,
            targets=self.task.targets,
            scales=self.scales,
            optics=self.optics,
            preview=self.preview,
            control_time=self.control_time,
            places=self.observation.places,
        )

    def _set_up_starts(self) -> None:
        """The nominal rod in every equilibrium that an episode may start from, as columns of rows."""
        cases, spread = self.task.start_cases, self.randomization
        self._start_fields = np.array([case.field for case in cases])
        self._start_poses = np.array([case.positions for case in cases]), np.array([case.quaternions for case in cases])
        if spread.active:
            self._spread: Spread | None = Spread(**dataclasses.asdict(spread))
            self._making = Making(
                layout=self.batch.layout,
                axes=self.rods.axes,
                across=3 if self.plane is None else self.rods.axes[2],
                gravity=self.model.static.gravity,
                drag=self.scene.drag_rate or 0.0,
                fields=self._start_fields,
            )
            self.rods.varied = True
            return
        self._spread, first = None, np.zeros(1, np.int64)
        columns = []
        for case in cases:
            self.rods.lay(first, case.positions[None], case.quaternions[None])
            self.batch.set_field(np.tile(case.field, (self.num_envs, 1)))
            columns.append(self.batch.rows[0, :, 0].copy())
        self._columns = np.array(columns)
        self.batch.travel[:] = 0.0

    # ---- seeds and resets

    def seed(self, which: np.ndarray, generators: list[np.random.Generator]) -> None:
        """Start the streams of some environments from one draw of each one's generator."""
        for i, generator in zip(which, generators, strict=True):
            self.episodes.streams[i] = generator.integers(0, 2**63, dtype=np.uint64)

    def seed_all(self, seeds: list[int | None]) -> None:
        """Seed every environment as Gymnasium seeds a single one; None leaves one as it is."""
        which = [i for i, seed in enumerate(seeds) if seed is not None]
        self.seed(np.array(which, np.int64), [seeding.np_random(seeds[i])[0] for i in which])

    def reset(self, which: np.ndarray, out: Outcome) -> None:
        """Begin new episodes in the environments ``which`` (indices) and write their first observations."""
        self._begin_episodes(self.episodes, self.task.targets, which, self._starts, self._draws, self._spread)
        batch = self.batch
        if self._spread is None:
            self._copy_starts(batch.rows, self._columns, which, self._starts, batch.status)
            self.commands[:, which] = self._start_fields[self._starts[which]]
        else:
            added = self._draws.initial_field
            added[which] *= np.isin(np.arange(3), self._coil_axes)  # only the coils make a field
            self._vary(which)
            self.commands[:, which] = self._start_fields[self._starts[which]] + added[which]
        self._add_travel(batch.rows, batch.travel, self.plane_axes, self._field_before)
        batch.travel[which] = 0.0
        self._observe_some(batch.rows, self.view, batch.terms.planar, self.full, self.episodes, which, out)
        if self.estimation is not None:
            self.estimation.reset(which, out)

    def _vary(self, which: np.ndarray) -> None:
        """Make rods that differ from the nominal one, each at rest in its own equilibrium.

        Where a rod loses stability on the way, it starts from the last stable shape.
        """
        starts, loads = self._starts[which], np.zeros((len(which), 12))
        self._vary_rods(self.rods.parameters, self._making, self.episodes, which, self._starts, self._draws, loads)
        self.rods.write(which)
        positions, quaternions = (part[starts] for part in self._start_poses)
        near = Shapes(positions, quaternions, np.ones(len(which)), np.zeros(len(which), bool))
        shapes = self.rods.equilibria(loads, which, near)
        self.rods.lay(which, shapes.positions, shapes.quaternions)
        self._write_fields(
            self.batch.rows,
            self._making,
            which,
            self._starts,
            self._draws,
            self.episodes,
            loads,
            self.batch.status,
        )

    def place_mixing(self, which: np.ndarray) -> None:
        """Give the kernel the mixing of the environments `which` where it mixes behind the slew limit."""
        layout, rows, axes = self.batch.layout, self.batch.rows, self.rods.axes
        if self.batch.terms.turned is not None:
            flat = self.episodes.mixing[which][:, axes, :][:, :, axes].reshape(-1, 9)
            width = self.batch.width
            rows[which // width, layout.mixing : layout.mixing + 9, which % width] = flat

    # ---- steps

    def step(self, actions: np.ndarray, out: Outcome) -> None:
        """One control step of every environment; ``actions`` (num_envs, num_axes), any size: the coils saturate at
        1.
        """
        clipped = np.clip(actions, -1.0, 1.0).astype(np.float64)
        self.commands[1:] = self.commands[:-1].copy()
        self.commands[0] = clipped @ self.coils.directions
        late, split = self.late_controls, self.late_steps
        batch = self.batch
        if split:
            self._send(self.commands[late + 1])
            batch.run(split, self.time_step, self.blend, self.largest_change)
            self._count_travel()
        self._send(self.commands[late])
        batch.run(self.num_steps - split, self.time_step, self.blend, self.largest_change)
        self._count_travel()
        batch.watch()
        batch.share(observe_blocks, batch.shown_terms, self.view, self.full, self.episodes, clipped, batch.status, out)
        if self.estimation is not None:
            self.estimation.step(out)

    def _send(self, commands: np.ndarray) -> None:
        self._write_commands(
            self.batch.rows, commands, self._command_mixing, self.plane_axes, self.num_envs, self.follows
        )

    def _count_travel(self) -> None:
        self._add_travel(self.batch.rows, self.batch.travel, self.plane_axes, self._field_before)

    def new_outcome(self) -> Outcome:
        """Fresh arrays for one step's results: nothing that is handed out is written again."""
        envs, tracked = self.num_envs, len(self.nodes)
        return Outcome(
            observations=np.zeros((envs, self.observation_size), np.float32),
            rewards=np.zeros(envs),
            terms=np.zeros((envs, 4)),
            errors=np.zeros((envs, tracked)),
            goals=np.zeros((envs, tracked, 3)),
            positions=np.zeros((envs, tracked, 3)),
            fields=np.zeros((envs, 3)),
        )

    def info(self, out: Outcome, actions: np.ndarray | None, success: float) -> dict[str, Any]:
        """What the environments say beside the observation; arrays with the first axis num_envs."""
        saturated = np.zeros(self.num_envs, bool) if actions is None else np.any(np.abs(actions) > 1.0, axis=1)
        error = out.errors.mean(axis=1)
        info = {
            "tip_error": out.errors[:, 0].copy(),
            "is_success": (error <= success) & (self.batch.status == 0),
            "field_applied": out.fields.copy(),
            "saturated": saturated,
            "diverged": self.batch.status != 0,
            "tip_position": out.positions[:, 0].copy(),
            "target": out.goals[:, 0].copy(),
        }
        if len(self.nodes) > 1:
            info["middle_error"] = out.errors[:, 1].copy()
        for k, name in enumerate(REWARD_TERMS):
            info[f"reward_{name}"] = out.terms[:, k].copy()
        return info if self.estimation is None else info | self.estimation.info()
