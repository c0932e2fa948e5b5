"""How exact the rod is, and what that costs: `python -m scripts.accuracy [--quick] [--json FILE] [--parts PART ...]`.

Errors in mm beside run times. The truth of the moving rods and of the equilibria is tests/reference/reference.npz, made
by a spectral-element solver that shares no code with this package; the rest are closed forms. Ends with the acceptance
figures, and with exit status 1 where one is not met. `--parts twist_and_tension` measures that part alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from scripts.accuracy.motion import driven, energy, free_decay, order_in_space, order_in_time, twisting_motion
from scripts.accuracy.rest import arc, loaded_rods, locking, statics
from scripts.common.command import Options, main
from scripts.common.report import Report

Part = Literal[
    "free_decay",
    "driven",
    "statics",
    "energy",
    "order_in_time",
    "order_in_space",
    "arc",
    "locking",
    "twist_and_tension",
]
PARTS: dict[Part, tuple[Callable[[Report, bool], None], ...]] = {
    "free_decay": (free_decay,),
    "driven": (driven,),
    "statics": (statics,),
    "energy": (energy,),
    "order_in_time": (order_in_time,),
    "order_in_space": (order_in_space,),
    "arc": (arc,),
    "locking": (locking,),
    "twist_and_tension": (loaded_rods, twisting_motion),
}


@dataclass
class Args(Options):
    """What to measure."""

    parts: tuple[Part, ...] = ()
    """which tables, in the order of the page; all of them by default"""


def measure(args: Args) -> Report:
    """Every table asked for, printed as it is ready."""
    report = Report("scripts.accuracy", args.quick)
    for part, tables in PARTS.items():
        for show in tables if not args.parts or part in args.parts else ():
            show(report, args.quick)
    return report


if __name__ == "__main__":
    main(Args, measure, __doc__)
