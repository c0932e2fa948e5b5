"""The policy's network: two tanh layers beside a linear path from the observation to the action.

A controller is nearly linear (the new field is the old field plus a gain times the error), which tanh layers alone
approximate to a few per cent of the coils' limit: millimetres at the tip.
"""

from __future__ import annotations

from typing import Any

import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.type_aliases import Schedule
from torch import nn


class SkipExtractor(nn.Module):
    """Latent vectors of actor and critic: the observation itself beside the output of two tanh layers."""

    def __init__(self, size: int, hidden: int) -> None:
        super().__init__()
        self.policy_net, self.value_net = self._layers(size, hidden), self._layers(size, hidden)
        self.latent_dim_pi = self.latent_dim_vf = size + hidden

    @staticmethod
    def _layers(size: int, hidden: int) -> nn.Sequential:
        return nn.Sequential(nn.Linear(size, hidden), nn.Tanh(), nn.Linear(hidden, hidden), nn.Tanh())

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Both latent vectors."""
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """Latent vector of the actor."""
        return torch.cat([self.policy_net(features), features], dim=1)

    def forward_critic(self, features: torch.Tensor) -> torch.Tensor:
        """Latent vector of the critic."""
        return torch.cat([self.value_net(features), features], dim=1)


class SkipPolicy(ActorCriticPolicy):
    """Actor and critic with `SkipExtractor`; the first policy repeats the field that it sees.

    field_entries: where an observation holds the field of each coil pair, in the order of the actions.
    """

    def __init__(self, *arguments: Any, hidden: int = 64, field_entries: tuple[int, ...] = (), **keywords: Any) -> None:
        self.hidden, self.field_entries = hidden, field_entries
        super().__init__(*arguments, **keywords)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = SkipExtractor(self.features_dim, self.hidden)  # type: ignore[assignment]

    def _build(self, lr_schedule: Schedule) -> None:
        super()._build(lr_schedule)
        with torch.no_grad():
            for axis, entry in enumerate(self.field_entries):
                self.action_net.weight[axis, self.hidden + entry] = 1.0  # type: ignore[operator]

    def _get_constructor_parameters(self) -> dict[str, Any]:
        return super()._get_constructor_parameters() | {"hidden": self.hidden, "field_entries": self.field_entries}
