"""Command-line programs, run from the root of a checkout (`python -m scripts.demo`): few doors, one folder a study.

What they share is in `scripts.common`; `scripts.reference` holds the solver that shares nothing with the package.
"""
