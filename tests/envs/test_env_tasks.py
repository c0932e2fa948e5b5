"""What the tasks ask for can be held: targets are static equilibria of the scene, within the coils' reach."""

import numpy as np
import pytest
from rollouts import run

from magrod_env import Simulation, StabilityError, load_scene
from magrod_env.envs import MagRodEnv, MagRodVectorEnv
from magrod_env.envs.paths import SHAPES, evenly_spaced, shape
from magrod_env.envs.workspace import Workspace
from magrod_env.magnetics import Actuator
from magrod_env.registration import IDS

pytestmark = pytest.mark.filterwarnings("error")

HELD = 2e-8  # m: fields are found to 1e-8 m, equilibria to their own rounding
FEW = {"num_elements": 3}
FIELDS = {"reach": ([1, 2], [-25e-3, -25e-3], 25e-3), "planar_reach": ([0, 2], [0.0, -25e-3], 25e-3)}  # T


def held_at(env, field):
    """Positions of the tracked magnets in static equilibrium, from the physics alone."""
    simulation = Simulation(env.core.scene, num_elements=env.core.num_elements)
    return simulation.equilibrium(field).positions[list(env.core.nodes)]


@pytest.mark.parametrize("task", ["circle", "path", "two_magnet"])
def test_path_is_held_by_its_fields(task):
    """Every eighth point, in the field that the task lists, reached from zero field."""
    env = MagRodEnv(task, **FEW)
    for k in range(0, len(env.core.task.fields), 8):
        np.testing.assert_allclose(held_at(env, env.core.task.fields[k]), env.core.task.path[k], rtol=0, atol=HELD)


@pytest.mark.parametrize("name", [name for name, (arguments, _) in IDS.items() if "reach" not in arguments["task"]])
def test_coils_can_hold_every_point_of_the_path(name):
    """The fields lie along the coils' axes and within three quarters of their limit, which leaves room to steer."""
    core = MagRodEnv(**IDS[name][0]).core
    fields = core.task.fields
    without = [axis for axis, letter in enumerate("xyz") if letter not in core.coils.axes]
    np.testing.assert_array_equal(fields[:, without], 0.0)
    assert np.abs(fields).max() <= 0.8 * core.actuator.limit


def test_circle_is_a_circle_about_the_compensated_tip():
    env = MagRodEnv("circle", **FEW, radius=12e-3, center_field=(0.0, 0.0, 5e-3))
    center = held_at(env, (0.0, 0.0, 5e-3))[0]
    path = env.core.task.path[:, 0]
    np.testing.assert_allclose(np.hypot(path[:, 1] - center[1], path[:, 2] - center[2]), 12e-3, rtol=0, atol=HELD)
    angles = np.unwrap(np.arctan2(path[:, 2] - center[2], path[:, 1] - center[1]))
    np.testing.assert_allclose(np.diff(angles), 2 * np.pi / len(path), rtol=0, atol=1e-5)


def test_circle_takes_its_period():
    """After one period the target is where it was; after half of it, opposite."""
    env = MagRodEnv("circle", **FEW, period=0.8)
    targets = np.array([result[-1]["target"] for result in run(env, np.zeros((41, 2)), 0)])
    np.testing.assert_allclose(targets[40], targets[0], rtol=0, atol=1e-12)
    centers = 0.5 * (targets[20] + targets[0])[1:]
    np.testing.assert_allclose(np.linalg.norm(targets[:, 1:] - centers, axis=1), 16e-3, rtol=0, atol=1e-5)


@pytest.mark.parametrize("task", ["circle", "path", "two_magnet"])
def test_targets_between_the_points_are_near_the_reachable_surface(task):
    """Straight pieces between 120 equilibria: within a fifth of the success distance of the surface."""
    core = MagRodEnv(task, **FEW).core
    path = core.task.path
    between = 0.5 * (path + np.roll(path, -1, axis=0))
    fields = 0.5 * (core.task.fields + np.roll(core.task.fields, -1, axis=0))
    env = MagRodEnv(task, **FEW)
    for k in range(0, len(path), 8):
        if np.linalg.norm(np.diff(path[[k, (k + 1) % len(path)], 0], axis=0)) > 0.0:
            assert np.linalg.norm(held_at(env, fields[k]) - between[k], axis=1).max() < 2e-4


def test_starts_are_spread_over_the_whole_path():
    batch = MagRodVectorEnv("circle", 600, **FEW)
    info = batch.reset(seed=0)[1]
    np.testing.assert_allclose(info["tip_error"], 0.0, rtol=0, atol=HELD)
    center = batch.core.task.path[:, 0, 1:].mean(axis=0)
    angles = np.arctan2(*(info["target"][:, 1:] - center).T)
    counts = np.histogram(angles, 12, (-np.pi, np.pi))[0]
    assert counts.min() > 50 - 4 * np.sqrt(50) and counts.max() < 50 + 4 * np.sqrt(50)


