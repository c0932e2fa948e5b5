"""The simulation as its users meet it: shapes, starts, snapshots, bad input, and scenes from soft to stiff."""

import copy
import pickle

import numpy as np
import pytest

from magrod_env import Magnet, Rod, Scene, Simulation, SimulationDiverged, StabilityError, load_scene, scene_names

SOFT = load_scene("paper4_pdms_tip_magnet").replace(drag_rate=5.0)
FIELDS = np.array([[0.0, 0.0, 8e-3], [2e-3, 3e-3, 5e-3], [1e-3, -4e-3, 7e-3]])


def batch(**options):
    return Simulation(SOFT, **{"num_rods": 3, "num_elements": 4, **options})


def everything(simulation):
    """All state that a user can see."""
    return (
        simulation.positions,
        simulation.rotations,
        simulation.velocities,
        simulation.angular_velocities,
        simulation.field,
        simulation.status,
        np.array(simulation.time),
    )


def assert_same(a, b):
    for one, other in zip(everything(a), everything(b), strict=True):
        np.testing.assert_array_equal(one, other)


# ---- what it shows


def test_shapes_of_everything_it_shows():
    simulation = batch()
    simulation.advance(0.02, field=FIELDS)
    shapes = {
        "positions": (3, 5, 3),
        "velocities": (3, 5, 3),
        "rotations": (3, 5, 3, 3),
        "angular_velocities": (3, 5, 3),
        "tip_position": (3, 3),
        "field": (3, 3),
        "status": (3,),
        "arc_lengths": (5,),
        "node_masses": (3, 5),
    }
    for name, shape in shapes.items():
        value = getattr(simulation, name)
        assert value.shape == shape, name
        assert value.dtype == (np.int64 if name == "status" else np.float64), name
    assert simulation.energy().shape == (3,)
    assert simulation.linear_momentum().shape == simulation.angular_momentum().shape == (3, 3)
    assert {part: energy.shape for part, energy in simulation.energies().items()} == dict.fromkeys(
        ("kinetic", "elastic", "gravitational", "magnetic"), (3,)
    )
    assert simulation.magnet_nodes == (4,)
    np.testing.assert_array_equal(simulation.tip_position, simulation.positions[:, -1])
    np.testing.assert_array_equal(simulation.field, FIELDS)


def test_what_it_shows_is_a_copy():
    simulation = batch()
    before = simulation.positions
    for name in (
        "positions",
        "velocities",
        "rotations",
        "angular_velocities",
        "tip_position",
        "field",
        "status",
        "arc_lengths",
    ):
        getattr(simulation, name)[...] = 7
    np.testing.assert_array_equal(simulation.positions, before)
    assert np.all(simulation.status == 0)
    assert np.all(simulation.field == 0.0)


def test_what_was_shown_does_not_change_with_the_simulation():
    simulation = batch()
    shown = [np.copy(x) for x in everything(simulation)]
    kept = everything(simulation)
    simulation.advance(0.01, field=FIELDS)
    for before, now in zip(shown, kept, strict=True):
        np.testing.assert_array_equal(before, now)


def test_rotations_are_rotations_and_the_clamp_stays():
    simulation = batch()
    simulation.advance(0.3, field=FIELDS)
    rotations = simulation.rotations
    np.testing.assert_allclose(
        rotations @ np.swapaxes(rotations, -1, -2), np.broadcast_to(np.eye(3), rotations.shape), atol=1e-14
    )
    np.testing.assert_array_equal(simulation.positions[:, 0], 0.0)
    np.testing.assert_array_equal(rotations[:, 0], np.broadcast_to(np.eye(3), (3, 3, 3)))
    np.testing.assert_array_equal(simulation.velocities[:, 0], 0.0)


