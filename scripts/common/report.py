"""A report: Markdown tables and checks on the screen, as JSON beside the machine's facts, as a page of documentation.

A page has two parts: text that people write, and below `MARKER` what its program writes anew each time.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from datetime import datetime, timezone
from importlib import metadata
from pathlib import Path

from scripts.common import ROOT

PACKAGES = ("magrod-env", "numpy", "numba", "llvmlite", "gymnasium")
MARKER = "<!-- All that follows is written by the command at its end. -->"
VERDICTS = {True: "met", False: "NOT MET", None: "not measured"}


@dataclass
class Table:
    """Rows of text, numbers or None (nothing was measured) under `columns`."""

    title: str
    columns: Sequence[str]
    rows: list[tuple] = field(default_factory=list)
    note: str = ""

    def add(self, *cells: object) -> None:
        """Append a row."""
        self.rows.append(cells)

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
    unit: str = ""
    at_least: bool = False
    timing: bool = False

    @property
    def met(self) -> bool | None:
        """None where nothing was measured."""
        if self.value is None:
            return None
        return bool(self.value >= self.bound if self.at_least else self.value <= self.bound)

    @property
    def asked(self) -> str:
        """The bound in words."""
        return f"{'>=' if self.at_least else '<='} {self.bound:g} {self.unit}".rstrip()


@dataclass
class Report:
    """Tables and checks of one run of a program.

    Args:
        program: its module.
        quick: whether only a part is measured.
        page: name of its page under docs/, whose text a new page takes over.
        unlisted: keys of tables that are for the JSON only.
        figures: paths of pictures, by the key of the table that they stand above.
    """

    program: str
    quick: bool
    page: str = ""
    unlisted: tuple[str, ...] = ()
    tables: dict[str, Table] = field(default_factory=dict)
    checks: list[Check] = field(default_factory=list)
    figures: dict[str, Path] = field(default_factory=dict)
    machine: dict[str, str | float | None] = field(default_factory=lambda: machine())

    @contextmanager
    def table(self, key: str, title: str, columns: str, note: str = "") -> Iterator[Table]:
        """A table to fill under `columns`, parted by " | "; kept and printed where the block ends."""
        table = Table(title, columns.split(" | "), note=note)
        yield table
        self.tables[key] = table
        if key not in self.unlisted:
            print(f"\n{table.markdown()}", flush=True)

    def check(
        self,
        figure: str,
        what: str,
        value: float | None,
        bound: float,
        unit: str = "",
        *,
        at_least: bool = False,
        timing: bool = False,
    ) -> None:
        """Hold a figure against its bound."""
        self.checks.append(Check(figure, what, value, bound, unit, at_least, timing))

    def finish(self, path: Path | None = None, page: Path | None = None) -> bool:
        """Write the page and the JSON, print checks and machine; returns whether no check failed."""
        self.machine["load_average_at_end"] = _load()
        if page is not None:
            self.write_page(page)
        table = Table("Acceptance", ("figure", "what", "measured", "asked", ""))
        table.rows = [(each.figure, each.what, each.value, each.asked, VERDICTS[each.met]) for each in self.checks]
        print(f"\n{table.markdown()}\n\n### Machine\n\n{self._facts}\n- command: {self.command}")
        for key, drawn in self.figures.items():
            print(f"- figure of {key}: {drawn}")
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(self.as_dict(), indent=1, allow_nan=False) + "\n")
            print(f"- JSON: {path}")
        return all(check.met is not False for check in self.checks)

    def write_page(self, path: Path) -> None:
        """Write a page of documentation: its text, each table under the figure of its name, the machine's facts."""
        parts = [text_of(ROOT / "docs" / self.page), MARKER]
        for key, table in self.tables.items():
            if key in self.unlisted:
                continue
            if key in self.figures:
                parts.append(f"![{table.title}]({os.path.relpath(self.figures[key], path.parent)})")
            parts.append(table.markdown().replace("### ", "## ", 1))
        parts.append(f"## Machine\n\n{self._facts}\n- command: `{self.command}`")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n\n".join(parts) + "\n")

    @property
    def _facts(self) -> str:
        return "\n".join(f"- {name}: {value}" for name, value in self.machine.items() if value is not None)

    @property
    def command(self) -> str:
        """The command that made this report, files outside the checkout by their names alone."""
        words = (Path(word).name if word.startswith("/") else word for word in sys.argv[1:])
        return " ".join(["python -m", self.program, *words])

    def as_dict(self) -> dict[str, object]:
        """Everything as plain JSON types."""
        return {
            "program": self.program,
            "command": self.command,
            "quick": self.quick,
            "machine": self.machine,
            "tables": {key: asdict(table) for key, table in self.tables.items()},
            "checks": [asdict(check) | {"met": check.met} for check in self.checks],
        }


def text_of(page: Path) -> str:
    """What people wrote of a page: all above the marker.

    Raises:
        ValueError: where the marker is missing.
    """
    text, marker, _ = page.read_text().partition(MARKER)
    if not marker:
        raise ValueError(f"{page} must hold the line {MARKER!r} below its text, but it does not: put it there.")
    return text.strip()


def machine() -> dict[str, str | float | None]:
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


def _cell(value: object) -> str:
    """A number with three digits that matter; large ones with thousands apart."""
    if value is None:
        return "-"
    if not isinstance(value, float):
        return f"{value:,}" if isinstance(value, int) and not isinstance(value, bool) else str(value)
    return f"{value:,.0f}" if 1e3 <= abs(value) < 1e9 else f"{value:.3g}"
