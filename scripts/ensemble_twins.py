"""The ensemble filter on twins of the paper's scenes: error, consistency, late frames, a sudden load, cost.

The truth has three times the elements, internal damping and a quadratic drag that the filters lack, and another
modulus. Frames come at 50 Hz with noise of 0.05 mm and show the tip only.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypedDict

import numpy as np
from tqdm import tqdm

from magrod_env import Scene, Simulation, SimulationDiverged, load_scene
from magrod_env.estimation import EnsembleFilter, Measurement, Unknown, UnscentedFilter
from magrod_env.estimation.members import Members, Rest
from scripts.common import run
from scripts.common.command import Options, main
from scripts.common.report import Report
from scripts.common.run import samples
from scripts.common.track import track
from scripts.estimation.twins import FINER, NOISE, brake, loaded, stiffer

if TYPE_CHECKING:
    from typing_extensions import Unpack

FRAME, ELEMENTS = 0.02, 6  # s
CASES = ("circle", "release")
LATE = 4  # frames
Filter = EnsembleFilter | UnscentedFilter


class FilterOptions(TypedDict, total=False):
    """Arguments of a filter."""

    num_members: int
    relaxation: float
    largest_growth: float
    num_modes: int
    parameters: Mapping[str, Unknown | float]
    num_elements: int
    rotary_scaling: float
    precision: str


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
    finer: run.Options = {"num_elements": FINER * ELEMENTS, "num_threads": 1}
    truth, model = Simulation(true, **finer), Simulation(scene, num_elements=ELEMENTS, num_threads=1)
    for simulation in (truth, model):
        simulation.reset(start)
    blind = run.follow(model, samples(count * FRAME, FRAME), commands).seen
    times, fields = samples(count * FRAME, FRAME / 4), np.repeat(commands, 4, axis=0)
    split = 4 * 50 if plain else len(fields)
    seen = run.follow(truth, times[: split + 1], fields[:split], after=None if plain else brake).seen
    if plain and len(fields) > split:
        seen = np.concatenate([seen, run.follow(loaded(truth, **finer), times[split:], fields[split:]).seen[1:]])
    tips = seen[::4]
    return Twin(scene, commands, tips, start, np.linalg.norm(blind - tips, axis=1)[1:])


@dataclass
class Run:
    """What a filter did on a twin: errors of the tip (m), statistics per degree of freedom, seconds."""

    before: np.ndarray
    after: np.ndarray
    statistic: np.ndarray
    seconds: float


Watch = Callable[[], object]


def follow(
    estimator: Filter, twin: Twin, *, seed: int = 1, delay: int = 0, honest: bool = True, around: Watch | None = None
) -> Run:
    """Run a filter over a twin, its frames `delay` frames late and, unless `honest`, taken for fresh.

    `around` is called before and after each update.
    """
    generator, rods = np.random.default_rng(seed), estimator.num_rods
    estimator.reset(twin.start)
    before, after, statistic = list[np.ndarray](), list[np.ndarray](), list[np.ndarray]()

    def frames(k: int) -> list[Measurement]:
        if k == 0:
            return []
        shown = k - delay
        seen = twin.tips[max(shown, 0)] + NOISE * generator.standard_normal((rods, 3))
        if shown <= 0:
            return []
        exposed = shown * FRAME if honest else estimator.time
        return [Measurement(positions=seen[:, None], covariance=NOISE**2 * np.eye(3), time=exposed)]

    def watch(k: int, arrived: Sequence[Measurement] | None) -> None:
        if k == 0:
            return
        error = np.linalg.norm(estimator.tip_position - twin.tips[k], axis=-1)
        (before if arrived is None else after).append(error)
        if arrived:
            statistic.append(estimator.normalised_innovation / 3.0)
        if around is not None:
            around()

    seconds = track(estimator, twin.commands, FRAME, frames, watch)
    return Run(np.array(before), np.array(after), np.array(statistic), seconds)


def build(kind: type[Filter], twin: Twin, rods: int = 1, **options: Unpack[FilterOptions]) -> Filter:
    """A filter of a twin's rods on one thread."""
    chosen: FilterOptions = {"num_elements": ELEMENTS, **options}
    return kind(twin.scene, num_rods=rods, num_threads=1, **chosen)  # type: ignore[misc]


def mm(values: np.ndarray) -> float:
    """Mean, in millimetres."""
    return float(1e3 * np.mean(values))


