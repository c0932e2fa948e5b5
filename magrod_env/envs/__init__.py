"""Gymnasium environments of magnetic rods."""

from magrod_env.envs.estimating import EstimateState
from magrod_env.envs.settings import Camera, Randomization
from magrod_env.envs.single import MagRodEnv
from magrod_env.envs.vector import MagRodVectorEnv

__all__ = ["Camera", "EstimateState", "MagRodEnv", "MagRodVectorEnv", "Randomization"]
