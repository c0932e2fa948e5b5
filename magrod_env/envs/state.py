"""The state of environments as a value: taken, kept, given back to them or to others of the same make."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from magrod_env.envs.core import SteeringCore
from magrod_env.envs.observing import Outcome
from magrod_env.simulation.state import RodState

Made = Mapping[str, object]


@dataclass(frozen=True, eq=False)
class EnvState:
    """States of K environments: rods, what was drawn for them, coils, camera, episode and random streams.

    Those who go on from it do so bit for bit. It can be pickled, indexed (``state[3]``, ``state[:8]``) and stacked
    (`EnvState.stack`).

    Args:
        rods: states of the rods.
        arrays: everything else, by name; first axis K.
        made_with: what the environments were made with.
        generator: of the single environment, state of `np_random`; else None.
        estimation: what estimates the state of all of them, as a copy; None where nothing does.
    """

    rods: RodState
    arrays: Mapping[str, np.ndarray]
    made_with: Made
    generator: Mapping[str, object] | None = None
    estimation: object | None = None

    def __len__(self) -> int:
        return len(self.rods)

    def __getitem__(self, envs: object) -> EnvState:
        """The states of some environments: an index, a slice or an array of indices."""
        keep = np.atleast_1d(np.arange(len(self))[envs])  # type: ignore[call-overload]
        if self.estimation is not None and len(keep) != len(self):
            raise ValueError(
                "state of environments whose state is estimated must stay whole, but was indexed: their estimators "
                "share one batch."
            )
        arrays = {name: value[keep] for name, value in self.arrays.items()}
        return EnvState(self.rods[keep], arrays, self.made_with, self.generator, self.estimation)

    @classmethod
    def stack(cls, states: Sequence[EnvState]) -> EnvState:
        """States one after another, of environments without estimation."""
        first = states[0]
        arrays = {name: np.concatenate([one.arrays[name] for one in states]) for name in first.arrays}
        return EnvState(RodState.stack([one.rods for one in states]), arrays, first.made_with)


def take_state(core: SteeringCore, outcome: Outcome, over: np.ndarray) -> EnvState:
    """The state of all environments of a core, whose last step ended in `outcome`, and whose episodes are `over`."""
    arrays = {f"episodes.{name}": value for name, value in core.episodes._asdict().items()}
    arrays |= {f"parameters.{name}": value for name, value in core.rods.parameters._asdict().items()}
    arrays |= {f"outcome.{name}": value for name, value in outcome._asdict().items()}
    arrays |= {"commands": core.commands.swapaxes(0, 1), "over": over}
    estimation = None if core.estimation is None else copy.deepcopy(core.estimation, _shared(core))
    kept = {name: value.copy() for name, value in arrays.items()}
    return EnvState(core.rods.state(), kept, made_with(core), estimation=estimation)


def put_state(core: SteeringCore, state: EnvState, envs: np.ndarray, outcome: Outcome, over: np.ndarray) -> None:
    """Put environments `envs` (M,) into states, one for all or one for each; `outcome` and `over` become theirs too."""
    which = np.minimum(np.arange(len(envs)), len(state) - 1)
    core.rods.set_parameters(
        {name: state.arrays[f"parameters.{name}"][which] for name in core.rods.parameters._fields}, envs
    )
    core.rods.set_state(state.rods[which], envs)
    for prefix, group in (("episodes", core.episodes), ("outcome", outcome)):
        for name, value in group._asdict().items():
            value[envs] = state.arrays[f"{prefix}.{name}"][which]
    core.commands[:, envs] = state.arrays["commands"][which].swapaxes(0, 1)
    over[envs] = state.arrays["over"][which]
    core.place_mixing(envs)
    if state.estimation is not None:
        core.estimation = copy.deepcopy(state.estimation, _shared(core))  # type: ignore[assignment]


def made_with(core: SteeringCore) -> Made:
    """What environments must have in common to go on from each other's states."""
    return {
        "scene": core.scene,
        "task": type(core.task).__name__,
        "targets": core.task.targets.table.tobytes(),
        "resolution": core.resolution,
        "precision": core.precision,
        "plane": core.plane,
        "coils": core.coils,
        "actuator": core.actuator,
        "control_rate": core.control_rate,
        "camera": core.camera,
        "observe": core.observe,
        "randomization": core.randomization,
    }


def checked_state(state: object, core: SteeringCore, envs: object) -> tuple[EnvState, np.ndarray]:
    """A state and the indices (M,) of the environments that are to take it.

    Raises:
        ValueError: if it is none, comes from environments of another make, or does not fit the indices.
    """
    if not isinstance(state, EnvState):
        raise ValueError(
            f"state must be what get_state() returned, but got {type(state).__name__}: take one of such an environment."
        )
    for name, value in made_with(core).items():
        if state.made_with.get(name) != value:
            raise ValueError(
                f"state must come from environments made alike, but their {name} differs: make both with the same "
                "arguments."
            )
    which = np.arange(core.num_envs) if envs is None else np.atleast_1d(np.asarray(envs))
    good = which.ndim == 1 and which.size > 0 and which.dtype.kind in "iu" and len(np.unique(which)) == len(which)
    if not good or which.min() < 0 or which.max() >= core.num_envs:
        raise ValueError(
            f"envs must be different indices between 0 and {core.num_envs - 1}, but got {envs!r}: leave it None for "
            "all."
        )
    if len(state) not in (1, len(which)) or (state.estimation is not None and len(state) != core.num_envs):
        raise ValueError(
            f"state must be of one environment or of {len(which)}, but is of {len(state)}: index it, state[0], or "
            "choose envs."
        )
    if (state.estimation is None) != (core.estimation is None) or (state.estimation is not None and envs is not None):
        raise ValueError(
            "state of environments whose state is estimated must go to all environments of such a batch: their "
            "estimators share one."
        )
    return state, which.astype(np.int64)


def _shared(core: SteeringCore) -> dict[int, object]:
    """What a copy of the estimation shares with the core."""
    shared = [core, core.batch, core.rods, core.commands, core.view, *core.episodes]
    return {id(part): part for part in shared}
