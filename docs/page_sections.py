"""Sections of an environment's page that the code decides: spaces, rewards, start, end, arguments, info."""

from __future__ import annotations

from dataclasses import dataclass, replace

import gymnasium

from magrod_env.envs import MagRodEnv
from magrod_env.envs.tasks import EnvironmentId, TaskSpec
from magrod_env.magnetics import Actuator

AXES = {"x": "along the rod", "y": "horizontal, across the rod", "z": "up"}


@dataclass(frozen=True)
class Page:
    """What a page is about: an id, its task, and an environment with the camera's observations."""

    one: EnvironmentId
    spec: TaskSpec
    env: MagRodEnv

    @classmethod
    def of(cls, one: EnvironmentId, spec: TaskSpec) -> Page:
        """Make the environment of an id."""
        env = gymnasium.make(one.name).unwrapped
        assert isinstance(env, MagRodEnv)
        return cls(one, spec, env)

    @property
    def name(self) -> str:
        """Of the page: "Circle" for "MagRod/Circle-v0"."""
        return self.one.name.split("/")[1].rsplit("-", 1)[0]

    @property
    def seconds(self) -> float:
        """Time limit, s."""
        return self.one.max_episode_steps * self.env.control_time

    def sections(self) -> dict[str, str]:
        """Every section that the code decides, by its heading."""
        return {
            "Action space": action_space(self),
            "Observation space": observation_space(self),
            "Rewards": sparse_reward(self) if self.one.goal else dense_reward(self),
            "Starting state": self.spec.start,
            "Episode end": episode_end(self),
            "Arguments": arguments(self),
            "Info": info(self),
        }


