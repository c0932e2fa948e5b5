"""State estimation: what cameras see of a rod, and filters that tell its shape and motion from it."""

from magrod_env.estimation.measurement import Measurement

__all__ = ["Measurement"]
