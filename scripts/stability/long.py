"""A hundred million steps: what should be constant, and whether it wanders."""

from __future__ import annotations

import math

import numpy as np
from tqdm import tqdm

from magrod_env import Scene, Simulation, load_scene
from scripts.common.report import Report
from scripts.common.run import follow, samples
from scripts.stability.scenes import first_period

FIELD = (5e-3, 0.0, 0.0)  # T, along the rod
STEPS = {False: 100_000_000, True: 200_000}  # rod steps of one run
SAMPLES = {False: 2000, True: 100}
PIECES = 20
SHARE = 0.5  # of the stability bound
QUANTITIES = ("energy", "axial momentum", "quaternion norm", "orthogonality")

LIMITS = {
    "float64": {"energy": 1e-3, "axial momentum": 1e-11, "quaternion norm": 1e-14, "orthogonality": 1e-14},
    "float32": {"energy": 1e-1, "axial momentum": 1e-2, "quaternion norm": 1e-6, "orthogonality": 1e-6},
}

Series = dict[str, np.ndarray]


def swinging_scene() -> Scene:
    """The paper's rod with a tip magnet, undamped, hanging straight down: the world is turned, gravity is along +x."""
    return load_scene("paper4_pdms_tip_magnet").replace(drag_rate=None, gravity=(9.81, 0.0, 0.0))


def start_swinging(simulation: Simulation) -> None:
    """Swing all rods in space, each harder than the one before, with some twist: across, and a while later aside."""
    period, length = first_period(simulation.scene), simulation.scene.rod.length
    shape = (simulation.num_rods, simulation.num_elements + 1, 3)
    x = simulation.arc_lengths / length
    strength = np.linspace(0.5, 1.0, simulation.num_rods)[:, None]
    simulation.reset()
    for axis in (1, 2):
        velocities, spins = simulation.velocities, simulation.angular_velocities
        velocities[..., axis] += 0.3 * 2.0 * math.pi / period * length * strength * (1.5 * x**2 - 0.5 * x**3)
        spins[..., 0] += 2.0 * math.pi / period * strength * x
        assert velocities.shape == shape
        simulation.set_motion(velocities, spins)
        simulation.advance(0.25 * period, field=FIELD)


def axial_momentum(simulation: Simulation) -> np.ndarray:
    """Angular momentum about the rod's line minus the sections' spin about their own axes, kg m^2/s, (num_rods,).

    Noether's momentum of turning everything about x and every section back about its own axis: p -> R p, O -> R O R^T.
    The clamp (O = 1) stays as it is, sections are round, and gravity and field lie along x. Neither of the two parts
    is constant alone, since the clamp holds the rod.
    """
    return simulation.angular_momentum()[:, 0] - simulation.rods.motion.momenta[:, 1:, 0].sum(axis=1)


def sample(simulation: Simulation) -> np.ndarray:
    """QUANTITIES and the kinetic energy, (5, num_rods); norm and orthogonality as deviations."""
    quaternions, rotations = simulation.rods.motion.quaternions, simulation.rotations
    skew = np.abs(np.swapaxes(rotations, -1, -2) @ rotations - np.eye(3)).max(axis=(1, 2, 3))
    norm = np.abs(np.linalg.norm(quaternions, axis=-1) - 1.0).max(axis=1)
    kinetic = simulation.energies()["kinetic"]
    return np.array([simulation.energy(), axial_momentum(simulation), norm, skew, kinetic], float)


def watch(num_rods: int, precision: str, steps: int, count: int) -> tuple[Series, int]:
    """Errors of the quantities over a run, (count, num_rods) each, and the steps that it took; energy relative to
    the largest kinetic, momentum relative to itself.
    """
    scene = swinging_scene()
    step, each = SHARE * Simulation(scene, num_elements=6).stable_time_step, -(-steps // count)
    simulation = Simulation(
        scene, num_rods=num_rods, num_elements=6, precision=precision, time_step=step, num_threads=1
    )
    start_swinging(simulation)
    times = samples(count * each * step, each * step)
    seen = follow(simulation, times, see=sample).seen
    energy, momentum, norm, skew, kinetic = np.moveaxis(seen[1:], 1, 0)
    start = seen[0]
    errors = (energy - start[0]) / kinetic.max(axis=0), (momentum - start[1]) / np.abs(start[1]), norm, skew
    return dict(zip(QUANTITIES, errors)), each * count


def drift(errors: np.ndarray) -> tuple[float, float]:
    """Slope over the whole run of a straight line through the means of PIECES pieces, and its standard error; of the
    rod (errors are (samples, num_rods)) where the slope is largest.
    """
    pieces = errors[: len(errors) // PIECES * PIECES].reshape(PIECES, -1, errors.shape[1]).mean(axis=1)
    at = (np.arange(PIECES) + 0.5) / PIECES
    fits = [np.polyfit(at, column, 1, cov=True) for column in pieces.T]
    slope, error = max(((fit[0][0], math.sqrt(fit[1][0, 0])) for fit in fits), key=lambda pair: abs(pair[0]))
    return float(slope), float(error)


def verdict(errors: np.ndarray) -> str:
    """Whether the error grows: the drift over the run stands out from its own scatter and from the swing."""
    slope, error = drift(errors)
    return "grows" if abs(slope) > max(4.0 * error, 0.5 * float(np.ptp(errors[: len(errors) // PIECES]))) else "bounded"


def long(report: Report, quick: bool) -> dict[str, Series]:
    """Long runs in both precisions, one rod and many."""
    kept = {}
    with report.table(
        "long",
        f"Long runs: {STEPS[quick]:,} rod steps each, 6 elements, half of the stability bound, undamped swing in space",
        "precision | rods | steps of each | what | largest, first twentieth | largest, last twentieth | "
        "drift over the run | its standard error | drift per step | ",
        "Energy in units of the largest kinetic energy. Axial momentum: what the symmetry about the rod's line "
        "conserves although the clamp takes linear and angular momentum; relative. Norm and orthogonality: largest "
        "of all sections. Drift: straight line through the means of twentieths of the run, worst rod.",
    ) as table:
        runs = [(precision, rods) for precision in LIMITS for rods in ((64,) if quick else (64, 1))]
        for precision, num_rods in tqdm(runs, desc="long runs", leave=False):
            series, steps = watch(num_rods, precision, STEPS[quick] // num_rods, SAMPLES[quick])
            kept[f"{precision}, {num_rods} rod{'s' if num_rods > 1 else ''}"] = series
            for name, errors in series.items():
                piece = len(errors) // PIECES
                first, last = (float(np.abs(some).max()) for some in (errors[:piece], errors[-piece:]))
                slope, error = drift(errors)
                row = (precision, num_rods, steps, name, first, last, slope, error, slope / steps)
                table.add(*row, verdict(errors))
                what = f"{precision}, {num_rods} x {steps:,} steps: {name}"
                report.check("long", what, float(np.abs(errors).max()), LIMITS[precision][name])
    return kept
