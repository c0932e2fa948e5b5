"""The implicit integrators: order, invariants, agreement with the explicit one and with independent references."""

from pathlib import Path

import numpy as np
import pytest
from term_sets import dragged, loaded

from magrod_env import Magnet, Rod, Scene, Simulation, load_scene
from magrod_env.rod.halfstep import NODE, finish, predict
from magrod_env.rod.implicit import MOST_ITERATIONS, TOLERANCE, iterate, largest_increment
from scripts import precision
from scripts.accuracy import LOADED

STORED = np.load(Path(__file__).parent / "reference" / "reference.npz")
IMPLICIT = ("implicit", "implicit4")
GRADIENT = np.array([[0.2, 0.1, -0.3], [0.1, -0.5, 0.4], [-0.3, 0.4, 0.3]])  # T/m
FIELD = (3e-3, -8e-3, 12e-3)  # T
SOFT = Scene(
    rod=Rod.circular(length=0.06, diameter=4e-3, density=1100.0, youngs_modulus=4e5, poissons_ratio=0.5),
    magnets=(Magnet.dipole(position=0.06, moment=0.013, mass=1e-4),),
    gravity=(0.0, 0.0, -9.81),
    drag_rate=3.0,
    spin_drag_rate=20.0,
)


def swung(scene, duration, gradient=None, **options):
    simulation = Simulation(scene, **options)
    simulation.advance(duration, field=FIELD if scene.magnets else None, gradient=gradient)
    return simulation


def smooth(at):
    return np.sin(20.0 * at) ** 4 * np.array(FIELD)


def first_swing(**options):
    """Tip after 48 ms of a rod set moving about as its first mode; soft, so that the steps resolve every mode."""
    rod = Rod.circular(length=0.06, diameter=4e-3, density=1100.0, youngs_modulus=4e4, poissons_ratio=0.5)
    scene = SOFT.replace(rod=rod, gravity=(0.0, 0.0, 0.0), drag_rate=0.0, spin_drag_rate=None)
    simulation = Simulation(scene, num_elements=2, **options)
    share = simulation.arc_lengths[:, None] / rod.length
    velocity = np.array([0.0, 0.05, 0.3]) * (6 * share**2 - 4 * share**3 + share**4) / 3
    slope = (12 * share - 12 * share**2 + 4 * share**3) / (3 * rod.length)
    simulation.set_motion(velocity[None], (slope * (0.0, -0.3, 0.05))[None])
    simulation.advance(0.048)
    return simulation.tip_position[0]


@pytest.mark.parametrize("integrator, order, step", [("implicit", 2, 4e-4), ("implicit4", 4, 1.6e-3)])
def test_error_falls_with_the_order(integrator, order, step):
    """Against the explicit scheme, extrapolated from two small steps."""
    truth = (4.0 * first_swing(time_step=4e-6) - first_swing(time_step=8e-6)) / 3.0
    coarse, half = (np.linalg.norm(first_swing(integrator=integrator, time_step=h) - truth) for h in (step, step / 2))
    assert np.log2(coarse / half) == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize("scene", [SOFT, SOFT.replace(internal_damping=2e-4)], ids=["dragged", "damped inside"])
def test_small_steps_agree_with_the_explicit_scheme(scene):
    """Gravity, a magnet in a gradient, both drags, internal damping: a quarter of the distance at half the step."""
    apart = []
    for step in (4e-5, 2e-5):
        explicit, implicit = (
            swung(scene, 0.02, GRADIENT, num_elements=3, time_step=step, integrator=name)
            for name in ("explicit", "implicit")
        )
        apart.append(np.abs(explicit.positions - implicit.positions).max())
    assert apart[1] < 2e-6
    assert apart[0] / apart[1] == pytest.approx(4.0, rel=0.2)


@pytest.mark.parametrize("integrator", IMPLICIT)
@pytest.mark.parametrize("name, elements, step, millimetres", [("niti", 4, 5e-3, 0.02), ("aluminium", 6, 2.5e-4, 0.15)])
def test_stiff_rods_follow_the_independent_reference(integrator, name, elements, step, millimetres):
    trial = next(each for each in precision.trials() if each.name == name)
    simulation = Simulation(loaded(trial.scene), num_elements=elements, integrator=integrator, time_step=step)
    tips = precision.trace(simulation, trial)
    assert 1e3 * np.sqrt(np.mean(np.sum((tips - STORED[f"{name}_tip"]) ** 2, axis=1))) < millimetres


