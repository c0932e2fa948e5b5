"""Experiments 1 to 6 of the paper: how each is started and driven, and its table beside what the paper prints."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from magrod_env import load_scene
from magrod_env.magnetics import FieldCourse
from magrod_env.scenes import PaperScene, paper_scene
from scripts.common.cases import smoothstep
from scripts.common.report import Report
from scripts.common.starts import FIRST_ROOT
from scripts.reproduction import runs
from scripts.reproduction.printed import implied_ranges, stated
from scripts.reproduction.runs import DAMPED, DRAG, EFFECTIVE, NODAL, PRINTED, SHAPED, Model, Run, span

RISE = 0.5  # s: of the turning field
TURN = 2.0  # s: of the tip around its circle; the paper does not state it
COURSE_STEP = 1e-3  # s, between samples of a field
MILLI = 1e3  # mm in a metre
Rows = list[tuple[str, str, Callable[[Run], float | None]]]


@dataclass(frozen=True)
class Experiment:
    """One experiment: its scene and plane, models, duration in full and quick, and time between samples, s."""

    number: int
    title: str
    name: str
    plane: str | None
    models: tuple[Model, ...]
    durations: tuple[float, float]
    interval: float

    @property
    def record(self) -> PaperScene:
        """What the paper states."""
        return paper_scene(self.name)

    def run(self, model: Model, quick: bool) -> Run:
        """One model from the experiment's start."""
        record, duration = self.record, self.durations[quick]
        field = FIELDS[self.number](record, duration) if self.number in FIELDS else None
        strongest = 0.0 if field is None else float(np.linalg.norm(field.fields, axis=1).max())
        simulation = runs.build(record, model, plane=self.plane, field=strongest)
        stiffening = stated(record.stiffening) if model == NODAL else 1.0
        if self.number in (1, 2):
            runs.release(simulation, start_offset(record), stiffening)
        elif self.number == 4:
            runs.swing_to(simulation, math.radians(stated(record.initial_tip_deflection_deg)))
        elif field is not None:
            simulation.reset(field=field(0.0))
        return runs.follow(model, simulation, duration, self.interval, field)


def start_offset(record: PaperScene) -> tuple[float, float]:
    """Offset (y, z) m of the tip at the start of experiments 1 and 2; an angle is taken as the chord's."""
    if record.initial_tip_offset is not None:
        return record.initial_tip_offset
    return 0.0, record.scene.rod.length * math.sin(math.radians(stated(record.initial_tip_deflection_deg)))


def circling_field(record: PaperScene, duration: float) -> FieldCourse:
    """B_g upwards, and B_u turning about the rod after a smooth rise."""
    times = np.arange(0.0, duration + COURSE_STEP, COURSE_STEP)
    size = stated(record.rotating_field) * np.array([smoothstep(at / RISE) for at in times])
    angle = 2.0 * np.pi * times / TURN
    across = np.stack([0.0 * times, size * np.cos(angle), size * np.sin(angle)], axis=1)
    return FieldCourse(times=times, fields=across + (0.0, 0.0, stated(record.gravity_compensation_field)))


def turning_down_field(record: PaperScene, duration: float) -> FieldCourse:
    """From 20 mT upwards to 19.85 mT downwards, turning smoothly past the rod's direction: a path of our own."""
    share = np.arange(0.0, 1.0 + 1e-9, COURSE_STEP / duration)
    first, last = stated(record.initial_field), stated(record.final_field)
    size = first + (last - first) * share
    angle = np.pi * (0.5 - share**2 * (3.0 - 2.0 * share))
    fields = np.stack([size * np.cos(angle), 0.0 * share, size * np.sin(angle)], axis=1)
    return FieldCourse(times=duration * share, fields=fields)


FIELDS = {5: circling_field, 6: turning_down_field}

POLYMER = (NODAL, SHAPED, PRINTED, EFFECTIVE, DAMPED)
METAL = (NODAL, SHAPED, PRINTED)
_PDMS = load_scene("paper4_pdms_tip_magnet").rod.youngs_modulus
_LOCKED = _PDMS * stated(paper_scene("paper6_two_magnets").stiffening)
TENTH = Model(f"nodal, {1e-3 * _PDMS:.0f} kPa", "nodal", _PDMS)  # a tenth of what Table 7 holds
TENTH_EFFECTIVE = Model(f"helical, {1e-6 * _LOCKED:.2f} MPa", "helical", _LOCKED)
CIRCLING = tuple(model.damped() for model in (NODAL, SHAPED, PRINTED, EFFECTIVE))
TURNING = tuple(model.damped() for model in (*METAL, TENTH, TENTH_EFFECTIVE))
EXPERIMENTS = (
    Experiment(1, "aluminium rod, in a plane", "paper1_aluminium_in_plane", "xz", METAL, (1.5, 0.06), 1e-4),
    Experiment(2, "aluminium rod, out of a plane", "paper2_aluminium_out_of_plane", None, METAL, (1.5, 0.01), 1e-4),
    Experiment(
        3, "PDMS rod without magnet, released straight", "paper3_pdms_no_magnet", "xz", POLYMER, (1.5, 1.5), 2e-3
    ),
    Experiment(4, "PDMS rod with tip magnet, released bent", "paper4_pdms_tip_magnet", "xz", POLYMER, (2.0, 2.0), 2e-3),
    Experiment(5, "tip magnet on a circle", "paper5_circle", None, CIRCLING, (4.0, 2.5), 1e-2),
    Experiment(6, "two magnets in a plane", "paper6_two_magnets", "xz", TURNING, (7.5, 7.5), 1e-2),
)


