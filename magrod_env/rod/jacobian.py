"""Derivatives of a helical element's strains by the poses of its ends, for the implicit step's stiffness.

Notation of ``helical.py``. A matrix is a tuple of its columns, one for each unit displacement (world) or unit rotation
(body) of an end. The variations are derived in docs/physics.md; tests compare them with finite differences.
"""

from magrod_env._jit import inline_jit
from magrod_env.rod.helical import unwind
from magrod_env.rod.so3 import add, add_scaled, cross, dot, scale, strain_slope, subtract


@inline_jit
def wind_change(w, along, phi, gamma, twice, geometry):
    """``-dS gamma`` where phi changes by ``w``; ``along`` = phi.w and ``twice`` = phi x (phi x gamma)."""
    chord, u, mid, q, unused, r, x, a, sinc_inverse = geometry
    slope = strain_slope(16.0 * x * q * q)
    change = add_scaled(scale(dot(w, gamma), phi), dot(phi, gamma), w)
    change = scale(-a, add_scaled(change, -2.0 * along, gamma))
    return add_scaled(change, -slope * along, twice)


@inline_jit
def strain_jacobian(gamma, phi, geometry, inverse_length):
    """Derivatives of the strains: of gamma by the position of b (a: its negative), by the rotations of a and of b; of
    phi by the rotations of a and of b.
    """
    chord, u, mid, q, w, r, x, a, sinc_inverse = geometry
    beta = 0.0625 * (w + q) * sinc_inverse * r
    by_position = (
        scale(inverse_length, unwind(mid[0], phi, a, sinc_inverse)),
        scale(inverse_length, unwind(mid[1], phi, a, sinc_inverse)),
        scale(inverse_length, unwind(mid[2], phi, a, sinc_inverse)),
    )
    twice = cross(phi, cross(phi, gamma))
    shrink, lean = 1.0 - beta * dot(phi, phi), -0.5 * dot(chord, u)
    p0, p1, p2 = scale(beta, phi)
    even = (
        (shrink + p0 * phi[0], p0 * phi[1], p0 * phi[2]),
        (p1 * phi[0], shrink + p1 * phi[1], p1 * phi[2]),
        (p2 * phi[0], p2 * phi[1], shrink + p2 * phi[2]),
    )
    zero = 0.0 * phi[0]
    odd = (
        (zero, 0.5 * phi[2], -0.5 * phi[1]),
        (-0.5 * phi[2], zero, 0.5 * phi[0]),
        (0.5 * phi[1], -0.5 * phi[0], zero),
    )
    turned = (
        (zero, 0.5 * chord[2], -0.5 * chord[1]),
        (-0.5 * chord[2], zero, 0.5 * chord[0]),
        (0.5 * chord[1], -0.5 * chord[0], zero),
    )
    u0, u1, u2 = scale(0.5 * chord[0], u), scale(0.5 * chord[1], u), scale(0.5 * chord[2], u)
    leant = (
        (u0[0] + lean, u0[1], u0[2]),
        (u1[0], u1[1] + lean, u1[2]),
        (u2[0], u2[1], u2[2] + lean),
    )
    common = (
        unwind(add(turned[0], wind_change(odd[0], zero, phi, gamma, twice, geometry)), phi, a, sinc_inverse),
        unwind(add(turned[1], wind_change(odd[1], zero, phi, gamma, twice, geometry)), phi, a, sinc_inverse),
        unwind(add(turned[2], wind_change(odd[2], zero, phi, gamma, twice, geometry)), phi, a, sinc_inverse),
    )
    opposite = (
        unwind(add(leant[0], wind_change(even[0], phi[0], phi, gamma, twice, geometry)), phi, a, sinc_inverse),
        unwind(add(leant[1], wind_change(even[1], phi[1], phi, gamma, twice, geometry)), phi, a, sinc_inverse),
        unwind(add(leant[2], wind_change(even[2], phi[2], phi, gamma, twice, geometry)), phi, a, sinc_inverse),
    )
    by_a = (
        subtract(common[0], opposite[0]),
        subtract(common[1], opposite[1]),
        subtract(common[2], opposite[2]),
    )
    by_b = add(common[0], opposite[0]), add(common[1], opposite[1]), add(common[2], opposite[2])
    bend_a = subtract(odd[0], even[0]), subtract(odd[1], even[1]), subtract(odd[2], even[2])
    bend_b = add(odd[0], even[0]), add(odd[1], even[1]), add(odd[2], even[2])
    return by_position, by_a, by_b, bend_a, bend_b


@inline_jit
def weighted1(column, along, across):
    """A vector times diag(along, across, across)."""
    return along * column[0], across * column[1], across * column[2]


@inline_jit
def weighted(columns, along, across):
    """Columns times diag(along, across, across)."""
    return (
        weighted1(columns[0], along, across),
        weighted1(columns[1], along, across),
        weighted1(columns[2], along, across),
    )


@inline_jit
def stretched1(column, direction, along, tied, across):
    """A vector times along d d^T + tied (I - d d^T) + diag(0, across, across), d a unit vector."""
    share, both = (along - tied) * dot(direction, column), tied + across
    return add_scaled((tied * column[0], both * column[1], both * column[2]), share, direction)


@inline_jit
def stretched(columns, direction, along, tied, across):
    """Columns of strains gamma times the stiffness against stretch along ``direction``, that of a chord under tension
    ``tied`` against turning, and that against shear.
    """
    return (
        stretched1(columns[0], direction, along, tied, across),
        stretched1(columns[1], direction, along, tied, across),
        stretched1(columns[2], direction, along, tied, across),
    )