def test_velocities_are_the_rates_of_positions_and_rotations():
    simulation = Simulation(SOFT, num_elements=4)
    simulation.advance(0.1, field=FIELDS[1])
    step = simulation.time_step
    states = []
    for _ in range(3):
        states.append(
            (
                simulation.positions[0],
                simulation.rotations[0],
                simulation.velocities[0],
                simulation.angular_velocities[0],
            )
        )
        simulation.advance(step)
    rate = (states[2][0] - states[0][0]) / (2 * step)
    np.testing.assert_allclose(states[1][2], rate, atol=0.02 * np.abs(rate).max())  # differences over two steps
    hat = np.swapaxes(states[1][1], -1, -2) @ (states[2][1] - states[0][1]) / (2 * step)
    spin = np.stack([hat[:, 2, 1], hat[:, 0, 2], hat[:, 1, 0]], axis=-1)
    np.testing.assert_allclose(states[1][3], spin, atol=0.1 * np.abs(spin).max())


# ---- starts


def test_it_starts_straight_and_at_rest():
    simulation = batch()
    assert simulation.time == 0.0
    np.testing.assert_allclose(simulation.positions[..., 0], np.tile(simulation.arc_lengths, (3, 1)), rtol=1e-15)
    assert np.all(simulation.positions[..., 1:] == 0.0)
    assert np.all(simulation.velocities == 0.0)
    assert np.all(simulation.angular_velocities == 0.0)


def test_reset_forgets_everything():
    fresh, used = batch(), batch()
    used.advance(0.05, field=FIELDS, gradient=0.1 * np.diag([1.0, -0.5, -0.5]))
    used.reset()
    assert_same(used, fresh)
    for simulation in (fresh, used):
        simulation.advance(0.02, field=FIELDS)
    np.testing.assert_allclose(used.positions, fresh.positions, atol=1e-13)


def test_reset_in_a_field_is_at_rest_there():
    simulation = batch()
    simulation.reset(field=FIELDS)
    before = simulation.positions
    np.testing.assert_array_equal(simulation.field, FIELDS)
    simulation.advance(0.1)
    np.testing.assert_allclose(simulation.positions, before, atol=1e-10)


def test_reset_where_no_stable_equilibrium_is_reached_says_so():
    scene = SOFT.replace(gravity=(0.0, 0.0, 0.0))
    with pytest.raises(StabilityError, match=r"at \[-0\.02, 0\.0, 0\.0\] T the rod loses stability .* % of the field"):
        Simulation(scene, num_elements=4).reset(field=(-20e-3, 0.0, 0.0))


def test_set_motion_gives_the_velocities_it_was_given():
    simulation = batch()
    rng = np.random.default_rng(0)
    velocities, spins = rng.normal(size=(2, 3, 5, 3))
    simulation.set_motion(velocities, spins)
    velocities[:, 0] = spins[:, 0] = 0.0  # the clamp does not move
    np.testing.assert_allclose(simulation.velocities, velocities, rtol=1e-15)
    np.testing.assert_allclose(simulation.angular_velocities, spins, rtol=1e-14)
    simulation.set_motion(velocities)
    assert np.all(simulation.angular_velocities == 0.0)


# ---- time


def test_time_is_the_sum_of_durations():
    simulation = batch()
    for duration in (0.01, 0.0, 0.0137, 1e-5):
        simulation.advance(duration)
    assert simulation.time == pytest.approx(0.0237 + 1e-5, rel=1e-12)


def test_a_constant_function_is_a_constant_field():
    called, constant = batch(), batch()
    called.advance(0.02, field=lambda t: FIELDS)
    constant.advance(0.02, field=FIELDS)
    # a function cuts every free rotation at the steps' ends, which in discrete time is not quite the same rotation
    np.testing.assert_allclose(called.positions, constant.positions, atol=1e-7)


def test_a_function_is_asked_in_the_middle_of_every_step():
    simulation, asked = Simulation(SOFT, num_elements=4, time_step=5e-5), []
    simulation.advance(0.01)
    simulation.advance(5 * 5e-5, field=lambda t: asked.append(t) or np.zeros(3))
    np.testing.assert_allclose(asked, 0.01 + 5e-5 * (np.arange(5) + 0.5), rtol=1e-12)


def test_a_field_is_kept_until_another_is_given():
    given, kept = batch(), batch()
    for _ in range(2):
        given.advance(0.01, field=FIELDS)
    kept.advance(0.01, field=FIELDS)
    kept.advance(0.01)
    assert_same(given, kept)


