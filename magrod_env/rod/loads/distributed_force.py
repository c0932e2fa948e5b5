"""A uniform force per length, fixed in the world or following the sections, lumped at the nodes like the mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from magrod_env._jit import inline_jit
from magrod_env.rod.access import load_vector
from magrod_env.rod.loads.rows import Vector, checked_flag, checked_load, for_rods, put_vectors
from magrod_env.rod.vectors import add_scaled_vector, add_vectors, scaled_vector, to_world

LINE_FORCE, BODY_LINE_FORCE = 0, 3  # N/m: world, body


@dataclass(frozen=True, kw_only=True, slots=True)
class DistributedForce:
    """The same force on every piece of rod.

    Args:
        force_per_length: N/m of the unstretched rod, (3,).
        follows: False: a vector of the world, with the potential -integral of f.p ds. True: it is in the body frame of
            each section and turns with it, as pressure does; then it has no potential.

    Raises:
        ValueError: if a number is not finite or beyond what a rod bears, or `follows` is no bool.
    """

    force_per_length: Vector
    follows: bool = False

    TERM: ClassVar[str] = "distributed_force"
    ROWS: ClassVar[int] = 6
    FORCES: ClassVar[int] = 6  # first rows, in which the load is linear

    def __post_init__(self) -> None:
        force = checked_load("force_per_length of the DistributedForce", self.force_per_length, "N/m")
        object.__setattr__(self, "force_per_length", force)
        object.__setattr__(self, "follows", checked_flag("follows of the DistributedForce", self.follows))

    @property
    def conservative(self) -> bool:
        """Whether it has a potential."""
        return not self.follows

    def clamp_moment(self, length: float) -> float:
        """Largest moment at the clamp of a rod of a length, m, in N m."""
        return 0.5 * float(np.linalg.norm(self.force_per_length)) * length**2

    def rows(self, plane: str | None, num_rods: int = 1, **values: Any) -> np.ndarray:
        """Rows of ``num_rods`` rods, (num_rods, ROWS); ``values`` replace `force_per_length`, (3,) or one a rod."""
        name = "force_per_length of the DistributedForce"
        force = for_rods(name, values.pop("force_per_length", self.force_per_length), (3,))
        if values:
            raise ValueError(
                f"values of the DistributedForce must be force_per_length only, but got {', '.join(values)}."
            )
        rows = np.zeros((num_rods, self.ROWS))
        put_vectors(rows, BODY_LINE_FORCE if self.follows else LINE_FORCE, name, force, plane)
        return rows


@inline_jit
def add_line_force(block, row, carried, force, lanes, planar):
    """Force on a node that carries the length ``carried``, with the dead one added."""
    return add_scaled_vector(force, carried, load_vector(block, row + LINE_FORCE, lanes, planar), planar)


@inline_jit
def add_following_line_force(block, row, carried, rotation, force, lanes, planar):
    """Force on a node that carries the length ``carried``, with the one that follows its section added."""
    own = scaled_vector(carried, load_vector(block, row + BODY_LINE_FORCE, lanes, planar), planar)
    return add_vectors(force, to_world(rotation, own, planar), planar)


def line_sizes(rows: np.ndarray) -> tuple[float, float]:
    """Dead force and following force per length, N/m, of one rod's rows."""
    dead, following = np.linalg.norm(rows.reshape(2, 3), axis=1)
    return float(dead), float(following)
