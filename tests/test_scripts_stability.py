"""Smoke test of scripts/stability, and its judgement on runs whose fate is known."""

import dataclasses
import math

import numpy as np
import pytest

from magrod_env import Simulation
from scripts.common.starts import first_mode
from scripts.stability import extreme
from scripts.stability.bound import disturb, first_failure, grows, limit, undamped
from scripts.stability.commands import EVERY, RODS, SIGNS, drive, flips
from scripts.stability.judge import (
    ENDINGS,
    Run,
    Runs,
    build,
    classify,
    distance,
    finer_elements,
    follow,
    plan,
)
from scripts.stability.long import axial_momentum, drift, start_swinging, swinging_scene, verdict
from scripts.stability.scenes import COURSES, HOLD, KINDS, SUDDEN, draw, first_period, own_time
from scripts.stability.stiff import TASKS, perform
from tests.test_scripts_bench import assert_well_formed, columns, run_quick

LENGTH = 0.1
TIMES = np.linspace(0.0, 1.0, 101)


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    return run_quick("scripts.stability", tmp_path_factory.mktemp("stability"))


# ---- the program


def test_report_is_well_formed(report):
    printed, content = report
    silent = content["tables"].pop("extreme_silent")
    assert silent["rows"] == [] and silent["note"] == "None."
    assert_well_formed(printed, content, "scripts.stability")
    assert {"straight_bounds", "state_bounds", "paper_steps", "long", "stiff"} <= set(content["tables"])


def test_all_figures_are_met(report):
    checks = report[1]["checks"]
    assert {check["figure"] for check in checks} == {"bound", "long", "extreme", "commands"}
    assert [check["what"] for check in checks if not check["met"]] == []


def test_every_scene_has_one_ending_and_none_is_silent(report):
    table = report[1]["tables"]["extreme_kinds"]
    (*_, (name, scenes, *counts)) = columns(table, "kind", "scenes", *ENDINGS)
    assert name == "all" and scenes == sum(counts) == extreme.SCENES[True]
    ending = dict(zip(ENDINGS, counts))
    assert ending["wrong and silent"] == 0
    assert ending["correct"] > 0.3 * scenes and ending["reported"] > 0


# ---- random scenes


def test_a_seed_makes_the_same_trial_again():
    one, other = draw(17), draw(17)
    assert one.scene == other.scene and one.num_elements == other.num_elements and one.share == other.share
    np.testing.assert_array_equal(one.first, other.first)


def test_trials_are_within_the_promised_ranges_and_cover_them():
    trials = [draw(seed) for seed in range(400)]
    rods = [trial.scene.rod for trial in trials]
    for values, low, high in (
        ([rod.youngs_modulus for rod in rods], 1e3, 200e9),
        ([rod.length / rod.width for rod in rods], 3.0, 2000.0),
        ([trial.field for trial in trials], 1e-3, 10.0),
        ([trial.num_elements for trial in trials], 1, 64),
    ):
        assert low * (1 - 1e-9) <= min(values) < 3.0 * low and high / 3.0 < max(values) <= high * (1 + 1e-9)
    assert {trial.course for trial in trials} == set(COURSES)
    assert {trial.kind.name for trial in trials} == {kind.name for kind in KINDS}
    for trial in trials:
        fields = trial.fields(TIMES, 1.0, 0.3)
        assert np.linalg.norm(fields, axis=1).max() <= trial.field * (1 + 1e-9)
        if trial.kind.plane:
            assert not fields[:, 1].any()


def test_the_first_period_is_about_that_of_the_linearised_rod():
    checked = 0
    for seed in range(40):
        trial = draw(seed)
        rod = trial.scene.rod
        if trial.kind.element == "helical" and trial.kind.damping is False and rod.length > 20.0 * rod.width:
            frequency = Simulation(trial.scene, num_elements=12).natural_frequencies()[0]
            np.testing.assert_allclose(first_period(trial.scene) * frequency, 1.0, rtol=0.15)
            checked += 1
    assert checked > 5


