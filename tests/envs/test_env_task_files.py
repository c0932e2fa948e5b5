"""A task is one file: what it describes is all that the environments need; and what controllers may read of them."""

import gymnasium
import numpy as np
import pytest
from rollouts import FEW, scripted_actions

from magrod_env.envs import MagRodEnv, MagRodVectorEnv, attributes_of
from magrod_env.envs.observation import ObservationLayout
from magrod_env.envs.tasks import TASKS, EnvironmentId, Reward, TaskSpec
from magrod_env.envs.tasks.following import RANDOM_START, follow_path, period_argument
from magrod_env.envs.tasks.scenes import ROUND_ROD, round_rod
from magrod_env.envs.tasks.task import Argument, within
from magrod_env.registration import register_task

pytestmark = pytest.mark.filterwarnings("error")


# ---- a new task, in one place


def line(workspace, *, width, period, random_start):
    """There and back along y, through the place of the tip at rest."""
    middle = workspace.equilibrium(np.zeros(3)).tip_position[1:]
    ends = middle + 0.5 * width * np.array([[-1.0, 0.0], [1.0, 0.0]])
    return follow_path(workspace, ends, period=period, axes="yz", random_start=random_start)


LINE = TaskSpec(
    name="line",
    ids=(EnvironmentId(name="MagRod/Line-v0", max_episode_steps=50, summary="the tip goes there and back"),),
    scene=round_rod,
    make=line,
    arguments=(
        Argument(
            name="width",
            default=8e-3,
            check=within("give it in metres", above=0.0, at_most=0.03),
            meaning="m, of the line",
        ),
        period_argument(1.0),
        RANDOM_START,
    ),
    sets_fields="width",
    resolution=ROUND_ROD,
    reward=Reward(effort=0.5),
    success_distance=2e-3,
    start="At rest on the line.",
)


@pytest.fixture
def line_task():
    register_task(LINE)
    yield LINE
    del TASKS["line"], gymnasium.registry["MagRod/Line-v0"]


def test_a_task_that_is_described_in_one_place_makes_environments(line_task):
    env, batch = gymnasium.make("MagRod/Line-v0", width=6e-3), gymnasium.make_vec("MagRod/Line-v0", num_envs=2)
    assert env.spec.max_episode_steps == 50 and batch.unwrapped.max_episode_steps == 50
    assert env.unwrapped.success_distance == 2e-3
    observation, info = env.reset(seed=0)
    assert observation in env.observation_space and info["is_success"]
    np.testing.assert_allclose(np.ptp(env.unwrapped.task.path[:, 0, 1]), 6e-3, rtol=1e-6)
    info = env.step(np.full(2, 0.5, np.float32))[-1]
    np.testing.assert_allclose(info["reward_effort"], -0.5 * 0.5, rtol=1e-12)


@pytest.mark.parametrize(("settings", "word"), [({"width": 1.0}, "width"), ({"radius": 0.01}, "radius.*spelling")])
def test_a_new_task_checks_its_own_arguments(line_task, settings, word):
    with pytest.raises(ValueError, match=word):
        MagRodEnv("line", **settings)


def test_two_tasks_cannot_have_one_name():
    other = TaskSpec(**{name: getattr(LINE, name) for name in LINE.__dataclass_fields__} | {"name": "circle"})
    with pytest.raises(ValueError, match=r"name.*circle"):
        register_task(other)
    assert TASKS["circle"] is not other


# ---- one list of entries


@pytest.mark.parametrize("settings", [{}, {"observe": "state"}], ids=["camera", "state"])
def test_kernels_write_entries_in_the_order_of_the_list(settings):
    """The list turned round: the same entries at their new places."""
    env, turned = (MagRodEnv("circle", num_elements=3, **settings) for _ in range(2))
    layout = env.observation_layout
    other = ObservationLayout(tuple(reversed(layout.entries)))
    turned.core.view = turned.core.view._replace(places=other.places)
    env.reset(seed=0), turned.reset(seed=0)
    for action in scripted_actions(env.action_space, 3):
        want, got = env.step(action)[0], turned.step(action)[0]
        for name, place in layout.slices.items():
            np.testing.assert_array_equal(got[other.slices[name]], want[place])


def test_docstring_lists_the_entries_and_their_units_in_order():
    layout = MagRodEnv("circle", num_elements=3, observe="state").observation_layout
    lines = [line.split("|")[1:-1] for line in MagRodEnv.__doc__.splitlines() if line.strip().startswith("| ")]
    units = {cells[0].strip(): cells[-1].strip() for cells in lines if cells[0].strip() in layout.slices}
    assert units == {entry.name: entry.unit.split(" = ")[0] for entry in layout.entries}
    assert list(units) == [entry.name for entry in layout.entries]


# ---- what controllers may read


@pytest.mark.parametrize("task", ["circle", "two_magnet"])
def test_phase_is_where_on_the_path_the_target_is(task):
    batch = MagRodVectorEnv(task, 3, num_elements=FEW[task])
    info = batch.reset(seed=0)[1]
    ahead = batch.phase(1)
    for phase in (batch.phase(), ahead):
        at, path = phase % 1.0 * len(batch.task.path), batch.task.path[:, 0]
        first, share = at.astype(int), (at % 1.0)[:, None]
        want = (1.0 - share) * path[first] + share * path[(first + 1) % len(path)]
        np.testing.assert_allclose(info["target"], want, rtol=0, atol=1e-12)
        info = batch.step(np.zeros((3, 2)))[-1]


def test_task_without_a_path_has_no_phase():
    env = MagRodEnv("reach", num_elements=3)
    assert env.task.path is None and env.task.fields is None
    with pytest.raises(ValueError, match="path"):
        env.phase()


def test_attributes_are_found_behind_wrappers_and_of_no_other_environment():
    env = gymnasium.make("MagRod/Circle-v0", num_elements=3)
    assert attributes_of(env) is env.unwrapped
    with pytest.raises(ValueError, match="MagRodEnv"):
        attributes_of(gymnasium.make("CartPole-v1"))
