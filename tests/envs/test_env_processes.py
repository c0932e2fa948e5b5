"""Other processes and recorders: a fresh interpreter, spawned workers, videos."""

import gc
import multiprocessing
import pickle
import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv
from rollouts import assert_same, scripted_actions

import magrod_env  # registers the ids

pytestmark = pytest.mark.filterwarnings("error")

FRESH = """
import gymnasium
env = gymnasium.make("magrod_env:MagRod/Circle-v0", num_elements=3)
observation, info = env.reset(seed=3)
for _ in range(5):
    observation, reward, terminated, truncated, info = env.step([0.3, -0.2])
batch = gymnasium.make_vec("magrod_env:MagRod/Circle-v0", num_envs=1, num_elements=3)
batch.reset(seed=3)
for _ in range(5):
    observations, *_ = batch.step([[0.3, -0.2]])
assert (observations[0] == observation).all()
print(observation.tobytes().hex())
"""


def test_module_prefix_makes_the_environment_in_a_fresh_process():
    """gym.make("magrod_env:...") imports and registers by itself, with warnings as errors, and repeats the bits."""
    arguments = [sys.executable, "-W", "error", "-c", FRESH]
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    env = gymnasium.make("MagRod/Circle-v0", num_elements=3)
    env.reset(seed=3)
    for _ in range(5):
        observation = env.step([0.3, -0.2])[0]
    assert done.stdout.strip() == observation.tobytes().hex()


def make_env():
    """For spawned workers, which import this module anew."""
    return gymnasium.make("magrod_env:MagRod/ReachGoal-v0", num_elements=3, max_episode_steps=4)


@pytest.mark.parametrize("shared_memory", [True, False])
def test_spawned_workers_give_the_same_bits(shared_memory):
    """Over an autoreset, with and without shared memory."""
    workers = AsyncVectorEnv([make_env] * 2, context="spawn", shared_memory=shared_memory)
    here = SyncVectorEnv([make_env] * 2)
    try:
        assert_same(workers.reset(seed=4), here.reset(seed=4))
        for actions in scripted_actions(here.action_space, 7, overdrive=1.0):
            assert_same(workers.step(actions), here.step(actions))
    finally:
        workers.close()


def go_on(pickled, actions):
    env = pickle.loads(pickled)
    return [env.step(action) for action in actions]


def test_pickled_environment_goes_on_in_another_process():
    """Single and vector, in the middle of an episode, to the bit; the pickle holds no compiled code of this process."""
    single = gymnasium.make("MagRod/Circle-v0", num_elements=3)
    batch = gymnasium.make_vec("MagRod/Circle-v0", num_envs=2, num_elements=3)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        for env in (single, batch):
            actions = scripted_actions(env.action_space, 6)
            env.reset(seed=1)
            for action in actions[:3]:
                env.step(action)
            elsewhere = pool.apply(go_on, (pickle.dumps(env), actions[3:]))
            assert_same(elsewhere, [env.step(action) for action in actions[3:]])


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="the system does not fork")
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")  # threads and fork, which this test is about
def test_forked_child_goes_on_with_a_batch_that_has_run():
    """On two threads, of which a child has none; with a time-out, since it would wait for them for ever."""
    batch = gymnasium.make_vec("MagRod/Circle-v0", num_envs=64, num_elements=3, num_threads=2)
    actions = scripted_actions(batch.action_space, 4)
    batch.reset(seed=1)
    batch.step(actions[0])
    receiver, sender = multiprocessing.get_context("fork").Pipe(duplex=False)
    child = multiprocessing.get_context("fork").Process(
        target=lambda: sender.send([batch.step(action)[:4] for action in actions[1:]])
    )
    child.start()
    try:
        assert receiver.poll(60), "the forked child hangs"
        assert_same(receiver.recv(), [batch.step(action)[:4] for action in actions[1:]])
    finally:
        child.kill()
        child.join()


def check_video(folder):
    imageio = pytest.importorskip("imageio.v2")
    (path,) = folder.glob("*.mp4")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # of the reader's own pipes
        with imageio.get_reader(path) as reader:
            frames = [np.asarray(frame) for frame in reader]
        del reader
        gc.collect()
    assert len(frames) >= 5
    assert frames[0].ndim == 3 and np.any(frames[0] != frames[-1])


def test_record_video_writes_an_episode(tmp_path):
    pytest.importorskip("moviepy")
    env = gymnasium.make("MagRod/Circle-v0", render_mode="rgb_array", num_elements=3, max_episode_steps=6)
    env = gymnasium.wrappers.RecordVideo(env, str(tmp_path / "video"), episode_trigger=lambda episode: episode == 0)
    env.reset(seed=0)
    for action in scripted_actions(env.action_space, 6, overdrive=1.0):
        env.step(action)
    env.close()
    check_video(tmp_path / "video")


def test_vector_record_video_writes_an_episode(tmp_path):
    pytest.importorskip("moviepy")
    batch = gymnasium.make_vec(
        "MagRod/Circle-v0", num_envs=2, render_mode="rgb_array", num_elements=3, max_episode_steps=6
    )
    folder = tmp_path / "video"
    batch = gymnasium.wrappers.vector.RecordVideo(batch, str(folder), episode_trigger=lambda episode: episode == 0)
    batch.reset(seed=0)
    for actions in scripted_actions(batch.action_space, 8, overdrive=1.0):
        batch.step(actions)
    batch.close()
    check_video(folder)


def test_closing_twice_is_harmless():
    for env in (gymnasium.make("MagRod/Circle-v0"), gymnasium.make_vec("MagRod/Circle-v0", num_envs=2)):
        env.reset(seed=0)
        env.close()
        env.close()
    assert magrod_env.__version__