def sudden(course, steps=1, **wanted):
    """The first trial of quick kinds, of a rod up to 50 widths long, whose field changes suddenly more than `steps`
    times.
    """
    trials = (draw(seed, True) for seed in range(2000))
    return next(
        trial
        for trial in trials
        if trial.course == course
        and len(trial.changes) > steps
        and trial.scene.rod.length < 50.0 * trial.scene.rod.width
        and all(getattr(trial.kind, name) == value for name, value in wanted.items())
    )


def gentle(trial, couple):
    """The trial without gravity, with 4 elements and the default step, in a field of m B L = `couple` EI."""
    rod, magnet = trial.scene.rod, trial.scene.magnets[0]
    field = couple * rod.bending_stiffness / (magnet.moment * rod.length)
    changes = trial.changes * own_time(trial.scene.replace(gravity=None), field) / own_time(trial.scene, trial.field)
    return dataclasses.replace(
        trial,
        scene=trial.scene.replace(gravity=(0.0, 0.0, 0.0)),
        field=field,
        share=None,
        hanging=False,
        num_elements=4,
        changes=changes,
    )


@pytest.mark.parametrize("course", SUDDEN)
def test_a_sudden_field_is_constant_between_its_changes(course):
    trial = sudden(course, steps=3)
    holds = np.diff(trial.changes)
    own = own_time(trial.scene, trial.field)
    assert trial.changes[0] == 0.0 and np.all(holds > 0.1 * HOLD[0] * own) and np.all(holds < 2.0 * HOLD[1] * own)
    edges = trial.changes
    begins, ends = edges[:-1] + 1e-6 * holds, edges[1:] - 1e-6 * holds
    one, other = (trial.fields(times, edges[-1], own) for times in (begins, ends))
    np.testing.assert_array_equal(one, other)
    assert np.any(np.diff(one, axis=0) != 0.0)


def test_flips_go_to_and_fro_and_some_of_them_aside_or_to_zero():
    trials = [trial for trial in map(draw, range(300)) if trial.course == "flips"]
    regular = [trial for trial in trials if np.abs(trial.shares[:, 0]).all()]
    assert 0.3 * len(trials) < len(regular) < 0.8 * len(trials)
    for trial in regular:
        np.testing.assert_array_equal(trial.shares[:, 0], (-1.0) ** np.arange(len(trial.changes)))
    broken = np.concatenate([trial.shares for trial in trials if trial not in regular])
    assert np.abs(broken[:, 1]).any() and not np.abs(broken).any(axis=1).all()


class Recorder:
    """A simulation that notes each stretch of constant field: when it begins and ends, the field and the step."""

    def __init__(self, simulation):
        self.simulation, self.stretches, self.field = simulation, [], None

    def __getattr__(self, name):
        return getattr(self.simulation, name)

    def __setattr__(self, name, value):
        if name == "_time_step":
            self.simulation._time_step = value
        else:
            super().__setattr__(name, value)

    def advance(self, duration, field=None):
        self.field = self.field if field is None else field
        begin = self.simulation.time
        self.simulation.advance(duration, field=field)
        if duration > 0.0:
            steps = math.ceil(duration / self.simulation.time_step - 1e-9)
            self.stretches.append((begin, self.simulation.time, *self.field, steps))


