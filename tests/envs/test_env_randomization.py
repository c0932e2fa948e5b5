"""Domain randomisation: what is drawn, that it reaches the rod, and that nothing else changes."""

import dataclasses

import numpy as np
import pytest
from rollouts import FEW, assert_same, run, scripted_actions

from magrod_env.envs import MagRodEnv, MagRodVectorEnv, Randomization
from magrod_env.rod.layout import AXIAL, DRAG, ELEMENT_ROWS, GRAVITY, LENGTH

scipy_stats = pytest.importorskip("scipy.stats")
pytestmark = pytest.mark.filterwarnings("error")

MANY = 512  # environments: Kolmogorov-Smirnov then sees a density that is wrong by a tenth


def batch_of(task="reach", num_envs=MANY, **spread):
    batch = MagRodVectorEnv(task, num_envs, num_elements=FEW[task], randomization=Randomization(**spread))
    batch.reset(seed=0)
    return batch


def moduli(core):
    return core.batch.gather(core.batch.layout.elements + AXIAL, 1)[:, 0] / core.scene.rod.axial_stiffness


def densities(core):
    """Factor of the rod's mass: the tip node's without its magnet."""
    rows, nodes = core.batch.node_rows, core.batch.layout.nodes
    inverse = core.batch.gather(nodes + rows.size + rows.inverse_mass, 1)[:, 0]  # node 1 carries no magnet
    nominal = MagRodEnv("reach", num_elements=core.num_elements).core
    return nominal.batch.gather(nodes + rows.size + rows.inverse_mass, 1)[0, 0] / inverse


def drags(core):
    return core.batch.gather(DRAG, 1)[:, 0] / core.scene.drag_rate


def remanences(core):
    moments = np.linalg.norm(core.batch.gather(core.batch.layout.magnets, 3), axis=1)
    return moments / core.scene.magnets[0].moment


def gains(core):
    return np.cbrt(np.linalg.det(core.episodes.mixing))


