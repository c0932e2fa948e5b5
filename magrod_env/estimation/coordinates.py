"""A rod's state as the strains of its elements and their rates: coordinates in which states may be averaged.

Averaging the positions and rotations of bent rods shortens them: the mean of two arcs is no arc, and the axial
stiffness answers with forces that no rod felt. The strains of the helical element, its rotation vector phi (rad) and
its stretch-and-shear strain gamma (1, 0, 0 at rest), are a linear space, and the stored energy is quadratic in them: a
weighted mean of rods is again a rod that bends by the mean and stretches by no more than the mean
(docs/ensemble_filter.md).
"""

from __future__ import annotations

import numpy as np

from magrod_env._jit import jit
from magrod_env.rod.helical import helical_strain, helical_strain_rates
from magrod_env.rod.so3 import add, add_scaled, cross, dot, scale, strain_slope, subtract

SMALL = 1e-2  # rad^2: series below


@jit
def vector(row, first):
    """Three numbers of a row, as a tuple."""
    return row[first], row[first + 1], row[first + 2]


@jit
def read_strains(positions, quaternions, velocities, spins, lengths, strains):
    """Strains and rates (K, N, 12) of K rods: phi (rad), gamma, and their rates (1/s).

    ``positions``, ``velocities`` (m, m/s, world) and ``spins`` (rad/s, body) (K, N + 1, 3), ``quaternions``
    (K, N + 1, 4), element ``lengths`` (N,) m.
    """
    for k in range(positions.shape[0]):
        for e in range(len(lengths)):
            q, s = quaternions[k, e], quaternions[k, e + 1]
            pose_a = (vector(positions[k, e], 0), (q[0], q[1], q[2], q[3]))
            pose_b = (vector(positions[k, e + 1], 0), (s[0], s[1], s[2], s[3]))
            gamma, phi, geometry = helical_strain(pose_a, pose_b, 1.0 / lengths[e])
            gamma_rate, phi_rate = helical_strain_rates(
                gamma,
                phi,
                geometry,
                vector(velocities[k, e], 0),
                vector(spins[k, e], 0),
                vector(velocities[k, e + 1], 0),
                vector(spins[k, e + 1], 0),
                1.0 / lengths[e],
            )
            for i in range(3):
                strains[k, e, i] = phi[i]
                strains[k, e, 3 + i] = gamma[i]
                strains[k, e, 6 + i] = phi_rate[i]
                strains[k, e, 9 + i] = gamma_rate[i]


@jit
def angle_functions(square):
    """Functions of an angle theta from its square: a = (1 - sinc(theta/2))/theta^2, sin(theta/4)/theta,
    sin(theta/2)/theta, (1 - cos theta)/theta^2, (theta - sin theta)/theta^3.
    """
    if square < SMALL:
        return (
            1.0 / 24.0 - square * (1.0 / 1920.0 - square * (1.0 / 322560.0 - square / 92897280.0)),
            0.25 - square * (1.0 / 384.0 - square * (1.0 / 122880.0 - square / 82575360.0)),
            0.5 - square * (1.0 / 48.0 - square * (1.0 / 3840.0 - square / 645120.0)),
            0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0 - square / 40320.0)),
            1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0 - square / 362880.0)),
        )
    angle = np.sqrt(square)
    half = np.sin(0.5 * angle)
    return (
        (1.0 - 2.0 * half / angle) / square,
        np.sin(0.25 * angle) / angle,
        half / angle,
        2.0 * half * half / square,
        (angle - np.sin(angle)) / (angle * square),
    )


