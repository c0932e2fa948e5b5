"""The damping law: the minimiser of its cost, its deviation, its bound, and the sensitivities that it works on."""

import numpy as np
from scipy.optimize import minimize
from term_sets import dragged

from magrod_env import Simulation, load_scene
from magrod_env.estimation.damping_choice import DampingChoice
from magrod_env.estimation.damping_law import bounded_share, damping_deviation, law_gain
from magrod_env.estimation.history import Piece, state_rows
from magrod_env.rod.layout import AXIAL, BENDING, SHEAR, SWAY, TORSION

SCENE = dragged(load_scene("paper4_pdms_tip_magnet", modulus="effective"))
FRAME = 0.01
OPTIONS = dict(num_elements=4, plane="xz", num_threads=1)


# ---- the law


def test_law_is_the_minimiser_of_the_cost():
    rng = np.random.default_rng(0)
    M, e = rng.normal(size=(4, 3)), rng.normal(size=4)
    half = rng.normal(size=(4, 4))
    R, W = half @ half.T, rng.uniform(0.5, 2.0, size=3)

    def cost(K):
        return (e + M @ K) @ R @ (e + M @ K) + K @ (W * K)

    found = minimize(cost, np.zeros(3), method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-14, "maxiter": 9999})
    np.testing.assert_allclose(-law_gain(M, R, W) @ e, found.x, atol=1e-6)


def test_deviation_is_that_of_the_posterior():
    """Drawn: K from its prior, a noisy output; the law's error has the deviation that it claims."""
    rng = np.random.default_rng(1)
    M, W, noise = rng.normal(size=(2, 3)), np.array([1.0, 4.0, 0.25]), 0.7
    R = np.eye(2) / noise**2
    K = rng.normal(size=(200000, 3)) / np.sqrt(W)
    seen = K @ M.T + noise * rng.normal(size=(200000, 2))
    error = K - seen @ law_gain(M, R, W).T  # predicted minus measured with K = 0 is -seen
    np.testing.assert_allclose(error.std(axis=0), damping_deviation(M, R, W), rtol=0.01)


def test_step_is_shrunk_to_its_bound_and_no_further():
    assert bounded_share(np.array([1.0, -8.0]), np.array([2.0, 2.0])) == 0.25
    assert bounded_share(np.array([1.0, -1.0]), np.array([2.0, 2.0])) == 1.0


# ---- sensitivities


def choice_for(scene, masses_of, nodes, marker_nodes, **options):
    nodes, axes = np.repeat(nodes, 2), np.tile([0, 2], len(nodes))
    nudged = Simulation(scene, num_rods=1 + len(nodes), on_failure="report", **options)
    weights = (masses_of.node_masses[0, nodes] * 20.0) ** -2.0
    return DampingChoice(
        nudged,
        1,
        nodes=nodes,
        axes=axes,
        marker_nodes=np.array(marker_nodes),
        W=weights,
        weight=None,
        largest_change=1.0,
    )


def test_sensitivity_of_a_free_mass_over_many_steps():
    """dp/dK = -T^2 v/(2 m), half of what the one-step formula gives with T for dt."""
    options = dict(OPTIONS, num_elements=1, time_step=1e-4)
    model = Simulation(SCENE.replace(gravity=(0.0, 0.0, 0.0)), **options)
    model.rods.batch.use_node_damping()
    for stiffness in (AXIAL, SHEAR, BENDING, TORSION, SWAY):
        model.rods.batch.rows[:, model.rods.batch.layout.elements + stiffness] = 0.0
    velocity = np.array([0.05, 0.0, -0.2])
    model.set_motion(np.array([[[0, 0, 0], velocity]]))
    rows, piece_field = state_rows(model), np.zeros((1, 3))
    choice = choice_for(SCENE.replace(gravity=(0.0, 0.0, 0.0)), model, [1], [1], **options)
    for duration in (1e-3, 2e-2):
        _, M = choice.sensitivity(rows, [Piece(0.0, duration, piece_field, rows)], np.array([duration]))
        expected = np.zeros((3, 2))
        expected[[0, 2], [0, 1]] = -(duration**2) * velocity[[0, 2]] / (2.0 * model.node_masses[0, 1])
        np.testing.assert_allclose(M[0], expected, rtol=2e-4, atol=1e-9)


def test_sensitivity_is_the_derivative_of_the_simulators_positions():
    """Central differences with node dampings a hundred times larger; markers in the middle and at the tip."""
    model = Simulation(SCENE, **OPTIONS)
    model.reset(field=(0.0, 0.0, 20e-3))
    model.rods.batch.use_node_damping()
    model.advance(0.1, field=np.zeros(3))
    rows, field = state_rows(model), np.zeros((1, 3))
    choice = choice_for(SCENE, model, [1, 2, 3, 4], [2, 4], **OPTIONS)
    _, M = choice.sensitivity(rows, [Piece(0.0, FRAME, field, rows)], np.array([FRAME]))
    masses = model.node_masses[0]
    for column, (node, axis) in enumerate((n, a) for n in (1, 2, 3, 4) for a in (0, 2)):
        ends = []
        for sign in (1, -1):
            damping = np.zeros((1, 5, 3))
            damping[0, node, axis] = sign * 1e-2 * masses[node] / FRAME
            model.rods.batch.scatter(0, rows)
            model.rods.batch.set_node_damping(damping)
            model.advance(FRAME, field=np.zeros(3))
            ends.append(model.positions[0, [2, 4]].ravel())
        slope = (ends[0] - ends[1]) / (2e-2 * masses[node] / FRAME)
        np.testing.assert_allclose(M[0, :, column], slope, rtol=1e-2, atol=1e-3 * np.abs(M).max())
