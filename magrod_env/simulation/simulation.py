"""The rod in time: pick the kernel a scene needs, step a batch of rods, turn a status into an exception with advice."""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Callable
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks
from magrod_env.magnetics import FieldCourse
from magrod_env.magnetics.maxwell import checked_gradient
from magrod_env.rod.batch import PLANE_AXES
from magrod_env.rod.equilibrium import Equilibrium, shapes_at
from magrod_env.rod.layout import BENDING
from magrod_env.rod.stability import angular_frequencies
from magrod_env.rod.threads import checked_num_threads
from magrod_env.scene import Scene
from magrod_env.simulation.errors import SYMPTOMS, CoarseWarning, SimulationDiverged, StabilityError
from magrod_env.simulation.felt_loads import FeltLoads
from magrod_env.simulation.integrators import check_integrator, implicit_schemes, largest_step, working_step
from magrod_env.simulation.inverse import InverseStatics, inverse_statics
from magrod_env.simulation.linear import LinearModel, linear_model
from magrod_env.simulation.model import RodModel
from magrod_env.simulation.parameters import checked_parameters, checked_rods
from magrod_env.simulation.reactions import Reactions, reactions
from magrod_env.simulation.resolution import (
    EXPECTED_FIELD,
    Resolution,
    checked_expected_field,
    checked_resolution,
)
from magrod_env.simulation.rods import Rods
from magrod_env.simulation.scene_values import axis_across, check_plane, relative_load
from magrod_env.simulation.search import choose_resolution
from magrod_env.simulation.starts import Shape, check_one_start, checked_shape
from magrod_env.simulation.state import RodState, check_state

ELEMENTS = ("helical", "nodal")
PRECISIONS = ("float64", "float32")
SAFETY = 0.4  # of the bound, for a step that is left to us: sudden fields ring, and bends shift the bound
WATCH_EVERY = 256  # steps
SAFE_PULLED = 0.5  # of the bound under tension
FIELD_AHEAD = (1.5, 1.1, 1.0)  # times a new strongest field: the step is checked as far ahead as it is stable
LARGEST_FIELD = 1e6  # T, beyond any: its squares and the energies that it makes stay finite
SHORTEST_STEP = 1e-15  # of the stable one: in a shorter one rounding swallows all motion of the rod
MOST_STEPS = 2**31  # of one call, hours at the least
MOST_ELEMENTS, MOST_RODS = 2000, 10**7  # statics take dense matrices of the elements, a batch takes memory
LARGEST_CONDITIONING = 1e12  # beyond which nothing is left of a stiffness beside rounding of the others

Field = ArrayLike | Callable[[float], ArrayLike] | None
Gradient = ArrayLike | Callable[[float], ArrayLike] | None