@jit
def place_nodes(strains, lengths, positions, quaternions, velocities, spins):
    """The inverse of `read_strains` for rods that are clamped at the origin along +x, into the last four arrays.

    Relative rotation exp(phi), chord S gamma in the mid frame exp(phi/2) with S = I + a phi^ phi^; the rates are those
    of `helical_strain_rates`, solved for the motion of the farther node (docs/physics.md).
    """
    for k in range(strains.shape[0]):
        for array in (positions, velocities, spins):
            array[k, 0] = 0.0
        quaternions[k, 0] = 0.0
        quaternions[k, 0, 0] = 1.0
        for e in range(len(lengths)):
            row, q = strains[k, e], quaternions[k, e]
            phi, gamma, phi_rate, gamma_rate = vector(row, 0), vector(row, 3), vector(row, 6), vector(row, 9)
            square = dot(phi, phi)
            a, quarter, half, first, second = angle_functions(square)
            cosine = np.sqrt(1.0 - quarter * quarter * square)  # cos(theta/4), positive below a turn
            middle = product(q, cosine, scale(quarter, phi))
            double = cross(phi, cross(phi, gamma))
            chord = add_scaled(gamma, a, double)
            end = product(q, np.cos(0.5 * np.sqrt(square)), scale(half, phi))
            norm = np.sqrt(end[0] ** 2 + end[1] ** 2 + end[2] ** 2 + end[3] ** 2)
            before = vector(spins[k, e], 0)
            turn = cross(phi, phi_rate)
            after = add_scaled(add_scaled(phi_rate, -first, turn), second, cross(phi, turn))
            after = add(after, rotated_back(np.cos(0.5 * np.sqrt(square)), scale(half, phi), before))
            u = scale(quarter / cosine, phi)
            spin = scale(0.5, add(add(after, before), cross(u, subtract(after, before))))
            rate = add_scaled(gamma_rate, a, cross(phi, cross(phi, gamma_rate)))
            twist = add(cross(phi_rate, cross(phi, gamma)), cross(phi, cross(phi_rate, gamma)))
            rate = add_scaled(rate, a, twist)
            rate = add_scaled(rate, strain_slope(square) * dot(phi, phi_rate), double)
            rate = subtract(rate, cross(chord, spin))
            step, motion = rotated(middle, chord), rotated(middle, rate)
            for i in range(3):
                positions[k, e + 1, i] = positions[k, e, i] + lengths[e] * step[i]
                velocities[k, e + 1, i] = velocities[k, e, i] + lengths[e] * motion[i]
                spins[k, e + 1, i] = after[i]
            for i in range(4):
                quaternions[k, e + 1, i] = end[i] / norm


@jit
def product(q, w, v):
    """Product of a quaternion and the quaternion (w, v)."""
    return (
        q[0] * w - q[1] * v[0] - q[2] * v[1] - q[3] * v[2],
        q[0] * v[0] + q[1] * w + q[2] * v[2] - q[3] * v[1],
        q[0] * v[1] - q[1] * v[2] + q[2] * w + q[3] * v[0],
        q[0] * v[2] + q[1] * v[1] - q[2] * v[0] + q[3] * w,
    )


@jit
def rotated(q, v):
    """A vector rotated by a unit quaternion: v + 2 (w u x v + u x (u x v))."""
    u = (q[1], q[2], q[3])
    once = cross(u, v)
    return add(v, scale(2.0, add_scaled(cross(u, once), q[0], once)))


@jit
def rotated_back(w, u, v):
    """A vector rotated by the inverse of the unit quaternion (w, u)."""
    once = cross(u, v)
    return add(v, scale(2.0, add_scaled(cross(u, once), -w, once)))


def strains_of(
    positions: np.ndarray, quaternions: np.ndarray, velocities: np.ndarray, spins: np.ndarray, lengths: np.ndarray
) -> np.ndarray:
    """Strains and their rates (K, N, 12) of rods; arguments as in `read_strains`."""
    strains = np.empty((len(positions), len(lengths), 12))
    arrays = (np.ascontiguousarray(array) for array in (positions, quaternions, velocities, spins))
    read_strains(*arrays, lengths, strains)
    return strains


def nodes_of(strains: np.ndarray, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Positions, quaternions, velocities (world) and spins (body) of clamped rods, (K, N + 1, 3 or 4), from
    (K, N, 12).
    """
    shape = (len(strains), len(lengths) + 1)
    positions, velocities, spins = np.empty((3, *shape, 3))
    quaternions = np.empty((*shape, 4))
    place_nodes(np.ascontiguousarray(strains), lengths, positions, quaternions, velocities, spins)
    return positions, quaternions, velocities, spins
