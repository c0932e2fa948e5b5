"""Drag linear in the motion: a force -c m v on every lumped mass, and spin drag, a torque -c_s J omega.

Semi-implicit, with the mean of the motion before and after a kick: stable at every rate, no bound on the step.
"""

from magrod_env._jit import inline_jit
from magrod_env._simd import constant, load


@inline_jit
def braking(block, row, drag, time_step, lanes):
    """Factors of a semi-implicit linear drag over one step: what is kept of a motion, and what a unit load adds."""
    one = constant(1.0, load(block, 0, lanes))
    if drag is None:
        return one, time_step * one
    half_rate = 0.5 * time_step * load(block, row, lanes)
    return (1.0 - half_rate) / (1.0 + half_rate), time_step / (1.0 + half_rate)
