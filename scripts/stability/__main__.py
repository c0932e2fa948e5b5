"""How far the rod can be trusted: `python -m scripts.stability [--part NAME] [--quick] [--json FILE] [--figures DIR]`.

bound: the largest stable step, found by bisection on the kernel, against the predicted one.
long: energy, momentum and orthogonality over a hundred million steps.
extreme: thousands of random scenes, each of which must end as correct, coarse (its elements, step or float32 resolve
it badly, as finer runs show), reported, or sensitive (finer runs differ among themselves); none may be wrong and
silent.
stiff: speed and error of thin metal rods.
commands: environments under bang-bang commands.

Exit status 1 where a check is not met.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from scripts import Report
from scripts.stability import figures
from scripts.stability.bound import bound
from scripts.stability.commands import commands
from scripts.stability.extreme import extreme, replay
from scripts.stability.long import long
from scripts.stability.stiff import stiff

PARTS = ("bound", "long", "extreme", "stiff", "commands")


@dataclass
class Args:
    """What to measure."""

    part: Literal["all", "bound", "long", "extreme", "stiff", "commands"] = "all"
    """one part only"""
    quick: bool = False
    """a small part of it, in a minute"""
    json: Path | None = None
    """where to write the numbers as JSON"""
    figures: Path | None = None
    """folder for pictures (needs matplotlib)"""
    resume: Path | None = None
    """JSON-lines file of the random scenes that are done; else extreme.jsonl beside --json"""
    replay: int | None = None
    """only show one random scene, by its seed"""


def measure(args: Args) -> Report:
    """The parts asked for, printed as they are ready."""
    report = Report("scripts.stability", args.quick)
    chosen = PARTS if args.part == "all" else (args.part,)
    lines = args.resume or (None if args.json is None else args.json.with_name("extreme.jsonl"))
    if "bound" in chosen:
        bound(report, args.quick)
        if args.figures:
            figures.draw_bound(report, args.figures)
    if "long" in chosen:
        kept = long(report, args.quick)
        if args.figures:
            figures.draw_long(kept, args.figures)
    if "extreme" in chosen:
        records = extreme(report, args.quick, lines)
        if args.figures:
            figures.draw_extreme(records, args.figures)
    if "stiff" in chosen:
        stiff(report, args.quick)
        if args.figures:
            figures.draw_stiff(report, args.figures)
    if "commands" in chosen:
        commands(report, args.quick)
    return report


def main() -> None:
    """Measure and report, or replay one seed."""
    args = tyro.cli(Args, description=__doc__)
    if args.replay is not None:
        replay(args.replay, args.quick)
        return
    sys.exit(0 if measure(args).finish(args.json) else 1)


if __name__ == "__main__":
    main()
