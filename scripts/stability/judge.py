"""Runs of one trial and what they say about it: correct, coarse (warned of or not), reported, sensitive, or wrong."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from magrod_env import Simulation, StabilityError
from magrod_env.rod.energy import ENERGETIC, NOT_FINITE
from magrod_env.rod.implicit import UNSOLVED
from magrod_env.simulation.errors import SYMPTOMS
from magrod_env.simulation.integrators import SHARES
from scripts.common.run import Options, whole_steps
from scripts.common.run import build as simulate
from scripts.stability.scenes import Trial, first_period, own_time

TOLERANCE = 0.05  # of the tip's largest distance from the straight rod's, RMS over the run
LEAST_EXCURSION = {"float64": 1e-9, "float32": 1e-4}  # lengths of the rod: below, rounding is all there is
DISTURBANCE = 1e-4  # of the loads, relative and in direction (rad)
ENERGY_MADE = 0.1  # of the largest kinetic and elastic energy: what a stable run's ripple may pretend to make
HALVED = ("asked", "half", "quarter", "eighth", "sixteenth", "thirty-second", "sixty-fourth")  # steps
SECOND_ORDER = 2.0  # least ratio of the errors of a step and its half, judged by the next half: 5 in theory
FAR = {2: 20.0, 4: 80.0}  # by order: largest ratio of the errors of a step and its half, of 4.2 and 17 in theory
LEAST_STEPS = {"explicit": 64, "implicit": 24, "implicit4": 24}  # of the run that is judged
INTERVALS = 120  # of constant field at most, where it does not change suddenly more often
STEPS_AN_INTERVAL = {"explicit": 8, "implicit": 2, "implicit4": 1}  # at least, but between sudden changes
NANOSECONDS = {None: 170.0, "xz": 60.0}  # of an explicit step and element, to plan with
NANOSECONDS_IMPLICIT = 2500.0  # of a midpoint step and element
LARGER_BUDGET = 5.0  # times the budget, where an explicit run judges an implicit one or one with internal damping
DAMPED_STEP = 0.125  # of the explicit step of a run that judges: errors of internal damping fall slowly with the step
FINER_IMPLICIT = 0.25  # of the step: of the implicit run that judges where an explicit one takes too long
COARSE = {True: "coarse, warned", False: "coarse, silent"}
ENDINGS = ("correct", COARSE[True], "reported", "sensitive", COARSE[False], "wrong and silent")


@dataclass
class Run:
    """What one simulation did.

    Args:
        tips: (samples, 3) m; fewer than asked for where it was stopped.
        status: of the simulation; 0 where all was well.
        refusal: message of a ValueError or StabilityError; "" where there was none.
        energy_made: largest rise, J, of the energy beyond what the field put in, over any stretch of the run.
        inner: largest kinetic and elastic energy, J.
        time_step: s.
        warned: whether the simulation said that its elements may be too few.
        complete: whether it got to the end with finite numbers.
    """

    tips: np.ndarray
    status: int = 0
    refusal: str = ""
    energy_made: float = 0.0
    inner: float = 0.0
    time_step: float = math.nan
    warned: bool = False
    complete: bool = False

    @property
    def well(self) -> bool:
        """Whether nothing was reported."""
        return self.status == 0 and not self.refusal

    @property
    def symptom(self) -> str:
        """What was reported, in short."""
        if self.refusal:
            return self.refusal
        return "" if self.status == 0 else SYMPTOMS[self.status].split(":")[0]


@dataclass(frozen=True)
class Plan:
    """Common times of all runs of a trial: `edges`, s, between which the field is constant, increasing from 0,
    (intervals + 1,).
    """

    edges: np.ndarray

    @property
    def duration(self) -> float:
        """s"""
        return float(self.edges[-1])


def build(
    trial: Trial, num_elements: int, precision: str | None = None, default: bool = False, integrator: str | None = None
) -> Simulation:
    """The simulation of a trial with this many elements; `default`: with the default step, told of the field."""
    kind = trial.kind
    options: Options = {
        "num_elements": num_elements,
        "element": kind.element,
        "plane": kind.plane,
        "precision": precision or kind.precision,
        "integrator": integrator or kind.integrator,
        "axial_softening": trial.axial_softening,
        "rotary_scaling": trial.rotary_scaling,
        "on_failure": "report",
        "num_threads": 1,
    }
    if default or trial.told:
        options["expected_field"] = trial.field
    simulation = Simulation(trial.scene, **options)
    if trial.share is None or default:
        return simulation
    explicit = simulation.integrator == "explicit"
    whole = simulation.stable_time_step_in(trial.field) if explicit else simulation.time_step
    return simulate(trial.scene, options, time_step=trial.share * whole)


def finer_elements(num_elements: int) -> int:
    """Elements of the run that judges another: twice as many, at least 6; half as many more where they are many."""
    return max(6, 2 * num_elements) if num_elements <= 12 else math.ceil(1.5 * num_elements)


def affordable(simulation: Simulation, seconds: float) -> float:
    """Time, s, that a simulation does in about so many seconds."""
    explicit = simulation.integrator == "explicit"
    midpoint = NANOSECONDS_IMPLICIT * len(SHARES[simulation.integrator])
    cost = NANOSECONDS[simulation.plane] if explicit else midpoint
    return 1e9 * seconds / (cost * simulation.num_elements) * simulation.time_step


def finer(trial: Trial, coarse: Simulation, budget: float) -> tuple[Simulation, float]:
    """The run that judges another, and how long (s) it lets both be: a few periods, or what it can do in about
    `budget` seconds, but LEAST_STEPS.

    An explicit run judges an implicit one where it can follow for an own time of the scene; else an implicit one does.
    """
    elements, own = finer_elements(trial.num_elements), own_time(trial.scene, trial.field)
    judge = build(trial, elements, "float64", default=True, integrator="explicit")
    least, duration = LEAST_STEPS[coarse.integrator] * coarse.time_step, trial.periods * own
    if coarse.integrator == "explicit":
        judge.time_step = min(judge.time_step, 0.5 * coarse.time_step)
    if trial.kind.damping:
        judge.time_step = DAMPED_STEP * judge.time_step
    if coarse.integrator == "explicit":
        seconds = LARGER_BUDGET * budget if trial.kind.damping else budget
        return judge, min(duration, max(affordable(judge, seconds), least))
    duration = max(duration, least)
    reach = affordable(judge, LARGER_BUDGET * budget)
    if reach >= min(duration, max(own, least)):
        return judge, min(duration, reach)
    judge = build(trial, elements, default=True)
    judge.time_step = FINER_IMPLICIT * min(judge.time_step, coarse.time_step)
    return judge, min(duration, max(affordable(judge, budget), least))


def plan(trial: Trial, coarse: Simulation, duration: float) -> Plan:
    """Intervals of constant field: equal ones, or parts of those between sudden changes."""
    shortest = STEPS_AN_INTERVAL[coarse.integrator] * coarse.time_step
    count = max(1, min(INTERVALS, int(duration / shortest)))
    changes = np.append(trial.changes[trial.changes < duration * (1.0 - 1e-9)], duration)
    if not len(trial.changes):
        return Plan(np.linspace(0.0, duration, count + 1))
    parts = [max(1, int(count * hold / duration)) for hold in np.diff(changes)]
    inner = [np.linspace(a, b, n, endpoint=False) for (a, b), n in zip(pairwise(changes), parts)]
    return Plan(np.append(np.concatenate(inner), duration))


def disturbed(trial: Trial) -> Trial:
    """The same trial with all loads a little stronger and turned."""

    def moved(vector):
        aside = np.cross(vector, (0.0, 1.0, 0.0) if trial.kind.plane else (0.36, 0.48, 0.8))
        return np.asarray(vector) + DISTURBANCE * (np.asarray(vector) + aside)

    scene = trial.scene
    if scene.gravity is not None:
        scene = scene.replace(gravity=tuple(moved(scene.gravity)))
    return dataclasses.replace(trial, scene=scene, first=moved(trial.first), second=moved(trial.second))


def follow(
    trial: Trial, simulation: Simulation, plan: Plan, to_the_end: bool = True, step: float | None = None, parts: int = 1
) -> Run:
    """Run a simulation over a plan, its field constant in every interval.

    The field does work only where it changes: what the energy gains in between, the integrator has made. `to_the_end`
    goes on after a report that an element is stretched or bent too far for the model, as long as numbers are finite:
    one run may touch that limit and another just not. `step`: s, None for the simulation's own; each of the steps that
    it would take is cut into `parts`.
    """
    lengths = np.diff(plan.edges)
    fields = trial.fields(plan.edges[:-1] + 0.5 * lengths, plan.duration, first_period(trial.scene))
    run = Run(np.empty((0, 3)), time_step=simulation.time_step if step is None else step / parts)
    gained, least, tips = 0.0, 0.0, []
    try:
        simulation.reset(field=np.zeros(3) if trial.hanging else None)
        tips.append(simulation.tip_position[0])
        for field, length in zip(fields, lengths):
            if step is not None:  # whatever it is, beyond the bound too
                simulation.force_time_step(length / (parts * whole_steps(length, step)))
            simulation.advance(0.0, field=field)
            before = float(simulation.energy()[0])
            simulation.advance(length)
            energies = simulation.energies()
            tips.append(simulation.tip_position[0])
            run.status = int(simulation.status[0])
            if run.status in (NOT_FINITE, ENERGETIC, UNSOLVED) or (run.status and not to_the_end):
                break
            gained += sum(float(part[0]) for part in energies.values()) - before
            least = min(least, gained)
            run.energy_made = max(run.energy_made, gained - least)
            run.inner = max(run.inner, float(energies["kinetic"][0] + energies["elastic"][0]))
    except (ValueError, StabilityError) as error:
        run.refusal = "no stable equilibrium to start from" if isinstance(error, StabilityError) else refused(error)
    run.warned = simulation.coarse
    run.tips = np.array(tips).reshape(-1, 3)
    run.complete = len(run.tips) == len(plan.edges) and bool(np.isfinite(run.tips).all())
    return run


def refused(error: ValueError) -> str:
    """A refusal in short: what it is about."""
    words = str(error)
    return "step beyond the bound in this field" if "in a field of" in words else words.split(",")[0]


def distance(one: Run, other: Run, length: float, precision: str) -> float:
    """RMS distance of the tips over the largest distance of `other` from the straight rod's, `length` (m) from the
    clamp; infinite where one did not get to the end.
    """
    return prefix_distance(one, other, length, precision) if one.complete and other.complete else math.inf


def prefix_distance(one: Run, other: Run, length: float, precision: str) -> float:
    """The same over the samples before either was stopped or lost its finite numbers."""
    whole = [np.isfinite(run.tips).all(axis=1) for run in (one, other)]
    common = min(len(some) if some.all() else int(np.argmin(some)) for some in whole)
    one, other = (Run(run.tips[:common]) for run in (one, other))
    excursion = float(np.linalg.norm(other.tips - (length, 0.0, 0.0), axis=1).max())
    rms = float(np.sqrt(np.mean(np.sum((one.tips - other.tips) ** 2, axis=1))))
    return rms / max(excursion, LEAST_EXCURSION[precision] * length)


@dataclass
class Verdict:
    """How a trial ended, why, and the numbers behind it.

    Args:
        ending: one of ENDINGS.
        reason: what was reported, or which of elements, step and float32 is coarse, or what makes it sensitive.
        error: distance of the tip from the finer run, in its largest excursion.
        step_error: the same from a quarter of the step with the same elements, or from explicit steps that agree with
            the finer run; None where it was not run.
        energy_made: in units of the largest kinetic and elastic energy.
        finer: what the finer run reported; "" where it was well, "not run" where the asked one was refused.
    """

    ending: str
    reason: str = ""
    error: float | None = None
    step_error: float | None = None
    energy_made: float | None = None
    finer: str = ""


class AnyRuns(Protocol):
    """Runs by name, and what a verdict must know of them."""

    precision: str
    length: float
    order: int

    @property
    def independent(self) -> bool: ...
    def __call__(self, name: str) -> Run: ...


def classify(runs: AnyRuns) -> Verdict:
    """The verdict from runs that are made when asked for.

    Correct: within TOLERANCE of the finer run. Else the same elements with a quarter of the step tell what is coarse:
    the elements where it agrees; the step where errors fall with it as those of second order do, at once or after
    further halvings; float32 where the same run in float64 is elsewhere. Where explicit runs judge an implicit one and
    agree, with its elements and with more, its step is at fault, and has to converge to them.
    Sensitive: fine runs, or runs under loads that differ by 1e-4, are further from each other than TOLERANCE or half of
    the error. What is left is wrong and silent, and so is every such run that made energy and did not warn.

    Args:
        runs: called with a name, returns a Run: "asked", "finer" (more elements, smaller step), "double" (the same
            in float64), HALVED (steps, same elements), and "disturbed quarter" and so on (of the step, loads changed
            by 1e-4), "explicit" (the same elements); and has the attributes `precision`, `order` (in
            the step), `independent` (the finer run of an implicit one is explicit) and `length` (of the rod, m).
    """
    asked = runs("asked")
    if not asked.well:
        return Verdict("reported", asked.symptom, finer=runs("finer").symptom if asked.status else "not run")
    finer = runs("finer")

    def apart(one: Run, other: Run) -> float:
        return distance(one, other, runs.length, runs.precision)

    def ended(ending: str, reason: str = "") -> Verdict:
        return Verdict(ending, reason, facts["error"], facts.get("step_error"), made, finer.symptom)

    def early(one: str, other: str) -> float:
        return prefix_distance(runs(one), runs(other), runs.length, runs.precision)

    made = asked.energy_made / asked.inner if asked.inner > 0.0 else 0.0
    coarse, wrong = COARSE[asked.warned], COARSE[True] if asked.warned else "wrong and silent"
    facts = {"error": apart(asked, finer)}
    if facts["error"] <= TOLERANCE:
        return ended("correct")
    if runs.independent and apart(runs("explicit"), finer) <= TOLERANCE:
        facts["step_error"] = apart(asked, runs("explicit"))
        if made > ENERGY_MADE:
            return ended(wrong, "energy made")
        if apart(runs(HALVED[-1]), runs("explicit")) <= TOLERANCE:
            return ended(coarse, "step")
        return ended("wrong and silent", "implicit steps do not converge to explicit ones")
    quarter = runs("quarter")
    facts["step_error"] = apart(asked, quarter)
    if facts["step_error"] <= TOLERANCE:
        return ended(coarse, "elements")
    if made > ENERGY_MADE:
        return ended(wrong, "energy made")
    if not math.isfinite(facts["step_error"]):
        if any(early(name, "quarter") > TOLERANCE for name in ("disturbed quarter", "eighth")):
            return ended("sensitive", "finer runs disagree before they stop")
        return ended("wrong and silent", "smaller steps do not get to the end")
    if runs.precision == "float32" and apart(runs("double"), asked) > 0.5 * facts["step_error"]:
        return ended(coarse, "float32")
    for judge_of in range(3, len(HALVED)):
        finest, fine = HALVED[judge_of], HALVED[judge_of - 1]
        errors = [apart(runs(name), runs(finest)) for name in HALVED[:judge_of]]
        steady = all(error <= FAR[runs.order] * next_one for error, next_one in pairwise(errors[:-1]))
        if steady and math.isfinite(errors[-1]) and errors[-1] <= errors[-2] / SECOND_ORDER:
            return ended(coarse, "step")
        for name, words in ((f"disturbed {fine}", "loads changed by 1e-4"), (finest, "finer runs disagree")):
            if early(name, fine) > min(TOLERANCE, 0.5 * facts["step_error"]):
                return ended("sensitive", words)
    return ended("wrong and silent", "does not converge with the step")


class Runs:
    """The runs of a trial, each made once, when asked for."""

    def __init__(self, trial: Trial, budget: float) -> None:
        self.trial, self.precision, self.length = trial, trial.kind.precision, trial.scene.rod.length
        self.order = 4 if trial.kind.integrator == "implicit4" else 2
        self.known: dict[str, Run] = {}
        self.refused, judge = True, trial.kind.integrator
        try:
            self.coarse = build(trial, trial.num_elements)
        except ValueError as error:
            self.known["asked"] = Run(np.empty((0, 3)), refusal=refused(error))
        else:
            self.refused = False
            self.fine, duration = finer(trial, self.coarse, budget)
            self.plan, judge = plan(trial, self.coarse, duration), self.fine.integrator
        self.integrators = f"{trial.kind.integrator} by {judge}"
        """Integrator of the run that is judged and of the finer one."""

    @property
    def independent(self) -> bool:
        """Whether explicit runs judge an implicit one."""
        return self.trial.kind.integrator != "explicit" and self.fine.integrator == "explicit"

    def __call__(self, name: str) -> Run:
        if name not in self.known:
            self.known[name] = self._run(name)
        return self.known[name]

    def _run(self, name: str) -> Run:
        if name == "asked":
            return follow(self.trial, self.coarse, self.plan, to_the_end=False)
        if name == "finer":
            return follow(self.trial, self.fine, self.plan)
        if name == "explicit":
            same = build(self.trial, self.trial.num_elements, default=True, integrator="explicit")
            same.time_step = min(same.time_step, self.fine.time_step)
            return follow(self.trial, same, self.plan)
        step = name.removeprefix("disturbed ")
        parts = 1 if step == "double" else 2 ** HALVED.index(step)
        trial = self.trial if name == step else disturbed(self.trial)
        simulation = build(trial, trial.num_elements, "float64", default=True)
        return follow(trial, simulation, self.plan, step=self.coarse.time_step, parts=parts)


def judge(trial: Trial, budget: float) -> tuple[Verdict, Runs]:
    """The verdict on a trial and the runs behind it."""
    runs = Runs(trial, budget)
    return classify(runs), runs
