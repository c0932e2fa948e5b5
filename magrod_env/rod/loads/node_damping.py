"""Damping of every node's own: a force -K_k v_k along each world axis, kg/s, semi-implicit like the linear drag."""

from magrod_env._jit import inline_jit
from magrod_env.rod.access import load2, load3


@inline_jit
def braked(velocity, acceleration, share, damping, keep, gain):
    """One component of a velocity after a kick with a node's own damping (kg/s) beside the drag, semi-implicit.

    ``share`` = gain/(2 m), so that q = share damping is what the half step of damping adds to 1 + c dt/2, over that.
    """
    q = share * damping
    return ((keep - q) * velocity + gain * acceleration) / (1.0 + q)


@inline_jit
def damped_velocity(block, layout, node, velocity, acceleration, inverse_mass, keep, gain, lanes, planar):
    """Velocity of a node after a kick, with the linear drag's factors ``keep`` and ``gain``."""
    share = 0.5 * gain * inverse_mass
    if planar is None:
        own = load3(block, layout.node_damping + 3 * node, lanes)
        return (
            braked(velocity[0], acceleration[0], share, own[0], keep, gain),
            braked(velocity[1], acceleration[1], share, own[1], keep, gain),
            braked(velocity[2], acceleration[2], share, own[2], keep, gain),
        )
    own = load2(block, layout.node_damping + 2 * node, lanes)
    return (
        braked(velocity[0], acceleration[0], share, own[0], keep, gain),
        braked(velocity[1], acceleration[1], share, own[1], keep, gain),
    )
