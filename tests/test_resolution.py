"""A tolerance chooses elements, step and conditioning, and keeps what it promises."""

from pathlib import Path

import gymnasium
import numpy as np
import pytest
from term_sets import damped, dragged

from magrod_env import Simulation, load_scene
from magrod_env.simulation import resolution_for, search
from magrod_env.simulation.integrators import cost_rate
from scripts import precision
from scripts.accuracy import CASES, follow, reference

STORED = np.load(Path(__file__).parent / "reference" / "reference.npz")
FIELDS = {"free_decay": 0.0, "rotating_field": 17e-3, "gravity_rotating_field": 17e-3, "two_magnet_free_decay": 10e-3}


def cost(simulation):
    return cost_rate(simulation.integrator, simulation.num_elements, simulation.time_step)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4])
@pytest.mark.parametrize("name", FIELDS)
def test_tip_stays_within_the_tolerance_of_the_independent_solution(name, tolerance):
    scene, field = CASES[name]
    simulation = Simulation(dragged(scene), tolerance=tolerance, expected_field=FIELDS[name])
    gap = follow(simulation, field)[:, 0] - reference(name)[:, 0]
    assert np.sqrt(np.mean(np.sum(gap**2, axis=-1))) <= tolerance
    assert simulation.resolution.error <= tolerance


def test_a_tighter_tolerance_costs_more():
    scene = CASES["gravity_rotating_field"][0]
    loose, tight = (Simulation(scene, tolerance=tolerance, expected_field=17e-3) for tolerance in (1e-3, 1e-4))
    assert cost(loose) < cost(tight)


WIRE = dragged(load_scene("niti_guidewire"))
FINE = dict(tolerance=1e-4, expected_field=20e-3)


def test_a_wire_gets_implicit_steps():
    wire, explicit = (Simulation(WIRE, integrator=name, **FINE) for name in (None, "explicit"))
    assert wire.integrator == wire.resolution.integrator != "explicit" == explicit.integrator
    assert cost(wire) < cost(explicit)


@pytest.mark.parametrize("options", [{"integrator": "explicit"}, {"precision": "float32"}])
def test_a_wire_of_explicit_steps_is_conditioned(options):
    wire = Simulation(WIRE, tolerance=1e-3, expected_field=20e-3, **options)
    assert wire.integrator == "explicit" and wire.resolution.axial_softening > 30.0
    assert wire.time_step > 10.0 * Simulation(wire.scene, num_elements=wire.num_elements).time_step


def test_a_wire_with_internal_damping_gets_no_steps_back_in_time():
    wire = Simulation(damped(WIRE.replace(internal_damping=1e-5)), **FINE)
    assert wire.integrator in ("explicit", "implicit")


def test_implicit_steps_stay_in_a_plane():
    """Chosen for planar motion, they are computed in space: nothing may leave the plane, not even by rounding."""
    fields = [(0.0, 0.0, 20e-3 * np.sin(0.3 * k)) for k in range(40)]
    tips = []
    for plane in ("xz", None):
        wire = Simulation(WIRE, plane=plane, **FINE)
        assert wire.integrator != "explicit"
        for field in fields:
            wire.advance(0.02, field=field)
        tips.append(wire.tip_position[0])
        assert not wire.positions[..., 1].any() and not wire.velocities[..., 1].any()
    assert np.abs(tips[0] - tips[1]).max() < 2e-4 and tips[0][2] != 0.0
    planar = Simulation(WIRE, num_elements=4, integrator="implicit", plane="xz")
    with pytest.raises(ValueError, match="field must lie in the plane 'xz'"):
        planar.advance(0.02, field=(0.0, 1e-3, 0.0))
    with pytest.raises(ValueError, match="velocities must keep the rod in the plane"):
        planar.set_motion(np.ones((1, 5, 3)))


@pytest.mark.parametrize("name, tolerance", [("niti", 1e-4), ("aluminium", 1e-3), ("aluminium", 1e-4)])
def test_stiff_rods_stay_within_the_tolerance_of_the_independent_solution(name, tolerance):
    trial = next(each for each in precision.trials() if each.name == name)
    scene = dragged(trial.scene) if trial.scene.magnets else trial.scene
    simulation = Simulation(scene, tolerance=tolerance, expected_field=trial.magnitude)
    gap = precision.trace(simulation, trial) - STORED[f"{name}_tip"]
    assert np.sqrt(np.mean(np.sum(gap**2, axis=-1))) <= tolerance


