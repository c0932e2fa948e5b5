"""Linear models against the simulation itself, closed forms and each other; inverse statics against statics."""

import numpy as np
import pytest

from magrod_env import Magnet, Rod, Scene, Simulation, load_scene

SCENE = load_scene("paper5_circle", modulus="effective").replace(drag_rate=5.0, internal_damping=3e-3)
FIELD = np.array([1e-3, 3e-3, 7e-3])
DURATION = 0.02


@pytest.fixture(scope="module")
def model():
    return Simulation(SCENE, num_elements=4).linearise(FIELD, DURATION)


def deviation(simulation, model):
    """x of a simulation's state, by the definition in `LinearModel`, for small rotations."""
    state = simulation.state()
    turn = np.swapaxes(model.start.rotations, -1, -2) @ state.rotations
    spin = 0.5 * np.stack(
        [turn[..., 2, 1] - turn[..., 1, 2], turn[..., 0, 2] - turn[..., 2, 0], turn[..., 1, 0] - turn[..., 0, 1]], -1
    )
    poses = np.concatenate([state.positions - model.start.positions, spin], axis=-1)[0, 1:]
    return np.concatenate(
        [poses.ravel(), np.concatenate([state.velocities, state.angular_velocities], -1)[0, 1:].ravel()]
    )


def test_the_model_predicts_small_motions(model):
    """Ten steps under small random changes of the field: second-order effects are below 1 % of the motion."""
    simulation = Simulation(SCENE, num_elements=4)
    simulation.reset(field=FIELD)
    rng, x = np.random.default_rng(0), np.zeros(model.A.shape[1])
    start = simulation.tip_position[0]
    for _ in range(10):
        u = 2e-5 * rng.normal(size=3)
        simulation.advance(DURATION, field=FIELD + u)
        x = model.A[0] @ x + model.B[0] @ u
    moved = simulation.tip_position[0] - start
    assert np.linalg.norm(moved) > 2e-6
    np.testing.assert_allclose(model.C[0] @ x, moved, atol=0.01 * np.linalg.norm(moved))
    np.testing.assert_allclose(deviation(simulation, model), x, atol=0.02 * np.abs(x).max())


def test_its_rest_under_a_constant_field_is_the_static_jacobian(model):
    """Differences of steps and the solved tangent stiffness are two ways to the same derivative."""
    rest = np.linalg.solve(np.eye(model.A.shape[1]) - model.A[0], model.B[0])
    np.testing.assert_allclose(model.C[0] @ rest, model.static_jacobian[0], rtol=1e-6, atol=1e-7)


def test_the_static_jacobian_is_the_slope_of_equilibria(model):
    simulation, step = Simulation(SCENE, num_elements=4), 1e-6
    for axis in range(3):
        ahead, behind = (simulation.equilibrium(FIELD + sign * step * np.eye(3)[axis]) for sign in (1, -1))
        slope = (ahead.tip_position - behind.tip_position) / (2.0 * step)
        np.testing.assert_allclose(model.static_jacobian[0][:, axis], slope, rtol=1e-5, atol=1e-6)


def test_the_dynamic_jacobian_is_the_slope_of_a_step(model):
    tips = []
    for sign in (1, -1):
        simulation = Simulation(SCENE, num_elements=4)
        simulation.reset(field=FIELD)
        simulation.advance(DURATION, field=FIELD + sign * np.array([0.0, 0.0, 1e-5]))
        tips.append(simulation.tip_position[0])
    np.testing.assert_allclose(model.dynamic_jacobian[0][:, 2], (tips[0] - tips[1]) / 2e-5, rtol=1e-5, atol=1e-8)


def test_eigenvalues_are_those_of_the_natural_vibrations():
    """Undamped and without drag, A has exp(+-i omega T) of every vibration, the step's own frequency shift left aside:
    the first, whose shift (omega dt)^2/24 is below 1e-4.
    """
    scene = SCENE.replace(drag_rate=None, internal_damping=None, spin_drag_rate=None)
    simulation = Simulation(scene, num_elements=3)
    model = simulation.linearise(FIELD, 0.01)
    values = np.linalg.eigvals(model.A[0])
    np.testing.assert_allclose(np.abs(values), 1.0, atol=1e-5)
    first = 2.0 * np.pi * simulation.natural_frequencies(FIELD)[0]
    slowest = np.min(np.abs(np.angle(values)))
    assert slowest <= first * 0.01 * 1.001
    assert np.abs(np.angle(values) - first * 0.01).min() < 1e-4 * first * 0.01


