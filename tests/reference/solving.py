"""Stiff motions and equilibria of the spectral rod: Gauss collocation in time, Newton's method at rest."""

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import lu_factor, lu_solve

from scripts.reference.spectral_rod import product


def gauss_collocation(stages):
    """Points c, matrix a and weights b of the Gauss collocation method on [0, 1]."""
    x, w = legendre.leggauss(stages)
    c = (x + 1) / 2
    powers = np.arange(1, stages + 1)
    a = (c[:, None] ** powers / powers) @ np.linalg.inv(c[:, None] ** (powers - 1))
    return c, a, w / 2


def run_implicit(mesh, times, steps, stages=4):
    """States at equally spaced times by Gauss collocation (order 2 * stages), in `steps` equal steps a sample.

    It neither damps nor resolves modes that are fast against a step: for stiff rods that move slowly. It keeps the
    length of the quaternions. The stages solve their equations to rounding, by simplified Newton iterations.
    """
    c, a, b = gauss_collocation(stages)
    roots, modes = np.linalg.eig(a)  # conjugate pairs: one of each is enough
    to_modes, pairs = np.linalg.inv(modes), np.flatnonzero(roots.imag > 0)
    powers = np.arange(1, stages + 1)
    to_powers = np.linalg.inv(c[:, None] ** powers)
    last, ahead, middle = b @ np.linalg.inv(a), (1 + c)[:, None] ** powers @ to_powers, 0.5**powers @ to_powers
    h = (times[-1] - times[0]) / (steps * (len(times) - 1))
    states, y = [mesh.start], mesh.start
    growth, newton = np.zeros((stages, len(y))), None  # of the stages since the beginning of the step

    def solved(growth):
        size, count = 1.0, 0
        while 1e-13 < size < 1e3 and count < 15:
            rates = np.array([mesh.rate(at + c_i * h, y + g) for c_i, g in zip(c, growth)])
            miss = to_modes @ (h * a @ rates - growth)
            change = sum(2 * np.outer(modes[:, k], lu_solve(lu, miss[k])).real for k, lu in zip(pairs, newton))
            growth = growth + change
            count += 1
            size = np.abs(change[:, : 7 * mesh.count]).max()  # of positions (m) and quaternions
        return growth, size, count

    for step in range(steps * (len(times) - 1)):
        at, guess = times[0] + step * h, growth
        for _ in range(3):
            if newton is None:
                slopes = jacobian(mesh, at + h / 2, y + middle @ growth)
                newton = [lu_factor(np.eye(len(y)) - h * roots[k] * slopes) for k in pairs]
            growth, size, count = solved(guess)
            if size <= 1e-13:
                break
            newton = None
        else:
            raise RuntimeError("stage iterations did not converge: take more steps a sample")
        newton = newton if count < 6 else None
        forward = last @ growth
        y, growth = y + forward, ahead @ growth - forward
        if (step + 1) % steps == 0:
            states.append(y)
    return np.array(states)


def jacobian(mesh, t, y):
    """Derivative of `rate` by central differences, exact in p (quadratic) and the velocities."""
    n, columns = mesh.count, []
    nudges = np.repeat([1e-5 * mesh.case.length, 1e-5, 1.0], [3 * n, 4 * n, 6 * n])
    for k, nudge in enumerate(nudges):
        up, down = y.copy(), y.copy()
        up[k] += nudge
        down[k] -= nudge
        columns.append((mesh.rate(t, up) - mesh.rate(t, down)) / (2 * nudge))
    return np.array(columns).T


def equilibrium(mesh, field, start=None):
    """A stable static state near `start` (default straight), by Newton's method on displacements and rotations."""
    state = (mesh.straight if start is None else start).copy()
    p, q, _, _ = mesh.split(state)
    unknowns = 6 * (mesh.count - 1)
    moment = mesh.case.c2[1] / mesh.case.length
    scale = np.repeat([moment / mesh.case.length, moment], unknowns // 2)

    def residual(p, q):
        force, torque, _ = mesh.loads(p, q, field)
        return np.concatenate([force[1:].ravel(), torque[1:].ravel()]) / scale

    def moved(x):
        x = x.reshape(2, mesh.count - 1, 3)
        half = 0.5 * x[1]
        p_new, q_new = p.copy(), q.copy()
        p_new[1:] += mesh.case.length * x[0]
        q_new[1:] = np.array([product(a, b / np.sqrt(b @ b)) for a, b in zip(q[1:], np.c_[np.ones(len(half)), half])])
        return p_new, q_new

    for _ in range(30):
        jacobian = np.empty((unknowns, unknowns))
        for k in range(unknowns):
            nudge = np.zeros(unknowns)
            nudge[k] = 1e-6
            jacobian[:, k] = (residual(*moved(nudge)) - residual(*moved(-nudge))) / 2e-6
        step = -np.linalg.solve(jacobian, residual(p, q))
        step *= min(1.0, 0.3 / np.abs(step).max())
        p[:], q[:] = moved(step)
        if np.abs(step).max() < 1e-10:
            break
    else:
        raise RuntimeError("no equilibrium found: take smaller load steps")
    if np.linalg.eigvalsh(-0.5 * (jacobian + jacobian.T))[0] <= 0.0:
        raise RuntimeError("the equilibrium found is unstable: take smaller load steps")
    return state
