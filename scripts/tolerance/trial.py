"""One trial: what a tolerance chooses, how far its tips are off, what it costs by hand.

Costs are element-steps: elements times explicit steps, for one rod over the trial; an implicit midpoint step counts as
several of them (`cost_rate`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from magrod_env import Simulation
from magrod_env.simulation.integrators import cost_rate, implicit_schemes
from magrod_env.simulation.search import LADDER, STEPS, cheapest_pair
from scripts.common import run
from scripts.common.run import Options, samples, whole_steps
from scripts.tolerance.scenes import CONTROL_TIME, DURATION, NUM_RODS, Trial

if TYPE_CHECKING:
    from typing_extensions import Unpack

CONDITIONING = ((1, 1), (1, 4), (1, 16), (4, 9), (16, 31), (64, 127), (256, 511), (1024, 2047))
"""axial_softening and rotary_scaling to choose from by hand, from stiff to soft, at the default step."""
DEAREST = 2.0  # a hand-chosen setting that costs this many times what the tolerance chose is not tried
PRICED = 5e6  # cost of a choice: the price of dearer ones is not searched
FINER_EVERY = 7  # trials: a still finer run checks every seventh reference, and all that say that a promise was broken


@dataclass(frozen=True, kw_only=True)
class Record:
    """What came of one trial at one tolerance (m).

    Args:
        seed, index, family, plane, num_magnets, load, magnitude: the trial's.
        tolerance: m.
        outcome: "measured"; "refused" by a ValueError; "too dear" where the reference was beyond the budget.
        choosing_time: s.
        num_elements, time_step, axial_softening, rotary_scaling, integrator: what was chosen.
        estimate: of the error by the pilots, m.
        cost: element-steps of the choice.
        run_time: of the choice over the trial, s.
        errors: RMS over time of each rod's tip, m; None where the rod was lost.
        reference_cost: element-steps.
        doubt: largest RMS distance between the reference and a finer one, m; None where none was run.
        apart: largest RMS distance, m, between an implicit reference and explicit steps of the same elements without
            conditioning; None where the reference is explicit or those would be beyond the budget.
        best: the cheapest hand-chosen setting within the tolerance.
        best_cost: its element-steps; None where none up to DEAREST times the cost was good enough.
        priced: whether such a setting was looked for.
    """

    seed: int
    index: int
    family: str
    plane: str | None
    num_magnets: int
    load: float
    magnitude: float
    tolerance: float
    outcome: str
    choosing_time: float = 0.0
    num_elements: int | None = None
    time_step: float | None = None
    axial_softening: float | None = None
    rotary_scaling: float | None = None
    integrator: str | None = None
    estimate: float | None = None
    cost: float | None = None
    run_time: float | None = None
    errors: list[float | None] | None = None
    reference_cost: float | None = None
    doubt: float | None = None
    apart: float | None = None
    best: Options | None = None
    best_cost: float | None = None
    priced: bool = False

    @property
    def error(self) -> float:
        """Largest error of the rods, m; infinite where one was lost, NaN where nothing was measured."""
        if self.errors is None:
            return math.nan
        return max(math.inf if error is None else error for error in self.errors)

    @property
    def ratios(self) -> np.ndarray:
        """Errors over the tolerance, rod by rod."""
        return np.array([np.inf if each is None else each for each in self.errors or []]) / self.tolerance

    @property
    def sensitive(self) -> bool:
        """Whether the reference itself is in doubt by more than the tolerance."""
        return self.doubt is not None and self.doubt > self.tolerance


def untried(trial: Trial, tolerance: float) -> Record:
    """The record of a trial of which nothing is measured."""
    return Record(
        seed=trial.seed,
        index=trial.index,
        family=trial.family,
        plane=trial.plane,
        num_magnets=len(trial.scene.magnets),
        load=trial.load,
        magnitude=trial.magnitude,
        tolerance=tolerance,
        outcome="not tried",
    )


def measure(trial: Trial, tolerance: float, budget: float, price: bool = True) -> Record:
    """Run a trial at a tolerance (m), with a reference of at most ``budget`` element-steps."""
    for name in ("explicit", *implicit_schemes(trial.scene)):  # so that no time below is compilation
        simulate(trial, num_elements=len(trial.scene.magnets), integrator=name).advance(1e-4)
    record, start = untried(trial, tolerance), time.perf_counter()
    try:
        chosen = simulate(trial, tolerance=tolerance)
    except ValueError:
        return replace(record, outcome="refused", choosing_time=time.perf_counter() - start)
    reference, resolution = finer(trial, chosen), chosen.resolution
    record = replace(
        record,
        outcome="too dear",
        choosing_time=time.perf_counter() - start,
        num_elements=resolution.num_elements,
        axial_softening=resolution.axial_softening,
        rotary_scaling=resolution.rotary_scaling,
        integrator=resolution.integrator,
        estimate=resolution.error,
        time_step=chosen.time_step,
        cost=cost(chosen),
        reference_cost=cost(reference),
    )
    return record if cost(reference) > budget else _compared(trial, record, chosen, reference, budget, price)


def _compared(
    trial: Trial, record: Record, chosen: Simulation, reference: Simulation, budget: float, price: bool
) -> Record:
    """The record with errors, doubts about the reference, and the price."""
    start = time.perf_counter()
    found = tips(chosen, trial.fields)
    run_time, truth = time.perf_counter() - start, tips(reference, trial.fields)
    errors, doubt, apart = distances(found, truth), None, None
    if errors.max() > record.tolerance or trial.index % FINER_EVERY == 0:
        doubt = _distance(trial, finer(trial, reference, 1.5, 4.0), truth, 2.0 * budget)
    if reference.integrator != "explicit":
        explicit = simulate(trial, num_elements=reference.num_elements, integrator="explicit")
        apart = _distance(trial, explicit, truth, budget)
    told = [float(error) if math.isfinite(error) else None for error in errors]
    record = replace(record, outcome="measured", run_time=run_time, errors=told, doubt=doubt, apart=apart)
    if not price or errors.max() > record.tolerance or cost(chosen) > PRICED:
        return record
    best, best_cost = _cheapest(trial, record.tolerance, truth, cost(chosen), chosen.num_elements)
    return replace(record, priced=True, best=best, best_cost=best_cost)


def simulate(trial: Trial, **resolution: Unpack[Options]) -> Simulation:
    """The trial's rods at a resolution."""
    options: Options = {"num_rods": NUM_RODS, "plane": trial.plane, "on_failure": "report", **resolution}
    return run.build(trial.scene, options, expected_field=trial.magnitude)


