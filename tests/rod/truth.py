"""Energies of one element from their definitions, in mpmath, and their derivatives by differences with 30 good digits.

A pose is (position, quaternion (w, x, y, z)); a stiffness is (EA, GA, GJ, EI). Nothing here is shared with the package.
"""

import mpmath
import numpy as np

DIGITS = 50
STEP = mpmath.mpf(10) ** -20  # of differences: their error is of the order of 1e-30 or less


def exact(numbers):
    return mpmath.matrix([mpmath.mpf(float(number)) for number in numbers])


def hat(v):
    return mpmath.matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def unit_quaternion(q):
    q = exact(q)
    return q / mpmath.norm(q)


def rotation_matrix(q):
    w, v = q[0], mpmath.matrix(q[1:4])
    return mpmath.eye(3) + 2 * w * hat(v) + 2 * hat(v) * hat(v)


def exponential(v):
    """Rotation matrix of a rotation vector; by its series where it is short."""
    angle = mpmath.norm(v)
    if angle < mpmath.mpf(10) ** -10:
        return mpmath.eye(3) + hat(v) + hat(v) ** 2 / 2 + hat(v) ** 3 / 6
    return mpmath.eye(3) + mpmath.sin(angle) / angle * hat(v) + (1 - mpmath.cos(angle)) / angle**2 * hat(v) ** 2


