"""A force at a point of the rod, fixed in the world or following the section there; a node sits at each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from magrod_env._jit import inline_jit
from magrod_env.rod.access import load_vector
from magrod_env.rod.loads.rows import Vector, checked_flag, checked_length, checked_load, for_rods, put_vectors
from magrod_env.rod.vectors import add_vectors, to_world

POINT_FORCE, BODY_POINT_FORCE = 0, 3  # N: world, body
POINT_ROWS = 6


@dataclass(frozen=True, kw_only=True, slots=True)
class PointLoad:
    """A force at one point of the rod.

    Args:
        position: arc length from the clamp, m. A node is put there, as for a magnet.
        force: N, (3,).
        follows: False: a vector of the world, with the potential -F.p. True: it is in the body frame of the section
            and turns with it; then it has no potential.

    Raises:
        ValueError: if a number is not finite or beyond what a rod bears, the position is not above 0, or `follows` is
            no bool.
    """

    position: float
    force: Vector
    follows: bool = False

    TERM: ClassVar[str] = "point_loads"
    ROWS: ClassVar[int] = POINT_ROWS
    FORCES: ClassVar[int] = POINT_ROWS  # first rows, in which the load is linear

    def __post_init__(self) -> None:
        advice = "give its arc length from the clamp in metres; at the clamp a load cannot act"
        position = checked_length("position of the PointLoad", self.position, advice)
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "force", checked_load("force of the PointLoad", self.force, "N"))
        object.__setattr__(self, "follows", checked_flag("follows of the PointLoad", self.follows))

    @property
    def conservative(self) -> bool:
        """Whether it has a potential."""
        return not self.follows

    def clamp_moment(self, length: float) -> float:
        """Largest moment at the clamp of a rod of a length, m, in N m."""
        return float(np.linalg.norm(self.force)) * self.position

    def rows(self, plane: str | None, num_rods: int = 1, **values: Any) -> np.ndarray:
        """Rows of ``num_rods`` rods, (num_rods, ROWS); ``values`` replace `force`, (3,) or one a rod."""
        force = for_rods("force of the PointLoad", values.pop("force", self.force), (3,))
        if values:
            raise ValueError(f"values of the PointLoad must be force only, but got {', '.join(values)}.")
        rows = np.zeros((num_rods, self.ROWS))
        first = BODY_POINT_FORCE if self.follows else POINT_FORCE
        put_vectors(rows, first, "force of the PointLoad", force, plane)
        return rows


@inline_jit
def add_point_forces(block, row, nodes, node, force, lanes, planar):
    """Force on a node with the dead ones of all point loads there added."""
    for number in range(len(nodes)):
        if nodes[number] == node:
            own = load_vector(block, row + POINT_ROWS * number + POINT_FORCE, lanes, planar)
            force = add_vectors(force, own, planar)
    return force


@inline_jit
def add_following_point_forces(block, row, nodes, node, rotation, force, lanes, planar):
    """Force on a node with those of all point loads there that follow its section added."""
    for number in range(len(nodes)):
        if nodes[number] == node:
            own = load_vector(block, row + POINT_ROWS * number + BODY_POINT_FORCE, lanes, planar)
            force = add_vectors(force, to_world(rotation, own, planar), planar)
    return force


def point_sizes(rows: np.ndarray) -> tuple[float, float]:
    """Dead force and following force, N, of one rod's rows of one load."""
    dead, following = np.linalg.norm(rows.reshape(2, 3), axis=1)
    return float(dead), float(following)