class Simulation:
    """A batch of equal rods under their own fields, stepped in time.

    The world frame has the clamp at its origin and the straight rod along +x. Rotations map body to world; a section's
    first body axis is its normal, the tangent of the unsheared rod.

    Args:
        scene: what is simulated.
        num_rods: rods in the batch.
        num_elements: elements along each rod; a node sits at every magnet. None takes 6.
        element: "helical" (default: exact for uniform strain) or "nodal" (the paper's, which locks in shear).
        time_step: s; None takes 0.4 of the bound in a sudden `expected_field`, straight or sagging under twice gravity.
        tolerance: RMS error of the tip, m, over two seconds from the straight rod in fields up to `expected_field` that
            change smoothly or in small steps. Pilot runs of the scene (a second to minutes, once a process) then choose
            `num_elements`, `time_step`, `axial_softening`, `rotary_scaling` and, unless it is given, `integrator`; see
            `resolution`.
        expected_field: magnitude, T, of the strongest field that is likely.
        precision: "float64" or "float32".
        plane: None for motion in space; "xz" or "xy" computes motion in that plane only: the same result at less cost.
        axial_softening: divides the axial stiffness EA, and
        rotary_scaling: multiplies the rotary inertia of the sections, both at least 1 and None for 1: conditioning of
            stiff modes that allows longer steps at an error to be weighed (docs/physics.md). Bending stays as it is.
        integrator: "explicit"; or, for stiff rods, "implicit" (order 2) or "implicit4" (order 4, without internal
            damping): with the helical element in float64, their steps are bounded by accuracy alone. `time_step` None
            then takes 1/64 or 1/12 of the period of the slowest vibration of the straight rod. None is "explicit", or
            what a `tolerance` chooses. Implicit steps are computed in space, in a `plane` too.
        frequency_shaping: with element="nodal", divide E by the locking factor 1 + GA h^2/(4 EI), h = length/elements.
        on_failure: "raise" SimulationDiverged after a step that a rod did not survive, or only "report" it in `status`.
        num_threads: threads that share the batch; None for one for each core that the process may use.

    Raises:
        ValueError: on bad input, among it a time step beyond `stable_time_step`.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        num_rods: int = 1,
        num_elements: int | None = None,
        element: str = "helical",
        time_step: float | None = None,
        tolerance: float | None = None,
        expected_field: float = EXPECTED_FIELD,
        precision: str = "float64",
        plane: str | None = None,
        axial_softening: float | None = None,
        rotary_scaling: float | None = None,
        integrator: str | None = None,
        frequency_shaping: bool = False,
        on_failure: str = "raise",
        num_threads: int | None = None,
    ) -> None:
        if not isinstance(scene, Scene):
            raise ValueError(f"scene must be a Scene, but got {scene!r}: build one or use load_scene(name).")
        num_threads = checked_num_threads(num_threads)
        num_rods = int(_checks.count("num_rods", num_rods, advice="give the number of rods in the batch"))
        _check_at_most("num_rods", num_rods, MOST_RODS)
        _check_choice("element", element, ELEMENTS)
        _check_choice("precision", precision, PRECISIONS)
        _check_choice("on_failure", on_failure, ("raise", "report"))
        check_plane(scene, plane)
        scheme = check_integrator(integrator, scene, element=element, precision=precision, tolerance=tolerance)
        if element == "nodal" and scene.damping_time is not None:
            raise ValueError(
                'internal_damping must be None with element="nodal", which the paper has without it, '
                f'but got {scene.damping_time!r}: use element="helical".'
            )
        self.scene, self.num_rods, self.element = scene, num_rods, element
        self.precision, self.plane, self.on_failure = precision, plane, on_failure
        self._across = axis_across(plane)
        self.expected_field = checked_expected_field(expected_field)
        _check_at_most("expected_field", self.expected_field, LARGEST_FIELD)
        resolution = checked_resolution(num_elements, time_step, axial_softening, rotary_scaling, tolerance)
        if tolerance is not None:
            if element == "nodal" or frequency_shaping:
                raise ValueError(
                    'tolerance must be None with element="nodal", which locks, but got '
                    f'{tolerance!r}: use element="helical", or give num_elements.'
                )
            free = integrator is None and precision == "float64"
            implicit = implicit_schemes(scene) if free else ()
            resolution = resolution_for(scene, float(tolerance), plane, self.expected_field, implicit=implicit)
        else:
            resolution = dataclasses.replace(resolution, integrator=scheme)
        self.integrator = resolution.integrator
        self.num_elements = num_elements = resolution.num_elements
        _check_at_most("num_elements", num_elements, MOST_ELEMENTS)
        for name in ("axial_softening", "rotary_scaling"):
            _check_at_most(name, getattr(resolution, name), LARGEST_CONDITIONING)
        self.rods = Rods(
            RodModel(
                scene,
                num_elements,
                element=element,
                axial_softening=resolution.axial_softening,
                rotary_scaling=resolution.rotary_scaling,
                frequency_shaping=frequency_shaping,
            ),
            num_rods=num_rods,
            precision=precision,
            plane=plane if self.integrator == "explicit" else None,  # implicit ones step in space
            num_threads=num_threads,
        )
        self._check_representable()
        self._time = self._safe_field = 0.0
        self._safe_pull, self._own_step = 0.0, False
        self._told_of_coarse = on_failure != "raise"
        chosen_for = -1.0 if tolerance is None else self.expected_field
        self._felt_loads = FeltLoads(self.rods, self.integrator, chosen_for, self._step_by_default)
        self._field, self._gradient = np.zeros((num_rods, 3)), np.zeros((num_rods, 3, 3))
        self._made_with = {
            "scene": scene,
            "num_elements": num_elements,
            "element": element,
            "precision": precision,
            "plane": plane,
            "integrator": self.integrator,
            "axial_softening": resolution.axial_softening,
            "rotary_scaling": resolution.rotary_scaling,
            "frequency_shaping": bool(frequency_shaping),
        }
        self.time_step = resolution.time_step
        self.resolution = dataclasses.replace(resolution, time_step=self.time_step)
        self.reset()

    def _check_representable(self) -> None:
        """Refuse a scene whose stiffness or inertia overflows, or is nothing, in the numbers of the kernels."""
        rows, layout = self.rods.batch.rows, self.rods.batch.layout
        if not np.isfinite(rows).all() or not (rows[:, layout.elements + BENDING] > 0.0).all():
            raise ValueError(
                "scene must have stiffness and inertia within the range of its numbers, but some overflow or vanish in "
                f'{self.precision}: check the units, or use precision="float64".'
            )

    # ---- the time step

    @cached_property
    def stable_time_step(self) -> float:
        """Largest stable time step of the straight rod without field, s (see also `stable_time_step_in`)."""
        return _sound_step(lambda: self.stable_time_step_in(0.0))

    def stable_time_step_in(self, field_magnitude: float) -> float:
        """Largest stable time step, s, of the straight rod in a field of any direction up to `field_magnitude` (T).

        Infinite with an implicit integrator, but for "implicit4" with drag.
        """
        if self.integrator != "explicit":
            return largest_step(self.integrator, self.scene.drag_rate, self.rods.model.terms["spin_drag_rate"])
        return self.rods.limit.stable_time_step(field_magnitude, self.plane)

    def stable_time_step_at(self, equilibrium: Equilibrium) -> float:
        """Largest stable time step, s, of small motions about an equilibrium of this simulation, tension and bend
        included; infinite with an implicit integrator.

        Raises:
            ValueError: if it was not reached, or is none of this simulation.
        """
        self._check_start(equilibrium)
        if self.integrator != "explicit":
            return self.stable_time_step
        return self.rods.model.static.stable_time_step_at(equilibrium, self.plane)

    def _checked_step(self, time_step: float | None) -> float:
        if time_step is None:
            return _sound_step(self._step_of_the_scene)  # not kept: expected_field may have changed
        step = _checks.number("time_step", time_step, above=0.0, advice="give it in seconds, or None for a stable one")
        if step > self.stable_time_step:
            raise ValueError(
                f"time_step must be at most {self.stable_time_step:.3g} s, the stability bound of this rod with "
                f"{self.num_elements} elements, but got {step:.3g} s: lower it, or num_elements, or leave it None."
            )
        if step < self._shortest_step:
            raise ValueError(
                f"time_step must be at least {self._shortest_step:.3g} s, below which rounding swallows the motion, "
                f"but got {step:.3g} s: give it in seconds, or None for a stable one."
            )
        return step

    @cached_property
    def _default_step(self) -> float:
        return _sound_step(self._step_of_the_scene)

    def _step_by_default(self) -> float:
        return self._default_step

    @cached_property
    def _shortest_step(self) -> float:
        return SHORTEST_STEP * (self.stable_time_step if self.integrator == "explicit" else self._default_step)

    def _step_of_the_scene(self) -> float:
        """Step, s, where nothing is said."""
        if self.integrator != "explicit":
            pull = float(np.linalg.norm(self.scene.gravity or (0.0, 0.0, 0.0))) / self.scene.rod.length
            return working_step(self.integrator, float(self.natural_frequencies()[0]), self.stable_time_step, pull)
        strength = self.expected_field if self.scene.magnets else 0.0
        return SAFETY * self.rods.limit.working_time_step(strength, self.plane)

    @property
    def coarse(self) -> bool:
        """Whether the elements may be too few for the strongest field since the reset: after sudden loads the tip may
        be off by more than a twentieth of its swing (an estimate: `resolution.elements_for`), or the element locks, or
        float32 holds up a thin rod with internal damping (an estimate: `resolution.rounding_share`), or implicit steps
        are too long for the vibrations that a sudden field excites. False where a tolerance chose the elements for
        such fields.
        """
        return self._felt_loads.coarse(self.time_step)

    def _feel_changes(self, fields: np.ndarray, times: np.ndarray) -> None:
        """Note changes from the present field to fields (K, num_rods, 3) T that begin to act at times (K,) s."""
        self._felt_loads.feel(np.diff(fields, axis=0, prepend=self._field[None]), times)

    def _tell_of_coarse(self) -> None:
        """Warn, once, that the elements may be too few."""
        if not self._told_of_coarse and self.coarse:
            self._told_of_coarse = True
            warnings.warn(self._felt_loads.advice(self.time_step), CoarseWarning, stacklevel=3)

    def _check_strength(self, fields: np.ndarray, gradients: np.ndarray, positions: np.ndarray | None = None) -> None:
        """Refuse fields in which the step is too long, with few eigenvalue problems while a field rises.

        Args:
            fields, gradients: T and T/m, (..., num_rods, 3) and (..., num_rods, 3, 3).
            positions: of the nodes, m, (num_rods, num_nodes, 3), where not the present ones.
        """
        if self.scene.magnets and gradients.any():
            self._check_pull(float(np.abs(gradients).max()))
            places = (self.positions if positions is None else positions)[:, list(self.magnet_nodes)]
            places = np.nan_to_num(places)  # of rods that have failed
            fields = fields[..., None, :] + np.einsum("...rij,rmj->...rmi", gradients, places)
        largest = float(np.linalg.norm(fields, axis=-1).max()) * self.rods.largest_gain
        if self.scene.magnets and largest > self._safe_field:
            self._safe_field = self._safe_reach(largest)
        self._felt_loads.strongest = max(self._felt_loads.strongest, largest)

    def _check_pull(self, largest: float) -> None:
        """Shorten a step left to us where a gradient of up to `largest` T/m pulls the rod taut; refuse a given one."""
        if self.integrator != "explicit" or largest <= self._safe_pull:
            return
        bound = self.rods.limit.stable_time_step(self._felt_loads.strongest, self.plane, 1.5 * largest)
        if self._own_step and self.time_step > SAFE_PULLED * bound:
            self._time_step = SAFE_PULLED * bound
        if self.time_step > bound:
            raise ValueError(
                f"time_step must be at most {bound:.3g} s in a gradient of {largest:.3g} T/m, which pulls the rod "
                f"taut, but is {self.time_step:.3g} s: give Simulation a smaller time_step."
            )
        self._safe_pull = 1.5 * largest

    def _safe_reach(self, largest: float) -> float:
        """A field, T, of at least `largest` in which the step is stable."""
        for reach in (max(FIELD_AHEAD[0] * largest, self.expected_field), *(ahead * largest for ahead in FIELD_AHEAD)):
            bound = self.stable_time_step_in(reach)
            if self.time_step <= bound:
                return reach
        raise ValueError(
            f"time_step must be at most {bound:.3g} s in a field of {largest:.3g} T, "
            f"but is {self.time_step:.3g} s: give Simulation a smaller time_step."
        )

    @property
    def time_step(self) -> float:
        """Longest step, s, that `advance` takes; to be set within the bounds of the argument, None for a stable one."""
        return self._time_step

    @time_step.setter
    def time_step(self, step: float | None) -> None:
        self._time_step, self._safe_field = self._checked_step(step), 0.0
        self._safe_pull, self._own_step = 0.0, step is None

    def force_time_step(self, step: float) -> None:
        """Take steps of this length (s) from now on, beyond the bound too: for studies of stability."""
        self._time_step, self._safe_field, self._own_step = step, math.inf, False

    # ---- running

    def reset(
        self,
        field: ArrayLike | None = None,
        shape: Shape | Equilibrium | None = None,
        *,
        gradient: ArrayLike | None = None,
    ) -> None:
        """Start again at time 0 and at rest, by default straight along +x with no field.

        Args:
            field: (3,) or (num_rods, 3), T: puts each rod into the static equilibrium that it reaches when gravity and
                then this field are turned on slowly.
            shape: positions (num_nodes, 3) m and rotations of the nodes, body to world, as matrices (num_nodes, 3, 3)
                or quaternions (num_nodes, 4), scalar first; or the same a rod; or an `Equilibrium`. The rods are
                released from it with no field. None beside a field or a gradient.
            gradient: T/m, (3, 3) or (num_rods, 3, 3), turned on with the field (zero where none is given), as in
                `advance`; None for none.

        Raises:
            ValueError: if field or gradient are not finite, have another shape, leave the plane or are too strong for
                the time step, if the gradient breaks Maxwell's equations; if the shape is none of a clamped rod.
            StabilityError: if a rod buckles or snaps through on the way. The simulation is then as it was.
        """
        check_one_start(field, shape, gradient)
        fields = np.zeros((self.num_rods, 3)) if field is None else self.checked_field(field)
        slopes = np.zeros((self.num_rods, 3, 3)) if gradient is None else self._checked_gradient(gradient)
        if shape is not None:
            start = checked_shape(shape, self.num_rods, self.num_elements + 1, self.scene.rod.length, self._across)
        elif field is None and gradient is None:
            start = self._straight()
        else:
            start = self._equilibria(fields, slopes)
        before, self._felt_loads.strongest = self._felt_loads.strongest, 0.0
        try:
            self._check_strength(fields, slopes, start[0])
        except ValueError:
            self._felt_loads.strongest = before
            raise
        self._time = 0.0
        self._felt_loads.calm()
        self.rods.batch.status[:] = 0
        self._put_field(fields)
        self._put_gradient(slopes)
        self.rods.batch.use_gradient(gradient is not None)
        self.rods.motion.write(*start)
        self.rods.batch.mark()

    def _straight(self) -> tuple[np.ndarray, np.ndarray]:
        shape = (self.num_rods, self.num_elements + 1)
        positions, quaternions = np.zeros((*shape, 3)), np.zeros((*shape, 4))
        positions[..., 0], quaternions[..., 0] = self.rods.arc_lengths, 1.0
        return positions, quaternions

    def _equilibria(self, fields: np.ndarray, gradients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        acting, slopes = self.rods.acting(fields), self.rods.acting_gradient(gradients).reshape(-1, 9)
        loads, rods = np.concatenate([acting, slopes], axis=1), np.arange(self.num_rods)
        index = rods
        if not self.rods.varied:  # equal loads then have equal equilibria
            _, rods, index = np.unique(loads, axis=0, return_index=True, return_inverse=True)
            index = index.ravel()
        shapes = self.rods.equilibria(loads[rods], rods)
        lost = np.flatnonzero(~shapes.reached)
        if len(lost):
            case = shapes_at(shapes, lost[0], np.concatenate([fields, gradients.reshape(-1, 9)], axis=1)[rods[lost[0]]])
            raise StabilityError.at(case, self.scene)
        return shapes.positions[index], shapes.quaternions[index]

    def equilibrium(
        self,
        field: ArrayLike = (0.0, 0.0, 0.0),
        gradient: ArrayLike | None = None,
        *,
        start: Equilibrium | Shape | None = None,
        rod: int = 0,
    ) -> Equilibrium:
        """Static equilibrium of one rod in one field, without touching the simulation's state; in space, whatever the
        `plane`.

        Args:
            field: (3,) T, world, at the origin.
            gradient: (3, 3) T/m, dB_i/dx_j, or None.
            start: None follows the branch from the straight rod: gravity is turned on, then field and gradient. An
                `Equilibrium` of this simulation is followed from its field and gradient to these along a straight
                line, gravity staying on: round a loop, say. A shape, as in `reset`, relaxes without inertia in the
                final loads: to another branch.
            rod: which one, where `set_parameters` has made them differ.

        Returns:
            positions (num_nodes, 3) m, quaternions (num_nodes, 4), whether it was `reached`, and where it was not the
            `share` of the loads at which stability was lost: 0-1 gravity, 1-2 field and gradient, or the way to them
            from those of `start`. From a shape it is 1 where no stable rest was found.

        Raises:
            ValueError: on bad loads, as in `reset`; if `start` was not reached, or is no equilibrium of this simulation
                or no shape of a clamped rod.
        """
        one = np.array(_checks.vector("field", field, advice="give a world vector in tesla"))
        _check_largest_field(one)
        slopes = None if gradient is None else checked_gradient(gradient, 1).reshape(3, 3)
        static, column = self.rods.model.static, self.rods.column(self._checked_rod(rod))
        felt, pull = self._felt(one, slopes, rod)
        if start is None:
            found = static.equilibrium(felt, pull, column)
        elif isinstance(start, Equilibrium):
            self._check_start(start, rod)
            found = static.continued(self._as_felt(start, rod), felt, pull, column)
        else:
            length = float(self.rods.arc_lengths_of(rod)[-1])
            positions, quaternions = checked_shape(start, 1, self.num_elements + 1, length, self._across, name="start")
            found = static.relaxed(positions[0], quaternions[0], felt, pull, column)
        commanded: np.ndarray = found.gradient if slopes is None else slopes
        return dataclasses.replace(found, field=one, gradient=commanded)

    def _checked_rod(self, rod: Any) -> int:
        if isinstance(rod, bool) or not isinstance(rod, (int, np.integer)) or not 0 <= rod < self.num_rods:
            raise ValueError(
                f"rod must be between 0 and {self.num_rods - 1}, but got {rod!r}: give the index of a rod."
            )
        return int(rod)

    def _felt(self, field: np.ndarray, gradient: np.ndarray | None, rod: int) -> tuple[np.ndarray, np.ndarray | None]:
        """The field and gradient that act on a rod where these are commanded."""
        if self.rods.mixing is None:
            return field, gradient
        every = np.broadcast_to(field, (self.num_rods, 3))
        slopes = None
        if gradient is not None:
            slopes = self.rods.acting_gradient(np.broadcast_to(gradient, (self.num_rods, 3, 3)))[rod]
        return self.rods.acting(every)[rod], slopes

    def _as_felt(self, case: Equilibrium, rod: int) -> Equilibrium:
        field, gradient = self._felt(case.field, case.gradient, rod)
        return dataclasses.replace(case, field=field, gradient=np.zeros((3, 3)) if gradient is None else gradient)

    def _check_start(self, start: Equilibrium, rod: int = 0) -> None:
        if not start.reached:
            raise ValueError(
                "start must be an equilibrium that was reached, but stability was lost on the way to it: take one "
                "before that, or a shape beyond."
            )
        static, column = self.rods.model.static, self.rods.column(rod)
        if len(start.positions) != self.num_elements + 1 or not static.holds(self._as_felt(start, rod), column):
            raise ValueError(
                "start must be an equilibrium of this simulation, but its shape does not stay where it is under its "
                "own loads: take it from a simulation of the same scene and elements, or give (positions, rotations)."
            )

    def advance(self, duration: float, field: Field = None, gradient: Gradient = None) -> None:
        """Step all rods over `duration` (s), in equal steps no longer than `time_step`.

        Args:
            duration: s.
            field: T, world, (3,) or (num_rods, 3), constant over the duration; or a `FieldCourse`, or a function of
                time (s) that returns one, taken in the middle of every step (a function costs a call in Python for
                each, a `FieldCourse` does not); None keeps the last.
            gradient: T/m, (3, 3) or (num_rods, 3, 3): dB_i/dx_j, symmetric and of trace zero; the field is then `field`
                + gradient @ position and pulls the magnets; or a function of time (s) that returns one, taken in the
                middle of every step (each step is then a call from Python of its own, some tens of microseconds); None
                keeps the last, which is zero after a reset.

        Raises:
            ValueError: on a wrong shape, NaN, a field or gradient that leaves the plane, a gradient that breaks
                Maxwell's equations, a field that is too strong for the time step.
            SimulationDiverged: if a rod fails and `on_failure` is "raise"; the others are then where they should be.
        """
        duration = _checks.number("duration", duration, at_least=0.0, advice="give it in seconds")
        if duration > MOST_STEPS * self.time_step:
            raise ValueError(
                f"duration must be at most {MOST_STEPS * self.time_step:.3g} s, {MOST_STEPS} time steps of "
                f"{self.time_step:.3g} s, but got {duration:.3g} s: check the units, or advance in parts."
            )
        self._set_loads(
            self._field if field is None or callable(field) else self.checked_field(field),
            self._gradient if gradient is None or callable(gradient) else self._checked_gradient(gradient),
        )
        if duration == 0.0:
            return
        steps = max(1, math.ceil(duration / self.time_step - 1e-9))
        step, start = duration / steps, self._time
        self._tell_of_coarse()
        for first in range(0, steps, WATCH_EVERY):
            if first > 0:
                self._watch()
            count = min(WATCH_EVERY, steps - first)
            middles = start + step * (first + 0.5 + np.arange(count))
            fields = self._fields_at(field, middles) if callable(field) else None
            slopes = self._gradients_at(gradient, middles) if callable(gradient) else None
            self._run(count, step, fields, slopes)
            self._time = start + (first + count) * step
        self._watch()

    def _run(self, count: int, step: float, fields: np.ndarray | None, gradients: np.ndarray | None) -> None:
        """Take steps in the fields (count, num_rods, 3) and gradients (count, num_rods, 3, 3) of their middles; None
        leaves what is.
        """
        if fields is not None or gradients is not None:
            self._check_strength(
                self._field if fields is None else fields,
                self._gradient if gradients is None else gradients,
            )
        if gradients is None:
            self._step(count, step, fields)
            return
        for k in range(count):
            self._put_gradient(gradients[k])
            self._step(1, step, None if fields is None else fields[k : k + 1])

    def _step(self, count: int, step: float, fields: np.ndarray | None) -> None:
        if fields is not None:
            self._feel_changes(fields, self._time + step * np.arange(count))
            self._field = fields[-1]
            fields = self.rods.acting(fields)
        self.rods.run(count, step, self.integrator, fields)

    def _fields_at(self, field: Callable[[float], ArrayLike], times: np.ndarray) -> np.ndarray:
        """Field of every rod at times (K,) s, T, (K, num_rods, 3)."""
        if not isinstance(field, FieldCourse):
            return np.array([self.checked_field(field(float(time))) for time in times])
        fields = field.sample(times)
        self.checked_field(fields[0])
        _check_largest_field(fields)
        fields = np.broadcast_to(fields[:, None] if fields.ndim == 2 else fields, (len(times), self.num_rods, 3))
        self._check_in_plane(fields)
        return fields

    def _gradients_at(self, gradient: Callable[[float], ArrayLike], times: np.ndarray) -> np.ndarray:
        """Gradient of every rod at times (K,) s, T/m, (K, num_rods, 3, 3)."""
        return np.array([self._checked_gradient(gradient(float(time))) for time in times])

    def _watch(self) -> None:
        self.rods.batch.watch()
        failed = np.flatnonzero(self.rods.batch.status)
        if len(failed) and self.on_failure == "raise":
            rod = int(failed[0])
            raise SimulationDiverged(
                f"rod {rod} left the stable range by t = {self._time:.4g} s: "
                f"{SYMPTOMS[int(self.rods.batch.status[rod])]}; "
                f"time step {self.time_step:.3g} s, bound of the straight rod {self.stable_time_step:.3g} s: "
                "lower time_step, or use more elements where the rod bends sharply."
            )

    def checked_field(self, field: Any) -> np.ndarray:
        """A field (3,) or (num_rods, 3) as one for every rod, T, (num_rods, 3); ValueError if it is none, as in
        `advance`.
        """
        array = np.asarray(field, float)
        if array.shape not in ((3,), (self.num_rods, 3)) or not np.isfinite(array).all():
            raise ValueError(
                f"field must be finite of shape (3,) or ({self.num_rods}, 3), but got "
                f"{'shape ' + str(array.shape) if array.size > 6 else repr(field)}: give world vectors in tesla."
            )
        _check_largest_field(array)
        array = np.array(np.broadcast_to(array, (self.num_rods, 3)))
        self._check_in_plane(array)
        return array

    def _check_in_plane(self, fields: np.ndarray) -> None:
        if self.plane is None:
            return
        across = fields[..., self._across]
        if np.any(across != 0.0):
            raise ValueError(
                f"field must lie in the plane {self.plane!r} of this planar simulation, but got up to "
                f"{np.abs(across).max():.3g} T across it: leave that component out, or use plane=None."
            )

    def _checked_gradient(self, gradient: Any) -> np.ndarray:
        """Gradient of every rod, T/m, (num_rods, 3, 3).

        Motion in a plane has only its part in the plane; what is left out must not couple the two, and is free to make
        the trace zero.
        """
        array = np.array(np.broadcast_to(checked_gradient(gradient, self.num_rods), (self.num_rods, 3, 3)))
        if self.plane is not None:
            across = self._across
            inside = [axis for axis in range(3) if axis != across]
            coupling = max(np.abs(array[:, across, inside]).max(), np.abs(array[:, inside, across]).max())
            if coupling > 0.0:
                raise ValueError(
                    f"gradient must not couple the plane {self.plane!r} of this planar simulation with the axis across "
                    f"it, but got up to {coupling:.3g} T/m between them: leave that out, or use plane=None."
                )
        return array

    def _set_loads(self, field: np.ndarray, gradient: np.ndarray) -> None:
        """Let a field (num_rods, 3) T and a gradient (num_rods, 3, 3) T/m act from now on, or leave all as it is."""
        self._check_strength(field, gradient)
        if field is not self._field:
            self._feel_changes(field[None], np.array([self._time]))
            self._put_field(field)
        if gradient is not self._gradient:
            self._put_gradient(gradient)

    def _put_field(self, field: np.ndarray) -> None:
        self._field = field
        self.rods.batch.set_field(self.rods.acting(field))

    def _put_gradient(self, gradient: np.ndarray) -> None:
        self._gradient = gradient
        self.rods.batch.use_gradient()
        self.rods.batch.set_gradient(self.rods.acting_gradient(gradient), 2.0 * self.scene.rod.length)

    # ---- state

    @property
    def time(self) -> float:
        """Time since the last reset, s."""
        return self._time

    @property
    def field(self) -> np.ndarray:
        """Field at the origin, T, world, (num_rods, 3)."""
        return self._field.copy()

    @property
    def status(self) -> np.ndarray:
        """0 for a rod that is well; 1 not finite, 2 an element bent by pi, 3 stretched, 4 too energetic, 5 an implicit
        step not solved; (num_rods,).
        """
        return self.rods.batch.status.copy()

    @property
    def arc_lengths(self) -> np.ndarray:
        """Arc length of every node, m, (num_nodes,)."""
        return self.rods.arc_lengths

    @property
    def magnet_nodes(self) -> tuple[int, ...]:
        """Node of each magnet of the scene."""
        return self.rods.batch.layout.magnet_nodes if self.scene.magnets else ()

    @property
    def positions(self) -> np.ndarray:
        """Positions of the nodes, m, world, (num_rods, num_nodes, 3)."""
        return self.rods.motion.positions

    @property
    def tip_position(self) -> np.ndarray:
        """Position of the tip, m, world, (num_rods, 3)."""
        return self.positions[:, -1].copy()

    @property
    def velocities(self) -> np.ndarray:
        """Velocities of the nodes, m/s, world, (num_rods, num_nodes, 3)."""
        return self.rods.motion.velocities

    @property
    def rotations(self) -> np.ndarray:
        """Rotation matrices of the sections, body to world, (num_rods, num_nodes, 3, 3)."""
        return self.rods.motion.rotations

    @property
    def angular_velocities(self) -> np.ndarray:
        """Angular velocities of the sections, rad/s, body frame, (num_rods, num_nodes, 3)."""
        return self.rods.motion.angular_velocities

    def set_motion(self, velocities: ArrayLike, angular_velocities: ArrayLike | None = None) -> None:
        """Give the nodes velocities (m/s, world) and angular velocities (rad/s, body), both (num_rods, num_nodes, 3).

        The clamp's entries are ignored.

        Raises:
            ValueError: on another shape or a number that is not finite.
        """
        shape = (self.num_rods, self.num_elements + 1, 3)
        arrays = []
        for name, value in (("velocities", velocities), ("angular_velocities", angular_velocities)):
            array = np.zeros(shape) if value is None else np.array(value, float)
            if array.shape != shape or not np.isfinite(array).all():
                raise ValueError(
                    f"{name} must be finite of shape {shape}, but got shape {array.shape}: one row a node."
                )
            array[:, 0] = 0.0
            arrays.append(array)
        if self.plane is not None:
            across = self._across
            inside = [axis for axis in range(3) if axis != across]
            if arrays[0][..., across].any() or arrays[1][..., inside].any():
                raise ValueError(
                    f"velocities must keep the rod in the plane {self.plane!r} of this planar simulation, but some "
                    "leave it: leave those components out, or use plane=None."
                )
        state = self.rods.motion
        state.write(state.positions, state.quaternions, arrays[0], state.momenta_of(arrays[1]))
        self.rods.batch.mark()

    def state(self) -> RodState:
        """Everything that changes in time, of all rods, to go back to with `set_state`: for planning, estimation and
        branching. `set_parameters` is not part of it.
        """
        return dataclasses.replace(
            self.rods.state(),
            time=self._time,
            field=self._field.copy(),
            gradient=self._gradient.copy(),
            made_with=self._made_with,
        )

    def set_state(self, state: RodState, rods: ArrayLike | None = None) -> None:
        """Put rods into states of a simulation of the same scene and arguments; a run goes on from them bit for bit.

        `num_rods`, `time_step`, `tolerance`, `expected_field`, `on_failure` and `num_threads` may differ; the step
        stays.

        Args:
            state: what `state` gave: of one rod, for all, or of as many rods as there are in `rods`.
            rods: indices (M,); None for all, and then the time is that of the state too.

        Raises:
            ValueError: if it is no state, or one of another scene, other arguments or another number of rods; if its
                field is too strong for the time step. The simulation is then as it was.
        """
        chosen = None if rods is None else checked_rods(rods, self.num_rods)
        check_state(state, self.rods.batch, self._made_with, self.num_rods if chosen is None else len(chosen))
        pulled = bool(state.gradient.any())
        if pulled or 2.0 * float(np.abs(state.field).max()) > self._felt_loads.strongest:  # 2 > sqrt(3)
            self._check_strength(state.field, state.gradient, state.positions if pulled else None)
        self.rods.set_state(state, chosen)
        self._field, self._gradient = self._field.copy(), self._gradient.copy()
        if chosen is None:
            self._time = state.time
            self._field[:], self._gradient[:] = state.field, state.gradient
        else:
            self._field[chosen], self._gradient[chosen] = state.field, state.gradient
            pulled = bool(self._gradient.any())
        self.rods.batch.use_gradient(pulled)

    # ---- what differs from rod to rod

    def set_parameters(
        self,
        *,
        modulus: ArrayLike | None = None,
        density: ArrayLike | None = None,
        moment: ArrayLike | None = None,
        magnet_shift: ArrayLike | None = None,
        gravity: ArrayLike | None = None,
        drag: ArrayLike | None = None,
        spin_drag: ArrayLike | None = None,
        internal_damping: ArrayLike | None = None,
        field_rotation: ArrayLike | None = None,
        field_gain: ArrayLike | None = None,
        rods: ArrayLike | None = None,
    ) -> None:
        """Let rods differ from the scene's, from now on; positions, velocities and angular velocities stay.

        Statics, energies, frequencies and bounds on the step know them (`stable_time_step` is then that of a rod as
        stiff as the stiffest, as light as the lightest, and so on). A step that was left to the simulation is chosen
        anew. None leaves a parameter as it is.

        Args:
            modulus: factors of Young's modulus, so of every stiffness; (num_rods,) or one for all, as all factors.
            density: factors of the rod's density; magnets keep their masses.
            moment: factors of the magnets' moments.
            magnet_shift: m, along the rod, of every magnet but one at the tip; elements get longer and shorter, so that
                `reset` should follow.
            gravity: m/s^2, world, (num_rods, 3) or (3,).
            drag, spin_drag, internal_damping: factors of the scene's `drag_rate`, `spin_drag_rate` and damping time.
            field_rotation: rotation vectors, rad, world, (num_rods, 3) or (3,), by which the coils are turned: the
                commanded field and gradient turn with them.
            field_gain: factors of the commanded field and gradient.
            rods: indices of the rods meant, (M,), which then take the place of num_rods; None for all.

        Raises:
            ValueError: on a wrong shape, a number that is not finite or out of range, a parameter that the scene has
                nothing for, or a given `time_step` that would be too long. Nothing is then changed.
        """
        chosen = np.arange(self.num_rods) if rods is None else checked_rods(rods, self.num_rods)
        given = {
            "modulus": modulus,
            "density": density,
            "moment": moment,
            "magnet_shift": magnet_shift,
            "gravity": gravity,
            "drag": drag,
            "spin_drag": spin_drag,
            "internal_damping": internal_damping,
            "field_rotation": field_rotation,
            "field_gain": field_gain,
        }
        values, turns, gains = checked_parameters(given, self.rods.model, len(chosen), self.plane)
        before = self.rods.kept_parameters()
        self.rods.set_parameters(values, chosen)
        if turns is not None or gains is not None:
            self.rods.turn_field(turns, gains, chosen)
        self._forget_bounds()
        try:
            self.time_step = None if self._own_step else self._time_step
            self._check_strength(self._field, self._gradient)
        except ValueError:
            self.rods.restore_parameters(before, chosen)
            self._forget_bounds()
            raise
        self.rods.batch.set_field(self.rods.acting(self._field))
        if self._gradient.any():
            self._put_gradient(self._gradient)
        self.rods.batch.mark(chosen)

    def set_load(self, number: int, *, rods: ArrayLike | None = None, **values: ArrayLike) -> None:
        """Give rods values of their own of one of the scene's listed loads, from now on, statics included.

        The time step is not chosen anew: `stable_time_step` is that of the scene's own loads.

        Args:
            number: of the load in `Scene.loads`, from 0.
            rods: indices of the rods meant, (M,); None for all.
            **values: by the names of the load's fields (`force`, `moment`, `density`, ...): one for all these rods, or
                one more axis with one for each.

        Raises:
            ValueError: on a number without load, values that are none of it, or that leave the plane.
        """
        count = len(self.scene.loads)
        if isinstance(number, bool) or number not in range(count):
            raise ValueError(
                f"number must be that of one of the scene's {count} loads, but got {number!r}: count from 0 in the "
                "order of Scene.loads."
            )
        chosen = np.arange(self.num_rods) if rods is None else checked_rods(rods, self.num_rods)
        self.rods.set_load(int(number), chosen, values)

    def _forget_bounds(self) -> None:
        """Work out anew what follows from the parameters."""
        for name in ("stable_time_step", "_default_step", "_shortest_step"):
            self.__dict__.pop(name, None)
        self._safe_field = self._safe_pull = 0.0

    # ---- linear models, inverse statics, forces

    def linearise(self, field: ArrayLike, duration: float, *, state: RodState | None = None) -> LinearModel:
        """Discrete linear model of every rod over `duration` (s) about its equilibrium in a field, or about a state.

        Derivatives are central differences of the simulation's own steps, all at once in lanes; see `LinearModel`.

        Args:
            field: T, world, (3,) or (num_rods, 3): constant over the duration.
            duration: s, of one step of the model, a control step say.
            state: where to linearise, as `state` gives it, of all rods; None for the equilibria in the field.

        Raises:
            ValueError: on a bad field, duration or state.
            StabilityError: if a rod buckles or snaps through on the way to its equilibrium.
        """
        fields = self.checked_field(field)
        duration = _checks.number("duration", duration, above=0.0, advice="give it in seconds")
        if state is not None:
            check_state(state, self.rods.batch, self._made_with, self.num_rods, exactly=True)
        self._check_strength(fields, np.zeros((self.num_rods, 3, 3)))
        steps = max(1, math.ceil(duration / self.time_step - 1e-9))
        shapes = None
        if state is None:
            shapes = self._equilibria(fields, np.zeros((self.num_rods, 3, 3)))
        return linear_model(self.rods, fields, steps, duration / steps, self.integrator, shapes, state, self._tracked)

    @property
    def _tracked(self) -> tuple[int, ...]:
        """The tip's node, then those of the other magnets from the tip inwards."""
        return (self.num_elements, *sorted(set(self.magnet_nodes) - {self.num_elements}, reverse=True))

    def inverse_statics(
        self,
        targets: ArrayLike,
        *,
        magnet: int | None = None,
        start: ArrayLike | None = None,
        limit: float | None = None,
        tolerance: float = 1e-6,
    ) -> InverseStatics:
        """Fields that hold the tip, or a magnet, at targets in equilibrium; what cannot be reached is reported.

        Gauss-Newton steps of least norm on the static Jacobian, for all targets at once in lanes. Where a target lies
        off the surface that the tip moves on, or beyond `limit`, the field is one that comes near it.

        Args:
            targets: m, world, (M, 3), for the rod of index 0; or, with several rods, one for each, (num_rods, 3).
            magnet: number of the magnet of the scene that is meant; None for the tip.
            start: T, (3,) or (M, 3), fields to start from; None for zero.
            limit: T, largest magnitude of the fields; None for `expected_field`.
            tolerance: m, distance at which a target counts as reached.

        Raises:
            ValueError: on a wrong shape or number, or a scene without magnets.
            StabilityError: if a rod buckles under gravity.
        """
        if not self.scene.magnets:
            raise ValueError("scene must have a magnet for inverse statics, but has none: add one.")
        goals = np.atleast_2d(np.asarray(targets, float))
        if goals.ndim != 2 or goals.shape[1] != 3 or not np.isfinite(goals).all():
            raise ValueError(
                f"targets must be finite of shape (M, 3), but got shape {goals.shape}: give world points in m."
            )
        if self.num_rods > 1 and len(goals) != self.num_rods:
            raise ValueError(
                f"targets must be one for each of the {self.num_rods} rods, but got {len(goals)}: "
                "use Simulation(..., num_rods=1) for many targets of one rod."
            )
        node = self.num_elements
        if magnet is not None:
            if isinstance(magnet, bool) or magnet not in range(len(self.scene.magnets)):
                raise ValueError(
                    f"magnet must be the number of one of {len(self.scene.magnets)} magnets, but got {magnet!r}: "
                    "count from 0 in the order of the scene."
                )
            node = self.magnet_nodes[magnet]
        advice = "give it in tesla, 45 mT is 45e-3"
        most = self.expected_field if limit is None else _checks.number("limit", limit, above=0.0, advice=advice)
        tolerance = _checks.number("tolerance", tolerance, above=0.0, advice="give metres, a micrometre is 1e-6")
        begin = np.zeros((len(goals), 3))
        if start is not None:
            begin = np.array(np.broadcast_to(np.asarray(start, float), (len(goals), 3)))
        rods = np.arange(self.num_rods) if self.num_rods > 1 else np.zeros(len(goals), np.int64)
        return inverse_statics(self.rods, goals, rods, node, begin, most, tolerance)

    def reactions(self) -> Reactions:
        """Force and moment of the clamp, forces, moments and curvature along every rod, at present; see `Reactions`."""
        return reactions(self.rods, self.scene.damping_time is not None)

    # ---- what the rods carry

    def energies(self) -> dict[str, np.ndarray]:
        """Kinetic, elastic, gravitational and magnetic energy, J, (num_rods,) each, and that of dead forces as "loads"
        where the scene lists loads; the clamp's node is the zero of gravity and of these.
        """
        return self.rods.batch.energies()

    def energy(self) -> np.ndarray:
        """Total energy, J, (num_rods,)."""
        return np.sum(list(self.energies().values()), axis=0)

    @property
    def node_masses(self) -> np.ndarray:
        """Lumped mass of each node, magnets included, kg, (num_rods, num_nodes); the clamp's is not part of the
        motion: 0.
        """
        return self.rods.motion.masses

    def linear_momentum(self) -> np.ndarray:
        """Linear momentum, kg m/s, world, (num_rods, 3)."""
        return np.einsum("rn,rnk->rk", self.node_masses, self.velocities)

    def angular_momentum(self) -> np.ndarray:
        """Angular momentum about the clamp, kg m^2/s, world, (num_rods, 3)."""
        orbital = np.cross(self.positions, self.node_masses[..., None] * self.velocities)
        return (orbital + np.einsum("rnij,rnj->rni", self.rotations, self.rods.motion.momenta))[:, 1:].sum(axis=1)

    def natural_frequencies(
        self, field: ArrayLike | None = None, gradient: ArrayLike | None = None, *, rod: int = 0
    ) -> np.ndarray:
        """Natural frequencies (Hz, increasing) of small vibrations about the equilibrium in a field and a gradient.

        Args:
            field: (3,) T; None for zero beside a gradient, else for the straight rod without any load.
            gradient: (3, 3) T/m, dB_i/dx_j, or None.
            rod: which one, where `set_parameters` has made them differ.

        Returns:
            6 a node, the clamp left out, 3 in a plane; NaN in every entry where no stable equilibrium is reached (see
            `equilibrium`).
        """
        case = None
        if field is not None or gradient is not None:
            case = self.equilibrium((0.0, 0.0, 0.0) if field is None else field, gradient, rod=rod)
        if case is not None and not case.reached:
            return np.full((6 if self.plane is None else 3) * self.num_elements, np.nan)
        column = self.rods.column(self._checked_rod(rod))
        stiffness, inertia = self.rods.model.static.linearise(
            None if case is None else self._as_felt(case, rod), column
        )
        return angular_frequencies(stiffness, inertia, self.plane) / (2.0 * math.pi)