@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
def test_all_runs_of_a_trial_see_the_same_field_at_the_same_times(integrator):
    runs = Runs(gentle(sudden("flips", steps=2, integrator=integrator, element="helical"), 0.01), 0.05)
    trial, coarse = runs.trial, runs.coarse
    seen = {}
    for name, simulation, step, parts in (
        ("asked", coarse, None, 1),
        ("quarter", build(trial, trial.num_elements, default=True), coarse.time_step, 4),
        ("finer", runs.fine, None, 1),
    ):
        recorder = Recorder(simulation)
        assert follow(trial, recorder, runs.plan, step=step, parts=parts).complete
        seen[name] = np.array(recorder.stretches)
    for name in ("quarter", "finer"):
        np.testing.assert_allclose(seen[name][:, :2], seen["asked"][:, :2], rtol=1e-9, atol=1e-12)
        np.testing.assert_array_equal(seen[name][:, 2:5], seen["asked"][:, 2:5])
    np.testing.assert_array_equal(seen["quarter"][:, 5], 4 * seen["asked"][:, 5])
    changed = np.flatnonzero(np.any(np.diff(seen["asked"][:, 2:5], axis=0) != 0.0, axis=1)) + 1
    assert len(changed) > 0
    for time in seen["asked"][changed, 0]:
        assert np.abs(trial.changes - time).min() < 1e-9 * runs.plan.duration


def test_flips_are_seen_as_sudden_changes():
    """The field that needs no warning as one step needs one where it flips."""
    flipping = gentle(sudden("flips", steps=10, integrator="explicit", element="helical", precision="float64"), 1.0)
    flipping = dataclasses.replace(flipping, axial_softening=1.0, rotary_scaling=1.0)
    coarse = build(flipping, 4)
    edges = plan(flipping, coarse, 0.999 * flipping.changes[-1])
    assert follow(flipping, coarse, edges).warned
    assert not follow(dataclasses.replace(flipping, course="step"), build(flipping, 4), edges).warned


def test_a_plan_has_an_edge_at_every_sudden_change():
    trial = sudden("random", steps=5)
    coarse = build(trial, trial.num_elements)
    duration = 1.001 * float(trial.changes[-1])
    edges = plan(trial, coarse, duration).edges
    assert np.all(np.diff(edges) > 0.0) and edges[-1] == duration
    assert np.isin(trial.changes, edges).all()


def test_an_implicit_run_is_judged_by_an_explicit_one_where_that_can_follow():
    found = {}
    for trial in (draw(seed, True) for seed in range(400)):
        if trial.kind.integrator == "implicit" and len(found) < 2:
            runs = Runs(trial, 0.05)
            if not runs.refused:
                found.setdefault(runs.integrators, runs)
    assert set(found) == {"implicit by explicit", "implicit by implicit"}
    fine, coarse = (found["implicit by implicit"].__dict__[name] for name in ("fine", "coarse"))
    assert fine.time_step <= 0.25 * coarse.time_step and fine.num_elements > coarse.num_elements


def test_a_given_implicit_step_is_a_factor_of_the_default_one():
    trials = (draw(seed, True) for seed in range(400))
    trial = next(trial for trial in trials if trial.kind.integrator == "implicit" and trial.share)
    default = build(trial, trial.num_elements, default=True).time_step
    assert 0.25 <= trial.share <= 2.0
    np.testing.assert_allclose(build(trial, trial.num_elements).time_step, trial.share * default)


def test_finished_seeds_are_taken_from_the_file(tmp_path, monkeypatch):
    path = tmp_path / "extreme.jsonl"
    judged = []
    monkeypatch.setattr(extreme, "judge", lambda trial, budget: judged.append(trial.seed) or (None, None))
    monkeypatch.setattr(extreme, "record", lambda trial, *_: {"seed": trial.seed, "ending": "correct"})
    first = extreme.campaign(range(3), True, path)
    assert extreme.campaign(range(5), True, path)[:3] == first
    assert judged == [0, 1, 2, 3, 4]
    assert len(path.read_text().splitlines()) == 5


# ---- the verdict


class Known:
    """Runs that are given instead of simulated; "asked" made `made` J of energy."""

    length, order, independent = LENGTH, 2, False

    def __init__(self, precision="float64", made=0.0, **tips):
        self.precision, self.tips, self.made = precision, tips, made

    def __call__(self, name):
        tips = self.tips.get(name, self.tips["finer"])
        run = tips if isinstance(tips, Run) else Run(tips, complete=True, inner=1.0)
        if name == "asked":
            run.energy_made = self.made
        return run


