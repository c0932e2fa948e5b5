"""The command line of a program that reports: its options, what it measures, its exit status."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

import tyro

from scripts.common.report import Report


@dataclass
class Options:
    """What to measure."""

    quick: bool = False
    """a small part of it, in seconds or minutes, to see that it runs"""
    json: Path | None = None
    """where to write the numbers as JSON"""


@dataclass
class PageOptions(Options):
    """What to measure and write."""

    page: Path | None = None
    """where to write the page of documentation"""


@dataclass
class FigureOptions(PageOptions):
    """What to measure, write and draw."""

    figures: Path | None = None
    """folder for the figures (needs matplotlib)"""


Chosen = TypeVar("Chosen", bound=Options)


def main(
    kind: type[Chosen],
    measure: Callable[[Chosen], Report],
    about: str | None,
    *,
    strict: Literal["always", "full runs", "never"] = "always",
) -> None:
    """Read the arguments, measure, report; exit with status 1 where a check is not met, if that run is `strict`."""
    args = tyro.cli(kind, description=about)
    met = measure(args).finish(args.json, getattr(args, "page", None))
    lenient = strict == "never" or (strict == "full runs" and args.quick)
    sys.exit(0 if met or lenient else 1)
