"""A spectral-element solver for a clamped-free Simo-Reissner rod with magnets, slow and accurate: the truth for tests.

It shares nothing with the package. Fields are polynomials through Gauss-Lobatto-Legendre (GLL) points: positions p_i
and unit quaternions q_i at the points, quadrature at the same points. With ' = d/ds of the polynomial, at point i

    Gamma = O^T p' - E1,   Omega = 2 Im(conj(q) q'),   V = sum_i w_i/2 (Gamma.C1 Gamma + Omega.C2 Omega),
    T = sum_i w_i/2 (rho A |v|^2 + omega.(rho diag(J, I, I)) omega) + sum_magnets m |v|^2 / 2,

so each point is a rigid body, driven by the exact gradient of V: the semi-discrete system is Hamiltonian. Rotations are
not limited to any angle. Time is left to an adaptive eighth-order Runge-Kutta method (DOP853); stiff rods and rods
at rest are solved in tests/reference/solving.py.
omega, Omega, Gamma and dipoles are in the body frame; p, v, forces and the field are in the world frame. SI units.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numba import njit
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp


@dataclass(frozen=True, kw_only=True)
class Magnet:
    """A point mass (kg) with a dipole (A m^2, body frame) fixed to the section at s (m); no rotary inertia."""

    s: float
    mass: float
    dipole: tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Case:
    """A rod, its loads and its magnets.

    area (m^2) and second_moment I (m^4, both bending axes; J = 2 I); gravity (m/s^2); drag (1/s): force
    -drag * mass * velocity on the rod and on the point masses, none on rotation. The magnetic field at p is
    field(t) + gradient @ p: T and T/m (dB_i/dx_j, constant), world frame; its force on a dipole is grad(m.B).
    The rod starts straight with velocity(s) (m/s) and spin(s) (rad/s) of the points s, shape (n, 3); None: at rest.
    """

    length: float
    area: float
    second_moment: float
    density: float
    youngs_modulus: float
    poisson_ratio: float = 0.5
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    drag: float = 0.0
    magnets: tuple[Magnet, ...] = ()
    field: Callable[[float], np.ndarray] = lambda t: np.zeros(3)
    gradient: tuple[tuple[float, float, float], ...] = ((0.0, 0.0, 0.0),) * 3
    velocity: Callable[[np.ndarray], np.ndarray] | None = None
    spin: Callable[[np.ndarray], np.ndarray] | None = None

    @property
    def shear_modulus(self):
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))

    @property
    def c1(self):
        """Stretch and shear stiffness (EA, GA, GA), N."""
        return self.area * np.array([self.youngs_modulus, self.shear_modulus, self.shear_modulus])

    @property
    def c2(self):
        """Twist and bending stiffness (GJ, EI, EI), N m^2."""
        return self.second_moment * np.array([2 * self.shear_modulus, self.youngs_modulus, self.youngs_modulus])

    @property
    def inertia(self):
        """Rotary inertia per length rho (J, I, I), kg m."""
        return self.density * self.second_moment * np.array([2.0, 1.0, 1.0])


def gauss_lobatto(degree):
    """GLL points on [-1, 1], weights, and the differentiation matrix of the polynomial through them."""
    top = legendre.Legendre.basis(degree)
    x = np.concatenate([[-1.0], np.sort(top.deriv().roots().real), [1.0]])
    for _ in range(3):  # polish the inner points: Newton on P'
        x[1:-1] -= top.deriv()(x[1:-1]) / top.deriv(2)(x[1:-1])
    values = top(x)
    weights = 2 / (degree * (degree + 1) * values**2)
    gap = x[:, None] - x[None, :] + np.eye(degree + 1)
    derivative = values[:, None] / values[None, :] / gap
    np.fill_diagonal(derivative, 0.0)
    np.fill_diagonal(derivative, -derivative.sum(axis=1))
    return x, weights, derivative


class Mesh:
    """Elements of one polynomial degree between the given cuts (m); magnets must sit on cuts."""

    def __init__(self, case, degree, inner_cuts=()):
        cuts = np.array([0.0, *inner_cuts, case.length])
        x, weights, derivative = gauss_lobatto(degree)
        sizes = np.diff(cuts)
        self.case, self.degree = case, degree
        self.derivative = np.array([derivative * 2 / size for size in sizes])
        self.weight = np.array([weights * size / 2 for size in sizes])
        self.count = degree * len(sizes) + 1
        self.s, share = np.zeros(self.count), np.zeros(self.count)
        for e, size in enumerate(sizes):
            here = slice(e * degree, e * degree + degree + 1)
            self.s[here] = cuts[e] + size * (x + 1) / 2
            share[here] += self.weight[e]
        self.mass = case.density * case.area * share
        self.inertia = share[:, None] * case.inertia
        self.magnet_node = [int(np.flatnonzero(np.isclose(self.s, m.s, rtol=0, atol=1e-12))[0]) for m in case.magnets]
        for node, magnet in zip(self.magnet_node, case.magnets):
            self.mass[node] += magnet.mass

    @cached_property
    def straight(self):
        """The straight rod at rest, flattened: all positions, quaternions, velocities, angular velocities."""
        p, q = np.zeros((self.count, 3)), np.zeros((self.count, 4))
        p[:, 0], q[:, 0] = self.s, 1.0
        return np.concatenate([p.ravel(), q.ravel(), np.zeros(6 * self.count)])

    @cached_property
    def start(self):
        """The straight rod with its initial motion."""
        y = self.straight.copy()
        _, _, v, omega = self.split(y)
        for motion, given in ((v, self.case.velocity), (omega, self.case.spin)):
            if given is not None:
                motion[1:] = given(self.s[1:])
        return y

    def split(self, y):
        """Views p (n, 3), q (n, 4), v (n, 3), omega (n, 3) of a state."""
        n = self.count
        return (
            y[: 3 * n].reshape(n, 3),
            y[3 * n : 7 * n].reshape(n, 4),
            y[7 * n : 10 * n].reshape(n, 3),
            y[10 * n :].reshape(n, 3),
        )

    def loads(self, p, q, field):
        """Force (n, 3; world) and torque (n, 3; body) from rod, gravity and magnets; the potential energy.

        field (3,): T, at the clamp; the case's gradient adds to it along the rod.
        """
        force, torque = np.zeros_like(p), np.zeros_like(p)
        energy = elastic_loads(p, q, self.derivative, self.weight, self.case.c1, self.case.c2, force, torque)
        force += self.mass[:, None] * np.asarray(self.case.gravity)
        energy -= self.mass @ (p @ np.asarray(self.case.gravity))
        gradient = np.asarray(self.case.gradient)
        for node, magnet in zip(self.magnet_node, self.case.magnets):
            field_body = to_body(q[node], field + gradient @ p[node])
            force[node] += np.array(to_world(q[node], magnet.dipole)) @ gradient
            torque[node] += cross(magnet.dipole, field_body)
            energy -= np.dot(magnet.dipole, field_body)
        return force, torque, energy

    def rate(self, t, y):
        """Time derivative of a state; point 0 is clamped."""
        p, q, v, omega = self.split(y)
        force, torque, _ = self.loads(p, q, self.case.field(t))
        dy = np.empty_like(y)
        dp, dq, dv, domega = self.split(dy)
        newton_euler(q, v, omega, force, torque, self.mass, self.inertia, self.case.drag, dp, dq, dv, domega)
        return dy

    def energy(self, y, t=0.0):
        """Total energy, J."""
        p, q, v, omega = self.split(y)
        return (
            self.loads(p, q, self.case.field(t))[2]
            + 0.5 * np.sum(self.mass[1:, None] * v[1:] ** 2)
            + 0.5 * np.sum(self.inertia[1:] * omega[1:] ** 2)
        )

    def run(self, times, tolerance):
        """States at the times, from the start. Each interval restarts: no sample is interpolated."""
        states, step = [self.start], 1e-6
        for start, stop in pairwise(times):
            done = solve_ivp(
                self.rate,
                (start, stop),
                states[-1],
                method="DOP853",
                rtol=tolerance,
                atol=tolerance * 1e-2,
                first_step=step,
            )
            states.append(done.y[:, -1])
            step = min(np.median(np.diff(done.t)), stop - start) * 0.9
        return np.array(states)


@njit
def product(a, b):
    """Quaternion product, as a tuple (small arrays would cost an allocation each)."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@njit