MODULUS = Unknown(deviation=0.2, memory=50.0)
DRAG: FilterOptions = {
    "parameters": {"modulus": MODULUS, "drag": 0.7, "acceleration": Unknown(deviation=0.1, memory=0.5)}
}
SETTINGS: dict[str, tuple[type[Filter], FilterOptions]] = {
    "ensemble of 64": (EnsembleFilter, {}),
    "of 16": (EnsembleFilter, {"num_members": 16}),
    "of 256": (EnsembleFilter, {"num_members": 256}),
    "of 64, relaxation 0": (EnsembleFilter, {"relaxation": 0.0}),
    "of 64, relaxation 0.3": (EnsembleFilter, {"relaxation": 0.3}),
    "of 64, growth 1": (EnsembleFilter, {"largest_growth": 1.0}),
    "of 64, one mode an axis": (EnsembleFilter, {"num_modes": 2}),
    "of 64, float32": (EnsembleFilter, {"precision": "float32"}),
    "of 64, drag unknown too": (EnsembleFilter, DRAG),
    "of 64, modulus only": (EnsembleFilter, {"parameters": {"modulus": MODULUS}}),
    "unscented": (UnscentedFilter, {}),
}


def accuracy(report: Report, count: int, rods: int) -> None:
    """Errors of the tip with and without a filter, for several settings."""
    with report.table(
        "accuracy",
        "Twins: error of the tip, modulus 20 % below the filter's",
        "scene | filter | before a frame, mm | after it, mm | largest after, mm | NIS/dof | modulus",
        f"{rods} runs of noise each; modulus: estimate over the truth's. Distances in space, in which noise of "
        "0.05 mm an axis is 0.080 mm. NIS/dof: 1 where the filter is as wrong as it thinks.",
    ) as table:
        for case in CASES:
            twin = make_twin(case, 0.8, count)
            table.add(case, "none", mm(twin.blind), None, float(1e3 * twin.blind.max()), None, 1.25)
            for name, (kind, options) in tqdm(SETTINGS.items(), desc=case, leave=False):
                estimator = build(kind, twin, rods, **options)
                run = follow(estimator, twin)
                row = (case, name, mm(run.before), mm(run.after), float(1e3 * run.after.max()))
                modulus = float(estimator.parameters["modulus"].mean() / 0.8)
                table.add(*row, float(run.statistic.mean()), modulus)


