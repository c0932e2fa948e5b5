"""What the programs share: cases, the run loop, the store of finished results, reports, figures, the command line."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
