"""Draw the pictures of the environment pages: `python -m docs.make_figures` from the root of a checkout."""

from __future__ import annotations

from pathlib import Path

import gymnasium
import numpy as np
from PIL import Image

import magrod_env  # noqa: F401  (registers the ids)
from magrod_env.envs import RodAttributes, attributes_of
from magrod_env.envs.core import SteeringCore

FOLDER = Path(__file__).parent / "figures"
STEPS = {"Circle": 95, "Path": 150, "Reach": 60, "TwoMagnet": 150, "PlanarReach": 60}


def reaching_field(core: SteeringCore, limit: float = 25e-3) -> np.ndarray:
    """Field (3,) T whose equilibrium is the target: targets come from a grid of fields (reach_limit = `limit`)."""
    shares = core.episodes.place[0] / (np.array(core.task.targets.table.shape[:2]) - 1)
    field = np.zeros(3)
    for axis, share in zip(core.coils.axes, shares, strict=True):
        field["xyz".index(axis)] = limit * (share if axis == "x" else 2.0 * share - 1.0)
    return field


def path_field(rods: RodAttributes) -> np.ndarray:
    """Field (3,) T that holds the nominal rod at the path's next point."""
    at = rods.phase(steps_ahead=0.5)[0] * len(rods.task.fields)
    return rods.task.fields[round(at) % len(rods.task.fields)]


def draw(name: str, steps: int) -> Image.Image:
    """A frame after `steps` control steps under the nominal rod's static inverse."""
    env = gymnasium.make(f"MagRod/{name}-v0", render_mode="rgb_array")
    env.reset(seed=0)
    rods = attributes_of(env)
    for _ in range(steps):
        field = reaching_field(rods.core) if rods.task.fields is None else path_field(rods)
        env.step(rods.coils.fraction(field).astype(np.float32))
    return Image.fromarray(env.render())


def main() -> None:
    """Write one picture for each environment that looks different."""
    FOLDER.mkdir(exist_ok=True)
    for name, steps in STEPS.items():
        path = FOLDER / f"{name.lower()}.png"
        draw(name, steps).quantize(256).save(path, optimize=True)
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
