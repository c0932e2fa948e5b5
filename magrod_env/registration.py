"""Ids of the environments."""

import gymnasium

IDS: dict[str, tuple[dict[str, object], int]] = {
    "MagRod/Circle-v0": ({"task": "circle"}, 300),
    "MagRod/Path-v0": ({"task": "path"}, 400),
    "MagRod/Reach-v0": ({"task": "reach"}, 100),
    "MagRod/ReachGoal-v0": ({"task": "reach", "goal": True}, 100),
    "MagRod/TwoMagnet-v0": ({"task": "two_magnet"}, 400),
    "MagRod/PlanarReach-v0": ({"task": "planar_reach"}, 100),
}


def register_all() -> None:
    """Register every id, once."""
    for name, (arguments, steps) in IDS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                id=name,
                entry_point="magrod_env.envs.single:MagRodEnv",
                vector_entry_point="magrod_env.envs.vector:MagRodVectorEnv",
                max_episode_steps=steps,
                kwargs=arguments,
            )