def logarithm(R):
    """Rotation vector of a rotation matrix of less than a half turn."""
    sine = mpmath.matrix([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    size = mpmath.norm(sine)
    if size == 0:
        return sine
    return mpmath.atan2(size, (R[0, 0] + R[1, 1] + R[2, 2] - 1) / 2) / size * sine


def helical_strains(frame_a, frame_b, difference, length):
    """Stretch-shear strain and bend of the screw motion from a to b: the logarithm in SE(3).

    The screw with bend phi moves a by frame_a J(phi) (length gamma), J = integral of exp(s phi) over s from 0 to 1.
    """
    phi = logarithm(frame_a.T * frame_b)
    angle, cross = mpmath.norm(phi), hat(phi)
    if angle < mpmath.mpf(10) ** -8:
        jacobian = mpmath.eye(3) + cross / 2 + cross**2 / 6 + cross**3 / 24 + cross**4 / 120
    else:
        jacobian = (
            mpmath.eye(3)
            + (1 - mpmath.cos(angle)) / angle**2 * cross
            + (angle - mpmath.sin(angle)) / angle**3 * cross**2
        )
    return mpmath.lu_solve(jacobian, frame_a.T * difference / length), phi


def stretch_energy(gamma, EA, GA):
    return EA * (gamma[0] - 1) ** 2 + GA * (gamma[1] ** 2 + gamma[2] ** 2)


def helical_energy(frame_a, frame_b, difference, length, stiffness):
    """Screw motion whose middle section is tilted by z, which takes the value of least energy.

    Stretch L = |gamma|; the shear that a tilt leaves, gamma - gamma_1 z, against GA - EA (1 - 1/L); the tilt against
    12 EI/h^2, driven by (EI - GJ) kappa_1 kappa. Shear in the plane of the bend meets a little less
    stiffness.
    """
    EA, GA, GJ, EI = stiffness
    gamma, phi = helical_strains(frame_a, frame_b, difference, length)
    kappa = phi / length
    stretch = mpmath.norm(gamma)
    section = max(GA - EA * (stretch - 1) / stretch, GA / (10 * stretch))
    tilting = 12 * EI / length**2
    corrected = 1 / (1 / GA + 1 / tilting)
    inside = (gamma[1] * phi[2] - gamma[2] * phi[1]) ** 2
    along = EA * (stretch - 1) ** 2
    along -= inside * corrected**2 * (1 / (30 * tilting) + 1 / (12 * EA))

    def energy(z):
        left = [gamma[k + 1] - gamma[0] * z[k] for k in range(2)]
        across = section * (left[0] ** 2 + left[1] ** 2) + tilting * (z[0] ** 2 + z[1] ** 2)
        twist = (EI - GJ) * kappa[0] * (kappa[1] * z[0] + kappa[2] * z[1])
        turned = GJ * kappa[0] ** 2 + EI * (kappa[1] ** 2 + kappa[2] ** 2)
        return length / 2 * (along + across + turned - 2 * twist)

    def least(k):  # a parabola in each of the two angles, and no product of them
        before, here, after = (energy([i if n == k else 0 for n in range(2)]) for i in (-1, 0, 1))
        return (before - after) / (2 * (before + after - 2 * here))

    return energy([least(0), least(1)])


def nodal_energy(frame_a, frame_b, difference, length, stiffness):
    """The paper's element: strain with the rotation of either end, bend 2 tan(theta/2) n."""
    EA, GA, GJ, EI = stiffness
    R = frame_a.T * frame_b
    sine = mpmath.matrix([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    psi = 2 * sine / (1 + R[0, 0] + R[1, 1] + R[2, 2])
    bend = GJ * psi[0] ** 2 + EI * (psi[1] ** 2 + psi[2] ** 2)
    ends = sum(stretch_energy(frame.T * difference / length, EA, GA) for frame in (frame_a, frame_b))
    return length / 4 * ends + bend / (2 * length)


def frames_and_difference(pose_a, pose_b):
    frame_a, frame_b = rotation_matrix(unit_quaternion(pose_a[1])), rotation_matrix(unit_quaternion(pose_b[1]))
    return frame_a, frame_b, exact(pose_b[0]) - exact(pose_a[0])


def central_difference(function):
    return (function(STEP) - function(-STEP)) / (2 * STEP)


def exact_loads(energy, pose_a, pose_b, length, stiffness):
    """Minus the gradient of an energy: world force on a, body torques on a and on b, as float arrays."""
    with mpmath.workdps(DIGITS):
        frame_a, frame_b, difference = frames_and_difference(pose_a, pose_b)
        constants = mpmath.mpf(float(length)), exact(stiffness)

        def moved(axis, on_a, on_b, shift):
            unit = mpmath.matrix(3, 1)
            unit[axis] = 1
            a, b = frame_a * exponential(on_a * unit), frame_b * exponential(on_b * unit)
            return energy(a, b, difference - shift * unit, *constants)

        loads = []
        for one in ((0, 0, 1), (1, 0, 0), (0, 1, 0)):
            turns = [
                central_difference(lambda e, k=k, one=one: moved(k, one[0] * e, one[1] * e, one[2] * e))
                for k in range(3)
            ]
            loads.append([-float(value) for value in turns])
        return tuple(np.array(load) for load in loads)


def exact_strains(pose_a, pose_b, length):
    """Strains of the helical element, as float arrays."""
    with mpmath.workdps(DIGITS):
        gamma, phi = helical_strains(*frames_and_difference(pose_a, pose_b), mpmath.mpf(float(length)))
        return np.array([float(x) for x in gamma]), np.array([float(x) for x in phi])


def exact_strain_rates(pose_a, pose_b, length, velocity, spin_a, spin_b):
    """Rates of the helical element's strains; ``velocity`` of b relative to a (world), spins in the body frames."""
    with mpmath.workdps(DIGITS):
        frame_a, frame_b, difference = frames_and_difference(pose_a, pose_b)
        spin_a, spin_b, velocity = exact(spin_a), exact(spin_b), exact(velocity)
        h = mpmath.mpf(float(length))

        def strains(time):
            a, b = frame_a * exponential(time * spin_a), frame_b * exponential(time * spin_b)
            return helical_strains(a, b, difference + time * velocity, h)

        after, before = strains(STEP), strains(-STEP)
        rates = [(after[k] - before[k]) / (2 * STEP) for k in range(2)]
        return tuple(np.array([float(x) for x in rate]) for rate in rates)
