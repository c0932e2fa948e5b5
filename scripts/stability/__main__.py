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

PAGE = """# Stability on stiff and extreme cases

How far the rod can be trusted: the largest stable step against the predicted one, very long runs, thousands of
random extreme scenes, thin metal rods, and environments under the worst commands. What a status means is in
[physics](physics.md#11-the-watchdog); what to choose is in [resolution](resolution.md).

**The bound.** For straight rods the largest stable step, found by bisection on the kernel itself, lies within 0.1 %
of the predicted one, for both elements, 1 to 40 elements, all scenes, conditioned or not. At sagging and magnetised
equilibria it agrees with the rod linearised there. `stable_time_step_in(B)` is the bound of the *straight* rod in a
field: a coarse rod that a strong field has bent far may need less (the table of states), and the watchdog then
reports it. The default step stays below the found one in every state tried.

**The paper's steps.** Three of the five time steps printed in Tables 3 to 7 lie beyond the limit of the paper's own
scheme (nodal element, its number of elements), by factors of 3.26, 6.49 and 2.96; at those steps the run is lost
within 256 steps.

**Long runs.** A clamp takes up linear and angular momentum, so the long runs follow what it leaves alone: a round
rod with gravity along its axis keeps Q = J_x - sum of Pi_1, the Noether momentum of turning the rod about x while
turning every section back. In float64 energy is bounded and Q holds to rounding; float32 loses both slowly: train
with it, do not measure energy with it.

**Extreme scenes.** Each random scene runs once as a user would run it and is then held against finer runs.
*Correct*: within 5 % of its swing. *Coarse*: finer runs agree with one another and this one does not; the same
elements at a quarter of the step agree, so that it lacks elements, or its errors fall with the step as those of second
order do. *Warned*: the simulation said so itself, by
a `CoarseWarning`, an estimate before the run that compares the elements with the length over which the loads bend
the rod; *silent*: it missed that. *Reported*: a status or a refusal, with advice. *Sensitive*: finer runs, or runs
with loads changed by 1e-4, disagree among themselves. *Wrong and silent* must be zero. The truth here is this same
code run finer; independent truths are in [accuracy](accuracy.md). Scenes are kept as they are done (`--resume`): this
table gathers several runs, between which the code under test did not change.

Fields step, reverse, rise, turn and swing, flip to and fro up to sixty times (*flips*), or are drawn anew as an agent
explores (*random*), every twentieth to three periods of the scene; every run of a scene has the same field at the same
times. Implicit runs are judged by an explicit one with more elements wherever that can follow the motion for a period;
else, as in the table of integrators, by a quarter of their own step. Explicit judges of rods with internal damping,
whose errors fall slowly with the step, take an eighth of the usual one.

**Thin metal rods.** At the speed of a conditioned explicit run, implicit steps err less on rods that ring, and about as
much on a wire in a slow field. A tolerance takes them by itself.
"""

FIGURES = {"straight_bounds": "bound", "long": "long", "extreme_kinds": "extreme", "stiff": "stiff"}
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
    page: Path | None = None
    """where to write the page of documentation"""
    scenes: int | None = None
    """number of random scenes; None for all"""
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
        records = extreme(report, args.quick, lines, args.scenes)
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
    report = measure(args)
    if args.page is not None:
        shown = (
            {}
            if args.figures is None
            else {key: args.figures / f"stability_{name}.png" for key, name in FIGURES.items()}
        )
        report.write_page(args.page, PAGE, {key: path for key, path in shown.items() if path.exists()})
    sys.exit(0 if report.finish(args.json) else 1)


if __name__ == "__main__":
    main()