def table(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """A Markdown table."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (header, *rows)).replace(
        "|\n", f"|\n|{'---|' * len(header)}\n", 1
    )


def action_space(page: Page) -> str:
    """Which field each entry of an action is."""
    coils = page.env.coils
    rows = [
        (str(k), f"field along {axis} ({AXES[axis]})", f"share of {1e3 * limit:g} mT")
        for k, (axis, limit) in enumerate(zip(coils.axes, coils.limit, strict=True))
    ]
    return (
        f"`{space(page.env.action_space)}`\n\n{table(('entry', 'what', 'unit'), rows)}\n\n"
        f"An action acts for one control step of {1e3 * page.env.control_time:g} ms. Entries beyond -1 or 1 are cut "
        '(`info["saturated"]`); NaN and infinity are refused.'
    )


def observation_space(page: Page) -> str:
    """What each entry of an observation is."""
    full = gymnasium.make(page.one.name, observe="state").unwrapped.observation_layout  # type: ignore[attr-defined]
    box = page.env.observation_space
    array = box["observation"] if isinstance(box, gymnasium.spaces.Dict) else box
    text = f'`{space(array)}`; with `observe="state"` the size is {full.size}.\n\n{full.table()}'
    if not isinstance(box, gymnasium.spaces.Dict):
        return text
    rows = [
        ('`"achieved_goal"`', "true position of the tip, world; zeros for a rod that has diverged"),
        ('`"desired_goal"`', "target, world"),
    ]
    return (
        f'{text}\n\nThe space is a `Dict` with this array under `"observation"` and two goals, '
        f"`{space(box['desired_goal'])}`, in metres (with a rod of yours of more than 0.67 m, up to 1.5 times its "
        f"length):\n\n{table(('key', 'what'), rows)}"
    )


def space(box: gymnasium.Space) -> str:
    """A box as it is written on the pages."""
    assert isinstance(box, gymnasium.spaces.Box)
    return f"Box({box.low.min():g}, {box.high.max():g}, {box.shape}, {box.dtype})"


def dense_reward(page: Page) -> str:
    """The terms of the dense reward."""
    reward, length = page.spec.reward, f"L = {1e3 * page.env.scene.rod.length:.4g} mm"
    one = "the distance of the tip from its target"
    distance = one if page.env.num_tracked == 1 else "the mean distance of tip and middle magnet from their targets"
    rows = [
        ("tracking", f"-min(d/({reward.tracking:g} L), 10); -10 for a rod that has left its range"),
        ("precision", f"exp(-d/{1e3 * reward.precision:g} mm)"),
        ("effort", rf"-{reward.effort:g} \|action\|^2"),
        (
            "smoothness",
            rf"-{reward.smoothness:g} \|action - last action\|^2; before the first step the last action is the one "
            "that holds the start",
        ),
    ]
    return (
        f'The sum of four terms, each also in `info["reward_<term>"]`. d is {distance}, {length}.\n\n'
        f"{table(('term', 'value'), rows)}\n\n"
        "The best reward of a step is close to 1. Errors are those of the true positions, not of what the camera saw."
    )


def sparse_reward(page: Page) -> str:
    """The reward of an id with goals."""
    return (
        f"Sparse: 0 where the tip is within `success_distance` ({1e3 * page.spec.success_distance:g} mm) of the "
        "target, else -1. `env.unwrapped.compute_reward(achieved_goal, desired_goal, info)` gives the reward of any "
        "pair of goals, one or a batch, as hindsight replay needs. A goal with an entry that is not finite is not "
        "reached: -1; another shape is refused."
    )


def episode_end(page: Page) -> str:
    """What ends an episode."""
    period = page.env.task.period
    rounds = "" if period is None else f", {page.seconds / period:g} rounds"
    return (
        '- *Terminated* when the rod leaves the range in which its numbers mean anything: `info["diverged"]`. '
        "Reaching the target does not end an episode.\n"
        f"- *Truncated* after {page.one.max_episode_steps} steps ({page.seconds:g} s{rounds})."
    )


def arguments(page: Page) -> str:
    """The arguments of the task, and the defaults that other tasks do not share."""
    spec, counts = page.spec, page.env.core.batch.counts
    rows = [(one.name, one.shown or repr(one.default), one.meaning) for one in spec.arguments]
    if len(counts) > 1:
        pieces = f"{counts[0]} to the middle magnet, {counts[1]} from there to the tip"
        rows.append(("num_elements", str(spec.resolution.num_elements), pieces))
    if spec.plane is not None:
        rows.append(("plane", f'"{spec.plane}"', "None computes the same in space"))
    if spec.actuator != Actuator():
        assert spec.actuator == replace(Actuator(), limit=spec.actuator.limit)
        rows.append(("actuator", f"Actuator(limit={spec.actuator.limit})", "T"))
    if page.one.goal:
        rows.append(("success_distance", f"{spec.success_distance:g}", "m; also the radius of the sparse reward"))
    shared = "Arguments shared by all environments are in [environments.md](../environments.md#arguments)."
    return f"{table(('argument', 'default', 'meaning'), rows)}\n\n{shared}"


def info(page: Page) -> str:
    """What `info` holds."""
    lost = "[counts as lying at the clamp](../environments.md#when-a-rod-is-lost)"
    two = page.env.num_tracked > 1
    rows = [
        ("`tip_error`", "float", "m", "distance of the tip from its target"),
        *([("`middle_error`", "float", "m", "distance of the middle magnet from its target")] if two else []),
        ("`is_success`", "bool", "", f"the {'mean of both errors' if two else 'tip'} is within `success_distance`"),
        ("`field_applied`", "(3,)", "T", "field that acts on the rod, world"),
        ("`saturated`", "bool", "", "an entry of the action was beyond -1 or 1"),
        ("`diverged`", "bool", "", f"the rod has left its range; it then {lost}"),
        ("`tip_position`", "(3,)", "m", "true position of the tip, world"),
        ("`target`", "(3,)", "m", "target of the tip now, world"),
    ]
    if not page.one.goal:
        names = ", ".join(f"`reward_{term}`" for term in ("tracking", "precision", "effort", "smoothness"))
        rows.append((names, "float", "", "terms of the dense reward; 0 at a reset"))
    return f"At every step and reset:\n\n{table(('key', 'type', 'unit', 'what'), rows)}"
