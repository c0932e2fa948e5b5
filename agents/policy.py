"""A trained policy's network by itself, in NumPy: what the repository ships, small and readable without torch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Policy:
    """Mean action of a Gaussian policy: a tanh network beside a linear path.

    layers: pairs of weights (out, in) and biases (out,); the last, linear layer sees the output of the tanh layers and
    the observation, and its result is clipped to [-1, 1].
    """

    layers: tuple[tuple[np.ndarray, np.ndarray], ...]

    def __call__(self, observations: np.ndarray, envs: Any = None) -> np.ndarray:
        """Actions (num_envs, num_axes) for observations (num_envs, size)."""
        seen = values = np.asarray(observations, np.float64)
        for weights, biases in self.layers[:-1]:
            values = np.tanh(values @ weights.T + biases)
        weights, biases = self.layers[-1]
        values = np.concatenate([values, seen], axis=1)
        return np.clip(values @ weights.T + biases, -1.0, 1.0)

    def save(self, path: Path, **facts: str) -> None:
        """Write weights as float32, with facts about how they were made, to a .npz file."""
        arrays: dict[str, Any] = {f"fact_{name}": np.array(text) for name, text in facts.items()}
        for k, (weights, biases) in enumerate(self.layers):
            arrays[f"weights_{k}"], arrays[f"biases_{k}"] = weights.astype(np.float32), biases.astype(np.float32)
        np.savez_compressed(path, **arrays)

    @classmethod
    def load(cls, path: Path) -> Policy:
        """Read a policy from a .npz file of `save`.

        Raises:
            ValueError: if there is no such file.
        """
        if not Path(path).exists():
            raise ValueError(
                f"path must be a policy file, but {path} does not exist: train one with scripts/train_ppo.py."
            )
        with np.load(path) as file:
            count = sum(name.startswith("weights_") for name in file.files)
            return cls(
                tuple((file[f"weights_{k}"].astype(float), file[f"biases_{k}"].astype(float)) for k in range(count))
            )

    @classmethod
    def of_sb3(cls, model: Any) -> Policy:
        """The deterministic policy of a Stable-Baselines3 model with `agents.network.SkipPolicy`."""
        linear = [layer for layer in model.policy.mlp_extractor.policy_net if hasattr(layer, "weight")]
        linear.append(model.policy.action_net)
        return cls(
            tuple(
                (layer.weight.detach().cpu().numpy().astype(float), layer.bias.detach().cpu().numpy().astype(float))
                for layer in linear
            )
        )