# ---- what is compared


def range_of(axis: int, point: int = 0) -> Callable[[Run], float]:
    """Range of a coordinate of a point, mm."""
    return lambda run: span(run.points[:, point, axis])


def first(axis: int) -> Callable[[Run], float]:
    """A coordinate of the tip at the start, mm."""
    return lambda run: MILLI * float(run.tip[0, axis])


def last(axis: int) -> Callable[[Run], float]:
    """A coordinate of the tip at the end, mm."""
    return lambda run: MILLI * float(run.tip[-1, axis])


def frequency_along(axis: int) -> Callable[[Run], float | None]:
    """Frequency of a coordinate of the tip, Hz."""
    return lambda run: runs.frequency(run.times, run.tip[:, axis])


def starting_chord(run: Run) -> float:
    """Angle of the line from the clamp to the tip at the start, degrees."""
    return math.degrees(math.atan2(run.tip[0, 2], run.tip[0, 0]))


def rest(run: Run) -> float:
    """Height of the tip at rest under gravity, m."""
    return float(run.simulation.equilibrium().tip_position[2])


def decay(run: Run) -> float | None:
    """Rate, 1/s, at which the height's turning points approach the rest position; None for an undamped rod."""
    return runs.decay_rate(run.times, run.tip[:, 2], rest(run)) if run.model.drag else None


def metal_rows(experiment: Experiment) -> Rows:
    """Experiments 1 and 2: start, range and frequency of each moving coordinate."""
    record, rows = experiment.record, []
    reported = next(iter(implied_ranges(record.name).values()))
    words = {1: f"{record.initial_tip_deflection_deg} degrees", 2: "section 4.1"}[experiment.number]
    for axis, offset in zip((1, 2), start_offset(record)):
        if offset:
            letter = "xyz"[axis]
            rows += [
                (f"{letter} of the tip at the start, mm", f"{MILLI * offset:.1f} ({words})", first(axis)),
                (f"{letter}: range, mm", f"{MILLI * reported:.1f} (Table 8)", range_of(axis)),
                (f"{letter}: frequency, Hz", "not printed", frequency_along(axis)),
            ]
    return rows


def polymer_rows(experiment: Experiment) -> Rows:
    """Experiments 3 and 4: ranges, lowest and rest position, frequency, decay."""
    record = experiment.record
    along, across = {3: ("E3", "E2"), 4: ("E2", "E3")}[experiment.number]
    implied = {key[1]: f"{MILLI * value:.1f} (Table 8, {key[1]})" for key, value in implied_ranges(record.name).items()}
    angle = record.initial_tip_deflection_deg or 0.0
    return [
        ("chord at the start, degrees", f"{angle:g} (section 4.2)", starting_chord),
        ("z of the tip at the start, mm", "not printed", first(2)),
        ("z (across): range, mm", implied[across], range_of(2)),
        ("x (along): range, mm", implied[along], range_of(0)),
        ("z: lowest, mm", "not printed", lambda run: MILLI * float(run.tip[:, 2].min())),
        ("z: highest, mm", "not printed", lambda run: MILLI * float(run.tip[:, 2].max())),
        ("z at rest, mm", "not printed", lambda run: MILLI * rest(run)),
        ("z: frequency, Hz", "not printed", frequency_along(2)),
        ("z: decay, 1/s", "not printed", decay),
    ]


def last_turn(run: Run) -> np.ndarray:
    """Tip (K, 3) m over the last turn of the field."""
    return run.tip[run.times >= run.times[-1] - TURN - 1e-9]


def circle_radii(run: Run) -> np.ndarray:
    """Distance of the tip from the centre of its last turn, seen along the rod, m."""
    across = last_turn(run)[:, 1:]
    return np.linalg.norm(across - 0.5 * (across.max(axis=0) + across.min(axis=0)), axis=1)


def circle_rows(experiment: Experiment) -> Rows:
    """Experiment 5: the circle."""
    whole = implied_ranges(experiment.name)["tip", "distance"]
    return [
        ("radius, mean, mm", "not printed", lambda run: MILLI * float(circle_radii(run).mean())),
        ("radius, least, mm", "not printed", lambda run: MILLI * float(circle_radii(run).min())),
        ("radius, largest, mm", "not printed", lambda run: MILLI * float(circle_radii(run).max())),
        (
            "circumference, mm",
            f"{MILLI * whole:.1f} (Table 8; of what is not said)",
            lambda run: MILLI * 2.0 * math.pi * float(circle_radii(run).mean()),
        ),
        (
            "height of its centre, mm",
            "not printed",
            lambda run: MILLI * 0.5 * float(last_turn(run)[:, 2].max() + last_turn(run)[:, 2].min()),
        ),
        ("x: range, mm", "not printed", lambda run: span(last_turn(run)[:, 0])),
        ("z at the start, B_g alone, mm", "not printed", first(2)),
    ]


