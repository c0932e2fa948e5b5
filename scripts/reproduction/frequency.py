"""Section 5 of the paper: motion at two moduli (Fig. 16), and frequency against the number of elements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from tqdm import tqdm

from magrod_env import Scene, Simulation, load_scene
from magrod_env.scenes import nodal_stiffening
from scripts.common.report import Report
from scripts.common.run import Options, build
from scripts.common.starts import pluck
from scripts.reproduction import runs
from scripts.reproduction.printed import stated
from scripts.reproduction.runs import NODAL, PRINTED, SHAPED, Run

PERIODS = 20  # over which a frequency is counted
SMALL = 1e-3  # of the length: a swing in which the rod is linear
LARGE = 0.1  # of the length: the swing of Fig. 16
SAMPLES = 60  # a period
COUNTS = (2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 40)
QUICK_COUNTS = (4, 10, 20)
RODS = {
    "rod of section 5": load_scene("paper7_frequency_scaling"),
    "PDMS rod with tip magnet": load_scene("paper4_pdms_tip_magnet"),
}
ELEMENTS = (NODAL, SHAPED, PRINTED)


@dataclass
class Frequencies:
    """Frequencies, Hz, of small swings by model and number of elements, and the factor of the closed form."""

    counts: tuple[int, ...]
    found: dict[str, list[float]]
    closed: list[float]

    @property
    def true(self) -> float:
        """That of the finest helical rod."""
        return self.found[PRINTED.name][-1]

    def gammas(self, model: str) -> list[float]:
        """(frequency over the true one) squared: gamma_corr as the paper prints it."""
        return [(value / self.true) ** 2 for value in self.found[model]]


def weightless(scene: Scene) -> Scene:
    """The scene with all terms of the experiments and none of their loads; shares their compiled kernels."""
    return scene.replace(gravity=(0.0, 0.0, 0.0), drag_rate=0.0)


def swing_frequency(simulation: Simulation) -> float:
    """Frequency, Hz, of a small swing, counted over a run."""
    period = 1.0 / float(simulation.natural_frequencies()[0])
    simulation.reset()
    pluck(simulation, (0.0, SMALL * simulation.scene.rod.length))
    run = runs.follow(PRINTED, simulation, (PERIODS + 0.6) * period, period / SAMPLES)
    return stated(runs.frequency(run.times, run.tip[:, 2]))


def count_frequencies(scene: Scene, counts: tuple[int, ...], words: str) -> Frequencies:
    """Frequencies of a rod with more and more elements."""
    found: dict[str, list[float]] = {model.name: [] for model in ELEMENTS}
    for count in tqdm(counts, desc=words, leave=False):
        for model in ELEMENTS:
            options: Options = {"num_elements": count, "element": model.element, "frequency_shaping": model.shaping}
            found[model.name].append(swing_frequency(build(weightless(scene), options, plane="xz")))
    return Frequencies(counts, found, [nodal_stiffening(scene.rod, count) for count in counts])


def frequencies(report: Report, quick: bool) -> dict[str, Frequencies]:
    """Frequency and gamma of every rod, element and number of elements."""
    made = {}
    for key, (words, scene) in zip(("section5", "magnet"), RODS.items()):
        one = made[words] = count_frequencies(scene, QUICK_COUNTS if quick else COUNTS, words)
        gammas = one.gammas(NODAL.name)
        with report.table(
            f"frequency_{key}",
            f"Frequency against the number of elements: {words}",
            f"N | {' | '.join(f'{model.name}, Hz' for model in ELEMENTS)} | gamma as printed, nodal | "
            "1 + GA h²/(4 EI) | their ratio | gamma that corrects: its reciprocal",
            f"Small swings, counted over {PERIODS} periods of a run. gamma as printed: (frequency with N elements "
            "over the true one) squared; true: helical element, the largest N.",
        ) as table:
            for row, (count, gamma, closed) in enumerate(zip(one.counts, gammas, one.closed)):
                values = (one.found[model.name][row] for model in ELEMENTS)
                table.add(count, *values, gamma, closed, gamma / closed, 1.0 / closed)
        far = max(abs(row[6] - 1.0) for row in table.rows if row[0] >= 10)
        report.check("gamma", f"{words}, N >= 10: gamma from the closed one", far, 0.03)
        ten = one.found[PRINTED.name][one.counts.index(10)]
        report.check("frequency", f"{words}, helical, N = 10: from the finest", abs(ten / one.true - 1.0), 1e-3)
    return made


# ---- Fig. 16


@dataclass
class Scaled:
    """The rod of section 5 at its high and its low modulus, and the low one again at the high one's time step."""

    high: Run
    low: Run
    low_fine: Run
    ratio: float


def scaled_motion(quick: bool) -> dict[str, Scaled]:
    """The same large swing at two moduli, by element."""
    made = {}
    scenes = [weightless(load_scene(f"paper7_frequency_scaling{end}")) for end in ("", "_low")]
    ratio = float(np.sqrt(scenes[0].rod.youngs_modulus / scenes[1].rod.youngs_modulus))
    for model in (NODAL, PRINTED):
        duration = 0.4 if quick else 1.0
        found: list[Run] = []
        for scene, scale, finer in ((scenes[0], 1.0, False), (scenes[1], ratio, False), (scenes[1], ratio, True)):
            step = found[0].simulation.time_step if finer else None
            simulation = Simulation(scene, num_elements=10, element=model.element, plane="xz", time_step=step)
            stiffening = nodal_stiffening(scene.rod, 10) if model == NODAL else 1.0
            runs.release(simulation, (0.0, LARGE * scene.rod.length), stiffening)
            found.append(runs.follow(model, simulation, duration * scale, 2.5e-3 * scale))
        high, low, low_fine = found
        made[model.name] = Scaled(high, low, low_fine, ratio)
    return made


def scaling(report: Report, quick: bool) -> dict[str, Scaled]:
    """Fig. 16 as a table."""
    made = scaled_motion(quick)
    with report.table(
        "scaling",
        "Fig. 16: one motion at two moduli",
        "element, N = 10 | f at 5e7 Pa, Hz | f at 5e5 Pa, Hz | ratio | the paper | "
        "largest distance, steps in the ratio, mm | the same step, mm",
        "Distance of the tips at times in the ratio 10. The paper states neither loads nor start: here no "
        f"gravity, released in the first mode at {LARGE:g} of the length.",
    ) as table:
        for name, one in made.items():
            high, low = (runs.frequency(run.times, run.tip[:, 2]) for run in (one.high, one.low))
            off = [1e3 * float(np.linalg.norm(run.tip - one.high.tip, axis=1).max()) for run in (one.low, one.low_fine)]
            table.add(name, high, low, high / low if high and low else None, f"{one.ratio:g} (from the moduli)", *off)
            report.check("Fig. 16", f"{name}: distance of the scaled motions", off[0], 1e-6, "mm")
    return made
