"""How exact the cameras are: `python -m scripts.cameras [--quick] [--json FILE]`.

Errors of measured markers in mm, as the covariance says and as many measurements show, for several places and set-ups;
what bent rods hide of themselves; what a frame costs. Exit status 1 where the covariance is not what is measured.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import tyro

from magrod_env import Simulation, load_scene
from magrod_env.estimation import CameraStream, GaussianCameras, PinholeCamera, StereoCameras
from magrod_env.estimation.cameras import Cameras, default_cameras
from scripts import Check, Report, Table, least_time

PLACES = {  # mm
    "middle of the straight rod": (30.0, 0.0, 0.0),
    "tip of the straight rod": (60.0, 0.0, 0.0),
    "tip bent up": (35.0, 0.0, 45.0),
    "tip bent to the camera at the side": (35.0, -45.0, 0.0),
    "tip bent away from it": (35.0, 45.0, 0.0),
    "clamp": (0.0, 0.0, 0.0),
}
AROUND = 2.0  # mm: the truth lies this far about the tip, some 25 pixels, so that rounding errors are spread
AXES = ("x", "y", "z")
STRONGEST = 45e-3  # T: the limit of the coils


@dataclass
class Args:
    """What to measure."""

    quick: bool = False
    """fewer measurements, in seconds"""
    json: Path | None = None
    """where to write the numbers as JSON"""


def errors(cameras: Cameras, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Standard deviations that the covariance says and RMS errors that came, mm, (3,) each, and the mean of e^T P^-1 e
    over its expectation 3, for one marker at each of `points` (K, 3), m.
    """
    measured, covariance = cameras.measure(points[:, None], np.random.default_rng(0))
    error, covariance = (measured[:, 0] - points), covariance[:, 0]
    said = np.sqrt(np.mean(np.diagonal(covariance, axis1=-2, axis2=-1), axis=0))
    squares = np.einsum("ki,kij,kj->k", error, np.linalg.inv(covariance), error)
    return 1e3 * said, 1e3 * np.sqrt(np.mean(error**2, axis=0)), float(squares.mean() / 3.0)


def show_places(report: Report, count: int) -> None:
    """Errors of the default set-up over the workspace."""
    columns = ("marker", *(f"{axis}, said" for axis in AXES), *(f"{axis}, measured" for axis in AXES), "normalised")
    table, worst = Table("Default cameras: error of a marker, mm", columns), 0.0
    for name, place in PLACES.items():
        said, came, squares = errors(StereoCameras(), np.tile(1e-3 * np.array(place), (count, 1)))
        table.rows.append((name, *map(float, said), *map(float, came), squares))
        worst = max(worst, 100.0 * float(np.abs(came / said - 1.0).max()))
        if name.startswith("tip of"):
            report.checks.append(
                Check("default error", "RMS over the axes, straight tip", float(np.sqrt((said**2).mean())), 0.05, "mm")
            )
    table.note = (
        f"{count:,} measurements each. Normalised: mean of e^T P^-1 e over 3, one if the covariance P is right."
    )
    report.show("places", table)
    report.checks.append(Check("covariance", "largest deviation of a measured error", worst, 4.0, "%"))


def set_ups() -> dict[str, Cameras]:
    """Cameras to compare at the tip."""
    side, above = default_cameras()
    lens = dict(focal_length=side.focal_length, image_size=side.image_size)
    front = PinholeCamera.looking_at((0.03, 0.0, 0.0), position=(0.31, -0.2, 0.2), **lens)
    return {
        "default: 0.3 pixels": StereoCameras(),
        "0.3 pixels, rounded to whole ones": StereoCameras(quantisation=1.0),
        "no noise, rounded to whole pixels": StereoCameras(noise=None, quantisation=1.0),
        "0.1 pixels": StereoCameras(noise=0.1),
        "0.3 pixels, a third camera in front": StereoCameras(cameras=(side, above, front)),
        "default, side camera believed 0.2 mm too high": StereoCameras(
            calibration=(side.moved(shift=(0.0, 0.0, 2e-4)), above)
        ),
        "default, side camera believed 0.5 mrad too high": StereoCameras(
            calibration=(side.moved(turn=(5e-4, 0.0, 0.0)), above)
        ),
        "Gaussian, 0.05 mm": GaussianCameras(),
    }


