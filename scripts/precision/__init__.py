"""Error against run time: scenes, set-ups, runs and figures of the program `python -m scripts.error_vs_runtime`."""

from scripts.precision.trials import Trial, begin, trace, trials

__all__ = ["Trial", "begin", "trace", "trials"]
