"""What a filter must remember to go back to a frame's exposure: states and fields since then, piece by piece."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from magrod_env.estimation.measurement import SAME_TIME
from magrod_env.simulation import Simulation


@dataclass(eq=False)
class Piece:
    """A stretch of time under one field.

    rows (num_rods, rows of a lane block): the complete state at its start; field (num_rods, 3) T.
    """

    start: float
    duration: float
    field: np.ndarray
    rows: np.ndarray

    @property
    def end(self) -> float:
        """s."""
        return self.start + self.duration


def state_rows(simulation: Simulation) -> np.ndarray:
    """Complete state of every rod, float64, (num_rods, rows of a lane block)."""
    return simulation.rods.batch.gather(0, simulation.rods.batch.layout.size)


def set_state_rows(simulation: Simulation, rows: np.ndarray) -> None:
    """Give every rod a state that `state_rows` has read."""
    simulation.rods.batch.scatter(0, rows)
    simulation.rods.batch.status[:] = 0


def split(pieces: Sequence[Piece], time: float) -> tuple[list[Piece], list[Piece]]:
    """Pieces before and after a time, s; one that it cuts is in both, the second part with the rows of the first."""
    before, after = [], []
    for piece in pieces:
        if piece.end <= time + SAME_TIME:
            before.append(piece)
        elif piece.start >= time - SAME_TIME:
            after.append(piece)
        else:
            before.append(Piece(piece.start, time - piece.start, piece.field, piece.rows))
            after.append(Piece(time, piece.end - time, piece.field, piece.rows))
    return before, after


def replay(
    simulation: Simulation,
    rows: np.ndarray,
    pieces: Sequence[Piece],
    damping: np.ndarray | None = None,
    born: np.ndarray | None = None,
    note: bool = False,
) -> None:
    """Run a simulation, whose batch holds each rod one or more times in a row, through pieces of the past.

    Args:
        simulation: with node damping; afterwards it is in the state at the end.
        rows: state of every rod at the start, (num_rods, rows of a lane block).
        pieces: of the past, in order.
        damping: K of every rod of the batch, kg/s, (rods of the batch, num_nodes, 3); None leaves that of `rows`.
        born: time of each rod's last reset, s, (num_rods,): at every piece that starts no later than that, the rod
            takes the state that it then had.
        note: write the states on the way into the pieces.
    """
    copies = simulation.num_rods // len(rows)
    set_state_rows(simulation, np.repeat(rows, copies, axis=0))
    if damping is not None:
        simulation.rods.batch.set_node_damping(damping)
    for piece in pieces:
        other = None if born is None else born >= piece.start - SAME_TIME
        if other is not None and other.any():
            state = state_rows(simulation)
            again = np.repeat(other, copies)
            state[again] = np.repeat(piece.rows[other], copies, axis=0)
            set_state_rows(simulation, state)
            if damping is not None:
                simulation.rods.batch.set_node_damping(damping)
        if note:
            piece.rows = state_rows(simulation)
        simulation.advance(piece.duration, field=np.repeat(piece.field, copies, axis=0))
