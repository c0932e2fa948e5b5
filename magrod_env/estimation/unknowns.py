"""What a filter does not know of a rod besides its motion: how uncertain it is and how long it stays what it is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from magrod_env import _checks
from magrod_env.rod.batch import PLANE_AXES
from magrod_env.scene import Scene

FACTORS = ("modulus", "drag", "moment")
VECTORS = ("misalignment", "acceleration")
FARTHEST = 5.0  # deviations, from the scene's value, that a factor may reach
PIECE = 0.5  # of the shortest memory: a longer prediction is made in pieces, with new noise for each


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """A parameter that is Gaussian about the scene's value, and forgets.

    It is an Ornstein-Uhlenbeck process: after a time t a share exp(-t/memory) of its deviation is left, and new noise
    makes up for the rest, so that without measurements its uncertainty tends to `deviation` and never beyond.

    Args:
        deviation: standard deviation: of the logarithm of a factor, rad, or m/s^2.
        memory: correlation time, s; infinite (default) for a constant. A constant that may jump wants 10 to 100 s: it
            then drifts by deviation * sqrt(2 t/memory) in a short time t.

    Raises:
        ValueError: if a number is negative or not finite (the memory may be infinite, and is above 0).
    """

    deviation: float
    memory: float = math.inf

    def __post_init__(self) -> None:
        deviation = _checks.number(
            "deviation", self.deviation, at_least=0.0, advice="0.2 is 20 % for a factor, angles are in rad"
        )
        memory = (
            math.inf
            if self.memory == math.inf
            else _checks.number("memory", self.memory, above=0.0, advice="give seconds, or math.inf for a constant")
        )
        object.__setattr__(self, "deviation", deviation)
        object.__setattr__(self, "memory", memory)


DEFAULTS: dict[str, Unknown] = {
    "modulus": Unknown(deviation=0.2, memory=50.0),
    "acceleration": Unknown(deviation=0.5, memory=2.0),
}
"""What is not known unless said otherwise."""


class Unknowns:
    """The columns of a parameter vector: their names, deviations and memories.

    Args:
        scene: of the rod.
        chosen: name to `Unknown`, or to a deviation of a constant: "modulus", "drag" and "moment" (logarithms of
            factors on the scene's values; a gain of the field acts as the moment does), "misalignment" (rotation vector
            of the field against the world, rad), "acceleration" (of an unmodelled load per mass, m/s^2, world).
        plane: as in `Simulation`.

    Raises:
        ValueError: on an unknown name, or one that the scene has nothing to vary for.
    """

    def __init__(self, scene: Scene, chosen: Mapping[str, Unknown | float], plane: str | None) -> None:
        self.names: list[str] = []
        self.columns: dict[str, np.ndarray] = {}
        deviations: list[float] = []
        memories: list[float] = []
        axes = PLANE_AXES[plane]
        across = tuple(axis for axis in range(3) if plane is None or axis not in axes)
        for name, value in chosen.items():
            unknown = value if isinstance(value, Unknown) else Unknown(deviation=value)
            _check_name(scene, name)
            used = {"misalignment": across, "acceleration": axes}.get(name, (0,))
            self.columns[name] = np.arange(len(self.names), len(self.names) + len(used))
            self.names += [f"{name}_{'xyz'[axis]}" for axis in used] if name in VECTORS else [name]
            deviations += [unknown.deviation] * len(used)
            memories += [unknown.memory] * len(used)
        self.axes = {"misalignment": np.array(across), "acceleration": np.array(axes)}
        self.deviations, self.memories = np.array(deviations), np.array(memories)

    def __len__(self) -> int:
        return len(self.names)

    def pieces(self, duration: float) -> int:
        """Into how many pieces a prediction over `duration` (s) is cut."""
        shortest = self.memories.min(initial=math.inf)
        return 1 if math.isinf(shortest) else max(1, math.ceil(duration / (PIECE * shortest) - 1e-9))

    def kept(self, duration: float) -> np.ndarray:
        """Share of each column's deviation that is left after `duration` (s)."""
        return np.exp(-duration / self.memories)

    def noise(self, duration: float) -> np.ndarray:
        """Standard deviation of what each column gains in `duration` (s)."""
        return self.deviations * np.sqrt(-np.expm1(-2.0 * duration / self.memories))

    def bounded(self, values: np.ndarray) -> np.ndarray:
        """Parameters (..., P) whose factors are no farther from the scene's value than `FARTHEST` deviations.

        A factor on a drag that hardly matters, or on one that is no linear drag, would else run away in growing spreads
        until its exponential overflows. Angles and accelerations have no bound: sudden loads go far beyond.
        """
        factors = self._factors
        values, far = values.copy(), FARTHEST * self.deviations[factors]
        values[..., factors] = np.clip(values[..., factors], -far, far)
        return values

    def pinned(self, values: np.ndarray) -> np.ndarray:
        """Whether a factor of parameters (..., P) is at its bound, to 1 %; (...)."""
        factors = self._factors
        return (np.abs(values[..., factors]) > 0.99 * FARTHEST * self.deviations[factors]).any(axis=-1)

    @property
    def _factors(self) -> list[int]:
        """Columns of the factors."""
        return [self.columns[name][0] for name in FACTORS if name in self.columns]

    def factor(self, name: str, values: np.ndarray) -> np.ndarray | float:
        """Factor on the scene's value from parameters (..., P); 1 where `name` is known."""
        return np.exp(values[..., self.columns[name][0]]) if name in self.columns else 1.0

    def vector(self, name: str, values: np.ndarray) -> np.ndarray:
        """World vector (..., 3) from parameters (..., P); 0 where `name` is known."""
        full = np.zeros((*values.shape[:-1], 3))
        if name in self.columns:
            full[..., self.axes[name]] = values[..., self.columns[name]]
        return full

    def told(self, means: np.ndarray, deviations: np.ndarray) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Estimates and standard deviations by name from (num_rods, P) each; factors as factors."""
        values, spreads = {}, {}
        for column, name in enumerate(self.names):
            mean, spread = means[:, column], deviations[:, column]
            values[name] = np.exp(mean) if name in FACTORS else mean.copy()
            spreads[name] = values[name] * spread if name in FACTORS else spread.copy()
        return values, spreads


def _check_name(scene: Scene, name: str) -> None:
    if name not in (*FACTORS, *VECTORS):
        raise ValueError(
            f"parameters must be among {', '.join(map(repr, (*FACTORS, *VECTORS)))}, but got {name!r}: choose of them."
        )
    if (name in ("moment", "misalignment") and not scene.magnets) or (name == "drag" and not scene.drag_rate):
        raise ValueError(
            f"parameters must be what the scene has, but got {name!r} on a scene without "
            f"{'drag_rate' if name == 'drag' else 'magnets'}: leave it out, or add it to the scene."
        )
