"""A high-order element beside the low-order ones of the package: the reference solver at coarse settings.

One spectral element of growing degree, `scripts.reference`, in time by DOP853 at a tolerance that the error in space
outweighs. Its loads are compiled, its time loop is SciPy's: the share of a run that is not in the loads is what a
compiled loop could save at most. It is as far from the reference as its degree lets it be; below 5e-6 mm the reference
itself is in doubt.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from scripts.precision.trials import Trial

NAME, WHOLE, LOADS = "spectral", "one element", "one element, its loads alone"
DEGREES = (4, 6, 8, 10)
TOLERANCE = 1e-5
SCENES = ("free_decay", "rotating_field")


@dataclass(frozen=True)
class SpectralRun:
    """Tip (SAMPLES, 3) m; wall time of a simulated second, s, in all and in the compiled loads alone."""

    resolution: str
    tip: np.ndarray
    wall: float
    wall_of_loads: float


def runs(trial: Trial, quick: bool) -> Iterator[SpectralRun]:
    """The solver at growing degree."""
    from scripts.reference import case_of  # SciPy
    from scripts.reference.spectral_rod import Mesh

    class Counting(Mesh):
        """A mesh that counts its calls."""

        calls = 0

        def rate(self, t: float, y: np.ndarray) -> np.ndarray:
            self.calls += 1
            return super().rate(t, y)

    for degree in DEGREES[:1] if quick else DEGREES:
        mesh = Counting(case_of(trial.scene, trial.field), degree)
        mesh.rate(0.0, mesh.start)  # compiles
        mesh.calls, start = 0, time.perf_counter()
        states = mesh.run(trial.times, TOLERANCE)
        wall, calls, start = time.perf_counter() - start, mesh.calls, time.perf_counter()
        for _ in range(1000):
            Mesh.rate(mesh, trial.duration, states[-1])
        loads = 1e-3 * calls * (time.perf_counter() - start)
        tip = np.array([mesh.split(state)[0][-1] for state in states])
        yield SpectralRun(f"degree {degree}", tip, wall / trial.duration, min(loads, wall) / trial.duration)