def swing(phase=0.0, scale=1.0):
    """Tip of a rod that swings by 2 cm."""
    turn = 2.0 * math.pi * TIMES + phase
    return np.stack([0.0 * TIMES + LENGTH, 0.0 * TIMES, 0.02 * scale * np.sin(turn)], axis=1)


STOPPED = Run(swing()[:7], status=1)


def test_a_run_near_the_finer_one_is_correct():
    found = classify(Known(asked=swing(0.03), finer=swing()))
    assert found.ending == "correct" and 0.0 < found.error < 0.05


def test_what_was_reported_or_refused_is_reported():
    assert classify(Known(asked=STOPPED, finer=swing())).reason == "its state is not finite"
    refused = classify(Known(asked=Run(np.empty((0, 3)), refusal="step too long"), finer=swing()))
    assert (refused.ending, refused.reason, refused.finer) == ("reported", "step too long", "not run")


def test_elements_are_coarse_where_smaller_steps_change_nothing():
    found = classify(Known(asked=swing(0.3), quarter=swing(0.299), finer=swing()))
    assert (found.ending, found.reason) == ("coarse, silent", "elements")


def test_a_coarse_run_that_the_simulation_warned_of_is_not_silent():
    asked = swing(0.3)
    warned = Run(asked, complete=True, warned=True)
    assert classify(Known(asked=warned, quarter=swing(0.299), finer=swing())).ending == "coarse, warned"
    assert (
        classify(Known(asked=Run(swing(1.0), complete=True, warned=True), finer=swing())).ending == "wrong and silent"
    )


def test_a_step_is_coarse_where_its_error_is_of_second_order():
    phases = {"asked": 0.32, "half": 0.08, "quarter": 0.02, "eighth": 0.005}
    found = classify(Known(**{name: swing(phase) for name, phase in phases.items()}, finer=swing()))
    assert (found.ending, found.reason) == ("coarse, silent", "step")


def test_the_error_of_a_step_of_fourth_order_may_fall_faster():
    phases = {"asked": 0.32, "half": 0.01, "quarter": 0.0006, "eighth": 0.00004}
    runs = Known(**{name: swing(phase) for name, phase in phases.items()}, finer=swing())
    assert classify(runs).ending == "wrong and silent"
    runs.order = 4
    assert (classify(runs).ending, classify(runs).reason) == ("coarse, silent", "step")


def test_explicit_runs_that_agree_excuse_no_implicit_one():
    """Finer implicit runs that disagree make a trial sensitive only where explicit ones disagree too."""
    phases = {"asked": 0.3, "half": 1.0, "quarter": 2.0, "eighth": 3.0, "disturbed quarter": 2.0, "explicit": 0.01}
    runs = Known(**{name: swing(phase) for name, phase in phases.items()}, finer=swing())
    assert classify(runs).ending == "sensitive"
    runs.independent = True
    assert (classify(runs).ending, classify(runs).reason) == ("coarse, silent", "step")
    runs.tips["sixty-fourth"] = swing(0.2)
    assert classify(runs).ending == "wrong and silent"
    runs.tips["explicit"] = swing(1.0)
    assert classify(runs).ending == "sensitive"


def test_a_step_whose_error_falls_late_is_coarse_too():
    """An unsteady error, within what a disturbance of the loads would excuse, and then one of second order."""
    phases = {"asked": 0.33, "half": 0.08, "quarter": 0.09, "eighth": 0.04, "sixteenth": 0.01, "thirty-second": 0.0025}
    phases |= {f"disturbed {name}": phase for name, phase in phases.items()}
    found = classify(Known(**{name: swing(phase) for name, phase in phases.items()}, finer=swing()))
    assert (found.ending, found.reason) == ("coarse, silent", "step")


def test_float32_is_coarse_where_float64_is_elsewhere():
    runs = dict(asked=swing(0.3), double=swing(0.001), finer=swing())
    assert classify(Known("float32", **runs)).reason == "float32"
    assert classify(Known("float64", **runs)).ending == "wrong and silent"


