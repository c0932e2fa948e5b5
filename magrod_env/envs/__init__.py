"""Gymnasium environments of magnetic rods.

The classes are imported when they are asked for, so that the tasks' ids can be registered without the kernels.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from magrod_env.envs.attributes import RodAttributes, attributes_of
    from magrod_env.envs.estimating import EstimateState
    from magrod_env.envs.settings import Camera, Randomization
    from magrod_env.envs.single import MagRodEnv
    from magrod_env.envs.state import EnvState
    from magrod_env.envs.vector import MagRodVectorEnv

__all__ = [
    "Camera",
    "EnvState",
    "EstimateState",
    "MagRodEnv",
    "MagRodVectorEnv",
    "Randomization",
    "RodAttributes",
    "attributes_of",
]

_MODULES = {
    "Camera": "settings",
    "EnvState": "state",
    "EstimateState": "estimating",
    "MagRodEnv": "single",
    "MagRodVectorEnv": "vector",
    "Randomization": "settings",
    "RodAttributes": "attributes",
    "attributes_of": "attributes",
}


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
