"""Checks on user input, for the modules that look for them here."""

from magrod_env._checks import Vector, bounded, count, number, points, unit_vector, vector

__all__ = ["Vector", "bounded", "count", "number", "points", "unit_vector", "vector"]
