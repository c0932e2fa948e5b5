"""Command-line programs, run from the root of a checkout (`python -m scripts.demo`), and how they report.

A report is a few Markdown tables on the screen and, if asked, the same numbers as JSON beside the machine's facts.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from datetime import datetime, timezone
from importlib import metadata
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("magrod-env", "numpy", "numba", "llvmlite", "gymnasium")


@dataclass
class Table:
    """Rows of text, numbers or None (nothing was measured) under `columns`."""

    title: str
    columns: tuple[str, ...]
    rows: list[tuple[Any, ...]] = field(default_factory=list)
    note: str = ""

    def markdown(self) -> str:
        """The table as Markdown, its columns aligned."""
        cells = [[_cell(value) for value in row] for row in (self.columns, *self.rows)]
        widths = [max(len(row[k]) for row in cells) for k in range(len(self.columns))]
        lines = ["| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths)) + " |" for row in cells]
        rule = "|" + "|".join("-" * (width + 2) for width in widths) + "|"
        note = f"\n\n{self.note}" if self.note else ""
        return "\n".join([f"### {self.title}", "", lines[0], rule, *lines[1:]]) + note


@dataclass
class Check:
    """An acceptance figure: `value` must be at most `bound`, or at least if `at_least`; `timing` if it is a speed."""

    figure: str
    what: str
    value: float | None
    bound: float
    unit: str
    at_least: bool = False
    timing: bool = False

    @property
    def met(self) -> bool | None:
        """None where nothing was measured."""
        if self.value is None:
            return None
        return bool(self.value >= self.bound if self.at_least else self.value <= self.bound)


@dataclass
class Report:
    """Tables and checks of one run of a program."""

    program: str
    quick: bool
    tables: dict[str, Table] = field(default_factory=dict)
    checks: list[Check] = field(default_factory=list)
    machine: dict[str, Any] = field(default_factory=lambda: machine())

    def show(self, key: str, table: Table) -> None:
        """Keep a table and print it."""
        self.tables[key] = table
        print(f"\n{table.markdown()}", flush=True)

    def finish(self, path: Path | None) -> bool:
        """Print the checks and the machine, write the JSON; returns whether no check failed."""
        self.machine["load_average_at_end"] = _load()
        verdict = {True: "met", False: "NOT MET", None: "not measured"}
        rows: list[tuple[Any, ...]] = []
        for check in self.checks:
            asked = f"{'>=' if check.at_least else '<='} {check.bound:g} {check.unit}".rstrip()
            rows.append((check.figure, check.what, check.value, asked, verdict[check.met]))
        self.show("checks", Table("Acceptance", ("figure", "what", "measured", "asked", ""), rows))
        facts = "\n".join(f"- {name}: {value}" for name, value in self.machine.items())
        print(f"\n### Machine\n\n{facts}\n- command: {self.command}")
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(self.as_dict(), indent=1, allow_nan=False) + "\n")
            print(f"- JSON: {path}")
        return all(check.met is not False for check in self.checks)

    def write_page(self, path: Path, text: str, figures: dict[str, Path], without: tuple[str, ...] = ()) -> None:
        """Write a page of documentation: a text, each table under the figure of its name, then the machine's facts.

        Tables named in `without` are for the JSON only.
        """
        parts = [text.strip()]
        for key, table in self.tables.items():
            if key in without:
                continue
            if key in figures:
                parts.append(f"![{table.title}]({os.path.relpath(figures[key], path.parent)})")
            parts.append(table.markdown().replace("### ", "## ", 1))
        facts = "\n".join(f"- {name}: {value}" for name, value in self.machine.items() if value is not None)
        parts.append(f"## Machine\n\n{facts}\n- command: `{self.command}`")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n\n".join(parts) + "\n")

    @property
    def command(self) -> str:
        """The command that made this report."""
        return " ".join(["python -m", self.program, *sys.argv[1:]])

    def as_dict(self) -> dict[str, Any]:
        """Everything as plain JSON types."""
        return {
            "program": self.program,
            "command": self.command,
            "quick": self.quick,
            "machine": self.machine,
            "tables": {key: asdict(table) for key, table in self.tables.items() if key != "checks"},
            "checks": [asdict(check) | {"met": check.met} for check in self.checks],
        }


def machine() -> dict[str, Any]:
    """What the numbers were measured on."""
    return {
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "platform": platform.platform(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "load_average": _load(),
        "python": platform.python_version(),
        **{name: _version(name) for name in PACKAGES},
        "commit": _commit(),
    }


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:  # run from a checkout that is not installed
        return None


def _commit() -> str | None:
    """The checkout's commit, with a plus sign where the sources differ from it."""
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty=+", "--exclude=*"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def _load() -> float | None:
    return round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None


def least_time(call: Callable[[], Any], *, repeats: int = 5, duration: float = 0.05) -> float:
    """Shortest time (s) of a call over `repeats` runs of about `duration` s each, after a warm-up call.

    Other processes only ever add time: the minimum is what the call takes.
    """
    call()
    start = time.perf_counter()
    call()
    count = max(1, round(duration / max(time.perf_counter() - start, 1e-9)))
    shortest = float("inf")
    for _ in range(repeats):
        start = time.perf_counter()
        for _ in range(count):
            call()
        shortest = min(shortest, (time.perf_counter() - start) / count)
    return shortest


def _cell(value: Any) -> str:
    """A number with three digits that matter; large ones with thousands apart."""
    if value is None:
        return "-"
    if not isinstance(value, float):
        return f"{value:,}" if isinstance(value, int) and not isinstance(value, bool) else str(value)
    return f"{value:,.0f}" if 1e3 <= abs(value) < 1e9 else f"{value:.3g}"