def magnets_rows(experiment: Experiment) -> Rows:
    """Experiment 6: ranges of both magnets."""
    implied = implied_ranges(experiment.name)
    rows: Rows = []
    for point, words in enumerate(("tip", "middle")):
        either = ", ".join(f"{MILLI * implied[words, axis]:.1f} ({axis})" for axis in ("E2", "E3"))
        for axis, letter in ((2, "z"), (0, "x")):
            rows.append((f"{words}: {letter}, range, mm", either, range_of(axis, point)))
    for axis in (2, 0):
        letter = "xyz"[axis]
        rows.append((f"tip: {letter} at the end, mm", "not printed", last(axis)))
    return rows


ROWS = {1: metal_rows, 2: metal_rows, 3: polymer_rows, 4: polymer_rows, 5: circle_rows, 6: magnets_rows}


def note(experiment: Experiment) -> str:
    """What else to know about a table."""
    record = experiment.record
    if experiment.number in (1, 2):
        rod = record.scene.rod
        pace = FIRST_ROOT**2 * math.sqrt(rod.bending_stiffness / rod.mass_per_length) / rod.length**2
        return (
            f"First frequency of the slender cantilever in closed form: {pace / (2.0 * math.pi):.2f} Hz. Starts "
            "at rest, bent in the first mode. Range by Table 8: the largest error over its share of the displacement."
        )
    return {
        3: f"Undamped, but for the last: drag {DRAG:g} /s, ours. A small swing decays at half of the drag.",
        4: f"Undamped, but for the last: drag {DRAG:g} /s, ours. Starts at the turning point of a swing about the sag "
        "where the chord, from clamp to tip, has the printed angle.",
        5: f"Drag {DRAG:g} /s. Field: B_g upwards, B_u rising over {RISE:g} s and turning once in {TURN:g} s; the "
        "last turn counts.",
        6: f"Drag {DRAG:g} /s. Field: from upwards past the rod's direction to downwards, ours. The last two: the PDMS "
        "of section 4.2, a tenth of the modulus in Table 7, with the locked element and as a rod that bends alike.",
    }[experiment.number]


def show(report: Report, experiment: Experiment, made: list[Run]) -> None:
    """The experiment's table."""
    title = f"Experiment {experiment.number}: {experiment.title}"
    columns = f" | the paper | {' | '.join(run.model.name for run in made)}"
    with report.table(f"experiment_{experiment.number}", title, columns, note(experiment)) as table:
        for words, printed, measure in ROWS[experiment.number](experiment):
            table.add(words, printed, *(measure(run) for run in made))


def show_readings(report: Report) -> None:
    """Experiment 4 with its printed angle read in both ways."""
    experiment = EXPERIMENTS[3]
    record, (full, _) = experiment.record, experiment.durations
    ranges = implied_ranges(record.name)
    with report.table(
        "experiment_4_angle",
        "Experiment 4: whose angle is printed?",
        "angle of | model | z of the tip at the start, mm | z (across): range, mm | x (along): range, mm",
    ) as table:
        table.add("(Table 8)", "the paper", None, MILLI * ranges["tip", "E3"], MILLI * ranges["tip", "E2"])
        for words, measure in (("the chord", runs.chord_angle), ("the tip's tangent", runs.tangent_angle)):
            for model in (EFFECTIVE, DAMPED):
                simulation = runs.build(record, model, plane=experiment.plane)
                runs.swing_to(simulation, math.radians(stated(record.initial_tip_deflection_deg)), measure)
                run = runs.follow(model, simulation, full, experiment.interval)
                table.add(words, model.name, first(2)(run), range_of(2)(run), range_of(0)(run))


def show_steps(report: Report, made: dict[int, list[Run]]) -> None:
    """Which time step every run took, beside the paper's and the bound."""
    with report.table(
        "steps",
        "Elements, time steps and run times",
        "experiment | model | N | paper's step, s | bound, s | paper's step / bound | taken, s | simulated, s | "
        "run time, s",
        "Bound: of the straight rod without field. The nodal element takes the paper's step, or 0.9 of the bound "
        "(in the experiment's field) where it is beyond that; the helical element its default.",
    ) as table:
        for number, some in made.items():
            step = stated(EXPERIMENTS[number - 1].record.paper_time_step)
            for run in some:
                bound, taken = run.simulation.stable_time_step, run.simulation.time_step
                row = (number, run.model.name, run.simulation.num_elements, step, bound, step / bound, taken)
                table.add(*row, float(run.times[-1]), run.wall)
