"""A trained policy's network by itself, in NumPy: what the repository ships, small and readable without torch."""

from __future__ import annotations

import io
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from agents.run_folder import write_whole

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

    from agents.network import SkipPolicy


@dataclass(frozen=True)
class Policy:
    """Mean action of a Gaussian policy: a tanh network beside a linear path.

    layers: pairs of weights (out, in) and biases (out,); the last, linear layer sees the output of the tanh layers and
    the observation, and its result is clipped to [-1, 1].

    Raises:
        ValueError: if weights do not fit each other or are not finite.
    """

    layers: tuple[tuple[np.ndarray, np.ndarray], ...]

    def __post_init__(self) -> None:
        if len(self.layers) < 2:
            raise ValueError(
                f"layers of a policy must be at least one tanh layer and the last, but got {len(self.layers)}."
            )
        width = self.size
        for k, (weights, biases) in enumerate(self.layers):
            width += self.size if k == len(self.layers) - 1 else 0
            if weights.ndim != 2 or weights.shape[1] != width or biases.shape != weights.shape[:1]:
                raise ValueError(
                    f"weights of layer {k} must have shape (out, {width}) and its biases (out,), "
                    f"but got {weights.shape} and {biases.shape}."
                )
            if not (np.isfinite(weights).all() and np.isfinite(biases).all()):
                raise ValueError(f"weights and biases of layer {k} must be finite, but got NaN or infinity.")
            width = len(biases)

    @property
    def size(self) -> int:
        """Entries of an observation."""
        return self.layers[0][0].shape[-1] if self.layers[0][0].ndim else 0

    def __call__(self, observations: np.ndarray, envs: object = None) -> np.ndarray:
        """Actions (num_envs, num_axes) for observations (num_envs, size)."""
        seen = values = np.asarray(observations, np.float64)
        if seen.ndim != 2 or seen.shape[1] != self.size:
            raise ValueError(
                f"observations must have shape (num_envs, {self.size}), but got {seen.shape}: "
                "evaluate a policy in the environment that it was trained in."
            )
        for weights, biases in self.layers[:-1]:
            values = np.tanh(values @ weights.T + biases)
        weights, biases = self.layers[-1]
        values = np.concatenate([values, seen], axis=1)
        return np.clip(values @ weights.T + biases, -1.0, 1.0)

    def save(self, path: Path, **facts: str) -> None:
        """Write weights as float32, with facts about how they were made, to a .npz file."""
        arrays: dict[str, np.ndarray] = {f"fact_{name}": np.array(text) for name, text in facts.items()}
        for k, (weights, biases) in enumerate(self.layers):
            arrays[f"weights_{k}"], arrays[f"biases_{k}"] = weights.astype(np.float32), biases.astype(np.float32)
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
        write_whole(Path(path), buffer.getvalue())

    @classmethod
    def load(cls, path: Path) -> Policy:
        """Read a policy from a .npz file of `save`; nothing in it is run.

        Raises:
            ValueError: if there is no such file, or it does not hold a policy, whole and finite.
        """
        if not Path(path).is_file():
            raise ValueError(
                f"path must be a policy file, but {path} does not exist: train one with scripts/train_ppo.py."
            )
        try:
            return cls(_layers_in(_arrays_in(Path(path))))
        except ValueError as error:
            raise ValueError(
                f"{path} must be a policy file as training writes it, policy.npz, but {_clause(error)}: "
                "train one with scripts/train_ppo.py."
            ) from None

    @classmethod
    def of_sb3(cls, model: BaseAlgorithm) -> Policy:
        """The deterministic policy of a Stable-Baselines3 model with `agents.network.SkipPolicy`."""
        from torch import nn

        policy = cast("SkipPolicy", model.policy)
        linear = [layer for layer in policy.mlp_extractor.policy_net if isinstance(layer, nn.Linear)]
        linear.append(cast("nn.Linear", policy.action_net))
        return cls(
            tuple(
                (layer.weight.detach().cpu().numpy().astype(float), layer.bias.detach().cpu().numpy().astype(float))
                for layer in linear
            )
        )


def _arrays_in(path: Path) -> dict[str, np.ndarray]:
    """All arrays of a .npz file by name, except facts about how they were made."""
    try:
        opened = np.load(path, allow_pickle=False)
        if isinstance(opened, np.ndarray):
            raise ValueError("it holds a single array")
        with opened as file:
            return {name: file[name] for name in file.files if not name.startswith("fact_")}
    except (EOFError, KeyError, NotImplementedError, OSError, zipfile.BadZipFile, zlib.error) as error:
        raise ValueError(f"it cannot be read ({error or type(error).__name__})") from None


def _layers_in(arrays: dict[str, np.ndarray]) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Pairs of weights and biases, in order, from arrays by name."""
    count = sum(name.startswith("weights_") for name in arrays)
    names = {f"{kind}_{k}" for kind in ("weights", "biases") for k in range(count)}
    if arrays.keys() != names or not names:
        wrong = ", ".join(sorted(map(repr, names ^ arrays.keys()))) or "every layer"
        raise ValueError(f"{wrong} is missing or unknown in it")
    for name, array in arrays.items():
        if array.dtype.kind != "f":
            raise ValueError(f"{name} holds {array.dtype} and not real numbers")
    return tuple((arrays[f"weights_{k}"].astype(float), arrays[f"biases_{k}"].astype(float)) for k in range(count))


def _clause(error: ValueError) -> str:
    """A sentence without its full stop, to go into another."""
    return str(error).splitlines()[0].rstrip(".")
