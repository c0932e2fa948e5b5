"""Statics and linearisation of one rod behind a small object: equilibria, stiffness, stable steps."""

import copy
from dataclasses import dataclass

import numpy as np

from magrod_env._jit import PRESENT
from magrod_env.rod import stability
from magrod_env.rod.layout import Terms, make_blocks, make_layout, rows_of
from magrod_env.rod.mesh import RodValues, write_rod
from magrod_env.rod.statics import REACHED, find_equilibrium, relax, set_loads
from magrod_env.rod.tangent import BAND, LANES


@dataclass(frozen=True)
class LoadCase:
    """An equilibrium, or the last stable shape before stability was lost.

    positions (num_nodes, 3) m and quaternions (num_nodes, 4), world; ``share`` 2 where all loads act, else where
    stability was lost: 0-1 the share of gravity, 1-2 one plus the share of the field.
    """

    positions: np.ndarray
    quaternions: np.ndarray
    reached: bool
    share: float
    field: np.ndarray
    gradient: np.ndarray

    @property
    def tip_position(self) -> np.ndarray:
        """Position of the tip, m, world, (3,)."""
        return self.positions[-1].copy()

    @property
    def tangents(self) -> np.ndarray:
        """First body axis of every section, world, (num_nodes, 3)."""
        w, x, y, z = self.quaternions.T
        return np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)


class StaticModel:
    """One rod's constants, always in float64 and in space, for equilibria and linearisation."""

    def __init__(self, values: RodValues, counts, magnet_segments, nodal: bool, gravity):
        def present(flag):
            return PRESENT if flag else None

        self.counts = counts
        self.terms = Terms(
            lanes=LANES,
            nodal=present(nodal),
            gravity=present(gravity is not None),
            magnets=present(len(magnet_segments) > 0),
        )
        ends = np.cumsum(counts)
        self.layout = make_layout(int(ends[-1]), tuple(int(ends[s]) for s in magnet_segments), self.terms)
        self.gravity = np.zeros(3) if gravity is None else np.array(gravity, float)
        self._block = make_blocks(len(LANES), self.layout, self.terms, np.float64)[0]
        rows = rows_of(self._block[None], len(LANES))[0]
        for lane in range(len(LANES)):
            write_rod(rows, lane, self.layout, counts, values, None, self.terms.nodal)
        stability.set_gravity(self._block, self.terms, self.gravity)

    def straight(self):
        """Positions (num_nodes, 3) and quaternions (num_nodes, 4) of the straight rod."""
        return stability.straight(self._block, self.layout, self.terms)

    def equilibrium(self, field, gradient=None) -> LoadCase:
        """Equilibrium in ``field`` (3,) T and ``gradient`` (3, 3) T/m or None (see ``find_equilibrium``)."""
        block = self._block.copy()
        positions, quaternions = self.straight()
        slopes = np.zeros(9) if gradient is None else np.array(gradient, float).ravel()
        present = None if gradient is None else PRESENT
        status, share = find_equilibrium(
            block,
            self.layout,
            self.terms,
            self.terms.nodal,
            present,
            np.array(field, float),
            slopes,
            positions,
            quaternions,
        )
        return LoadCase(positions, quaternions, status == REACHED, float(share), np.array(field, float), slopes)

    def follow(self, case: LoadCase, field) -> LoadCase:
        """Equilibrium in ``field`` (3,) T, continued from one nearby; from zero field where that is too far."""
        block = self._block.copy()
        positions, quaternions = case.positions.copy(), case.quaternions.copy()
        field, slopes = np.array(field, float), np.zeros(9)
        set_loads(block, self.terms, 2.0, self.gravity, field, slopes)
        size = 6 * self.layout.num_elements
        residual, band = np.zeros(size), np.zeros((size, BAND))
        if case.reached and relax(
            block, self.layout, self.terms, self.terms.nodal, None, positions, quaternions, residual, band
        ):
            return LoadCase(positions, quaternions, True, 2.0, field, slopes)
        return self.equilibrium(field)

    def linearise(self, case: LoadCase | None):
        """Dense stiffness and lumped inertia at an equilibrium; None: straight and without load."""
        block = self._block.copy()
        if case is None:
            terms = self.terms._replace(magnets=None)
            return stability.linearise(block, self.layout, terms, None, *self.straight())
        set_loads(block, self.terms, 2.0, self.gravity, case.field, case.gradient)
        present = PRESENT if case.gradient.any() else None
        return stability.linearise(block, self.layout, self.terms, present, case.positions, case.quaternions)

    def stable_time_step(self, field_magnitude: float, plane: str | None, pull: float = 0.0) -> float:
        """See ``stability.stable_time_step``."""
        return stability.stable_time_step(self._block, self.layout, self.terms, field_magnitude, plane, pull=pull)

    def stable_time_step_at(self, case: LoadCase, plane: str | None) -> float:
        """Largest stable step, s, of small motions about an equilibrium."""
        return stability.time_step_bound(*self.linearise(case), plane)

    def working_time_step(self, field_magnitude: float, plane: str | None) -> float:
        """Bound on the step, s, that also covers a swing under gravity and sudden fields up to ``field_magnitude`` T.

        The least of straight, sagging under 2 g and hanging under 3 g, as at the bottom of a swing, all with
        ``shock_stiffness`` added (docs/physics.md).
        """
        shock = stability.shock_stiffness(self._block, self.layout, self.terms, field_magnitude)
        bound = stability.stable_time_step(self._block, self.layout, self.terms, field_magnitude, plane, shock)
        if self.terms.gravity is None:
            return bound
        hanging = np.array([3.0 * np.linalg.norm(self.gravity), 0.0, 0.0])
        for gravity in (2.0 * self.gravity, hanging):
            swung = copy.copy(self)
            swung.gravity, swung._block = gravity, self._block.copy()
            stability.set_gravity(swung._block, self.terms, gravity)
            stiffness, inertia = swung.linearise(swung.equilibrium(np.zeros(3)))
            bound = min(bound, stability.time_step_bound(stiffness + np.diag(shock), inertia, plane))
        return bound