def conjugate(a):
    return a[0], -a[1], -a[2], -a[3]


@njit
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit
def to_world(q, a):
    """The body vector a in the world frame: a + 2 q0 (r x a) + 2 r x (r x a), with q = (q0, r) of unit length."""
    r = (q[1], q[2], q[3])
    b = cross(r, a)
    c = cross(r, b)
    return a[0] + 2 * (q[0] * b[0] + c[0]), a[1] + 2 * (q[0] * b[1] + c[1]), a[2] + 2 * (q[0] * b[2] + c[2])


@njit
def to_body(q, a):
    return to_world(conjugate(q), a)


@njit
def elastic_loads(p, q, derivative, weight, c1, c2, force, torque):
    """Adds minus the gradient of the elastic energy to force (world) and torque (body); returns the energy."""
    elements, points = weight.shape
    gradient_q = np.zeros_like(q)
    world_force, couple = np.empty((points, 3)), np.empty((points, 4))
    energy = 0.0
    for e in range(elements):
        first = e * (points - 1)
        here = slice(first, first + points)
        dp, dq = derivative[e] @ p[here], derivative[e] @ q[here]
        for j in range(points):
            i, w = first + j, weight[e, j]
            chord = to_body(q[i], dp[j])
            n = (c1[0] * (chord[0] - 1), c1[1] * chord[1], c1[2] * chord[2])
            half = product(conjugate(q[i]), dq[j])  # (.., Omega / 2)
            moment = (0.0, 2 * c2[0] * half[1], 2 * c2[1] * half[2], 2 * c2[2] * half[3])
            n_world, n_torque = to_world(q[i], n), cross(chord, n)
            by_slope, by_value = product(q[i], moment), product(dq[j], moment)
            for k in range(3):
                world_force[j, k] = w * n_world[k]
                torque[i, k] += w * n_torque[k]
                energy += 0.5 * w * (n[k] ** 2 / c1[k] + moment[k + 1] ** 2 / c2[k])
            for k in range(4):
                couple[j, k] = 2 * w * by_slope[k]  # dV/dq'
                gradient_q[i, k] -= 2 * w * by_value[k]  # dV/dq at fixed q'
        force[here] -= derivative[e].T @ world_force
        gradient_q[here] += derivative[e].T @ couple
    for i in range(len(q)):
        turned = product(conjugate(q[i]), gradient_q[i])
        for k in range(3):
            torque[i, k] -= 0.5 * turned[k + 1]
    return energy


@njit
def newton_euler(q, v, omega, force, torque, mass, inertia, drag, dp, dq, dv, domega):
    """Rigid-body rates of every point from its loads; point 0 does not move."""
    dp[0], dq[0], dv[0], domega[0] = 0.0, 0.0, 0.0, 0.0
    for i in range(1, len(q)):
        spin = product(q[i], (0.0, 0.5 * omega[i, 0], 0.5 * omega[i, 1], 0.5 * omega[i, 2]))
        gyroscopic = cross(
            omega[i], (inertia[i, 0] * omega[i, 0], inertia[i, 1] * omega[i, 1], inertia[i, 2] * omega[i, 2])
        )
        for k in range(4):
            dq[i, k] = spin[k]
        for k in range(3):
            dp[i, k] = v[i, k]
            dv[i, k] = force[i, k] / mass[i] - drag * v[i, k]
            domega[i, k] = (torque[i, k] - gyroscopic[k]) / inertia[i, k]
