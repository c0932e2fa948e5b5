"""The ensemble filter on twins of the paper's scenes: error, consistency, late frames, a sudden load, cost.

The truth has three times the elements, internal damping and a quadratic drag that the filters lack, and another
modulus. Frames come at 50 Hz with noise of 0.05 mm and show the tip only.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from magrod_env import Scene, Simulation, SimulationDiverged, load_scene
from magrod_env.estimation import EnsembleFilter, Measurement, Unknown, UnscentedFilter
from magrod_env.estimation.members import Members, Rest
from scripts import Report, Table
from scripts.estimation.twins import FINER, NOISE, brake, loaded, stiffer

FRAME, ELEMENTS = 0.02, 6  # s
CASES = ("circle", "release")
LATE = 4  # frames


@dataclass
class Twin:
    """A truth: commands of every frame (count, 3) T, tips at the start and after every frame (count + 1, 3) m."""

    scene: Scene  # as the filters have it
    commands: np.ndarray
    tips: np.ndarray
    start: np.ndarray | None  # field of the equilibrium from which it starts; None: straight
    blind: np.ndarray = field(default_factory=lambda: np.zeros(0))  # error of the model alone, m


def turning(count: int) -> np.ndarray:
    """Field of the circle: against gravity, and turning once a second, (count, 3) T."""
    angle = 2.0 * np.pi * FRAME * np.arange(count)
    return np.stack([0.0 * angle, 14.5e-3 * np.cos(angle), 7.75e-3 + 14.5e-3 * np.sin(angle)], axis=1)


def make_twin(case: str, factor: float, count: int) -> Twin:
    """Truth of "circle" (scene 5 of the paper), "release" (scene 4, from straight, no field) or "load" (the circle,
    with a fifth of the rod's mass hung to the tip after one second; else as the filters have it).
    """
    name = "paper4_pdms_tip_magnet" if case == "release" else "paper5_circle"
    scene = load_scene(name, modulus="effective").replace(drag_rate=1.0)
    commands = np.zeros((count, 3)) if case == "release" else turning(count)
    start = None if case == "release" else commands[0]
    plain = case == "load"
    true = stiffer(scene, factor) if plain else stiffer(scene, factor).replace(internal_damping=2e-3, drag_rate=None)
    truth = Simulation(true, num_elements=FINER * ELEMENTS, num_threads=1)
    model = Simulation(scene, num_elements=ELEMENTS, num_threads=1)
    for simulation in (truth, model):
        simulation.reset(start)
    tips, blind = [truth.tip_position[0]], []
    for k, command in enumerate(commands):
        if plain and k == 50:
            truth = loaded(truth, num_elements=FINER * ELEMENTS, num_threads=1)
        for _ in range(4):
            truth.advance(FRAME / 4, command)
            if not plain:
                brake(truth, FRAME / 4)
        model.advance(FRAME, command)
        tips.append(truth.tip_position[0])
        blind.append(np.linalg.norm(model.tip_position[0] - tips[-1]))
    return Twin(scene, commands, np.array(tips), start, np.array(blind))


@dataclass
class Run:
    """What a filter did on a twin: errors of the tip (m), statistics per degree of freedom, seconds."""

    before: np.ndarray
    after: np.ndarray
    statistic: np.ndarray
    seconds: float
    estimator: Any


def follow(estimator: Any, twin: Twin, *, seed: int = 1, delay: int = 0, honest: bool = True, every: Any = None) -> Run:
    """Run a filter over a twin, its frames `delay` frames late and, unless `honest`, taken for fresh."""
    generator, rods = np.random.default_rng(seed), estimator.num_rods
    estimator.reset(twin.start)
    before, after, statistic, seconds = [], [], [], 0.0
    for k, command in enumerate(twin.commands):
        shown = k + 1 - delay
        seen = twin.tips[max(shown, 0)] + NOISE * generator.standard_normal((rods, 3))
        began = time.perf_counter()
        estimator.predict(command, FRAME)
        seconds += time.perf_counter() - began
        before.append(np.linalg.norm(estimator.tip_position - twin.tips[k + 1], axis=-1))
        if shown > 0:
            exposed = shown * FRAME if honest else estimator.time
            measurement = Measurement(positions=seen[:, None], covariance=NOISE**2 * np.eye(3), time=exposed)
            began = time.perf_counter()
            estimator.update(measurement)
            seconds += time.perf_counter() - began
            statistic.append(estimator.normalised_innovation / 3.0)
        after.append(np.linalg.norm(estimator.tip_position - twin.tips[k + 1], axis=-1))
        if every is not None:
            every(k, estimator)
    return Run(np.array(before), np.array(after), np.array(statistic), seconds, estimator)


def mm(values: Any) -> float:
    """Mean, in millimetres."""
    return float(1e3 * np.mean(values))


def accuracy(report: Report, count: int, rods: int) -> None:
    """Errors of the tip with and without a filter, for several settings."""
    table = Table(
        "Twins: error of the tip, modulus 20 % below the filter's",
        ("scene", "filter", "before a frame, mm", "after it, mm", "largest after, mm", "NIS/dof", "modulus"),
        note=f"{rods} runs of noise each; modulus: estimate over the truth's. Distances in space, in which noise of "
        "0.05 mm an axis is 0.080 mm. NIS/dof: 1 where the filter is as wrong as it thinks.",
    )
    drag = {
        "modulus": Unknown(deviation=0.2, memory=50.0),
        "drag": 0.7,
        "acceleration": Unknown(deviation=0.1, memory=0.5),
    }
    settings: dict[str, tuple[Any, dict[str, Any]]] = {
        "ensemble of 64": (EnsembleFilter, {}),
        "of 16": (EnsembleFilter, {"num_members": 16}),
        "of 256": (EnsembleFilter, {"num_members": 256}),
        "of 64, relaxation 0": (EnsembleFilter, {"relaxation": 0.0}),
        "of 64, relaxation 0.3": (EnsembleFilter, {"relaxation": 0.3}),
        "of 64, growth 1": (EnsembleFilter, {"largest_growth": 1.0}),
        "of 64, one mode an axis": (EnsembleFilter, {"num_modes": 2}),
        "of 64, float32": (EnsembleFilter, {"precision": "float32"}),
        "of 64, drag unknown too": (EnsembleFilter, {"parameters": drag}),
        "of 64, modulus only": (EnsembleFilter, {"parameters": {"modulus": Unknown(deviation=0.2, memory=50.0)}}),
        "unscented": (UnscentedFilter, {}),
    }
    for case in CASES:
        twin = make_twin(case, 0.8, count)
        table.rows.append((case, "none", mm(twin.blind), None, float(1e3 * twin.blind.max()), None, 1.25))
        for name, (kind, options) in tqdm(settings.items(), desc=case, leave=False):
            run = follow(kind(twin.scene, num_rods=rods, num_elements=ELEMENTS, num_threads=1, **options), twin)
            modulus = float(run.estimator.parameters["modulus"].mean() / 0.8)
            figures = (
                mm(run.before),
                mm(run.after),
                float(1e3 * run.after.max()),
                float(run.statistic.mean()),
                modulus,
            )
            table.rows.append((case, name, *figures))
    report.show("accuracy", table)


def lateness(report: Report, count: int, rods: int) -> None:
    """Frames that come late."""
    table = Table(
        f"Frames {1e3 * LATE * FRAME:.0f} ms late: error of the present tip",
        ("scene", "filter", "in time, mm", "late, mm", "late, taken for fresh, mm"),
    )
    for case in CASES:
        twin = make_twin(case, 0.8, count)
        for name, kind in (("ensemble", EnsembleFilter), ("unscented", UnscentedFilter)):
            errors: list[float | None] = []
            for delay, honest in ((0, True), (LATE, True), (LATE, False)):
                estimator = kind(twin.scene, num_rods=rods, num_elements=ELEMENTS, num_threads=1)
                try:
                    run = follow(estimator, twin, delay=delay, honest=honest)
                    errors.append(mm(run.after[count // 4 :]))
                except SimulationDiverged:
                    errors.append(None)
            table.rows.append((case, name, *errors))
    table.note = "From a quarter of the run on; a dash where the filter's rods diverged."
    report.show("lateness", table)


class PlainMembers(Members):
    """Members mixed node by node: positions, rotation vectors, velocities, angular velocities; for comparison."""

    def split(self) -> tuple[np.ndarray, Rest]:
        """Nodal coordinates (num_rods, num_members, 12 N), and nothing left out."""
        simulation = self.simulation
        quaternions = simulation.rods.motion.quaternions[:, 1:]
        size = np.linalg.norm(quaternions[..., 1:], axis=-1, keepdims=True)
        vectors = quaternions[..., 1:] * 2.0 * np.arctan2(size, quaternions[..., :1]) / np.where(size > 0.0, size, 1.0)
        moved = [
            simulation.positions[:, 1:],
            vectors,
            simulation.velocities[:, 1:],
            simulation.angular_velocities[:, 1:],
        ]
        every = np.concatenate(moved, axis=-1)
        return every.reshape(*self.shape, -1), Rest(every[..., :6], every[..., 6:])

    def join(self, values: np.ndarray, rest: Rest) -> None:
        """Put the members where nodal coordinates say."""
        every = np.zeros((len(rest.strains), self.num_elements + 1, 12))
        every[:, 1:] = values.reshape(len(rest.strains), self.num_elements, 12)
        vectors = every[..., 3:6]
        angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
        scaled = vectors * np.sin(0.5 * angle) / np.where(angle > 0.0, angle, 1.0)
        every[:, 1:, 9:] /= self._spin_scale
        self.simulation.rods.motion.write(
            every[..., :3], np.concatenate([np.cos(0.5 * angle), scaled], axis=-1), every[..., 6:9], every[..., 9:]
        )


def stiff_energy(members: Members) -> float:
    """Mean elastic energy of the members in stretch and shear, J, from the strains and the nominal stiffness."""
    rod, lengths, strains = members.simulation.scene.rod, members.lengths, members.strains()[..., 3:6]
    shear = 1.0 / (1.0 / rod.shear_stiffness + lengths**2 / (12.0 * rod.bending_stiffness))
    stretch = rod.axial_stiffness / members.simulation.resolution.axial_softening * (strains[..., 0] - 1.0) ** 2
    return float((0.5 * lengths * (stretch + shear * (strains[..., 1:] ** 2).sum(axis=-1))).sum(axis=-1).mean())


def mixing(report: Report, count: int) -> None:
    """What updates leave in the stiff modes: members mixed node by node, and as the filter does."""
    table = Table(
        "Stretch and shear energy of the members, mean, J, and the fastest section, rad/s",
        (
            "twin",
            "members mixed by",
            "first update: before",
            "after",
            "at the end",
            "fastest section",
            "before a frame, mm",
            "after it, mm",
        ),
        note="Load: a fifth of the rod's mass is hung to the tip at 1 s; bending energy 6e-5 J. Wire: NiTi, 0.35 mm, "
        "without spin drag; bending energy 2e-6 J. A dash where the filter's rods diverged.",
    )
    wire = load_scene("niti_guidewire")
    true = Simulation(stiffer(wire, 0.8), num_elements=ELEMENTS, axial_softening=100.0, rotary_scaling=200.0)
    commands = turning(8) * [1.0, 0.7, 0.7]
    true.reset(commands[0])
    tips = [true.tip_position[0]]
    for command in commands:
        true.advance(FRAME, command)
        tips.append(true.tip_position[0])
    loud = {"spin_drag_rate": 0.0}
    load = make_twin("load", 1.0, count)
    trials: dict[str, tuple[Twin, dict[str, Any]]] = {
        "load": (load, {}),
        "load, growth 1": (load, {"largest_growth": 1.0}),
        "load, no spin drag": (dataclasses.replace(load, scene=load.scene.replace(**loud)), {}),
        "wire": (
            Twin(wire.replace(**loud), commands, np.array(tips), commands[0]),
            {"num_elements": 4, "rotary_scaling": 2.0},
        ),
    }
    for title, (twin, options) in trials.items():
        for name, kind in (("nodes", PlainMembers), ("slow coordinates", Members)):
            estimator = EnsembleFilter(twin.scene, **{"num_elements": ELEMENTS, "num_threads": 1, **options})
            estimator.members.__class__ = kind
            update, energies = estimator.update, []

            def watched(measurement: Any, update: Any = update, energies: Any = energies, e: Any = estimator) -> None:
                energies.append(stiff_energy(e.members))
                update(measurement)
                energies.append(stiff_energy(e.members))

            estimator.update = watched  # type: ignore[method-assign]
            try:
                run = follow(estimator, twin)
            except SimulationDiverged:
                table.rows.append((title, name, *energies[:2], None, None, None, None))
                continue
            fastest = float(np.abs(estimator.members.simulation.angular_velocities).max())
            figures = (energies[-1], fastest, mm(run.before), mm(run.after))
            table.rows.append((title, name, *energies[:2], *figures))
    report.show("mixing", table)


def sudden_load(report: Report, count: int, rods: int) -> None:
    """How a load that nothing in the model stands for is followed."""
    table = Table(
        "A fifth of the rod's mass hung to the tip at 1 s, unknown to the filter",
        (
            "filter",
            "1st s, mm",
            "0.5 s after: before a frame",
            "after it",
            "NIS/dof",
            "last 1 s: before",
            "after",
            "NIS/dof ",
        ),
    )
    twin = make_twin("load", 1.0, count)
    modulus = Unknown(deviation=0.2, memory=50.0)
    table.rows.append(
        ("none", mm(twin.blind[:50]), mm(twin.blind[50:75]), None, None, mm(twin.blind[-50:]), None, None)
    )
    for name, options in {
        "ensemble": {},
        "growth 1": {"largest_growth": 1.0},
        "modulus only": {"parameters": {"modulus": modulus}},
        "modulus only, growth 1": {"parameters": {"modulus": modulus}, "largest_growth": 1.0},
        "load 2 m/s^2, memory 2 s": {
            "parameters": {"modulus": modulus, "acceleration": Unknown(deviation=2.0, memory=2.0)}
        },
    }.items():
        estimator = EnsembleFilter(twin.scene, num_rods=rods, num_elements=ELEMENTS, num_threads=1, **options)
        try:
            run = follow(estimator, twin)
        except SimulationDiverged:
            table.rows.append((name, *[None] * 7))
            continue
        soon, late = slice(50, 75), slice(-50, None)
        figures = [mm(run.after[:50]), mm(run.before[soon]), mm(run.after[soon]), float(run.statistic[soon].mean())]
        figures += [mm(run.before[late]), mm(run.after[late]), float(run.statistic[late].mean())]
        table.rows.append((name, *figures))
    table.note = "A dash where the filter's rods diverged."
    report.show("load", table)


def cost(report: Report, count: int) -> None:
    """Simulated over wall time on one thread."""
    table = Table(
        "Speed on one core, one rod at 50 Hz: simulated over wall time",
        ("scene", "filter", "members", "elements", "precision", "real-time factor"),
    )
    for case in CASES:
        twin = make_twin(case, 0.8, count)
        for elements in (4, 6):
            for precision in ("float64", "float32"):
                for kind, options in ((EnsembleFilter, {"num_members": 64}), (UnscentedFilter, {})):
                    estimator = kind(twin.scene, num_elements=elements, precision=precision, num_threads=1, **options)
                    follow(estimator, dataclasses.replace(twin, commands=twin.commands[:3]))
                    best = min(follow(estimator, twin).seconds for _ in range(3))
                    members = estimator.members.shape[1]
                    row = (case, kind.__name__, members, elements, precision, len(twin.commands) * FRAME / best)
                    table.rows.append(row)
    report.show("cost", table)


def main() -> None:
    """Print the report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few frames and rods, to see that it runs")
    parser.add_argument("--json", type=Path, help="file for the numbers")
    arguments = parser.parse_args()
    report = Report("scripts.ensemble_twins", arguments.quick)
    count, rods = (60, 1) if arguments.quick else (100, 4)
    accuracy(report, count, rods)
    lateness(report, count, rods)
    sudden_load(report, count + 50, min(rods, 4))
    mixing(report, count + 50)
    cost(report, count)
    report.finish(arguments.json)


if __name__ == "__main__":
    main()
