"""A hundred million steps: what should be constant, and whether it wanders."""

from __future__ import annotations

import math

import numpy as np
from tqdm import tqdm

from magrod_env import Scene, Simulation, load_scene
from scripts import Check, Report, Table
from scripts.stability.drawing import first_period

FIELD = (5e-3, 0.0, 0.0)  # T, along the rod
STEPS = {False: 100_000_000, True: 200_000}  # rod steps of one run
SAMPLES = {False: 2000, True: 100}
PIECES = 20
SHARE = 0.5  # of the stability bound
QUANTITIES = ("energy", "axial momentum", "quaternion norm", "orthogonality")

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


def sample(simulation: Simulation) -> dict[str, np.ndarray]:
    """The quantities, (num_rods,) each; norm and orthogonality as deviations."""
    quaternions, rotations = simulation.rods.motion.quaternions, simulation.rotations
    skew = np.swapaxes(rotations, -1, -2) @ rotations - np.eye(3)
    return {
        "energy": simulation.energy(),
        "axial momentum": axial_momentum(simulation),
        "quaternion norm": np.abs(np.linalg.norm(quaternions, axis=-1) - 1.0).max(axis=1),
        "orthogonality": np.abs(skew).max(axis=(1, 2, 3)),
    }


def watch(num_rods: int, precision: str, steps: int, samples: int) -> tuple[Series, int]:
    """Errors of the quantities over a run, (samples, num_rods) each, and the steps that it took; energy relative to
    the largest kinetic, momentum relative to itself.
    """
    scene = swinging_scene()
    options = dict(num_rods=num_rods, num_elements=6, precision=precision, num_threads=1)
    step = SHARE * Simulation(scene, num_elements=6).stable_time_step
    simulation = Simulation(scene, time_step=step, **options)
    start_swinging(simulation)
    start, seen, kinetic = sample(simulation), [], np.zeros(num_rods)
    each = -(-steps // samples)
    for _ in tqdm(range(samples), desc=f"{num_rods} rods, {precision}", leave=False):
        simulation.advance(each * step)
        seen.append(sample(simulation))
        kinetic = np.maximum(kinetic, simulation.energies()["kinetic"])
    scales = {"energy": kinetic, "axial momentum": np.abs(start["axial momentum"])}
    series = {}
    for name in QUANTITIES:
        found = np.array([one[name] for one in seen])
        series[name] = (found - start[name]) / scales[name] if name in scales else found
    return series, each * samples


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
    table = Table(
        f"Long runs: {STEPS[quick]:,} rod steps each, 6 elements, half of the stability bound, undamped swing in space",
        (
            "precision",
            "rods",
            "steps of each",
            "what",
            "largest, first twentieth",
            "largest, last twentieth",
            "drift over the run",
            "its standard error",
            "drift per step",
            "",
        ),
        note="Energy in units of the largest kinetic energy. Axial momentum: what the symmetry about the rod's line "
        "conserves although the clamp takes linear and angular momentum; relative. Norm and orthogonality: largest "
        "of all sections. Drift: straight line through the means of twentieths of the run, worst rod.",
    )
    kept = {}
    for precision in ("float64", "float32"):
        for num_rods in (64,) if quick else (64, 1):
            series, steps = watch(num_rods, precision, STEPS[quick] // num_rods, SAMPLES[quick])
            kept[f"{precision}, {num_rods} rod{'s' if num_rods > 1 else ''}"] = series
            for name in QUANTITIES:
                errors = series[name]
                piece = len(errors) // PIECES
                first, last = (float(np.abs(some).max()) for some in (errors[:piece], errors[-piece:]))
                slope, error = drift(errors)
                words = verdict(errors)
                row = (precision, num_rods, steps, name, first, last, slope, error, slope / steps, words)
                table.rows.append(row)
                limits = LIMITS[precision][name]
                what = f"{precision}, {num_rods} x {steps:,} steps: {name}"
                report.checks.append(Check("long", what, float(np.abs(errors).max()), limits, ""))
    report.show("long", table)
    return kept


LIMITS = {
    "float64": {"energy": 1e-3, "axial momentum": 1e-11, "quaternion norm": 1e-14, "orthogonality": 1e-14},
    "float32": {"energy": 1e-1, "axial momentum": 1e-2, "quaternion norm": 1e-6, "orthogonality": 1e-6},
}