@pytest.mark.parametrize("task", ["circle", "path", "two_magnet"])
def test_without_random_start_every_episode_begins_at_the_first_point(task):
    batch = MagRodVectorEnv(task, 5, **FEW, random_start=False)
    for seed in (0, 1):
        info = batch.reset(seed=seed)[1]
        np.testing.assert_array_equal(info["target"], np.tile(batch.core.task.path[0, 0], (5, 1)))
        np.testing.assert_allclose(info["tip_error"], 0.0, rtol=0, atol=HELD)
        np.testing.assert_allclose(
            info["field_applied"], np.tile(batch.core.task.fields[0], (5, 1)), rtol=0, atol=1e-12
        )


@pytest.mark.parametrize("task", ["reach", "planar_reach"])
def test_reach_targets_come_from_equilibria(task):
    """The grid of targets is that of the documented fields, up to 25 mT on each axis."""
    env = MagRodEnv(task, **FEW)
    table, (columns, low, high) = env.core.task.targets.table, FIELDS[task]
    first, second = (np.linspace(start, high, count) for start, count in zip(low, table.shape, strict=False))
    for a in range(0, table.shape[0], 4):
        for b in range(0, table.shape[1], 4):
            field = np.zeros(3)
            field[columns] = first[a], second[b]
            np.testing.assert_allclose(held_at(env, field), table[a, b], rtol=0, atol=HELD)


@pytest.mark.parametrize("task", ["reach", "planar_reach"])
def test_drawn_reach_targets_can_be_held(task):
    """By the field at the same place of the grid, to a fifth of the success distance."""
    batch = MagRodVectorEnv(task, 40, **FEW)
    targets, core = batch.reset(seed=0)[1]["target"], batch.core
    columns, low, high = FIELDS[task]
    for place, target in zip(core.episodes.place, targets, strict=True):
        field = np.zeros(3)
        field[columns] = low + place / (np.array(core.task.targets.table.shape[:2]) - 1) * (high - np.array(low))
        assert np.linalg.norm(core.workspace.equilibrium(field).tip_position - target) < 2e-4


def test_workspace_finds_the_field_that_holds_a_target():
    """Inverse statics: the coordinates that it is asked for to 1e-8 m, the third one to the grid's interpolation."""
    batch = MagRodVectorEnv("reach", 40, **FEW)
    for target in batch.reset(seed=0)[1]["target"]:
        tip = batch.core.workspace.hold(target, axes="yz").tip_position
        np.testing.assert_allclose(tip[1:], target[1:], rtol=0, atol=HELD)
        np.testing.assert_allclose(tip, target, rtol=0, atol=2e-4)


def test_reach_targets_cover_the_workspace():
    """Independent coordinates in the table, evenly drawn: quartiles hold a quarter each within four standard errors."""
    batch = MagRodVectorEnv("reach", 800, **FEW)
    batch.reset(seed=0)
    place = batch.core.episodes.place / (np.array(batch.core.task.targets.table.shape[:2]) - 1)
    for column in place.T:
        counts = np.histogram(column, 4, (0.0, 1.0))[0]
        assert np.abs(counts - 200).max() < 4 * np.sqrt(150)
    assert abs(np.corrcoef(place.T)[0, 1]) < 4 / np.sqrt(800)


def test_reach_limit_bounds_the_targets():
    spread = []
    for limit in (5e-3, 10e-3):
        targets = MagRodVectorEnv("reach", 200, **FEW, reach_limit=limit).reset(seed=0)[1]["target"]
        spread.append(np.ptp(targets[:, 1]))
    assert 1.5 < spread[1] / spread[0] < 2.5


@pytest.mark.parametrize("name", SHAPES)
def test_named_shapes_are_closed_and_even(name):
    points = shape(name, 240)
    assert points.shape == (240, 2)
    assert np.linalg.norm(points, axis=1).max() <= np.sqrt(2.0) + 1e-12
    steps = np.linalg.norm(np.diff(np.concatenate([points, points[:1]]), axis=0), axis=1)
    assert steps.max() / np.median(steps) < 1.01  # shorter only where a corner is cut