def angles_of(matrices):
    return np.arccos(np.clip((np.trace(matrices, axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0))


RELATIVE = {"modulus": moduli, "density": densities, "drag": drags, "remanence": remanences, "field_gain": gains}


@pytest.mark.parametrize("name", RELATIVE)
def test_factor_is_uniform_within_its_bounds(name):
    """In [1 - x, 1 + x], and only this quantity differs."""
    core = batch_of(**{name: 0.2}).core
    for other, measure in RELATIVE.items():
        found = measure(core)
        if other == name:
            assert found.min() >= 0.8 - 1e-12 and found.max() <= 1.2 + 1e-12
            assert scipy_stats.kstest(found, "uniform", (0.8, 0.4)).pvalue > 0.01
        else:
            np.testing.assert_allclose(found, 1.0, rtol=0, atol=1e-12)


def test_misalignment_angle_is_uniform_and_its_axis_of_any_direction():
    mixing = batch_of(field_misalignment=0.4).core.episodes.mixing
    assert scipy_stats.kstest(angles_of(mixing), "uniform", (0.0, 0.4)).pvalue > 0.01
    axes = np.stack([mixing[:, 2, 1], mixing[:, 0, 2], mixing[:, 1, 0]], axis=1) - np.stack(
        [mixing[:, 1, 2], mixing[:, 2, 0], mixing[:, 0, 1]], axis=1
    )
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    for component in axes.T:  # Archimedes: each coordinate of a random direction is uniform in [-1, 1]
        assert scipy_stats.kstest(component, "uniform", (-1.0, 2.0)).pvalue > 0.01


def test_gravity_tilts_by_a_uniform_angle_at_any_heading():
    core = batch_of(gravity_direction=0.3).core
    gravity = core.batch.gather(GRAVITY, 3)
    np.testing.assert_allclose(np.linalg.norm(gravity, axis=1), 9.81, rtol=1e-12)
    tilt, heading = np.arccos(-gravity[:, 2] / 9.81), np.arctan2(gravity[:, 1], gravity[:, 0])
    assert scipy_stats.kstest(tilt, "uniform", (0.0, 0.3)).pvalue > 0.01
    assert scipy_stats.kstest(heading, "uniform", (-np.pi, 2.0 * np.pi)).pvalue > 0.01


def test_initial_field_is_uniform_on_each_coil_axis():
    batch = batch_of(initial_field=2e-3)
    field = batch.reset(seed=0)[1]["field_applied"]
    for axis in (1, 2):
        assert scipy_stats.kstest(field[:, axis], "uniform", (-2e-3, 4e-3)).pvalue > 0.01


def test_middle_magnet_moves_and_the_tip_magnet_does_not():
    core = batch_of("two_magnet", magnet_position=3e-3).core
    layout = core.batch.layout
    lengths = np.stack(
        [core.batch.gather(layout.elements + ELEMENT_ROWS * e + LENGTH, 1)[:, 0] for e in range(core.num_elements)],
        axis=1,
    )
    np.testing.assert_allclose(lengths.sum(axis=1), core.scene.rod.length, rtol=1e-12)
    middle_node = min(layout.magnet_nodes)
    place = lengths[:, :middle_node].sum(axis=1) - min(magnet.position for magnet in core.scene.magnets)
    assert scipy_stats.kstest(place, "uniform", (-3e-3, 6e-3)).pvalue > 0.01


def test_draws_are_independent_of_each_other():
    """Correlations within four standard errors of none."""
    core = batch_of(modulus=0.2, density=0.2, drag=0.2, remanence=0.2, field_gain=0.2).core
    found = np.array([measure(core) for measure in RELATIVE.values()])
    correlations = np.corrcoef(found)[np.triu_indices(len(found), 1)]
    assert np.abs(correlations).max() < 4.0 / np.sqrt(MANY)


def test_rods_are_drawn_anew_at_every_reset_and_kept_within_an_episode():
    batch = batch_of(num_envs=4, modulus=0.2, drag=0.2, field_gain=0.1)
    before = [measure(batch.core) for measure in (moduli, drags, gains)]
    for actions in scripted_actions(batch.action_space, 5):
        batch.step(actions)
    assert_same([measure(batch.core) for measure in (moduli, drags, gains)], before)
    batch.reset()
    for measure, old in zip((moduli, drags, gains), before, strict=True):
        assert not np.any(measure(batch.core) == old)


@pytest.mark.parametrize(
    "spread",
    [
        {"modulus": 0.2},
        {"density": 0.2},
        {"drag": 0.9},
        {"remanence": 0.2},
        {"field_gain": 0.2},
        {"field_misalignment": 0.2},
        {"gravity_direction": 0.2},
        {"initial_field": 5e-3},
    ],
    ids=lambda spread: next(iter(spread)),
)
def test_each_quantity_changes_the_motion(spread):
    """Against the nominal rod under the same actions, by more than 0.1 mm within 0.2 s."""
    env, nominal = (MagRodEnv("circle", num_elements=3, randomization=made) for made in (Randomization(**spread), None))
    actions = scripted_actions(env.action_space, 10)
    got, want = run(env, actions, 1), run(nominal, actions, 1)
    apart = [np.linalg.norm(a[-1]["tip_position"] - b[-1]["tip_position"]) for a, b in zip(got, want, strict=True)]
    assert max(apart) > 1e-4


def test_magnet_position_changes_the_motion():
    env, nominal = (
        MagRodEnv("two_magnet", num_elements=6, randomization=made)
        for made in (Randomization(magnet_position=3e-3), None)
    )
    actions = scripted_actions(env.action_space, 10)
    apart = run(env, actions, 1)[-1][-1]["tip_position"] - run(nominal, actions, 1)[-1][-1]["tip_position"]
    assert np.linalg.norm(apart) > 1e-4


def test_no_spread_is_the_nominal_rod():
    plain = MagRodEnv("circle", num_elements=3)
    zero = MagRodEnv("circle", num_elements=3, randomization=Randomization())
    actions = scripted_actions(plain.action_space, 5)
    assert_same(run(zero, actions, 3), run(plain, actions, 3))


@pytest.mark.parametrize("task", ["circle", "planar_reach", "two_magnet"])
def test_vanishing_spread_is_the_nominal_rod_to_rounding(task):
    """Rods made one by one, and copies of the nominal one, move alike: their statics differ by rounding, 1e-15 m, which
    hard driving spreads to less than 1e-11 m in 0.2 s.
    """
    few = FEW[task]
    plain = MagRodEnv(task, num_elements=few)
    spread = MagRodEnv(
        task, num_elements=few, randomization=Randomization(modulus=1e-13), time_step=plain.core.time_step
    )
    actions = scripted_actions(plain.action_space, 10)
    for got, want in zip(run(spread, actions, 3), run(plain, actions, 3), strict=True):
        for key in ("tip_position", "target", "field_applied"):
            np.testing.assert_allclose(got[-1][key], want[-1][key], rtol=0, atol=1e-9, err_msg=key)


def rolled(env, actions):
    return np.array([result[-1]["tip_position"] for result in run(env, actions, 11)])


def test_drawn_rod_moves_like_a_scene_with_the_drawn_values():
    """Modulus, density, drag, remanence and gravity reach every term that they belong to: 1e-7 m over 0.3 s."""
    spread = Randomization(modulus=0.2, density=0.2, drag=0.5, remanence=0.2, gravity_direction=0.2)
    env = MagRodEnv("reach", num_elements=3, randomization=spread)
    actions = scripted_actions(env.action_space, 15)
    got, core, nominal = rolled(env, actions), env.core, env.core.scene
    magnet = dataclasses.replace(nominal.magnets[0], moment=nominal.magnets[0].moment * remanences(core)[0])
    rod = dataclasses.replace(
        nominal.rod,
        youngs_modulus=nominal.rod.youngs_modulus * moduli(core)[0],
        density=nominal.rod.density * densities(core)[0],
    )
    gravity = tuple(core.batch.gather(GRAVITY, 3)[0])
    scene = nominal.replace(rod=rod, magnets=(magnet,), gravity=gravity, drag_rate=nominal.drag_rate * drags(core)[0])
    want = rolled(MagRodEnv("reach", scene=scene, num_elements=3, time_step=core.time_step), actions)
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-7)
    assert np.abs(got - rolled(MagRodEnv("reach", num_elements=3), actions)).max() > 1e-3


def test_moved_magnet_moves_like_a_scene_with_it_there():
    spread = Randomization(magnet_position=3e-3)
    env = MagRodEnv("two_magnet", num_elements=6, randomization=spread, random_start=False)
    actions = scripted_actions(env.action_space, 10, overdrive=1.0)
    got, core = rolled(env, actions), env.core
    node = min(core.batch.layout.magnet_nodes)
    place = sum(core.batch.gather(core.batch.layout.elements + ELEMENT_ROWS * e + LENGTH, 1)[0, 0] for e in range(node))
    magnets = tuple(
        dataclasses.replace(magnet, position=place) if magnet.position < core.scene.rod.length else magnet
        for magnet in core.scene.magnets
    )
    scene = core.scene.replace(magnets=magnets)
    other = MagRodEnv("two_magnet", scene=scene, num_elements=6, time_step=core.time_step, random_start=False)
    np.testing.assert_allclose(got, rolled(other, actions), rtol=0, atol=1e-7)


@pytest.mark.parametrize("task", ["circle", "reach", "planar_reach", "two_magnet"])
def test_drawn_rods_start_at_rest_in_their_own_equilibrium(task):
    """Keeping the field of the start keeps every rod where it is: 1e-6 m, since actions are float32."""
    spread = {"modulus": 0.1, "density": 0.1, "remanence": 0.05, "gravity_direction": 0.05, "field_gain": 0.05}
    if task != "planar_reach":  # a planar rod does not feel the part of a turned field that leaves its plane
        spread["field_misalignment"] = 0.05
    batch = batch_of(task, 6, **spread)
    observations, info = batch.reset(seed=3)
    size = 6 * len(batch.core.nodes)
    hold, start = observations[:, size : size + batch.core.coils.num_axes], info["tip_position"]
    for _ in range(5):
        info = batch.step(hold)[-1]
    np.testing.assert_allclose(info["tip_position"], start, rtol=0, atol=1e-6)


def test_first_targets_do_not_depend_on_the_randomisation():
    """Comparisons of nominal and randomised rods on the same seeds ask the same of both."""
    plain = MagRodVectorEnv("reach", 8, num_elements=3).reset(seed=5)[1]["target"]
    spread = batch_of(num_envs=8, modulus=0.2).reset(seed=5)[1]["target"]
    np.testing.assert_array_equal(spread, plain)


def test_time_step_allows_for_the_stiffest_rod():
    """Stiff and light rods in strong fields still run under hard driving; far softer ones would coil up."""
    spread = Randomization(modulus=0.4, density=0.9, remanence=0.3, field_gain=0.3)
    batch = MagRodVectorEnv("reach", 32, randomization=spread)
    nominal = MagRodVectorEnv("reach", 1)
    assert batch.core.time_step < nominal.core.time_step
    for result in run(batch, np.sign(scripted_actions(batch.action_space, 25)), 0)[1:]:
        assert not result[2].any()