def finer(trial: Trial, simulation: Simulation, elements: float = 2.0, conditioning: float = 8.0) -> Simulation:
    """A simulation with so many times the elements, that much less conditioning, and at most half the time step.

    An implicit choice is compared with the most exact implicit scheme at that much shorter half a step.
    """
    resolution = simulation.resolution
    count = math.ceil(elements * resolution.num_elements)
    if simulation.integrator != "explicit":
        scheme, step = implicit_schemes(trial.scene)[0], 2.0 * simulation.time_step / conditioning
        return simulate(trial, num_elements=count, integrator=scheme, time_step=step)
    fine = simulate(
        trial,
        num_elements=count,
        axial_softening=1.0 + (resolution.axial_softening - 1.0) / conditioning,
        rotary_scaling=1.0 + (resolution.rotary_scaling - 1.0) / conditioning,
    )
    fine.time_step = min(fine.time_step, 0.5 * simulation.time_step)
    return fine


def cost(simulation: Simulation) -> float:
    """Element-steps of one rod over a trial."""
    step = CONTROL_TIME / whole_steps(CONTROL_TIME, simulation.time_step)
    return DURATION * cost_rate(simulation.integrator, simulation.num_elements, step)


def tips(simulation: Simulation, fields: np.ndarray) -> np.ndarray:
    """Tips after every control step from the straight rod at rest, m, (num_times, num_rods, 3); NaN once lost."""
    simulation.reset()
    return run.follow(simulation, samples(DURATION, CONTROL_TIME), fields, see=run.tips).seen[1:]


def distances(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """RMS over time of the distance of the tips, m, (num_rods,); infinite where either was lost."""
    off = np.sqrt(((found - truth) ** 2).sum(axis=2).mean(axis=0))
    return np.where(np.isnan(off), np.inf, off)


def _distance(trial: Trial, other: Simulation, truth: np.ndarray, budget: float) -> float | None:
    """Largest RMS distance, m, of the reference to another run; None where that is beyond the budget."""
    if cost(other) > budget:
        return None
    return float(min(distances(truth, tips(other, trial.fields)).max(), 1e3))


def _by_hand(trial: Trial) -> Iterator[tuple[str, list[dict[str, float]]]]:
    """Settings to choose from by hand, beside the elements, from loose to exact: integrator, and its choices."""
    yield "explicit", [{"axial_softening": axial, "rotary_scaling": rotary} for axial, rotary in CONDITIONING[::-1]]
    for name in implicit_schemes(trial.scene):
        longest = Simulation(trial.scene, num_elements=len(trial.scene.magnets), integrator=name).stable_time_step
        yield name, [{"time_step": CONTROL_TIME / each} for each in STEPS if CONTROL_TIME / each <= longest]


def _cheapest(
    trial: Trial, tolerance: float, truth: np.ndarray, chosen_cost: float, most_elements: int
) -> tuple[Options | None, float | None]:
    """The cheapest setting within the tolerance of those that `_by_hand` lists, at LADDER's elements, and its cost."""
    best, least = None, DEAREST * chosen_cost
    rungs = [rung for rung in LADDER if len(trial.scene.segment_ends) <= rung <= most_elements]
    for name, settings in _by_hand(trial):

        def build(rung: int, setting: dict[str, float], name: str = name) -> Simulation:
            return simulate(trial, num_elements=rung, integrator=name, **setting)  # type: ignore[arg-type]

        def price(rung: int, setting: dict[str, float], build=build) -> float:
            return cost(build(rung, setting))

        def good(rung: int, setting: dict[str, float], build=build) -> bool:
            return bool(distances(tips(build(rung, setting), trial.fields), truth).max() <= tolerance)

        found = cheapest_pair(rungs, settings, price, good, least)
        if found is not None:
            best, least = Options(integrator=name, num_elements=found[0], **found[1]), price(*found)  # type: ignore
    return best, None if best is None else least