def test_fine_runs_that_differ_among_themselves_make_a_sensitive_trial():
    phases = {"asked": 0.3, "half": 1.0, "quarter": 2.0, "eighth": 3.0, "disturbed quarter": 2.0}
    found = classify(Known(**{name: swing(phase) for name, phase in phases.items()}, finer=swing()))
    assert (found.ending, found.reason) == ("sensitive", "finer runs disagree")
    phases |= {"eighth": 2.05, "half": 2.06, "disturbed quarter": 3.0}
    found = classify(Known(**{name: swing(phase) for name, phase in phases.items()}, finer=swing()))
    assert (found.ending, found.reason) == ("sensitive", "loads changed by 1e-4")


def test_a_run_apart_from_fine_ones_that_agree_is_wrong_and_silent():
    assert classify(Known(asked=swing(1.0), finer=swing())).ending == "wrong and silent"


def test_a_wrong_run_that_makes_energy_is_never_excused():
    phases = {"asked": 0.3, "half": 1.0, "quarter": 2.0, "eighth": 3.0}
    runs = Known(**{name: swing(phase) for name, phase in phases.items()}, finer=swing(), made=0.2)
    assert (classify(runs).ending, classify(runs).reason) == ("wrong and silent", "energy made")


def test_a_run_is_not_excused_by_finer_ones_that_fail():
    found = classify(Known(asked=swing(), quarter=STOPPED, eighth=STOPPED, finer=STOPPED))
    assert found.ending == "wrong and silent"


def test_finer_runs_that_part_before_they_fail_make_a_sensitive_trial():
    stopped = {name: Run(swing(phase)[:40], status=2) for name, phase in (("quarter", 0.0), ("eighth", 0.5))}
    found = classify(Known(asked=swing(1.0), finer=swing(), **stopped, **{"disturbed quarter": stopped["quarter"]}))
    assert (found.ending, found.reason) == ("sensitive", "finer runs disagree before they stop")


def test_distance_is_relative_to_the_deflection():
    one, other = Run(swing(scale=1.1), complete=True), Run(swing(), complete=True)
    np.testing.assert_allclose(distance(one, other, LENGTH, "float64"), 0.1 / math.sqrt(2.0), rtol=0.01)
    assert distance(one, STOPPED, LENGTH, "float64") == math.inf
    still = Run(np.tile((LENGTH, 0.0, 0.0), (101, 1)), complete=True)
    assert distance(still, still, LENGTH, "float64") == 0.0


@pytest.mark.parametrize("share", [1.05, 1.3])
def test_an_unstable_run_never_ends_as_correct(share):
    """A step beyond the bound, past the check, in a trial that is correct below it."""
    seed = next(s for s in range(200) if (t := draw(s, True)).share and t.kind.name == "one magnet, planar")
    trial = draw(seed, True)
    runs = extreme.Runs(trial, 0.05)
    runs.coarse._time_step = share * runs.coarse.stable_time_step
    assert classify(runs).ending in ("reported", "sensitive", "wrong and silent")


def test_a_finer_run_has_more_elements():
    assert [finer_elements(n) for n in (1, 3, 6, 12, 13, 64)] == [6, 6, 12, 24, 20, 96]
    trial = draw(3)
    assert build(trial, 20, "float64", default=True).num_elements == 20


# ---- bounds, long runs, stiff rods


def test_bisection_finds_the_limit_of_a_straight_rod():
    simulation = Simulation(undamped(swinging_scene(), weightless=True), num_elements=4, on_failure="report")
    bound, before = simulation.stable_time_step, simulation.positions
    np.testing.assert_allclose(limit(simulation, 1.1 * bound), bound, rtol=2e-4)
    assert grows(simulation, 1.01 * bound) and not grows(simulation, 0.99 * bound)
    np.testing.assert_array_equal(simulation.positions, before)
    assert limit(simulation, 100.0 * bound) is None


