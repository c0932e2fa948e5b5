"""PyElastica's rod for a problem: where its nodes are, what they weigh, how stiff it is and which step is stable.

`OneEndFixedBC`, the usual clamp, holds node 0 and the directors of element 0, whose middle lies half an element from
the wall: no bending there, an error of first order. Three levels of care:
- "plain": as in PyElastica's examples; a magnet turns the element that holds it;
- "half element": element 0 is centred on the wall. Node 0 sits at -h/2, h = L / (n - 1/2), so the directors of element
  0, fixed, are those at s = 0, and node 1 at h/2 carries the mass of 0 ... h. Only half of element 0 is rod: its shear
  and stretch stiffness is doubled. The last directors are those at L - h/2, so a dipole at L points along the directors
  extrapolated to L; its torque goes to the last element. Second order;
- "corrected": also this package's two corrections: 1 / GA raised by h^2 / (12 EI), the bending inside an element under
  an end load, which allows longer steps too, and the weights 3/8, 7/6, 23/24 on the masses of the last nodes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scripts.peers import Problem

if TYPE_CHECKING:
    import elastica

PLAIN, HALF, CORRECTED = "plain", "half element", "corrected"


@dataclass(frozen=True)
class Setting:
    """elements; care: one of the three levels; time_step: longest step, s."""

    elements: int
    care: str
    time_step: float

    @property
    def label(self) -> str:
        """The kind of set-up."""
        return f"position Verlet, {self.care}"

    @property
    def resolution(self) -> str:
        """Elements and step."""
        return f"{self.elements} elements, <= {1e3 * self.time_step:.3g} ms"


def at_limit(problem: Problem, elements: int, care: str) -> Setting:
    """A set-up at a share of 2 / (highest angular frequency of the straight rod as PyElastica discretises it).

    The share is 0.9, found by trying. Beyond 40 elements it is 0.55: in `free_decay`, without damping, 80 elements
    swing up slowly at 0.7, 0.8 and 0.9.
    """
    from scipy.linalg import eigh

    setting = Setting(elements, care, math.inf)
    spacing, _ = _grid(problem, setting)
    shear, stretch = _stiffness(problem, setting)
    mass = _masses(problem, setting)[1:]  # node 0 and element 0 do not move
    inertia = np.full(elements - 1, problem.scene.rod.rotary_inertia_per_length * spacing)
    chord = (np.eye(elements) - np.eye(elements, k=-1)) / spacing
    turn = np.eye(elements)[:, 1:]
    bend = np.diff(turn, axis=0) / spacing
    strain = np.hstack([chord, -turn])
    stiffness = spacing * strain.T @ (shear[:, None] * strain)
    stiffness[elements:, elements:] += spacing * problem.scene.rod.bending_stiffness * bend.T @ bend
    across = eigh(stiffness, np.diag([*mass, *inertia]), eigvals_only=True)[-1]
    along = eigh(spacing * chord.T @ (stretch[:, None] * chord), np.diag(mass), eigvals_only=True)[-1]
    share = 0.9 if elements <= 40 else 0.55
    return Setting(elements, care, 2 * share / math.sqrt(max(across, along)))


def _grid(problem: Problem, setting: Setting) -> tuple[float, float]:
    """Element length and position of node 0 along the rod, m."""
    if setting.care == PLAIN:
        return problem.scene.rod.length / setting.elements, 0.0
    spacing = problem.scene.rod.length / (setting.elements - 0.5)
    return spacing, -spacing / 2


def _stiffness(problem: Problem, setting: Setting) -> tuple[np.ndarray, np.ndarray]:
    """Shear and stretch stiffness (elements,) N."""
    spacing, _ = _grid(problem, setting)
    rod = problem.scene.rod
    shear, stretch = (np.full(setting.elements, value) for value in (rod.shear_stiffness, rod.axial_stiffness))
    if setting.care == CORRECTED:  # MacNeal 1978
        shear = 1 / (1 / shear + spacing**2 / (12 * rod.bending_stiffness))
    if setting.care != PLAIN:
        shear[0] *= 2
        stretch[0] *= 2
    return shear, stretch


def build(problem: Problem, setting: Setting) -> elastica.CosseratRod:
    """PyElastica's rod along x with the magnets' masses on its nodes."""
    import elastica

    rod, (spacing, start) = problem.scene.rod, _grid(problem, setting)
    made = elastica.CosseratRod.straight_rod(
        setting.elements,
        np.array([start, 0.0, 0.0]),
        np.array([1.0, 0.0, 0.0]),
        np.array([0.0, 1.0, 0.0]),
        setting.elements * spacing,
        rod.width / 2,
        rod.density,
        youngs_modulus=rod.youngs_modulus,
        shear_modulus=rod.shear_modulus,
    )
    shear, stretch = _stiffness(problem, setting)
    for axis, stiffness in enumerate((shear, shear, stretch)):
        made.shear_matrix[axis, axis] = stiffness
    made.mass[:] = _masses(problem, setting)
    return made


def _masses(problem: Problem, setting: Setting) -> np.ndarray:
    """Masses (elements + 1,) kg of the nodes, magnets included."""
    spacing, start = _grid(problem, setting)
    share = np.ones(setting.elements + 1)
    share[[0, -1]] = 0.5
    if setting.care == CORRECTED:  # Gregory's weights; what happens at the clamped end does not matter
        share[-3:] = 23 / 24, 7 / 6, 3 / 8
    mass = problem.scene.rod.mass_per_length * spacing * share
    for magnet in problem.scene.magnets:
        for node, part in _shares(magnet.position, start, spacing, len(mass), setting.care):
            mass[node] += part * magnet.mass
    return mass


def dipoles(problem: Problem, setting: Setting) -> tuple[np.ndarray, ...]:
    """The magnets for `_turn`: two elements each (K, 2), moments (K, 3) A m^2 along the directors (y, z, x), shares."""
    spacing, start = _grid(problem, setting)
    magnets = problem.scene.magnets
    elements, shares = np.zeros((len(magnets), 2), dtype=np.int64), np.zeros((len(magnets), 2))
    for k, magnet in enumerate(magnets):
        found = _shares(magnet.position, start + spacing / 2, spacing, setting.elements, setting.care)
        elements[k], shares[k] = zip(*found)
    moments = np.array([np.roll(magnet.dipole_moment, -1) for magnet in magnets]).reshape(-1, 3)
    return elements, moments, shares, np.clip(shares, 0.0, 1.0)


def _shares(position: float, start: float, spacing: float, count: int, care: str) -> tuple[tuple[int, float], ...]:
    """Weights on two of the points `start` + k `spacing` that interpolate to a position (m); all on one if plain."""
    at = (position - start) / spacing
    left = min(int(at), count - 2)
    right = at - left if care != PLAIN else float(round(min(at - left, 1.0)))
    return (left, 1.0 - right), (left + 1, right)
