"""How exact the cameras are: `python -m scripts.cameras [--quick] [--json FILE]`.

Errors of measured markers in mm, as the covariance says and as many measurements show, for several places and set-ups;
what bent rods hide of themselves; what a frame costs. Exit status 1 where the covariance is not what is measured.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from magrod_env import Simulation, load_scene
from magrod_env.estimation import CameraStream, GaussianCameras, PinholeCamera, StereoCameras
from magrod_env.estimation.cameras import Cameras, default_cameras
from scripts.common.command import Options, main
from scripts.common.report import Report
from scripts.common.run import least_time

PLACES = {  # mm
    "middle of the straight rod": (30.0, 0.0, 0.0),
    "tip of the straight rod": (60.0, 0.0, 0.0),
    "tip bent up": (35.0, 0.0, 45.0),
    "tip bent to the camera at the side": (35.0, -45.0, 0.0),
    "tip bent away from it": (35.0, 45.0, 0.0),
    "clamp": (0.0, 0.0, 0.0),
}
AROUND = 2.0  # mm: the truth lies this far about the tip, some 25 pixels, so that rounding errors are spread
ERRORS = "x, said | y, said | z, said | x, measured | y, measured | z, measured | normalised"
STRONGEST = 45e-3  # T: the limit of the coils


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
    worst = 0.0
    with report.table(
        "places",
        "Default cameras: error of a marker, mm",
        f"marker | {ERRORS}",
        f"{count:,} measurements each. Normalised: mean of e^T P^-1 e over 3, one if the covariance P is right.",
    ) as table:
        for name, place in PLACES.items():
            said, came, squares = errors(StereoCameras(), np.tile(1e-3 * np.array(place), (count, 1)))
            table.add(name, *map(float, said), *map(float, came), squares)
            worst = max(worst, 100.0 * float(np.abs(came / said - 1.0).max()))
            if name.startswith("tip of"):
                spread = float(np.sqrt((said**2).mean()))
                report.check("default error", "RMS over the axes, straight tip", spread, 0.05, "mm")
    report.check("covariance", "largest deviation of a measured error", worst, 4.0, "%")


def set_ups() -> dict[str, Cameras]:
    """Cameras to compare at the tip."""
    side, above = default_cameras()
    shifted, turned = side.moved(shift=(0.0, 0.0, 2e-4)), side.moved(turn=(5e-4, 0.0, 0.0))
    front = PinholeCamera.looking_at(
        (0.03, 0.0, 0.0), position=(0.31, -0.2, 0.2), focal_length=side.focal_length, image_size=side.image_size
    )
    return {
        "default: 0.3 pixels": StereoCameras(),
        "0.3 pixels, rounded to whole ones": StereoCameras(quantisation=1.0),
        "no noise, rounded to whole pixels": StereoCameras(noise=None, quantisation=1.0),
        "0.1 pixels": StereoCameras(noise=0.1),
        "0.3 pixels, a third camera in front": StereoCameras(cameras=(side, above, front)),
        "default, side camera believed 0.2 mm too high": StereoCameras(calibration=(shifted, above)),
        "default, side camera believed 0.5 mrad too high": StereoCameras(calibration=(turned, above)),
        "Gaussian, 0.05 mm": GaussianCameras(),
    }


def show_set_ups(report: Report, count: int) -> None:
    """Errors of several set-ups about the tip of the straight rod."""
    spread = np.random.default_rng(1).uniform(-AROUND, AROUND, (count, 3))
    points = 1e-3 * (np.array(PLACES["tip of the straight rod"]) + spread)
    title = "Other cameras: error of a marker at the tip of the straight rod, mm"
    note = "The covariance knows nothing of a wrong calibration."
    with report.table("set_ups", title, f"cameras | {ERRORS}", note) as table:
        for name, cameras in set_ups().items():
            said, came, squares = errors(cameras, points)
            table.add(name, *map(float, said), *map(float, came), squares)


def show_hidden(report: Report, num_rods: int) -> None:
    """Share of bent rods that hide their own markers."""
    scene = load_scene("paper5_circle", modulus="effective").replace(drag_rate=20.0)
    simulation, nodes = Simulation(scene, num_rods=num_rods, num_elements=6), (2, 4, 6)
    rng = np.random.default_rng(0)
    angles, strengths = rng.uniform(0.0, 2.0 * np.pi, num_rods), rng.uniform(0.0, STRONGEST, num_rods)
    across = np.stack([0.0 * angles, np.cos(angles), np.sin(angles)], axis=-1)
    simulation.advance(1.0, field=strengths[:, None] * across)
    rods = simulation.positions
    cameras = StereoCameras(noise=None, rod_radius=0.5 * scene.rod.width)
    seen = np.isfinite(cameras.photograph(rods[:, nodes], rng, rods)[..., 0])  # (cameras, rods, markers)
    furthest = 1e3 * np.hypot(rods[:, -1, 1], rods[:, -1, 2]).max()
    with report.table(
        "hidden",
        "Default cameras: share of bent rods that do not hide their own marker, %",
        "marker | from the side | from above | from both",
        f"{num_rods} rods of the paper's circle after 1 s in a constant field across x, any direction, up to "
        f"{1e3 * STRONGEST:g} mT; their tips are up to {furthest:.0f} mm from the x axis.",
    ) as table:
        for k, node in enumerate(nodes):
            place = f"at {1e3 * simulation.arc_lengths[node]:.1f} mm of {1e3 * scene.rod.length:.1f} mm"
            shares = [*seen[..., k].mean(axis=1), seen[..., k].all(axis=0).mean()]
            table.add(place, *(100.0 * float(share) for share in shares))


def next_frame(stream: CameraStream, points: np.ndarray) -> None:
    """Take the frame that is due, and what arrives."""
    stream.observe(stream.next_exposure, points)


def show_times(report: Report, batches: tuple[int, ...]) -> None:
    """What a frame costs."""
    with report.table(
        "times", "Time of a frame, one marker a rod, one core", "rods | stereo, ms | Gaussian, ms"
    ) as table:
        for num_rods in batches:
            points = np.array([0.05, 0.01, 0.01]) + 1e-3 * np.random.default_rng(0).standard_normal((num_rods, 1, 3))
            streams = [CameraStream(cameras) for cameras in (StereoCameras(), GaussianCameras())]
            table.add(num_rods, *(1e3 * least_time(partial(next_frame, stream, points)) for stream in streams))


def measure(args: Options) -> Report:
    """All tables, from fewer measurements if quick."""
    report = Report("scripts.cameras", args.quick)
    count = 4000 if args.quick else 100_000
    show_places(report, count)
    show_set_ups(report, count)
    show_hidden(report, 16 if args.quick else 2048)
    show_times(report, (1,) if args.quick else (1, 256, 4096))
    return report


if __name__ == "__main__":
    main(Options, measure, __doc__)
