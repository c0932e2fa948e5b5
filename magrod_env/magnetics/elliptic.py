"""Complete elliptic integrals by the arithmetic-geometric mean, in forms that lose no digits at m -> 0.

A field of a current loop needs K(m), E(m) and a difference of the two that vanishes like m^2 on the axis of
the loop. With the Gauss sequence a_n, b_n, c_n started from a_0 = 1, b_0 = sqrt(1 - m), c_0 = sqrt(m)
(Abramowitz and Stegun 17.6),

    E = K (1 - m/2 - m^2 sigma),    sigma = sum over n >= 1 of 2^(n-1) (c_n / m)^2,

and c_n / m obeys a recursion without a division by m, so that sigma is exact to rounding down to m = 0.
"""

from __future__ import annotations

import numpy as np

_STEPS = 10  # the sequence converges quadratically; 10 steps suffice down to a complementary modulus of 1e-16


def complete_integrals(complementary_modulus: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return K(m), E(m) and sigma(m), each of shape (...), for kc = sqrt(1 - m) of shape (...) in (0, 1]."""
    kc = complementary_modulus
    m = (1.0 - kc) * (1.0 + kc)
    a, b = 0.5 * (1.0 + kc), np.sqrt(kc)
    c_over_m = 0.25 / a  # c_1 = (1 - kc)/2 = m / (2 (1 + kc))
    sigma, weight = c_over_m**2, 1.0
    for _ in range(_STEPS):
        a, b = 0.5 * (a + b), np.sqrt(a * b)
        c_over_m = 0.25 * m * c_over_m**2 / a
        weight *= 2.0
        sigma = sigma + weight * c_over_m**2
    first_kind = 0.5 * np.pi / a
    return first_kind, first_kind * (1.0 - 0.5 * m - m**2 * sigma), sigma
