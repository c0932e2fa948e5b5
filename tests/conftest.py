"""Settings that must be in place before numerical libraries load; subprocesses of tests inherit them."""

import os

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("OMP_NUM_THREADS", "1")  # torch and BLAS: several pytest workers share the cores
