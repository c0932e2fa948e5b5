"""How many threads share a batch, and what a forked child has of them."""

import copy
import math
import multiprocessing
import os

import gymnasium
import numpy as np
import pytest

import magrod_env  # noqa: F401  (registers the ids)
from magrod_env import Simulation, load_scene
from magrod_env.estimation import EnsembleFilter, PredictionFilter, UnscentedFilter
from magrod_env.rod.batch import RODS_PER_THREAD
from magrod_env.rod.threads import checked_num_threads, usable_cores

SCENE = load_scene("paper4_pdms_tip_magnet").replace(drag_rate=5.0)
NUM_RODS = 2 * RODS_PER_THREAD["float64"]  # enough for two threads

OWNERS = {
    "Simulation": lambda **options: Simulation(SCENE, **options),
    "make": lambda **options: gymnasium.make("MagRod/Reach-v0", **options),
    "make_vec": lambda **options: gymnasium.make_vec("MagRod/Reach-v0", num_envs=2, **options),
    "EnsembleFilter": lambda **options: EnsembleFilter(SCENE, **options),
    "UnscentedFilter": lambda **options: UnscentedFilter(SCENE, **options),
    "PredictionFilter": lambda **options: PredictionFilter(SCENE, **options),
}


@pytest.mark.parametrize("owner", OWNERS)
@pytest.mark.parametrize("value", [0, -1, True, 1.5, "x", math.nan, math.inf, [2]], ids=repr)
def test_a_number_of_threads_that_is_none_is_refused(owner, value):
    with pytest.raises(ValueError, match="num_threads must be a whole number of 1 or more, but got"):
        OWNERS[owner](num_threads=value)


def test_a_number_of_threads_that_is_none_is_refused_before_pilots_run(monkeypatch):
    monkeypatch.setattr("magrod_env.simulation.simulation.resolution_for", lambda *_, **__: pytest.fail("pilots ran"))
    with pytest.raises(ValueError, match="num_threads"):
        Simulation(SCENE, tolerance=1e-3, num_threads=0)


@pytest.mark.parametrize("value", [2, 2.0, np.int64(2), np.float32(2.0)], ids=repr)
def test_whole_numbers_of_any_type_are_taken(value):
    assert checked_num_threads(value) == 2 and type(checked_num_threads(value)) is int


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system has no affinity mask")
def test_one_thread_for_each_core_of_the_affinity_mask():
    cores = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(cores)})
        assert usable_cores() == checked_num_threads(None) == 1
    finally:
        os.sched_setaffinity(0, cores)
    assert usable_cores() == len(cores)


def test_the_cores_of_python_3_13_are_asked_for_first(monkeypatch):
    monkeypatch.setattr(os, "process_cpu_count", lambda: 3, raising=False)
    assert usable_cores() == 3


def forked(call):
    """What a call returns in a forked child, or None if it takes more than 30 s: it takes milliseconds."""
    queue = multiprocessing.get_context("fork").SimpleQueue()
    child = multiprocessing.get_context("fork").Process(target=lambda: queue.put(call()))
    child.start()
    child.join(30)
    if child.exitcode is None:
        child.kill()
        child.join()
    return None if queue.empty() else queue.get()


def tips_after(simulation):
    simulation.advance(0.01)
    return simulation.tip_position


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="the system does not fork")
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")  # threads and fork, which this test is about
def test_a_forked_child_steps_a_batch_that_its_parent_used():
    """Also a copy of it, and a child's child; the same bits everywhere."""
    simulation = Simulation(SCENE, num_rods=NUM_RODS, num_elements=4, num_threads=2)
    simulation.advance(0.01, field=(0.0, 0.0, 5e-3))  # starts the other thread
    in_child = forked(lambda: tips_after(simulation))
    in_copy = forked(lambda: tips_after(copy.deepcopy(simulation)))
    in_grandchild = forked(lambda: (tips_after(copy.deepcopy(simulation)), forked(lambda: tips_after(simulation)))[1])
    here = tips_after(simulation)
    for elsewhere in (in_child, in_copy, in_grandchild):
        np.testing.assert_array_equal(elsewhere, here)