def _check_choice(name: str, value: Any, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise ValueError(
            f"{name} must be one of {', '.join(map(repr, choices))}, but got {value!r}: choose one of them."
        )


def _sound_step(find: Callable[[], float]) -> float:
    """A time step, s, that follows from a scene; ValueError where its numbers leave none."""
    try:
        with np.errstate(all="ignore"):
            step = find()
    except (np.linalg.LinAlgError, ZeroDivisionError):  # what overflows or underflows on the way
        step = math.nan
    if not step > 0.0:
        raise ValueError(
            f"scene must have sizes, materials, magnets and dampings that fit together, but no time step suits them "
            f"all (found {step:.3g} s): check the units; lengths are in metres, moduli in pascal, times in seconds."
        )
    return step


def _check_at_most(name: str, value: float, most: float) -> None:
    if value > most:
        raise ValueError(
            f"{name} must be at most {most:.12g}, but got {value:.12g}: more cannot be computed, nor is it of use."
        )


def _check_largest_field(field: np.ndarray) -> None:
    if np.abs(field).max() > LARGEST_FIELD:
        raise ValueError(
            f"field must be at most {LARGEST_FIELD:.0g} T, but got {np.abs(field).max():.3g} T: give it in tesla, "
            "10 mT is 10e-3."
        )


@lru_cache(maxsize=64)
def resolution_for(
    scene: Scene,
    tolerance: float,
    plane: str | None,
    expected_field: float,
    hanging: bool = False,
    implicit: tuple[str, ...] = (),
) -> Resolution:
    """What a tolerance asks for; kept, since a process that asks once often asks again (see `choose_resolution`)."""
    return choose_resolution(
        partial(Simulation, scene, plane=plane, expected_field=expected_field, on_failure="report"),
        tolerance=tolerance,
        least_elements=len(scene.segment_ends),
        magnitude=expected_field if scene.magnets else 0.0,
        axes=PLANE_AXES[plane],
        load=relative_load(scene, expected_field) - relative_load(scene, 0.0),
        hanging=hanging,
        implicit=implicit,
    )
