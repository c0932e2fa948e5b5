"""One rod or many, one thread or more: the same bits; and an absent term is a term with the value zero."""

import numpy as np
import pytest
from term_sets import damped

from magrod_env import Magnet, Simulation, load_scene
from magrod_env.rod.batch import LANES, RODS_PER_THREAD

SOFT = load_scene("paper4_pdms_tip_magnet").replace(drag_rate=5.0)
RICH = damped(SOFT.replace(internal_damping=1e-4))
SLOPE = np.array([[0.2, 0.1, -0.3], [0.1, -0.5, 0.05], [-0.3, 0.05, 0.3]])


def fields(num_rods, seed=0):
    """A different field for each rod, T."""
    return 12e-3 * np.random.default_rng(seed).normal(size=(num_rods, 3))


def state(simulation):
    return np.concatenate([simulation.positions, simulation.velocities, simulation.angular_velocities], axis=-1)


def run(num_rods, field, *, scene=SOFT, gradient=None, **options):
    """State of the rods after two unequal stretches of time in two fields."""
    options = {"num_elements": 4, **options}
    simulation = Simulation(scene, num_rods=num_rods, **options)
    simulation.advance(0.05, field=field, gradient=gradient)
    simulation.advance(0.03, field=-0.5 * field[..., [1, 2, 0]])
    return state(simulation)


@pytest.mark.parametrize(("precision", "scene"), [("float64", SOFT), ("float32", RICH)], ids=["float64", "float32"])
@pytest.mark.parametrize("num_rods", [3, 8, 19])
def test_batch_equals_singles_bitwise(precision, scene, num_rods):
    assert LANES[precision] > 1
    field = fields(num_rods)
    together = run(num_rods, field, scene=scene, precision=precision)
    for rod in range(num_rods):
        np.testing.assert_array_equal(together[rod], run(1, field[rod], scene=scene, precision=precision)[0])


@pytest.mark.parametrize(("precision", "num_rods", "num_elements"), [("float64", 3, 10), ("float32", 19, 4)])
def test_batch_equals_singles_bitwise_with_every_term(precision, num_rods, num_elements):
    """Internal damping keeps its matrices in memory, where the compiler must fuse no product across a store."""
    options = {"scene": RICH, "num_elements": num_elements, "precision": precision}
    field, slopes = fields(num_rods), SLOPE * np.linspace(-1.0, 1.0, num_rods)[:, None, None]
    together = run(num_rods, field, gradient=slopes, **options)
    for rod in range(0, num_rods, 4):
        np.testing.assert_array_equal(together[rod], run(1, field[rod], gradient=slopes[rod], **options)[0])


def test_batch_equals_singles_bitwise_for_the_papers_element():
    field = fields(3)
    together = run(3, field, element="nodal")
    for rod in range(3):
        np.testing.assert_array_equal(together[rod], run(1, field[rod], element="nodal")[0])


def test_rods_of_one_field_are_equal():
    together = run(11, np.tile(fields(1), (11, 1)))
    np.testing.assert_array_equal(together, np.broadcast_to(together[:1], together.shape))


def test_threads_give_the_same_bits():
    num_rods = 2 * RODS_PER_THREAD["float64"] + LANES["float64"]  # enough for two threads, in unequal shares
    field = fields(num_rods)
    alone, shared = (run(num_rods, field, num_threads=threads) for threads in (1, 2))
    np.testing.assert_array_equal(shared, alone)


def test_single_precision_follows_double():
    """To seven digits of the rod's length, after a thousand steps."""
    field = fields(3)
    double, single = (run(3, field, scene=RICH, precision=precision) for precision in LANES)
    np.testing.assert_allclose(single[..., :3], double[..., :3], atol=5e-6)


# ---- None and zero


def test_absent_terms_are_terms_of_value_zero():
    field = fields(1)
    without = run(1, field, scene=SOFT.replace(gravity=None, drag_rate=None))
    zero = SOFT.replace(gravity=(0.0, 0.0, 0.0), drag_rate=0.0, spin_drag_rate=0.0)
    of_zero = run(1, field, scene=zero, gradient=np.zeros((3, 3)))
    np.testing.assert_allclose(of_zero, without, atol=1e-12)  # another order of additions, at most


def test_no_magnet_is_a_magnet_without_moment_or_mass():
    light = Magnet.dipole(position=SOFT.rod.length, moment=0.0)
    with_magnet, without = (
        run(1, fields(1), scene=SOFT.replace(magnets=magnets, drag_rate=rate))
        for magnets, rate in (((light,), 0.0), ((), None))
    )
    np.testing.assert_allclose(with_magnet, without, atol=1e-12)
