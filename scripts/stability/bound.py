"""The largest stable step, found on the kernel by bisection, against what the linearised rod predicts."""

from __future__ import annotations

import math

import numpy as np
from tqdm import tqdm

from magrod_env import Scene, Simulation, load_scene, paper_scene, scene_names
from scripts.common.report import Report
from scripts.common.run import Options, build

NUM_STEPS = 3000  # a step 1e-5 beyond the limit magnifies the highest mode by e^26 in them
GROWTH = 1e4  # stable modes near the limit swell by 1/sqrt(2 x), x the share that is left: 700 at 1e-6
SMALL = 1e-11  # the disturbance's speed over that of sound: its strain, small enough to stay linear where it grows
ELEMENTS, ELEMENT_KINDS = (1, 2, 3, 6, 10, 20, 40), ("helical", "nodal")
CONDITIONING: dict[str, Options] = {
    "as it is": {},
    "EA/8, rho I x 16": {"axial_softening": 8.0, "rotary_scaling": 16.0},
}
PAPER_TABLES = {
    "Table 3": "paper1_aluminium_in_plane",
    "Table 4": "paper2_aluminium_out_of_plane",
    "Table 5": "paper3_pdms_no_magnet",
    "Table 6": "paper4_pdms_tip_magnet",
    "Table 7": "paper6_two_magnets",
}
WEIGHTLESS = (0.0, 0.0, 0.0)
PLAIN, TWO, WIRE = "paper4_pdms_tip_magnet", "paper6_two_magnets", "niti_guidewire"
State = tuple[str, bool, str, tuple[float, float, float], str]
STATES: tuple[State, ...] = (  # scene, whether under gravity, element, field in T, what it is
    ("paper3_pdms_no_magnet", True, "helical", (0.0, 0.0, 0.0), "sagging"),
    (PLAIN, True, "helical", (0.0, 0.0, 0.0), "sagging with a tip magnet"),
    (PLAIN, True, "helical", (0.0, 0.0, -20e-3), "pulled down, 20 mT"),
    (PLAIN, True, "helical", (0.0, 0.0, 45e-3), "pulled up, 45 mT"),
    (PLAIN, True, "helical", (0.0, 30e-3, 30e-3), "aside and up, 42 mT"),
    (PLAIN, True, "helical", (45e-3, 0.0, 0.0), "sagging, 45 mT along the rod"),
    (PLAIN, False, "helical", (1.0, 0.0, 0.0), "straight, 1 T along the rod"),
    (PLAIN, False, "helical", (10.0, 0.0, 0.0), "straight, 10 T along"),
    (PLAIN, True, "nodal", (0.0, 0.0, 0.0), "sagging with a tip magnet"),
    (PLAIN, True, "nodal", (0.0, 0.0, 45e-3), "pulled up, 45 mT"),
    (TWO, True, "helical", (0.0, 0.0, 20e-3), "two magnets, 20 mT"),
    (TWO, True, "helical", (0.0, 30e-3, -20e-3), "two magnets, 36 mT"),
    (WIRE, True, "helical", (0.0, 0.0, 20e-3), "stiff wire, 20 mT"),
    (WIRE, True, "helical", (0.0, 0.0, 0.5), "stiff wire, 0.5 T"),
)
FATES = ("well", "not finite", "bent", "stretched", "too energetic")  # by status


def undamped(scene: Scene, weightless: bool = False) -> Scene:
    """The scene without damping, its gravity a zero vector where it has none: fewer kernels to compile."""
    gravity = WEIGHTLESS if weightless or scene.gravity is None else scene.gravity
    return scene.replace(drag_rate=None, spin_drag_rate=None, internal_damping=None, gravity=gravity)


def disturb(simulation: Simulation) -> float:
    """Give all nodes small random velocities (of strain SMALL); returns the largest, m/s."""
    rng, rod = np.random.default_rng(0), simulation.scene.rod
    speed = SMALL * math.sqrt(rod.youngs_modulus / rod.density)
    shape = (simulation.num_rods, simulation.num_elements + 1, 3)
    velocities, spins = speed * rng.normal(size=shape), speed / rod.length * rng.normal(size=shape)
    simulation.set_motion(velocities, spins)
    return float(np.abs(simulation.velocities).max())


def grows(simulation: Simulation, time_step: float, num_steps: int = NUM_STEPS) -> bool:
    """Whether a small disturbance of the present state grows without end at a step (s); the state is left as it is."""
    snapshot = simulation.state()
    before = disturb(simulation)
    simulation.force_time_step(time_step)
    simulation.advance(num_steps * time_step)
    after = float(np.abs(simulation.velocities).max())
    simulation.set_state(snapshot)
    return not after < GROWTH * before


def limit(simulation: Simulation, guess: float, digits: float = 1e-4) -> float | None:
    """Largest step, s, at which the present state is stable, to a relative `digits`; None outside 0.2 to 5 guesses."""
    low = 0.2 * guess if grows(simulation, 0.97 * guess) else 0.97 * guess
    high = 1.03 * guess if grows(simulation, 1.03 * guess) else 5.0 * guess
    if grows(simulation, low) or not grows(simulation, high):
        return None
    while high > (1.0 + digits) * low:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if grows(simulation, middle) else (middle, high)
    return low


