"""Physical constants of the magnetics, SI."""

MU_0 = 1.25663706127e-6
"""Magnetic permeability of vacuum, N/A^2 (CODATA 2022)."""