@pytest.mark.parametrize("integrator, steps", [("implicit", 20_000), ("implicit4", 4_000)])
def test_energy_of_a_stiff_rod_stays(integrator, steps):
    """20,000 midpoint steps, a hundred times the stable step of the explicit scheme."""
    trial = next(each for each in precision.trials() if each.name == "aluminium")
    simulation = Simulation(loaded(trial.scene), num_elements=4, integrator=integrator)
    precision.begin(simulation, trial)
    start, seen = simulation.energy()[0], []
    for _ in range(20):
        simulation.advance(steps / 20 * simulation.time_step)
        seen.append(simulation.energy()[0])
    assert np.abs(np.array(seen) / start - 1.0).max() < 2e-4


@pytest.mark.parametrize("integrator", IMPLICIT)
def test_momentum_of_sections_without_loads_stays(integrator):
    """A rod of next to no stiffness, whose sections fly and tumble freely by 0.3 rad a step; to Newton's tolerance."""
    rod = Rod.circular(length=0.06, diameter=4e-3, density=1100.0, youngs_modulus=1e-16, poissons_ratio=0.5)
    options = {"num_elements": 3, "time_step": 0.05, "on_failure": "report"}  # the sections shear by more than half
    simulation = Simulation(loaded(Scene(rod=rod)), integrator=integrator, **options)
    rng = np.random.default_rng(1)
    simulation.set_motion(1e-3 * rng.normal(size=(1, 4, 3)), 5.0 * rng.normal(size=(1, 4, 3)))
    linear = simulation.linear_momentum()
    spins = [np.einsum("nij,nj->ni", simulation.rotations[0], simulation.rods.motion.momenta[0])]
    simulation.advance(0.2)
    spins.append(np.einsum("nij,nj->ni", simulation.rotations[0], simulation.rods.motion.momenta[0]))
    np.testing.assert_allclose(simulation.linear_momentum(), linear, rtol=1e-9)
    np.testing.assert_allclose(spins[1], spins[0], atol=1e-6 * np.abs(spins[0]).max())
    still = np.eye(3)[0] == 1.0
    assert np.abs(simulation.rotations[0, -1] - np.eye(3))[:, still].max() > 0.1


@pytest.mark.parametrize("integrator", IMPLICIT)
def test_a_motion_turned_round_goes_back_to_its_start(integrator):
    scene = dragged(load_scene("niti_guidewire").replace(drag_rate=None))
    simulation = Simulation(scene, num_elements=4, integrator=integrator, time_step=2e-3)
    simulation.advance(0.1, field=(0.0, 0.0, 10e-3))
    assert np.abs(simulation.tip_position[0] - (0.1, 0.0, 0.0)).max() > 1e-3
    simulation.set_motion(-simulation.velocities, -simulation.angular_velocities)
    simulation.advance(0.1)
    straight = np.zeros((5, 3))
    straight[:, 0] = simulation.arc_lengths
    np.testing.assert_allclose(simulation.positions[0], straight, atol=1e-7)


@pytest.mark.parametrize("integrator, micrometres", [("implicit", 40.0), ("implicit4", 0.3)])
def test_a_wire_under_strong_tension_follows_the_explicit_scheme(integrator, micrometres):
    """A weight pulls with 74 times what an element resists tilting with; 28 and 0.19 micrometres were found."""
    scene = dragged(LOADED["static_wire_with_weight"].scene)
    explicit = Simulation(scene, num_elements=2)
    simulation = Simulation(scene, num_elements=2, integrator=integrator, time_step=2e-3)
    for each in (explicit, simulation):
        each.advance(0.06)
    assert 1e6 * np.linalg.norm(simulation.tip_position[0] - explicit.tip_position[0]) < micrometres


def iterations(simulation, field, num_steps):
    """Newton iterations of every step of a rod in a field; MOST_ITERATIONS where a step is not solved."""
    batch, h, counts, before = simulation.rods.batch, simulation.time_step, [], 0.0
    lanes = len(batch.terms.lanes)
    batch.set_field(np.array([field]))
    scratch = np.zeros((simulation.num_elements + 1) * NODE * lanes)
    for _ in range(num_steps):
        predict(batch.blocks[0], scratch, batch.layout, batch.terms, h, before)
        count, last, solved = 0, 0.0, False
        while not solved and count < MOST_ITERATIONS:
            iterate(batch.blocks[0], scratch, batch.layout, batch.terms, None, h)
            largest = largest_increment(batch.blocks[0], scratch, batch.layout, lanes, batch.status, 0)
            solved = (largest / last if last > 0.0 else 1.0) * largest <= TOLERANCE * TOLERANCE
            count, last = count + 1, largest
        counts.append(count)
        finish(batch.blocks[0], scratch, batch.layout, batch.terms, h, before)
        before = h
    return np.array(counts)