@pytest.mark.parametrize("options", [{"plane": "xz"}, {"integrator": "implicit", "time_step": 1e-3}])
def test_planar_and_implicit_models_predict_too(options):
    simulation, field = Simulation(SCENE, num_elements=4, **options), np.array([1e-3, 0.0, 7e-3])
    model = simulation.linearise(field, DURATION)
    assert model.A.shape[1] == (24 if "plane" in options else 48)
    simulation.reset(field=field)
    start = simulation.tip_position[0]
    simulation.advance(DURATION, field=field + [0.0, 0.0, 1e-5])
    moved = simulation.tip_position[0] - start
    np.testing.assert_allclose(model.dynamic_jacobian[0][:, 2] * 1e-5, moved, atol=2e-3 * np.linalg.norm(moved))


def test_a_model_about_a_moving_state_predicts_its_neighbours():
    simulation = Simulation(SCENE, num_elements=4)
    simulation.advance(0.05, field=FIELD)
    state = simulation.state()
    model = simulation.linearise(FIELD, DURATION, state=state)
    assert model.static_jacobian is None
    simulation.advance(DURATION, field=FIELD)
    np.testing.assert_allclose(model.end.positions, simulation.positions, atol=1e-13)
    simulation.set_state(state)
    simulation.advance(DURATION, field=FIELD + [0.0, 1e-5, 0.0])
    moved = simulation.tip_position[0] - model.end.tip_position[0]
    np.testing.assert_allclose(model.dynamic_jacobian[0][:, 1] * 1e-5, moved, atol=2e-3 * np.linalg.norm(moved))


def test_rods_that_differ_have_models_of_their_own():
    simulation = Simulation(SCENE, num_rods=2, num_elements=3)
    simulation.set_parameters(modulus=[1.0, 1.5], moment=[1.0, 0.8], field_gain=[1.0, 1.1])
    both = simulation.linearise(FIELD, DURATION)
    rest = np.linalg.solve(np.eye(both.A.shape[1]) - both.A, both.B)
    np.testing.assert_allclose(both.C @ rest, both.static_jacobian, rtol=1e-6, atol=1e-7)
    assert np.abs(both.static_jacobian[0] - both.static_jacobian[1]).max() > 0.1


# ---- inverse statics


def test_fields_are_found_for_where_fields_have_held_the_tip():
    simulation = Simulation(SCENE, num_elements=4)
    rng = np.random.default_rng(1)
    fields = rng.normal(size=(64, 3)) * 6e-3
    targets = np.array([simulation.equilibrium(field).tip_position for field in fields])
    found = simulation.inverse_statics(targets)
    assert found.reached.all()
    assert found.distances.max() < 1e-6
    for field, target in zip(found.fields[::8], targets[::8], strict=True):
        np.testing.assert_allclose(simulation.equilibrium(field).tip_position, target, atol=1e-6)


def test_targets_out_of_reach_are_reported_and_approached():
    simulation = Simulation(SCENE, num_elements=4)
    tip = simulation.equilibrium(FIELD).tip_position
    targets = np.array([tip, 2.0 * tip, tip + [3e-3, 0.0, 0.0]])
    found = simulation.inverse_statics(targets, limit=0.03)
    assert found.reached.tolist() == [True, False, False]
    assert (np.linalg.norm(found.fields, axis=1) <= 0.03 * (1 + 1e-12)).all()
    assert found.distances[2] < 3e-3
    np.testing.assert_allclose(
        found.distances, np.linalg.norm(found.positions - [tip, 2 * tip, tip + [3e-3, 0, 0]], axis=1)
    )