def test_a_rod_that_no_field_moves_is_judged_by_its_swing():
    """The aluminium rod of the paper's first experiment, plucked: 37 Hz for two seconds, undamped."""
    scene = load_scene("paper1_aluminium_in_plane")
    tips = []
    for settings in ({"tolerance": 1e-3}, {"num_elements": 12}):
        simulation = Simulation(scene, **settings)
        share = simulation.arc_lengths / scene.rod.length
        velocities, spins = np.zeros((2, 1, len(share), 3))
        velocities[0, :, 2] = 2.3 * (6 * share**2 - 4 * share**3 + share**4) / 3  # swings by 10 mm
        spins[0, :, 1] = -2.3 * (12 * share - 12 * share**2 + 4 * share**3) / (3 * scene.rod.length)
        simulation.set_motion(velocities, spins)
        tips.append([])
        for _ in range(100):
            simulation.advance(0.005)
            tips[-1].append(simulation.tip_position[0])
    gap = np.array(tips[0]) - np.array(tips[1])
    assert np.sqrt(np.mean(np.sum(gap**2, axis=-1))) <= 1e-3


def test_every_pilot_run_is_logged(caplog):
    scene = dragged(CASES["rotating_field"][0].replace(drag_rate=5.5))  # not chosen for in another test
    with caplog.at_level("INFO", logger="magrod_env"):
        Simulation(scene, tolerance=1e-3, expected_field=17e-3)
    assert len(caplog.messages) >= 4
    assert all(message.startswith("pilot run: ") for message in caplog.messages)


def test_the_choice_is_made_once():
    scene = CASES["rotating_field"][0]
    assert resolution_for(scene, 1e-3, None, 17e-3) is resolution_for(scene, 1e-3, None, 17e-3)


def test_planar_motion_may_have_a_tolerance():
    scene = CASES["gravity_rotating_field"][0]
    simulation = Simulation(scene, tolerance=1e-3, expected_field=10e-3, plane="xz")
    simulation.advance(0.1, field=(0.0, 0.0, 5e-3))
    assert simulation.resolution.num_elements <= 6


@pytest.mark.parametrize("name", ["num_elements", "time_step", "axial_softening", "rotary_scaling"])
def test_tolerance_beside_another_choice_is_refused(name):
    value = 6 if name == "num_elements" else 1e-5 if name == "time_step" else 2.0
    with pytest.raises(ValueError, match=f"{name} must be None beside a tolerance"):
        Simulation(load_scene("paper5_circle"), tolerance=1e-3, **{name: value})


@pytest.mark.parametrize("tolerance", [0.0, -1e-3, np.nan, "fine"])
def test_bad_tolerance_is_refused(tolerance):
    with pytest.raises(ValueError, match="tolerance must be"):
        Simulation(load_scene("paper5_circle"), tolerance=tolerance)


def test_tolerance_of_the_locking_element_is_refused():
    with pytest.raises(ValueError, match='tolerance must be None with element="nodal"'):
        Simulation(load_scene("paper5_circle"), tolerance=1e-3, element="nodal")


@pytest.mark.parametrize("value", [-1.0, np.nan, "strong"])
def test_bad_expected_field_is_refused(value):
    with pytest.raises(ValueError, match="expected_field must be"):
        Simulation(load_scene("paper5_circle"), expected_field=value)


def test_a_tolerance_out_of_reach_says_what_to_do(monkeypatch):
    monkeypatch.setattr(search, "LADDER", (3, 4, 5, 8))
    with pytest.raises(ValueError, match=r"tolerance must be within reach of 8 elements.*expected_field"):
        Simulation(load_scene("paper4_pdms_tip_magnet"), tolerance=1.1e-5, expected_field=5e-3)


# ---- environments


def test_environment_takes_a_tolerance():
    env = gymnasium.make("MagRod/Circle-v0", tolerance=1e-3)
    chosen = env.unwrapped.core.resolution
    assert chosen.error <= 1e-3 and chosen.num_elements == env.unwrapped.core.num_elements
    env.reset(seed=0)
    assert not env.step(np.zeros(2, np.float32))[4]["diverged"]


def test_environment_keeps_the_users_elements_without_conditioning():
    core = gymnasium.make("MagRod/Circle-v0", num_elements=6).unwrapped.core
    assert (core.num_elements, core.resolution.rotary_scaling) == (6, 1.0)


def test_environment_conditions_another_scene_only_if_asked():
    scene = load_scene("paper5_circle", modulus=2e6).replace(drag_rate=5.0)
    assert gymnasium.make("MagRod/Circle-v0", scene=scene).unwrapped.core.resolution.rotary_scaling == 1.0
    asked = gymnasium.make("MagRod/Circle-v0", scene=scene, rotary_scaling=4.0)
    assert asked.unwrapped.core.resolution.rotary_scaling == 4.0


def test_environment_refuses_tolerance_beside_elements():
    with pytest.raises(ValueError, match="num_elements must be None beside a tolerance"):
        gymnasium.make("MagRod/Circle-v0", tolerance=1e-3, num_elements=5)
