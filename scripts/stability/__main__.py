"""How far the rod can be trusted: `python -m scripts.stability [--part NAME] [--quick] [--json FILE] [--figures DIR]`.

bound: the largest stable step, found by bisection on the kernel, against the predicted one.
long: energy, momentum and orthogonality over a hundred million steps.
extreme: thousands of random scenes, each of which must end as correct, coarse (its elements, step or float32 resolve
it badly, as finer runs show) with or without a warning, reported, or sensitive (finer runs differ among themselves);
none may be wrong and silent.
stiff: speed and error of thin metal rods.
commands: environments under coils at their limit that flip every few control steps.

Exit status 1 where a check is not met.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from scripts.common.command import FigureOptions, main
from scripts.common.report import Report
from scripts.stability.bound import bound
from scripts.stability.commands import commands
from scripts.stability.extreme import extreme, replay
from scripts.stability.long import long
from scripts.stability.stiff import stiff

FIGURES = {"bound": "straight_bounds", "long": "long", "extreme": "extreme_kinds", "stiff": "stiff"}
"""Part and the table that its figure stands above."""


@dataclass
class Args(FigureOptions):
    """What to measure."""

    part: Literal["all", "bound", "long", "extreme", "stiff", "commands"] = "all"
    """one part only"""
    resume: Path | None = None
    """JSON-lines file of the random scenes that are done; else extreme.jsonl beside --json"""
    scenes: int | None = None
    """number of random scenes; None for all"""
    replay: int | None = None
    """only show one random scene, by its seed"""


def measure(args: Args) -> Report:
    """The parts asked for, printed as they are ready; or one seed again."""
    report = Report("scripts.stability", args.quick, "stability.md")
    if args.replay is not None:
        replay(args.replay, args.quick)
        raise SystemExit
    wanted = (*FIGURES, "commands") if args.part == "all" else (args.part,)
    if "bound" in wanted:
        bound(report, args.quick)
    kept = long(report, args.quick) if "long" in wanted else {}
    beside = None if args.json is None else args.json.with_name("extreme.jsonl")
    lines = extreme(report, args.quick, args.resume or beside, args.scenes) if "extreme" in wanted else []
    if "stiff" in wanted:
        stiff(report, args.quick)
    if "commands" in wanted:
        commands(report, args.quick)
    if args.figures is not None:
        from scripts.stability import figures  # matplotlib

        paths = {part: args.figures / f"stability_{part}.png" for part in FIGURES if part in wanted}
        draw = {
            "bound": lambda path: figures.draw_bound(report, path),
            "long": lambda path: figures.draw_long(kept, path),
            "extreme": lambda path: figures.draw_extreme(lines, path),
            "stiff": lambda path: figures.draw_stiff(report, path),
        }
        for part, path in paths.items():
            draw[part](path)
            report.figures[FIGURES[part]] = path
    return report


if __name__ == "__main__":
    main(Args, measure, __doc__)
