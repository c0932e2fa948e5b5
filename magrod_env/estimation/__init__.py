"""State estimation: what cameras see of a rod, and filters that tell its shape and motion from it."""

from magrod_env.estimation.ensemble import EnsembleFilter
from magrod_env.estimation.measurement import Measurement
from magrod_env.estimation.unknowns import Unknown
from magrod_env.estimation.unscented import UnscentedFilter

__all__ = ["EnsembleFilter", "Measurement", "Unknown", "UnscentedFilter"]