def test_a_step_beyond_the_bound_fails_and_one_within_does_not():
    simulation = Simulation(undamped(swinging_scene()), num_elements=4, on_failure="report")
    bound = simulation.stable_time_step
    assert first_failure(simulation, 0.9 * bound, 0.2)[0] == 0
    simulation.reset()
    assert first_failure(simulation, 1.1 * bound, 0.2)[0] > 0
    assert disturb(simulation) > 0.0


def test_the_axial_momentum_of_a_clamped_rod_is_conserved_while_its_parts_are_not():
    simulation = Simulation(swinging_scene(), num_elements=4)
    start_swinging(simulation)
    whole, part = [], []
    for _ in range(20):
        simulation.advance(0.02)
        whole.append(axial_momentum(simulation)[0])
        part.append(simulation.angular_momentum()[0, 0])
    assert np.ptp(whole) < 1e-12 * abs(whole[0])
    assert np.ptp(part) > 1e-6 * abs(whole[0])


def test_drift_tells_growth_from_swing():
    rng = np.random.default_rng(0)
    swinging = np.sin(0.7 * np.arange(2000.0))[:, None] + 0.1 * rng.normal(size=(2000, 1))
    assert verdict(swinging) == "bounded"
    growing = swinging + np.linspace(0.0, 5.0, 2000)[:, None]
    assert verdict(growing) == "grows"
    np.testing.assert_allclose(drift(growing)[0], 5.0, rtol=0.02)


def test_a_plucked_rod_swings_to_the_offset_that_was_asked_for():
    shape, slope = first_mode(np.array([0.0, 1.0]))
    np.testing.assert_allclose((*shape, slope[0], slope[1]), (0.0, 1.0, 0.0, 1.3765), atol=1e-4)
    task = TASKS["aluminium, 1 mm, plucked 8 and 10 mm"]
    simulation = Simulation(task.scene, num_elements=4, axial_softening=100.0, rotary_scaling=200.0)
    course = perform(task, simulation, 0.3)
    np.testing.assert_allclose(np.abs(course.seen[:, 1:]).max(axis=0), task.offset, rtol=0.1)
    assert course.wall > 0.0


# ---- commands


@pytest.mark.parametrize("every", EVERY)
def test_commands_flip_every_few_steps(every):
    for signs in SIGNS:
        actions = flips(np.random.default_rng(0), (50, 3), every, signs, 20)
        assert actions.shape == (20, 50, 3) and np.all(np.abs(actions) == 1.0)
        changed = np.any(actions[1:] != actions[:-1], axis=(1, 2))
        np.testing.assert_array_equal(np.flatnonzero(changed) + 1, np.arange(every, 20, every))
        turned = (actions[every] == -actions[0]).mean()
        assert turned == 1.0 if signs == "in phase" else 0.3 < turned < 0.7
    assert set(RODS) == {"nominal", "randomised"}


def test_every_lost_rod_is_counted_once_with_what_was_reported():
    class Batch:
        """Two rods, the second lost in the second step; its episode begins anew in the third."""

        num_envs, step_number = 2, 0
        unwrapped = property(lambda self: self)
        core = property(lambda self: self)
        batch = property(lambda self: self)
        status = np.zeros(2, int)

        def reset(self, seed):
            self.step_number = 0

        def step(self, action):
            self.step_number += 1
            lost = np.array([False, self.step_number == 2])
            self.status = np.where(lost, 2, 0)
            tips = np.where(lost[:, None] | np.array([[self.step_number == 3], [False]]), np.nan, np.zeros((2, 3)))
            return None, None, lost, np.zeros(2, bool), {"tip_position": tips}

    fate = drive(Batch(), np.ones((4, 2, 3)))
    assert fate.steps == 7 and fate.lost.total() == 1 and fate.unreported == 1
    assert next(iter(fate.lost)).startswith("one element has bent")