def lateness(report: Report, count: int, rods: int) -> None:
    """Frames that come late."""
    with report.table(
        "lateness",
        f"Frames {1e3 * LATE * FRAME:.0f} ms late: error of the present tip",
        "scene | filter | in time, mm | late, mm | late, taken for fresh, mm",
        "From a quarter of the run on; a dash where the filter's rods diverged.",
    ) as table:
        for case in CASES:
            twin = make_twin(case, 0.8, count)
            kinds: dict[str, type[Filter]] = {"ensemble": EnsembleFilter, "unscented": UnscentedFilter}
            for name, kind in kinds.items():
                errors: list[float | None] = []
                for delay, honest in ((0, True), (LATE, True), (LATE, False)):
                    try:
                        run = follow(build(kind, twin, rods), twin, delay=delay, honest=honest)
                        errors.append(mm(run.after[count // 4 :]))
                    except SimulationDiverged:
                        errors.append(None)
                table.add(case, name, *errors)


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


def wire_twin() -> Twin:
    """A NiTi wire without spin drag, its modulus 20 % below the filter's, eight frames long."""
    wire = load_scene("niti_guidewire")
    true = Simulation(stiffer(wire, 0.8), num_elements=ELEMENTS, axial_softening=100.0, rotary_scaling=200.0)
    commands = turning(8) * [1.0, 0.7, 0.7]
    true.reset(commands[0])
    tips = run.follow(true, samples(8 * FRAME, FRAME), commands).seen
    return Twin(wire.replace(spin_drag_rate=0.0), commands, tips, commands[0])


def mixing(report: Report, count: int) -> None:
    """What updates leave in the stiff modes: members mixed node by node, and as the filter does."""
    load = make_twin("load", 1.0, count)
    loud = dataclasses.replace(load, scene=load.scene.replace(spin_drag_rate=0.0))
    trials: dict[str, tuple[Twin, FilterOptions]] = {
        "load": (load, {}),
        "load, growth 1": (load, {"largest_growth": 1.0}),
        "load, no spin drag": (loud, {}),
        "wire": (wire_twin(), {"num_elements": 4, "rotary_scaling": 2.0}),
    }
    with report.table(
        "mixing",
        "Stretch and shear energy of the members, mean, J, and the fastest section, rad/s",
        "twin | members mixed by | first update: before | after | at the end | fastest section | before a frame, mm | "
        "after it, mm",
        "Load: a fifth of the rod's mass is hung to the tip at 1 s; bending energy 6e-5 J. Wire: NiTi, 0.35 mm, "
        "without spin drag; bending energy 2e-6 J. A dash where the filter's rods diverged.",
    ) as table:
        for title, (twin, options) in trials.items():
            for name, kind in (("nodes", PlainMembers), ("slow coordinates", Members)):
                estimator, energies = build(EnsembleFilter, twin, **options), list[float]()
                members = estimator.members
                members.__class__ = kind
                try:
                    done = follow(estimator, twin, around=lambda: energies.append(stiff_energy(members)))  # noqa: B023
                except SimulationDiverged:
                    table.add(title, name, *energies[:2], None, None, None, None)
                    continue
                fastest = float(np.abs(members.simulation.angular_velocities).max())
                table.add(title, name, *energies[:2], energies[-1], fastest, mm(done.before), mm(done.after))


LOADS: dict[str, FilterOptions] = {
    "ensemble": {},
    "growth 1": {"largest_growth": 1.0},
    "modulus only": {"parameters": {"modulus": MODULUS}},
    "modulus only, growth 1": {"parameters": {"modulus": MODULUS}, "largest_growth": 1.0},
    "load 2 m/s^2, memory 2 s": {
        "parameters": {"modulus": MODULUS, "acceleration": Unknown(deviation=2.0, memory=2.0)}
    },
}


def sudden_load(report: Report, count: int, rods: int) -> None:
    """How a load that nothing in the model stands for is followed."""
    first, soon, late = slice(50), slice(50, 75), slice(-50, None)
    twin = make_twin("load", 1.0, count)
    with report.table(
        "load",
        "A fifth of the rod's mass hung to the tip at 1 s, unknown to the filter",
        "filter | 1st s, mm | 0.5 s after: before a frame | after it | NIS/dof | last 1 s: before | after | NIS/dof ",
        "A dash where the filter's rods diverged.",
    ) as table:
        table.add("none", mm(twin.blind[first]), mm(twin.blind[soon]), None, None, mm(twin.blind[late]), None, None)
        for name, options in LOADS.items():
            try:
                run = follow(build(EnsembleFilter, twin, rods, **options), twin)
            except SimulationDiverged:
                table.add(name, *[None] * 7)
                continue
            figures = [mm(run.after[first])]
            for part in (soon, late):
                figures += [mm(run.before[part]), mm(run.after[part]), float(run.statistic[part].mean())]
            table.add(name, *figures)


def cost(report: Report, count: int) -> None:
    """Simulated over wall time on one thread."""
    kinds: list[tuple[type[Filter], FilterOptions]] = [(EnsembleFilter, {"num_members": 64}), (UnscentedFilter, {})]
    with report.table(
        "cost",
        "Speed on one core, one rod at 50 Hz: simulated over wall time",
        "scene | filter | members | elements | precision | real-time factor",
    ) as table:
        for case in CASES:
            twin = make_twin(case, 0.8, count)
            for elements in (4, 6):
                for precision in ("float64", "float32"):
                    for kind, options in kinds:
                        chosen: FilterOptions = {**options, "num_elements": elements, "precision": precision}
                        estimator = build(kind, twin, **chosen)
                        follow(estimator, dataclasses.replace(twin, commands=twin.commands[:3]))
                        best = min(follow(estimator, twin).seconds for _ in range(3))
                        members, factor = estimator.members.shape[1], len(twin.commands) * FRAME / best
                        table.add(case, kind.__name__, members, elements, precision, factor)


def measure(args: Options) -> Report:
    """All tables; from few frames and rods if quick."""
    report = Report("scripts.ensemble_twins", args.quick)
    count, rods = (60, 1) if args.quick else (100, 4)
    accuracy(report, count, rods)
    lateness(report, count, rods)
    sudden_load(report, count + 50, rods)
    mixing(report, count + 50)
    cost(report, count)
    return report


if __name__ == "__main__":
    main(Options, measure, __doc__, strict="never")