@pytest.mark.parametrize("num_elements, step, mean", [(1, 5e-3, 4.0), (4, 2e-3, 3.4), (4, 5e-4, 2.8), (10, 2e-3, 3.5)])
def test_newtons_method_takes_a_few_iterations_for_a_wire_in_a_sudden_field(num_elements, step, mean):
    """Where a stiffness lacks the stretch along the inclined chord it takes 7, or fails."""
    scene = dragged(load_scene("niti_guidewire").replace(drag_rate=None))
    simulation = Simulation(scene, num_elements=num_elements, integrator="implicit", time_step=step)
    counts = iterations(simulation, (0.0, 0.0, 10e-3), round(0.1 / step))
    assert counts.max() < MOST_ITERATIONS // 2
    assert counts.mean() < mean


@pytest.mark.parametrize("integrator", IMPLICIT)
def test_an_equilibrium_stays(integrator):
    simulation = Simulation(SOFT, num_elements=4, integrator=integrator)
    simulation.reset(field=FIELD)
    before = simulation.positions
    simulation.advance(1.0)
    np.testing.assert_allclose(simulation.positions, before, atol=1e-10)


def test_rods_of_a_batch_move_as_single_ones():
    """To the tolerance of Newton's method, whose number of iterations a block of lanes shares."""
    fields = 1e-3 * np.random.default_rng(2).normal(size=(11, 3))
    options = dict(num_elements=3, integrator="implicit4", time_step=2e-3)
    many = Simulation(SOFT, num_rods=11, num_threads=2, **options)
    many.advance(0.1, field=fields)
    for rod in (0, 7, 10):
        one = Simulation(SOFT, **options)
        one.advance(0.1, field=fields[rod])
        np.testing.assert_allclose(one.positions[0], many.positions[rod], atol=1e-8)


def test_a_field_course_acts_in_the_middle_of_every_step():
    one, other = (Simulation(SOFT, num_elements=3, integrator="implicit", time_step=1e-2) for _ in range(2))
    one.advance(0.1, field=smooth)
    for step in range(10):
        other.advance(0.01, field=smooth((step + 0.5) * 0.01))
    np.testing.assert_allclose(one.positions, other.positions, atol=1e-9)


@pytest.mark.parametrize("integrator, parts", [("implicit", 64), ("implicit4", 12)])
def test_default_step_is_a_share_of_the_slowest_vibration(integrator, parts):
    simulation = Simulation(load_scene("niti_guidewire"), integrator=integrator)
    assert simulation.time_step * parts == pytest.approx(1.0 / simulation.natural_frequencies()[0])


def test_a_step_too_long_for_the_drag_is_refused_where_time_goes_back():
    assert Simulation(SOFT, integrator="implicit", time_step=0.5).stable_time_step == np.inf
    assert Simulation(SOFT, integrator="implicit4").stable_time_step == pytest.approx(0.1)
    with pytest.raises(ValueError, match=r"time_step must be at most 0\.1 s"):
        Simulation(SOFT, integrator="implicit4", time_step=0.2)


def test_a_step_that_cannot_be_solved_is_reported():
    wire = dragged(load_scene("niti_guidewire"))
    simulation = Simulation(wire, num_elements=1, integrator="implicit", time_step=0.5, on_failure="report")
    for sign in (1.0, -1.0) * 5:
        simulation.advance(0.5, field=(sign, -sign, 1.0))
    assert simulation.status[0] != 0


@pytest.mark.parametrize(
    "options, sentence",
    [
        ({"integrator": "midpoint"}, r"integrator must be one of 'explicit', 'implicit', 'implicit4', but got"),
        ({"integrator": "implicit", "element": "nodal"}, r"element must be 'helical' with integrator='implicit'"),
        ({"integrator": "implicit", "precision": "float32"}, r"precision must be 'float64' with integrator"),
        ({"integrator": "implicit", "tolerance": 1e-4}, r"tolerance must be None with integrator='implicit'"),
    ],
)
def test_what_an_implicit_integrator_cannot_do_is_refused(options, sentence):
    with pytest.raises(ValueError, match=sentence):
        Simulation(SOFT, **options)


def test_internal_damping_is_refused_where_time_goes_back():
    with pytest.raises(ValueError, match=r"internal_damping must be None with integrator=\"implicit4\""):
        Simulation(SOFT.replace(internal_damping=1e-3), integrator="implicit4")
