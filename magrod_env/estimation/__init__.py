"""State estimation: what cameras see of a rod, and filters that tell its shape and motion from it."""

from magrod_env.estimation.measurement import Measurement
from magrod_env.estimation.prediction_filter import PredictionFilter

__all__ = ["Measurement", "PredictionFilter"]