def straight_bounds(report: Report, quick: bool) -> None:
    """Limits of the straight rod without field, every scene."""
    elements, found = (1, 6) if quick else ELEMENTS, []
    cases = [(name, element, words) for name in scene_names() for element in ELEMENT_KINDS for words in CONDITIONING]
    with report.table(
        "straight_bounds",
        "Stable step of the straight rod: found over predicted",
        f"scene | element | stiff modes | predicted, N = 6, s | {' | '.join(f'N = {n}' for n in elements)}",
        "Found by bisection on the kernel to 1e-4. Beyond 1 the prediction is on the safe side.",
    ) as table:
        chosen = [case for case in cases if not quick or case[0] == PLAIN]
        for name, element, words in tqdm(chosen, desc="straight rods", leave=False):
            scene, six = undamped(load_scene(name), weightless=True), None
            ratios: list[float | None] = []
            for n in elements:
                if n < len(scene.segment_ends):
                    ratios.append(None)
                    continue
                options: Options = {"num_elements": n, "element": element, "on_failure": "report"}
                simulation = build(scene, options, **CONDITIONING[words])
                predicted = simulation.stable_time_step
                six = predicted if n == 6 else six
                ratios.append(round((limit(simulation, predicted) or math.nan) / predicted, 4))
            table.add(name, element, words, six, *ratios)
            found += [ratio for ratio in ratios if ratio is not None]
    report.check("bound", f"least found/predicted of {len(found)} rods", min(found), 0.999, at_least=True)
    report.check("bound", f"largest found/predicted of {len(found)} rods", max(found), 1.001)


def state_bounds(report: Report, quick: bool) -> None:
    """Limits of bent and magnetised rods at rest, and where the default step lies."""
    with report.table(
        "state_bounds",
        "Stable step of rods in equilibrium, s",
        "state | element | N | found | found / linearised there | found / bound in this field | found / straight bound"
        " | default step / found",
        "Linearised there: 2 over the highest angular frequency about the equilibrium. Default step: told of the "
        "field. The bound in a field holds for the straight rod and any direction of the field. Stiff wire in 0.5 T: "
        "m B L/EI = 4.5.",
    ) as table:
        for state in tqdm(STATES[1:3] if quick else STATES, desc="states", leave=False):
            for n in (6,) if quick else (4, 6, 16):
                table.add(state[-1], state[2], n, *_state_bound(state, n))
    rows = [row for row in table.rows if row[3] is not None]
    far, largest = max(abs(row[4] - 1.0) for row in rows), max(row[7] for row in rows)
    report.check("bound", "equilibria: largest |found/linearised - 1|", far, 1e-3)
    report.check("bound", "equilibria: largest default step/found", largest, 1.0)
    report.check("bound", "equilibria without a limit", float(len(table.rows) - len(rows)), 0.0)


def _state_bound(state: State, n: int) -> tuple[float | None, ...]:
    """The largest stable step, s, and the ratios of the table; None where there is no limit near the expected one."""
    name, heavy, element, field, _ = state
    strength = float(np.linalg.norm(field))
    options: Options = {"num_elements": n, "element": element, "on_failure": "report", "expected_field": strength}
    simulation = Simulation(undamped(load_scene(name), weightless=not heavy), **options)
    default = simulation.time_step
    simulation.reset(field=field)
    linearised = 1.0 / (math.pi * float(np.nanmax(simulation.natural_frequencies(field))))
    found = limit(simulation, linearised)
    if found is None:
        return (None,) * 5
    inside, straight = simulation.stable_time_step_in(strength), simulation.stable_time_step
    return found, *(round(x, 4) for x in (found / linearised, found / inside, found / straight, default / found))


def first_failure(simulation: Simulation, time_step: float, duration: float) -> tuple[int, int]:
    """Status and number of steps at which a disturbed rod is first reported; (0, all of them) where it never is."""
    simulation.force_time_step(time_step)
    disturb(simulation)
    total = math.ceil(duration / time_step)
    for done in range(256, total + 256, 256):
        simulation.advance(256 * time_step)
        if simulation.status[0]:
            return int(simulation.status[0]), done
    return 0, total


def paper_steps(report: Report, quick: bool) -> None:
    """The time steps that the paper prints, against the limit of its own element at its own number of elements."""
    with report.table(
        "paper_steps",
        "Time steps of the paper and the limit of its own scheme (nodal element, its masses), s",
        "table | N | printed | predicted limit | found limit | printed / found | at the printed step | steps | "
        "found limit, helical",
        "At the printed step: the straight rod under its own gravity, disturbed by a strain of 1e-11, for half a "
        "second or until it is reported (looked at every 256 steps).",
    ) as table:
        for words, name in PAPER_TABLES.items() if not quick else [("Table 7", TWO)]:
            record = paper_scene(name)
            weightless, printed = undamped(record.scene, weightless=True), record.paper_time_step or math.nan
            options: Options = {"num_elements": record.num_elements, "on_failure": "report"}
            simulation = build(weightless, options, element="nodal")
            predicted, helical = simulation.stable_time_step, Simulation(weightless, **options)
            found = limit(simulation, predicted) or math.nan
            loaded = build(undamped(record.scene), options, element="nodal")
            status, steps = first_failure(loaded, printed, 0.5)
            row = (words, record.num_elements, printed, predicted, found, printed / found, FATES[status], steps)
            table.add(*row, limit(helical, helical.stable_time_step))
            beyond = printed > predicted
            what = f"{words}: bound, bisection and run agree that the step is {'beyond' if beyond else 'within'}"
            agrees = float(beyond == (status != 0) == (printed > found))
            report.check("bound", what, agrees, 1.0, at_least=True)


def bound(report: Report, quick: bool) -> None:
    """All tables of this part."""
    straight_bounds(report, quick)
    state_bounds(report, quick)
    paper_steps(report, quick)
