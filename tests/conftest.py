"""Settings that must be in place before numerical libraries load; subprocesses of tests inherit them."""

import os

from hypothesis import settings

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("OMP_NUM_THREADS", "1")  # torch and BLAS: several pytest workers share the cores

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None, max_examples=30)
settings.load_profile("repeatable")  # the same examples in every run