def show_set_ups(report: Report, count: int) -> None:
    """Errors of several set-ups about the tip of the straight rod."""
    spread = np.random.default_rng(1).uniform(-AROUND, AROUND, (count, 3))
    points = 1e-3 * (np.array(PLACES["tip of the straight rod"]) + spread)
    columns = ("cameras", *(f"{axis}, said" for axis in AXES), *(f"{axis}, measured" for axis in AXES), "normalised")
    table = Table("Other cameras: error of a marker at the tip of the straight rod, mm", columns)
    for name, cameras in set_ups().items():
        said, came, squares = errors(cameras, points)
        table.rows.append((name, *map(float, said), *map(float, came), squares))
    table.note = "The covariance knows nothing of a wrong calibration."
    report.show("set_ups", table)


def show_hidden(report: Report, num_rods: int) -> None:
    """Share of bent rods that hide their own markers."""
    scene = load_scene("paper5_circle", modulus="effective").replace(drag_rate=20.0)
    simulation, nodes = Simulation(scene, num_rods=num_rods, num_elements=6), (2, 4, 6)
    rng = np.random.default_rng(0)
    angles, strengths = rng.uniform(0.0, 2.0 * np.pi, num_rods), rng.uniform(0.0, STRONGEST, num_rods)
    simulation.advance(
        1.0, field=strengths[:, None] * np.stack([0.0 * angles, np.cos(angles), np.sin(angles)], axis=-1)
    )
    rods = simulation.positions
    cameras = StereoCameras(noise=None, rod_radius=0.5 * scene.rod.width)
    seen = np.isfinite(cameras.photograph(rods[:, nodes], rng, rods)[..., 0])  # (cameras, rods, markers)
    columns = ("marker", "from the side", "from above", "from both")
    table = Table("Default cameras: share of bent rods that do not hide their own marker, %", columns)
    for k, node in enumerate(nodes):
        place = f"at {1e3 * simulation.arc_lengths[node]:.1f} mm of {1e3 * scene.rod.length:.1f} mm"
        shares = [*seen[..., k].mean(axis=1), seen[..., k].all(axis=0).mean()]
        table.rows.append((place, *(100.0 * float(share) for share in shares)))
    furthest = 1e3 * np.hypot(rods[:, -1, 1], rods[:, -1, 2]).max()
    table.note = (
        f"{num_rods} rods of the paper's circle after 1 s in a constant field across x, any direction, up to "
        f"{1e3 * STRONGEST:g} mT; their tips are up to {furthest:.0f} mm from the x axis."
    )
    report.show("hidden", table)


def next_frame(stream: CameraStream, points: np.ndarray) -> None:
    """Take the frame that is due, and what arrives."""
    stream.observe(stream.next_exposure, points)


def show_times(report: Report, batches: tuple[int, ...]) -> None:
    """What a frame costs."""
    table = Table("Time of a frame, one marker a rod, one core", ("rods", "stereo, ms", "Gaussian, ms"))
    for num_rods in batches:
        points = np.array([0.05, 0.01, 0.01]) + 1e-3 * np.random.default_rng(0).standard_normal((num_rods, 1, 3))
        times = []
        for cameras in (StereoCameras(), GaussianCameras()):
            times.append(1e3 * least_time(partial(next_frame, CameraStream(cameras), points)))
        table.rows.append((num_rods, *times))
    report.show("times", table)


def main(args: Args) -> bool:
    """All tables; whether the checks were met."""
    report = Report("scripts.cameras", args.quick)
    count = 4000 if args.quick else 100_000
    show_places(report, count)
    show_set_ups(report, count)
    show_hidden(report, 16 if args.quick else 2048)
    show_times(report, (1,) if args.quick else (1, 256, 4096))
    return report.finish(args.json)


if __name__ == "__main__":
    sys.exit(0 if main(tyro.cli(Args)) else 1)