# ---- snapshots and copies


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_restore_goes_back_to_the_same_bits(precision):
    simulation = batch(precision=precision)
    simulation.advance(0.05, field=FIELDS)
    snapshot = simulation.snapshot()
    simulation.advance(0.05, field=-FIELDS)
    first = everything(simulation)
    simulation.restore(snapshot)
    simulation.advance(0.05, field=-FIELDS)
    for one, other in zip(everything(simulation), first, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_snapshot_goes_to_another_simulation_with_its_field_and_gradient():
    slope = 0.2 * np.diag([1.0, -0.5, -0.5])
    source, target = batch(), batch()
    source.advance(0.05, field=FIELDS, gradient=slope)
    target.restore(source.snapshot())
    assert_same(source, target)
    for simulation in (source, target):
        simulation.advance(0.05)
    assert_same(source, target)


def test_a_snapshot_is_not_touched_by_what_follows():
    simulation = batch()
    snapshot = simulation.snapshot()
    kept = copy.deepcopy(snapshot)
    simulation.advance(0.05, field=FIELDS)
    for name, value in kept.items():
        np.testing.assert_array_equal(snapshot[name], value)


def test_a_snapshot_of_another_size_is_refused():
    with pytest.raises(ValueError, match="snapshot must come from a simulation of the same scene and size"):
        batch().restore(batch(num_elements=5).snapshot())


@pytest.mark.parametrize("copied", [lambda s: pickle.loads(pickle.dumps(s)), copy.deepcopy], ids=["pickle", "deepcopy"])
def test_a_copy_goes_on_with_the_same_bits(copied):
    original = batch()
    original.advance(0.05, field=FIELDS)
    other = copied(original)
    assert_same(original, other)
    for simulation in (original, other):
        simulation.advance(0.05)
    assert_same(original, other)
    other.advance(0.01)
    assert other.time > original.time  # they share nothing


# ---- bad input

BAD_ARGUMENTS = [
    (dict(num_rods=0), "num_rods must be a whole number of 1 or more, but got 0"),
    (dict(num_rods=2.5), "num_rods must be a whole number"),
    (dict(num_elements=0), "num_elements must be a whole number of 1 or more, but got 0"),
    (dict(num_elements=True), "num_elements must be a whole number"),
    (dict(element="cubic"), "element must be one of 'helical', 'nodal', but got 'cubic'"),
    (dict(precision="float16"), "precision must be one of 'float64', 'float32', but got 'float16'"),
    (dict(on_failure="ignore"), "on_failure must be one of 'raise', 'report'"),
    (dict(plane="yz"), 'plane must be "xy", "xz" or None'),
    (dict(plane="xy"), "gravity must lie in the plane 'xy'"),
    (dict(time_step=1.0), "time_step must be at most"),
    (dict(time_step=0.0), "time_step must be a finite number > 0"),
    (dict(time_step=np.nan), "time_step must be a finite number > 0"),
    (dict(frequency_shaping=True), "frequency_shaping must be False with element='helical'"),
]


@pytest.mark.parametrize(("options", "sentence"), BAD_ARGUMENTS)
def test_a_bad_argument_gets_one_sentence(options, sentence):
    with pytest.raises(ValueError) as error:
        batch(**options)
    assert str(error.value).startswith(sentence)
    assert str(error.value).endswith(".")


def test_what_is_no_scene_is_refused():
    with pytest.raises(ValueError, match="scene must be a Scene, but got 'paper4"):
        Simulation("paper4_pdms_tip_magnet")


def test_internal_damping_needs_the_helical_element():
    with pytest.raises(ValueError, match='internal_damping must be None with element="nodal"'):
        Simulation(SOFT.replace(internal_damping=1e-3), element="nodal")


def test_fewer_elements_than_segments_are_refused():
    with pytest.raises(ValueError, match="num_elements must be at least 2"):
        Simulation(load_scene("paper6_two_magnets"), num_elements=1)


def test_a_magnet_across_the_plane_is_refused():
    scene = SOFT.replace(magnets=(Magnet.dipole(position=SOFT.rod.length, moment=1e-3, direction=(0, 1, 0)),))
    with pytest.raises(ValueError, match="direction of a magnet must lie in the plane 'xz'"):
        Simulation(scene, plane="xz")


BAD_FIELDS = [
    [np.nan, 0.0, 0.0],
    [np.inf, 0.0, 0.0],
    [0.0, 0.0],
    np.zeros((2, 3)),
    np.zeros((3, 3, 1)),
    np.zeros((5, 3)),
]


@pytest.mark.parametrize("field", BAD_FIELDS, ids=["nan", "inf", "two_numbers", "two_rods", "three_axes", "five_rods"])
def test_a_bad_field_is_refused_and_nothing_moves(field):
    simulation = batch()
    for act in (simulation.advance, lambda d, field: simulation.reset(field=field)):
        with pytest.raises(ValueError, match=r"field must be finite of shape \(3,\) or \(3, 3\)"):
            act(0.01, field=field)
        assert simulation.time == 0.0
        np.testing.assert_array_equal(simulation.field, 0.0)


def test_a_function_that_returns_a_bad_field_is_refused():
    with pytest.raises(ValueError, match="field must be finite"):
        batch().advance(0.01, field=lambda t: [np.nan] * 3)


def test_a_field_that_leaves_the_plane_is_refused():
    simulation = Simulation(SOFT, num_elements=4, plane="xz")
    with pytest.raises(ValueError, match="field must lie in the plane 'xz'"):
        simulation.advance(0.01, field=(0.0, 1e-3, 0.0))
    simulation.advance(0.01, field=(1e-3, 0.0, 1e-3))


@pytest.mark.parametrize("gradient", [np.zeros(3), np.full((3, 3), np.nan), np.zeros((2, 3, 3))])
def test_a_bad_gradient_is_refused(gradient):
    with pytest.raises(ValueError, match=r"gradient must be finite of shape \(3, 3\)"):
        batch().advance(0.01, gradient=gradient)


def test_a_gradient_that_leaves_the_plane_is_refused():
    simulation = Simulation(SOFT, num_elements=4, plane="xz")
    with pytest.raises(ValueError, match="gradient"):
        simulation.advance(0.01, gradient=np.array([[0.0, 0.5, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.0]]))


@pytest.mark.parametrize("duration", [-0.01, np.nan, np.inf, "1"])
def test_a_bad_duration_is_refused(duration):
    with pytest.raises(ValueError, match="duration must be a finite number >= 0"):
        batch().advance(duration)


@pytest.mark.parametrize("shape", [(5, 3), (3, 4, 3), (3, 5)])
def test_a_motion_of_another_shape_is_refused(shape):
    with pytest.raises(ValueError, match=r"velocities must be finite of shape \(3, 5, 3\)"):
        batch().set_motion(np.zeros(shape))


def test_a_motion_that_leaves_the_plane_is_refused():
    simulation = Simulation(SOFT, num_elements=4, plane="xz")
    velocities = np.zeros((1, 5, 3))
    velocities[0, 2, 1] = 0.1
    with pytest.raises(ValueError, match="velocities"):
        simulation.set_motion(velocities)


# ---- from soft to stiff


@pytest.mark.parametrize("name", scene_names())
def test_every_scene_runs(name):
    """Under its own weight and, with magnets, in 5 mT; absent terms as zeros, to compile few kernels."""
    scene = load_scene(name)
    scene = scene.replace(gravity=scene.gravity or (0.0, 0.0, 0.0), drag_rate=scene.drag_rate or 0.0)
    simulation = Simulation(scene, num_elements=4)
    simulation.advance(3000 * simulation.time_step, field=(0.0, 2e-3, 5e-3) if scene.magnets else None)
    assert simulation.status[0] == 0
    reach = np.linalg.norm(simulation.positions[0], axis=1)
    assert np.all(reach <= 1.05 * simulation.arc_lengths)


def test_a_guidewire_comes_to_rest_in_the_arc_of_its_tip_couple():
    """theta = m B L cos(theta)/EI, at steps of a microsecond; the field rises in parts so that it rings little."""
    scene = load_scene("niti_guidewire").replace(gravity=(0.0, 0.0, 0.0), drag_rate=190.0)
    simulation = Simulation(scene, num_elements=3)
    for part in np.linspace(0.05, 1.0, 20):
        simulation.advance(4e-3, field=(0.0, 0.0, part * 20e-3))
    simulation.advance(0.12)
    strength = scene.magnets[0].moment * 20e-3 * scene.rod.length / scene.rod.bending_stiffness
    theta = strength
    for _ in range(50):
        theta = strength * np.cos(theta)
    exact = scene.rod.length / theta * np.array([np.sin(theta), 0.0, 1.0 - np.cos(theta)])
    np.testing.assert_allclose(simulation.tip_position[0], exact, atol=2e-6)


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_field_that_turns_round_snaps_the_rod_over(precision):
    """From aligned to opposed: the straight rod is unstable there and swings over to the mirror image of its arc."""
    scene = SOFT.replace(gravity=(0.0, 0.0, 0.0), drag_rate=40.0)
    simulation = Simulation(scene, num_elements=6, precision=precision)
    simulation.advance(0.2, field=(10e-3, 0.0, 0.5e-3))
    simulation.advance(2.0, field=(-10e-3, 0.0, 0.5e-3))
    assert simulation.status[0] == 0
    moment, L, stiffness = scene.magnets[0].moment, scene.rod.length, scene.rod.bending_stiffness
    strength, alpha = np.hypot(10e-3, 0.5e-3) * moment * L / stiffness, np.arctan2(0.5e-3, -10e-3)
    assert strength > 1.0
    theta = alpha
    for _ in range(200):
        theta -= (theta - strength * np.sin(alpha - theta)) / (1.0 + strength * np.cos(alpha - theta))
    exact = L / theta * np.array([np.sin(theta), 0.0, 1.0 - np.cos(theta)])
    np.testing.assert_allclose(simulation.tip_position[0], exact, atol=2e-5)


def test_one_element_without_gravity_swings_like_a_pendulum_of_its_stiffness():
    """A small push in plane: the first natural frequency, by the time between zeros of the tip's height."""
    scene = SOFT.replace(gravity=(0.0, 0.0, 0.0), drag_rate=0.0)
    simulation = Simulation(scene, num_elements=1)
    stiffness, inertia = simulation._static.linearise(None)
    velocities = np.zeros((1, 2, 3))
    keep = [2, 4]
    shape = np.linalg.solve(stiffness[np.ix_(keep, keep)], [1.0, 0.0])  # nearly the first mode
    velocities[0, 1, 2] = 1e-3
    spins = np.zeros((1, 2, 3))
    spins[0, 1, 1] = 1e-3 * shape[1] / shape[0]
    simulation.set_motion(velocities, spins)
    frequency = simulation.natural_frequencies()[0]
    step, seen = 0.002 / frequency, []
    for _ in range(5000):
        simulation.advance(step)
        seen.append(simulation.tip_position[0, 2])
    seen = np.array(seen)
    up = np.flatnonzero((seen[:-1] < 0) & (seen[1:] >= 0))
    crossings = up + seen[up] / (seen[up] - seen[up + 1])
    np.testing.assert_allclose(1.0 / (np.diff(crossings).mean() * step), frequency, rtol=2e-3)


def test_a_field_far_too_strong_is_refused_or_reported_never_wrong():
    simulation = Simulation(SOFT, num_elements=4)
    with pytest.raises((ValueError, SimulationDiverged)):
        simulation.advance(0.5, field=(0.0, 10.0, 0.0))


@pytest.mark.parametrize("modulus", [1e3, 1e12])
def test_moduli_from_jelly_to_beyond_steel_run(modulus):
    """The step follows the stiffness; the jelly hangs down, the steel stays straight."""
    rod = Rod.circular(length=0.06, diameter=4e-3, density=1000.0, youngs_modulus=modulus, poissons_ratio=0.3)
    magnet = Magnet.dipole(position=0.06, moment=1e-6, mass=1e-6)
    scene = Scene(rod=rod, magnets=(magnet,), gravity=(0.0, 0.0, -9.81), drag_rate=5.0)
    simulation = Simulation(scene, num_elements=10)
    simulation.advance(2000 * simulation.time_step)
    assert simulation.status[0] == 0
    tip = simulation.tip_position[0]
    assert (tip[2] < -0.02) if modulus < 1e4 else (abs(tip[2]) < 1e-6)
