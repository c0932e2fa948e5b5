"""How fast it is: `python -m scripts.bench [--quick] [--json FILE]`.

The first step of a fresh process, the cold compilation of what the demo needs, environment and kernel speeds, frames a
second, memory. Every speed is the least time of several runs after a warm-up: other processes only ever add time. The
load average beside the machine's facts says how quiet it was. `--quick` leaves out the cold compilation.
"""

from __future__ import annotations

from scripts.common.command import PageOptions, main
from scripts.common.report import Report
from scripts.speed.environments import environments, frames, memory, targets
from scripts.speed.kernels import features, kernels, scaling
from scripts.speed.start import start_up

TABLES = (start_up, targets, environments, kernels, features, scaling, frames, memory)


def measure(args: PageOptions) -> Report:
    """Every table, printed as it is ready."""
    report = Report("scripts.bench", args.quick, "speed.md")
    for show in TABLES:
        show(report, args.quick)
    return report


if __name__ == "__main__":
    main(PageOptions, measure, __doc__, strict="never")
