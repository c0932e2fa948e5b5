"""Gravity: m g on every lumped mass, with the potential energy -m g.p."""

from magrod_env._jit import inline_jit
from magrod_env.rod.access import load2, load3
from magrod_env.rod.layout import GRAVITY
from magrod_env.rod.so3 import add, dot


@inline_jit
def add_gravity(acceleration, block, lanes, planar):
    """Acceleration of a node (world, m/s^2) with that of free fall added."""
    if planar is None:
        return add(acceleration, load3(block, GRAVITY, lanes))
    pull = load2(block, GRAVITY, lanes)
    return acceleration[0] + pull[0], acceleration[1] + pull[1]


@inline_jit
def gravity_energy(block, mass, position, lanes, planar):
    """Potential energy of a node, J; the clamp's node is its zero."""
    if planar is None:
        return -mass * dot(load3(block, GRAVITY, lanes), position)
    gravity = load2(block, GRAVITY, lanes)
    return -mass * (gravity[0] * position[0] + gravity[1] * position[1])
