"""Compiled commands of every environment: what reaches the coils, and how far their field has travelled."""

from magrod_env._jit import jit
from magrod_env.rod.layout import FIELD, TARGET


@jit
def write_commands(rows, commands, mixing, axes, num_envs, lagging):
    """Put the commanded fields (num_envs, 3) T, as misaligned coils make them, into the blocks (num_blocks, rows,
    L).
    """
    width = rows.shape[2]
    for i in range(num_envs):
        block, lane = i // width, i % width
        for k in range(len(axes)):
            field = 0.0
            for j in range(3):
                field += mixing[i, axes[k], j] * commands[i, j]
            rows[block, TARGET + k, lane] = field
            if not lagging:
                rows[block, FIELD + k, lane] = field


@jit
def add_travel(rows, travel, axes, before):
    """Count the change of every rod's field since ``before`` (num_envs, 3) for the watchdog, and note the field
    there.
    """
    width = rows.shape[2]
    for i in range(len(travel)):
        for k in range(len(axes)):
            field = rows[i // width, FIELD + k, i % width]
            travel[i] += abs(field - before[i, k])
            before[i, k] = field