@pytest.mark.parametrize("name", SHAPES)
def test_every_named_shape_can_be_followed(name):
    env = MagRodEnv("path", path=name, **FEW)
    assert env.core.task.path.shape == (120, 1, 3)
    first = env.reset(seed=0)[1]
    assert first["tip_error"] < HELD
    size = np.abs(env.core.task.path[:, 0, 1:] - env.core.task.path[:, 0, 1:].mean(axis=0)).max()
    assert 10e-3 < size < 18e-3  # 12 mm from centre to side


SQUARE = np.array([(-8e-3, -20e-3), (8e-3, -20e-3), (8e-3, -8e-3), (-8e-3, -8e-3)])


def test_given_points_are_the_corners_of_the_path():
    """(M, 2): y and z, m, closed, at constant speed; the tip's own x."""
    core = MagRodEnv("path", path=SQUARE, period=3.0, **FEW).core
    path = core.task.path[:, 0]
    np.testing.assert_allclose(path[:, 1:], evenly_spaced(SQUARE, 120), rtol=0, atol=HELD)
    np.testing.assert_allclose(path[0, 1:], SQUARE[0], rtol=0, atol=HELD)
    assert np.ptp(path[:, 0]) > 1e-3
    assert core.task.period == 3.0


@pytest.mark.parametrize("given", [SQUARE.tolist(), tuple(map(tuple, SQUARE)), np.insert(SQUARE, 0, 99.0, axis=1)])
def test_given_points_may_be_lists_or_have_an_ignored_x(given):
    want = MagRodEnv("path", path=SQUARE, **FEW).core.task.path
    np.testing.assert_array_equal(MagRodEnv("path", path=given, **FEW).core.task.path, want)


@pytest.mark.parametrize(
    "settings",
    [
        {"task": "circle", "radius": 80e-3},
        {"task": "path", "size": 90e-3},
        {"task": "path", "path": [(0.0, 0.0), (0.0, 0.1)]},
        {"task": "path", "path": [(0.0, 70e-3, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1e-3)]},
    ],
)
def test_unreachable_path_is_refused(settings):
    with pytest.raises(ValueError, match=r"within reach.*choose a point nearer"):
        MagRodEnv(**settings, **FEW)


@pytest.mark.parametrize(
    "settings",
    [
        {"task": "circle", "actuator": Actuator(limit=10e-3)},
        {"task": "path", "actuator": Actuator(limit=5e-3)},
        {"task": "two_magnet", "actuator": Actuator(limit=10e-3)},
        {"task": "reach", "actuator": Actuator(limit=10e-3)},
    ],
    ids=lambda settings: settings["task"],
)
def test_targets_beyond_the_coils_are_refused(settings):
    """A path that needs more field than the coils have cannot be followed, nor begun."""
    with pytest.raises(ValueError, match="limit"):
        MagRodEnv(**settings, **FEW)


@pytest.mark.parametrize(
    "settings",
    [
        {"task": "circle", "axes": "xz"},
        {"task": "path", "axes": "y"},
        {"task": "two_magnet", "axes": "yz"},
        {"task": "reach", "axes": "xy"},
    ],
    ids=lambda settings: settings["task"],
)
def test_axes_that_cannot_hold_the_targets_are_refused(settings):
    with pytest.raises(ValueError, match="axes"):
        MagRodEnv(**settings, **FEW)


def test_spatial_task_in_a_plane_is_refused():
    """A planar rod cannot follow a circle across its plane, nor the coils in its plane hold one there."""
    for task, axes in (("circle", "xz"), ("circle", "yz"), ("reach", "z")):
        with pytest.raises(ValueError, match=r"plane|axes"):
            MagRodEnv(task, plane="xz", axes=axes, **FEW)


def test_rod_without_magnets_is_refused():
    """No field would move it."""
    scene = MagRodEnv("reach", **FEW).core.scene.replace(magnets=())
    for task in ("circle", "reach"):
        with pytest.raises(ValueError, match="magnet"):
            MagRodEnv(task, scene=scene, **FEW)


def test_static_command_of_a_target_holds_the_rod_there():
    """Dynamics agree with statics: from zero field, 3 s in the field of a target bring the tip to it."""
    env = MagRodEnv("reach", **FEW, control_rate=10.0)
    target = env.reset(seed=3)[1]["target"]
    field = env.core.workspace.hold(target, axes="yz").field
    for _ in range(30):
        info = env.step(field[1:] / env.core.actuator.limit)[4]
    assert info["tip_error"] < 2e-4 and info["is_success"]


def test_a_rod_that_its_weight_buckles_is_not_blamed_on_the_field():
    standing = load_scene("paper5_circle").replace(gravity=(-200.0, 0.0, 0.0))
    with pytest.raises(StabilityError, match="gravity must not buckle"):
        Workspace(standing, 4).equilibrium((0.0, 0.0, 0.01))
