"""From an environment's state to what the renderer draws."""

from __future__ import annotations

import numpy as np

from magrod_env.envs.core import SteeringCore
from magrod_env.envs.observing import Outcome
from magrod_env.rod.layout import PLANAR, SPATIAL

TRACE = 100  # positions of the tip that a frame shows


class Painter:
    """Draws the environments of a core; needs the extra ``viz``."""

    def __init__(self, core: SteeringCore) -> None:
        from magrod_env.rendering import Picture, Renderer  # only who renders needs Pillow

        self.core = core
        scene, magnets = core.scene, core.scene.magnets
        self._renderer = Renderer(
            Picture(
                length=scene.rod.length,
                radius=0.5 * scene.rod.width,
                section=scene.rod.shape,
                magnet_nodes=core.batch.layout.magnet_nodes if magnets else (),
                magnet_lengths=tuple(magnet.length or scene.rod.width for magnet in magnets),
                magnet_radii=tuple(0.5 * (magnet.diameter or 0.5 * scene.rod.width) for magnet in magnets),
                magnet_directions=tuple(magnet.direction for magnet in magnets),
                field_limit=float(np.max(core.coils.limit)),
                gravity=scene.gravity if scene.gravity is not None and any(scene.gravity) else None,
                plane="spatial" if core.plane is None else core.plane,  # type: ignore[arg-type]  # one of a few names
            )
        )
        self._trace: list[np.ndarray] = []

    def begin(self) -> None:
        """Forget the trace of the last episode."""
        self._trace = []

    def follow(self, out: Outcome) -> None:
        """Add the tip to the trace, unless the rod is lost."""
        if self.core.batch.status[0] == 0:
            self._trace = [*self._trace[-TRACE + 1 :], out.positions[0, 0].copy()]

    def paint(self, i: int, out: Outcome) -> np.ndarray:
        """Frame of environment ``i``."""
        nodes, rotations = self._pose(i)
        path = self.core.task.path
        return self._renderer.draw(
            nodes=nodes,
            rotations=rotations,
            field=out.fields[i],
            target=out.goals[i],
            path=None if path is None else np.concatenate([path[:, 0], path[:1, 0]]),
            trace=np.array(self._trace) if len(self._trace) > 1 else None,
            time=float(self.core.episodes.steps[i]) * self.core.control_time,
            tip_error=float(out.errors[i, 0]),
        )

    def _pose(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """Node positions (num_nodes, 3) m and rotation matrices (num_nodes, 3, 3)."""
        batch = self.core.batch
        size, count = batch.node_rows.size, batch.layout.num_elements + 1
        rows = batch.rows[i // batch.width, batch.layout.nodes : batch.layout.nodes + size * count, i % batch.width]
        rows = rows.reshape(count, size).astype(float)
        if batch.plane is None:
            w, x, y, z = rows[:, SPATIAL.rotation : SPATIAL.rotation + 4].T
            positions = rows[:, :3]
        else:
            w, turn = rows[:, PLANAR.rotation : PLANAR.rotation + 2].T
            zero = np.zeros_like(w)
            x, y, z = (zero, zero, turn) if batch.plane == "xy" else (zero, -turn, zero)
            positions = np.zeros((count, 3))
            positions[:, list(batch.axes)] = rows[:, :2]
        matrices = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        return positions, np.moveaxis(np.array(matrices), -1, 0)