def test_each_rod_of_a_batch_has_its_own_target_and_a_magnet_may_be_meant():
    scene = load_scene("paper6_two_magnets")
    simulation = Simulation(scene, num_rods=3, num_elements=6)
    simulation.set_parameters(
        modulus=[1.0, 1.2, 0.9], field_rotation=[[0.0, 0.1, 0.0], [0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]
    )
    fields = np.array([[1e-3, 0.0, 3e-3], [0.0, 2e-3, 4e-3], [1e-3, 1e-3, 1e-3]])
    for magnet in (0, 1):
        node = simulation.magnet_nodes[magnet]
        targets = np.array([simulation.equilibrium(fields[k], rod=k).positions[node] for k in range(3)])
        found = simulation.inverse_statics(targets, magnet=magnet)
        assert found.reached.all()
        for k in range(3):
            held = simulation.equilibrium(found.fields[k], rod=k).positions[node]
            np.testing.assert_allclose(held, targets[k], atol=1e-6)


def test_bad_targets_are_refused():
    simulation = Simulation(SCENE, num_rods=2)
    for targets, sentence in (([[0.0, 0.0]], "targets must be finite of shape"), (np.zeros((3, 3)), "one for each of")):
        with pytest.raises(ValueError, match=sentence):
            simulation.inverse_statics(targets)
    with pytest.raises(ValueError, match="magnet must be the number of one of 1 magnets"):
        simulation.inverse_statics(np.zeros((2, 3)), magnet=3)
    with pytest.raises(ValueError, match="scene must have a magnet"):
        Simulation(SCENE.replace(magnets=())).inverse_statics(np.zeros((1, 3)))


# ---- reactions


def test_the_clamp_bears_what_acts_on_a_rod_at_rest():
    """Weight and field torque, by their own formulas."""
    simulation = Simulation(SCENE, num_elements=8)
    simulation.reset(field=FIELD)
    reactions, scene = simulation.reactions(), SCENE
    weight = (scene.rod.mass + scene.magnets[0].mass) * np.array(scene.gravity)
    np.testing.assert_allclose(reactions.clamp_force[0], -weight, rtol=1e-9, atol=1e-12)
    free = simulation.node_masses[0][:, None] * np.array(scene.gravity)
    moment = np.cross(simulation.positions[0], free).sum(axis=0)
    dipole = simulation.rotations[0, -1] @ scene.magnets[0].dipole_moment
    np.testing.assert_allclose(reactions.clamp_moment[0], -(moment + np.cross(dipole, FIELD)), atol=1e-12)
    np.testing.assert_allclose(reactions.moments[0, 0, 0], -reactions.clamp_moment[0], atol=1e-14)


@pytest.mark.parametrize("damped", [False, True])
def test_the_clamp_changes_the_momentum(damped):
    """Force and moment of clamp, weight and field over one short step, by central differences: to its square."""
    scene = SCENE.replace(drag_rate=None, spin_drag_rate=None, internal_damping=1e-3 if damped else None)
    simulation = Simulation(scene, num_elements=6)
    simulation.advance(0.03, field=FIELD)
    step = 0.02 * simulation.time_step
    momenta, moments = [], []
    simulation.time_step = step
    state = simulation.state()
    for steps in (0, 2):
        simulation.set_state(state)
        for _ in range(steps):
            simulation.advance(step)
        momenta.append(simulation.linear_momentum()[0])
        moments.append(simulation.angular_momentum()[0])
    simulation.set_state(state)
    simulation.advance(step)
    reactions = simulation.reactions()
    free = simulation.node_masses[0][:, None] * np.array(scene.gravity)
    weight = free.sum(axis=0) + (scene.rod.mass + scene.magnets[0].mass - simulation.node_masses[0].sum()) * np.array(
        scene.gravity
    )
    force = reactions.clamp_force[0] + weight
    np.testing.assert_allclose((momenta[1] - momenta[0]) / (2 * step), force, atol=2e-3 * np.abs(force).max())
    dipole = simulation.rotations[0, -1] @ scene.magnets[0].dipole_moment
    acting = np.cross(simulation.positions[0], free).sum(axis=0) + np.cross(dipole, FIELD)
    total = reactions.clamp_moment[0] + acting
    np.testing.assert_allclose((moments[1] - moments[0]) / (2 * step), total, atol=2e-3 * np.abs(acting).max())


def test_curvature_and_moment_of_a_rod_bent_to_an_arc():
    """A dipole across the field at the tip bends a weightless rod with one moment all along: an arc, kappa = M/EI."""
    rod = Rod.circular(length=0.1, diameter=2e-3, density=1100.0, youngs_modulus=1e6, poissons_ratio=0.5)
    tip = Magnet.dipole(position=0.1, moment=1e-2, direction=(1.0, 0.0, 0.0))
    simulation = Simulation(Scene(rod=rod, magnets=(tip,)), num_elements=5)
    simulation.reset(field=(0.0, 0.0, 2e-3))
    reactions = simulation.reactions()
    turned = simulation.rotations[0, -1] @ tip.dipole_moment
    moment = np.cross(turned, (0.0, 0.0, 2e-3))
    np.testing.assert_allclose(reactions.forces[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(reactions.moments[0].reshape(-1, 3), np.tile(moment, (10, 1)), atol=1e-12)
    bend = np.tile(moment / rod.bending_stiffness, (5, 1))
    np.testing.assert_allclose(reactions.curvatures[0], bend, atol=1e-6 * np.abs(bend).max())
    np.testing.assert_allclose(reactions.arc_lengths, 0.02 * (np.arange(5) + 0.5))


@pytest.mark.parametrize("options", [{"plane": "xz"}, {"precision": "float32"}, {"element": "nodal"}])
def test_reactions_of_other_kinds_balance_the_weight(options):
    scene = SCENE.replace(internal_damping=None)
    simulation = Simulation(scene, num_rods=2, num_elements=6, **options)
    simulation.reset(field=(0.0, 0.0, 5e-3))
    weight = (scene.rod.mass + scene.magnets[0].mass) * 9.81
    tolerance = 1e-3 if "precision" in options else 1e-8
    np.testing.assert_allclose(simulation.reactions().clamp_force, [[0.0, 0.0, weight]] * 2, atol=tolerance * weight)
