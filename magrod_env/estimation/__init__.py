"""State estimation: what cameras see of a rod, and filters that tell its shape and motion from it."""

from magrod_env.estimation.cameras import GaussianCameras, StereoCameras
from magrod_env.estimation.ensemble import EnsembleFilter
from magrod_env.estimation.measurement import Measurement
from magrod_env.estimation.pinhole import PinholeCamera
from magrod_env.estimation.prediction_filter import PredictionFilter
from magrod_env.estimation.stream import CameraStream
from magrod_env.estimation.unknowns import Unknown
from magrod_env.estimation.unscented import UnscentedFilter

__all__ = [
    "CameraStream",
    "EnsembleFilter",
    "GaussianCameras",
    "Measurement",
    "PinholeCamera",
    "PredictionFilter",
    "StereoCameras",
    "Unknown",
    "UnscentedFilter",
]
