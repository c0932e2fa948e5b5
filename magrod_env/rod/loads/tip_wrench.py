"""Force and moment on the tip's section, fixed in the world or following the section.

A dead force has the potential -F.p. A moment has none in space, whether its axis is fixed in the world or in the
section, and neither has a force that follows: they are not conservative, and the tangent of statics is not symmetric.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from magrod_env._jit import inline_jit
from magrod_env.rod.access import load_torque, load_vector
from magrod_env.rod.loads.rows import Vector, checked_flag, checked_load, for_rods, put_moments, put_vectors
from magrod_env.rod.vectors import add_torques, add_vectors, to_world, torque_to_body

FORCE, MOMENT, BODY_FORCE, BODY_MOMENT = 0, 3, 6, 9  # N and N m, world, then body


@dataclass(frozen=True, kw_only=True, slots=True)
class TipWrench:
    """A force and a moment on the tip's section.

    Args:
        force: N, (3,).
        moment: N m, (3,).
        follows: False: both are vectors of the world and stay. True: both are in the body frame of the tip's section
            (first axis along its normal, the tangent of an unsheared rod) and turn with it.

    Raises:
        ValueError: if a number is not finite or beyond what a rod bears, or `follows` is no bool.
    """

    force: Vector = (0.0, 0.0, 0.0)
    moment: Vector = (0.0, 0.0, 0.0)
    follows: bool = False

    TERM: ClassVar[str] = "tip_wrench"
    ROWS: ClassVar[int] = 12
    FORCES: ClassVar[int] = 12  # first rows, in which the load is linear

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", checked_load("force of the TipWrench", self.force, "N"))
        object.__setattr__(self, "moment", checked_load("moment of the TipWrench", self.moment, "N m"))
        object.__setattr__(self, "follows", checked_flag("follows of the TipWrench", self.follows))

    @property
    def conservative(self) -> bool:
        """Whether it has a potential."""
        return not self.follows and not any(self.moment)

    def clamp_moment(self, length: float) -> float:
        """Largest moment at the clamp of a rod of a length, m, in N m."""
        return float(np.linalg.norm(self.force)) * length + float(np.linalg.norm(self.moment))

    def rows(self, plane: str | None, num_rods: int = 1, **values: Any) -> np.ndarray:
        """Rows of ``num_rods`` rods, (num_rods, ROWS); ``values`` replace `force` and `moment`, (3,) or one a rod."""
        force = for_rods("force of the TipWrench", values.pop("force", self.force), (3,))
        moment = for_rods("moment of the TipWrench", values.pop("moment", self.moment), (3,))
        if values:
            raise ValueError(f"values of the TipWrench must be force or moment, but got {', '.join(values)}.")
        if self.conservative and moment.any():
            raise ValueError(
                f"moment of the TipWrench must be zero where the scene's has none, but got {moment.tolist()!r}: give "
                "the scene's TipWrench a moment, so that its kernels are compiled for one."
            )
        rows = np.zeros((num_rods, self.ROWS))
        put_vectors(rows, BODY_FORCE if self.follows else FORCE, "force of the TipWrench", force, plane)
        put_moments(rows, BODY_MOMENT if self.follows else MOMENT, "moment of the TipWrench", moment, plane)
        return rows


@inline_jit
def tip_force(block, row, lanes, planar):
    """Dead force on the tip, world."""
    return load_vector(block, row + FORCE, lanes, planar)


@inline_jit
def add_tip_circulation(block, row, following, rotation, force, torque, lanes, planar):
    """Force (world) and torque (body) on the tip with what has no potential added."""
    moment = load_torque(block, row + MOMENT, lanes, planar)
    torque = add_torques(torque, torque_to_body(rotation, moment, planar), planar)
    if following is not None:
        own = load_vector(block, row + BODY_FORCE, lanes, planar)
        force = add_vectors(force, to_world(rotation, own, planar), planar)
        torque = add_torques(torque, load_torque(block, row + BODY_MOMENT, lanes, planar), planar)
    return force, torque


def tip_sizes(rows: np.ndarray) -> tuple[float, float, float]:
    """Dead force and following force, N, and moment, N m, of one rod's rows."""
    dead, moment, following, own = np.linalg.norm(rows.reshape(4, 3), axis=1)
    return float(dead), float(following), float(moment + own)
