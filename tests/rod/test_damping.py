"""Internal damping against dense matrices, the decay of vibrations, and what it may never do."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from term_sets import damped as all_terms
from term_sets import dragged

from magrod_env import Simulation, load_scene
from magrod_env.magnetics import FieldCourse
from magrod_env.rod.damping import damp, damping_rows, freedoms_of, share_due

SOFT = dragged(load_scene("paper4_pdms_tip_magnet", modulus=1.48e6))
WEIGHTLESS = SOFT.replace(gravity=(0.0, 0.0, 0.0))
TIME = 2e-3  # s, Kelvin-Voigt
BENT = (0.0, 20e-3, 30e-3)  # T
RISE = np.sin(np.linspace(0.0, 0.5 * np.pi, 501)) ** 2


def damped(scene=WEIGHTLESS, time=TIME, **options):
    return Simulation(all_terms(scene.replace(internal_damping=time)), **{"num_elements": 4, **options})


def shaken(simulation, seed=0):
    """The simulation in a bent shape, its nodes moving at random; in the plane, if it has one."""
    rng, shape = np.random.default_rng(seed), (simulation.num_rods, simulation.num_elements + 1, 3)
    velocities, spins = rng.normal(size=shape), 30.0 * rng.normal(size=shape)
    if simulation.plane == "xz":
        velocities[..., 1] = spins[..., 0] = spins[..., 2] = 0.0
    simulation.reset(field=BENT if simulation.plane is None else (0.0, 0.0, 30e-3))
    simulation.set_motion(velocities, spins)
    return simulation


def damp_for(simulation, span):
    """Let only the damping act, for a span of time (s)."""
    batch = simulation.rods.batch
    planar, lanes = batch.terms.planar, len(batch.terms.lanes)
    scratch = np.zeros(simulation.num_elements * damping_rows(freedoms_of(planar)) * lanes, batch.dtype)
    for block in batch.blocks:
        damp(block, scratch, batch.layout, batch.terms, planar, span)


def motion(simulation):
    """Velocities and angular velocities in the world frame of the free nodes, flat."""
    spins = np.einsum("nij,nj->ni", simulation.rotations[0, 1:], simulation.angular_velocities[0, 1:])
    return np.concatenate([simulation.velocities[0, 1:], spins], axis=1).ravel()


def hat(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def dense(simulation):
    """Mass and damping matrices of the free nodes in the present shape, from their definitions."""
    rod, n = simulation.scene.rod, simulation.num_elements
    h, positions, rotations = np.diff(simulation.arc_lengths), simulation.positions[0], simulation.rotations[0]
    mass, damping = np.zeros((6 * n, 6 * n)), np.zeros((6 * n + 6, 6 * n + 6))
    for node in range(1, n + 1):
        part = 6 * (node - 1)
        inertia = 0.5 / simulation.rods.motion.compliance[0, node]
        mass[part : part + 3, part : part + 3] = simulation.node_masses[0, node] * np.eye(3)
        mass[part + 3 : part + 6, part + 3 : part + 6] = rotations[node] @ np.diag(inertia) @ rotations[node].T
    EA, GA, EI, GJ = rod.axial_stiffness, rod.shear_stiffness, rod.bending_stiffness, rod.torsional_stiffness
    for e in range(n):
        half = Rotation.from_matrix(rotations[e].T @ rotations[e + 1]).as_rotvec() / 2
        middle = rotations[e] @ Rotation.from_rotvec(half).as_matrix()
        chord = (positions[e + 1] - positions[e]) / h[e]
        rates = np.zeros((6, 12))
        rates[:3, 6:9], rates[:3, :3] = np.eye(3) / h[e], -np.eye(3) / h[e]
        rates[:3, 3:6] = rates[:3, 9:12] = hat(chord) / 2
        rates[3:, 9:12], rates[3:, 3:6] = np.eye(3) / h[e], -np.eye(3) / h[e]
        rates = np.kron(np.eye(2), middle.T) @ rates
        corrected = 1.0 / (1.0 / GA + h[e] ** 2 / (12.0 * EI))
        stiff = h[e] * np.diag([EA, corrected, corrected, GJ, EI, EI])
        damping[6 * e : 6 * e + 12, 6 * e : 6 * e + 12] += TIME * rates.T @ stiff @ rates
    return mass, damping[6:, 6:]


def test_a_short_span_is_the_exponential_of_the_dense_matrices():
    """Of second order: the error falls eightfold a span, where the span resolves the stiffest damped motion."""
    simulation = shaken(damped())
    mass, damping = dense(simulation)
    rate = np.linalg.solve(mass, damping)
    fastest = np.abs(np.linalg.eigvals(rate)).max()
    start, state, errors = motion(simulation), simulation.state(), []
    for share in (0.1, 0.05, 0.025):
        simulation.set_state(state)
        damp_for(simulation, share / fastest)
        errors.append(np.abs(motion(simulation) - expm(-share / fastest * rate) @ start).max() / np.abs(start).max())
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 3.0, atol=0.15)


@pytest.mark.parametrize("span", [1e-6, 1e-4, 1e-2, 1.0])
def test_any_span_is_the_rational_function_of_the_dense_matrices(span):
    """(1 - G)(1 - (1 + sqrt 2) G) with G = (M + c D)^-1 c D, c = (1 - 1/sqrt 2) span."""
    simulation = shaken(damped())
    mass, damping = dense(simulation)
    share = (1.0 - np.sqrt(0.5)) * span
    g = np.linalg.solve(mass + share * damping, share * damping)
    eye = np.eye(len(g))
    expected = (eye - g) @ (eye - (1.0 + np.sqrt(2.0)) * g) @ motion(simulation)
    start = np.abs(motion(simulation)).max()
    damp_for(simulation, span)
    np.testing.assert_allclose(motion(simulation), expected, atol=1e-11 * start)


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("plane", [None, "xz"])
def test_no_span_and_no_damping_adds_energy(plane, precision):
    for time in (1e-6, 1e-3, 10.0):
        simulation = shaken(damped(time=time, plane=plane, precision=precision))
        state, before = simulation.state(), simulation.energies()["kinetic"][0]
        for span in (1e-7, 1e-5, 1e-3, 0.1, 1e3):
            simulation.set_state(state)
            damp_for(simulation, span)
            assert simulation.energies()["kinetic"][0] <= before * (1.0 + 1e-6)


def test_damping_in_a_plane_is_that_in_space():
    flat, space = (shaken(damped(plane=plane)) for plane in ("xz", None))
    space.reset(shape=(flat.positions, flat.rotations))
    space.set_motion(flat.velocities, flat.angular_velocities)
    for simulation in (flat, space):
        damp_for(simulation, 1e-3)
    np.testing.assert_allclose(flat.velocities, space.velocities, atol=1e-13)
    np.testing.assert_allclose(flat.angular_velocities, space.angular_velocities, atol=1e-10)


def test_single_precision_keeps_slow_motion():
    """A solution in float32 may not brake a motion that hardly strains the rod: one that turns about the clamp."""
    kept = []
    for precision in ("float32", "float64"):
        simulation = damped(precision=precision)
        velocities, spins = np.zeros((2, 1, 5, 3))
        velocities[0, :, 2], spins[0, 1:, 1] = simulation.positions[0, :, 0], -1.0  # bends the first element only
        simulation.set_motion(velocities, spins)
        damp_for(simulation, 1e-6)
        kept.append(motion(simulation))
    np.testing.assert_allclose(kept[0], kept[1], atol=2e-5)


# ---- in a run


@pytest.mark.parametrize("loss", [0.002, 0.02, 0.1])
@pytest.mark.parametrize("num_elements", [4, 10])
def test_vibrations_decay_at_half_the_time_times_their_frequency_squared(loss, num_elements):
    """Every mode of the straight rod whose free vibration is one (damping ratio below 0.4), at the default step."""
    plain = Simulation(WEIGHTLESS, num_elements=num_elements)
    time = loss / (2.0 * np.pi * plain.natural_frequencies()[0])
    simulation = damped(time=time, num_elements=num_elements)
    stiffness, inertia = simulation.rods.model.static.linearise(None)
    root = 1.0 / np.sqrt(inertia)
    squares, shapes = np.linalg.eigh(root[:, None] * stiffness * root)
    for square, shape in zip(squares[: 2 * num_elements], shapes.T, strict=False):
        ratio = 0.5 * time * np.sqrt(square)
        if ratio > 0.4:
            break
        shape = (root * shape).reshape(num_elements, 6)
        size = max(np.abs(shape[:, :3]).max() / 0.06, np.abs(shape[:, 3:]).max())
        moving = np.zeros((2, 1, num_elements + 1, 3))
        moving[:, 0, 1:] = 1e-6 * np.sqrt(square) / size * np.stack([shape[:, :3], shape[:, 3:]])
        simulation.reset()
        simulation.set_motion(*moving)
        start = np.concatenate([simulation.velocities, simulation.angular_velocities], axis=-1)[0, 1:]
        period = 2.0 * np.pi / np.sqrt(square * (1.0 - ratio**2))
        periods = max(1, min(20, int(1.0 / (6.0 * ratio))))
        simulation.advance(periods * period)
        end = np.concatenate([simulation.velocities, simulation.angular_velocities], axis=-1)[0, 1:]
        left = (inertia.reshape(-1, 6) * start * end).sum() / (inertia.reshape(-1, 6) * start * start).sum()
        np.testing.assert_allclose(-np.log(left) / (periods * period), 0.5 * time * square, rtol=0.01)


def test_a_damped_run_is_of_second_order_in_time():
    """Whatever remains of a group of steps: none of these is a multiple of the group. A field that rises smoothly: a
    sudden one excites motions that no step resolves; damping that is stiff against the span costs order, not accuracy.
    """
    scene = SOFT.replace(drag_rate=5.0)

    def tip(steps):
        simulation = damped(scene, time=5e-5, time_step=0.05 / steps)
        simulation.reset(field=(0.0, 0.0, 0.0))
        rise = FieldCourse(times=np.linspace(0.0, 0.05, 501), fields=RISE[:, None] * np.array([0.0, 5e-3, 8e-3]))
        simulation.advance(0.05, field=rise)
        return simulation.tip_position[0]

    finest = tip(9601)
    errors = [np.linalg.norm(tip(steps) - finest) for steps in (601, 1201, 2401)]
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2.0, atol=0.3)


@pytest.mark.parametrize("num_steps", [1, 2, 3, 7, 8, 9, 16, 21])
def test_each_step_is_damped_once(num_steps):
    due = np.array([share_due(boundary, num_steps) for boundary in range(num_steps + 1)])
    assert due.sum() == num_steps
    whole = due[: 8 * (num_steps // 8) + 1]
    np.testing.assert_array_equal(np.flatnonzero(whole[: 8 * (num_steps // 8)]) % 8, 4)


def test_zero_damping_changes_nothing_but_rounding():
    plain, none = Simulation(SOFT, num_elements=4), damped(SOFT, time=0.0)
    for simulation in (plain, none):
        simulation.advance(0.05, field=(0.0, 5e-3, 8e-3))
    np.testing.assert_allclose(
        none.positions, plain.positions, atol=1e-9
    )  # where damped, a free rotation is cut in two


def test_rods_of_a_batch_are_damped_like_single_ones():
    rods = damped(SOFT, num_rods=9)
    fields = 8e-3 * np.random.default_rng(2).normal(size=(9, 3))
    rods.advance(0.02, field=fields)
    for rod in (0, 8):
        single = damped(SOFT)
        single.advance(0.02, field=fields[rod])
        np.testing.assert_allclose(rods.positions[rod], single.positions[0], atol=1e-13)
