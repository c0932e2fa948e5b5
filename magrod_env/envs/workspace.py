"""Where magnets can be held: static equilibria for fields, and fields for positions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from magrod_env.rod.equilibrium import Equilibrium, StaticModel
from magrod_env.rod.mesh import split_elements
from magrod_env.scene import Scene
from magrod_env.simulation import StabilityError
from magrod_env.values import rod_values


class Workspace:
    """Statics of a scene's nominal rod.

    Args:
        scene: the scene.
        num_elements: elements of the helical rod.
        axial_softening: divides the axial stiffness (see `Simulation`).
    """

    def __init__(self, scene: Scene, num_elements: int, axial_softening: float = 1.0) -> None:
        values, segments = rod_values(scene, axial_softening)
        self.scene = scene
        counts = split_elements(values.ends, num_elements)
        self.model = StaticModel(values, counts, segments, False, scene.gravity, scene.acting_loads)

    @property
    def tracked_nodes(self) -> tuple[int, ...]:
        """Nodes whose positions tasks are about: the magnets from the tip inwards; the tip where there is none."""
        nodes = self.model.layout.magnet_nodes if self.scene.magnets else (self.model.layout.num_elements,)
        return tuple(sorted(nodes, reverse=True))

    def equilibrium(self, field: ArrayLike, near: Equilibrium | None = None) -> Equilibrium:
        """Equilibrium in a field (3,) T, continued from `near` where that is given, else from zero field.

        Raises:
            StabilityError: if the rod loses stability on the way.
        """
        goal = np.asarray(field, float)
        case = self.model.equilibrium(goal) if near is None else self.model.follow(near, goal)
        if not case.reached:
            raise StabilityError.at(case, self.scene)
        return case

    def equilibria(self, fields: ArrayLike) -> list[Equilibrium]:
        """Equilibria along a path of fields (M, 3) T."""
        cases: list[Equilibrium] = []
        for field in np.asarray(fields, float):
            cases.append(self.equilibrium(field, cases[-1] if cases else None))
        return cases

    def positions(self, cases: list[Equilibrium]) -> np.ndarray:
        """Positions of the tracked nodes, m, (len(cases), num_tracked, 3)."""
        return np.array([case.positions[list(self.tracked_nodes)] for case in cases])

    def hold(
        self, target: ArrayLike, *, axes: str = "yz", near: Equilibrium | None = None, tolerance: float = 1e-8
    ) -> Equilibrium:
        """Equilibrium whose outermost tracked point has two coordinates of `target` (3,) m; its `field` is what holds
        it.

        The coordinates, and the field's only components, are those of the two axes: y and z for "yz". Newton's method
        from the equilibrium `near`.

        Raises:
            ValueError: if the point is out of reach: no field was found.
        """
        columns, step, node = ["xyz".index(letter) for letter in axes], 1e-6, self.tracked_nodes[0]
        goal = np.asarray(target, float)[columns]
        case = self.equilibrium(np.zeros(3)) if near is None else near
        miss = case.positions[node, columns] - goal
        for _ in range(50):
            if np.abs(miss).max() < tolerance:
                return case
            slope = np.empty((2, 2))
            for k, column in enumerate(columns):
                nearby = self.equilibrium(case.field + step * np.eye(3)[column], case)
                slope[:, k] = (nearby.positions[node, columns] - goal - miss) / step
            change = np.linalg.lstsq(slope, -miss, rcond=None)[0]
            change *= min(1.0, 5e-3 / max(np.abs(change).max(), 1e-30))  # at most 5 mT at a time
            trial = case.field.copy()
            trial[columns] += change
            try:
                case = self.equilibrium(trial, case)
            except StabilityError:
                break
            miss = case.positions[node, columns] - goal
        raise ValueError(
            f"target must be within reach of the field along {axes!r}, but no field was found that holds the rod at "
            f"{np.asarray(target).tolist()} m: choose a point nearer to the straight rod's tip."
        )

    def hold_along(self, points: ArrayLike, *, axes: str = "yz") -> list[Equilibrium]:
        """Equilibria along a path of points (M, 3) m (see `hold`)."""
        cases: list[Equilibrium] = []
        for point in np.asarray(points, float):
            cases.append(self.hold(point, axes=axes, near=cases[-1] if cases else None))
        return cases
