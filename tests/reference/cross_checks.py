"""Second methods, 1 to 3 without equations in common with spectral_rod.py: python -m tests.reference.cross_checks

1. Small vibrations: frequencies of the clamped Timoshenko beam with a tip mass, from its transfer matrix.
2. Free decay: planar angle theta(s, t), hierarchical Legendre basis with consistent mass, Gauss quadrature, and the
   four-stage Gauss collocation method in time (order 8, implicit, symplectic). The undamped metal rod, too.
3. Statics: the rod's balance equations as a two-point boundary value problem (scipy's solve_bvp).
4. Stiff rods, which the reference takes in implicit steps: the first 20 ms with the explicit method.
"""

from functools import partial

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import solve_bvp
from scipy.linalg import block_diag, eigh, expm, lu_factor, lu_solve
from scipy.optimize import brentq

from .cases import ALUMINIUM, DYNAMIC, OWN_TIMES, ROUND, STATIC, STIFFER, TIMES, inner_cuts
from .make_reference import FILE, REFERENCE, trajectory
from .spectral_rod import Mesh, gauss_collocation


def exact_frequencies(case, count):
    """Lowest bending frequencies (rad/s) of the straight rod with a tip mass; y = (w, theta, shear, moment)."""
    _, ga, _ = case.c1
    _, ei, _ = case.c2
    mass = case.density * case.area

    def mismatch(omega):
        slope = np.zeros((4, 4))
        slope[0, 1], slope[0, 2], slope[1, 3] = 1.0, 1 / ga, 1 / ei
        slope[2, 0], slope[3, 2], slope[3, 1] = -mass * omega**2, -1.0, -case.inertia[1] * omega**2
        end = expm(slope * case.length)[:, 2:]  # w = theta = 0 at the clamp
        return np.linalg.det([end[2] - case.magnets[0].mass * omega**2 * end[0], end[3]])

    grid = np.linspace(1.0, 4000.0, 4000)
    values = [mismatch(omega) for omega in grid]
    roots = [brentq(mismatch, a, b, xtol=1e-11) for a, b, u, v in zip(grid, grid[1:], values, values[1:]) if u * v < 0]
    return np.array(roots[:count])


def mesh_frequencies(case, count):
    """The same frequencies from finite differences of the spectral rod's loads about the straight state."""
    mesh = Mesh(case, REFERENCE["degree"], inner_cuts(case, REFERENCE["elements"]))
    p, q, _, _ = mesh.split(mesh.straight)
    free, eps = mesh.count - 1, 1e-5
    stiffness = np.empty((2 * free, 2 * free))
    for k in range(2 * free):
        moved = []
        for sign in (1, -1):
            p_new, q_new = p.copy(), q.copy()
            if k < free:
                p_new[k + 1, 2] += sign * eps * case.length
            else:
                q_new[k - free + 1] = np.cos(eps / 2), 0.0, -sign * np.sin(eps / 2), 0.0  # positive angle lifts the tip
            force, torque, _ = mesh.loads(p_new, q_new, np.zeros(3))
            moved.append(np.concatenate([force[1:, 2], -torque[1:, 1]]))
        stiffness[:, k] = (moved[1] - moved[0]) / (2 * eps * (case.length if k < free else 1.0))
    mass = np.concatenate([mesh.mass[1:], mesh.inertia[1:, 1]])
    return np.sqrt(eigh((stiffness + stiffness.T) / 2, np.diag(mass), eigvals_only=True)[:count])


class PlanarGalerkin:
    """x = s + sum a_i f_i(s), z = sum b_i f_i(s), theta = sum c_i f_i(s); f_i: integral of Legendre polynomial i."""

    def __init__(self, case, count):
        xi, weight = legendre.leggauss(2 * count)
        half = case.length / 2
        self.weight = weight * half
        self.slope = np.array([legendre.Legendre.basis(i)(xi) for i in range(count)])
        primitive = [legendre.Legendre.basis(i).integ(lbnd=-1) for i in range(count)]
        self.value = half * np.array([f(xi) for f in primitive])
        self.tip = half * np.array([f(1.0) for f in primitive])
        self.ea, self.ga, _ = case.c1
        self.ei = case.c2[1]
        gram = (self.value * self.weight) @ self.value.T
        tip_mass = sum(magnet.mass for magnet in case.magnets)
        moving = case.density * case.area * gram + tip_mass * np.outer(self.tip, self.tip)
        self.mass = block_diag(moving, moving, case.inertia[1] * gram)
        masses = case.density * case.area * self.value @ self.weight + tip_mass * self.tip
        self.load = np.concatenate([case.gravity[0] * masses, case.gravity[2] * masses, np.zeros(count)])
        s = half * (xi + 1)
        self.start = np.zeros((3, count))  # velocities
        if case.velocity is not None:
            given = (*case.velocity(s)[:, [0, 2]].T, -case.spin(s)[:, 1])  # positive angle lifts the tip
            self.start = np.array([np.linalg.lstsq(self.value.T, v, rcond=None)[0] for v in given])
        self.count, self.length = count, case.length

    def strains(self, u):
        a, b, c = u.reshape(3, self.count)
        x, z, theta, kappa = 1 + a @ self.slope, b @ self.slope, c @ self.value, c @ self.slope
        cos, sin = np.cos(theta), np.sin(theta)
        stretch, shear = x * cos + z * sin, -x * sin + z * cos
        return cos, sin, stretch, shear, kappa, self.ea * (stretch - 1), self.ga * shear

    def force(self, u):
        cos, sin, stretch, shear, kappa, n1, n2 = self.strains(u)
        w = self.weight
        along_x, along_z = self.slope @ (w * (n1 * cos - n2 * sin)), self.slope @ (w * (n1 * sin + n2 * cos))
        turning = self.value @ (w * (n1 * shear - n2 * stretch)) + self.slope @ (w * self.ei * kappa)
        return self.load - np.concatenate([along_x, along_z, turning])

    def stiffness(self, u):
        """Minus the Jacobian of force."""
        cos, sin, stretch, shear, _, n1, n2 = self.strains(u)
        ea, ga, f, d = self.ea, self.ga, self.value, self.slope

        def form(left, density, right):
            return (left * (self.weight * density)) @ right.T

        xx, zz, xz = ea * cos**2 + ga * sin**2, ea * sin**2 + ga * cos**2, (ea - ga) * sin * cos
        n1_turn, n2_turn = ea * shear, -ga * stretch
        xt = n1_turn * cos - n1 * sin - n2_turn * sin - n2 * cos
        zt = n1_turn * sin + n1 * cos + n2_turn * cos - n2 * sin
        tt = n1_turn * shear - n1 * stretch - n2_turn * stretch - n2 * shear
        kxt, kzt = form(d, xt, f), form(d, zt, f)
        bending = form(d, np.full_like(cos, self.ei), d)
        return np.block(
            [
                [form(d, xx, d), form(d, xz, d), kxt],
                [form(d, xz, d), form(d, zz, d), kzt],
                [kxt.T, kzt.T, form(f, tt, f) + bending],
            ]
        )

    def run(self, times, steps_per_sample, stages=4):
        """Tip (x, z) at the times, released straight; stage accelerations by simplified Newton iterations."""
        c, a, b = gauss_collocation(stages)
        h = (times[1] - times[0]) / steps_per_sample
        aa, ba = h * h * a @ a, h * h * b @ a
        u, v = np.zeros(3 * self.count), self.start.ravel()
        acceleration = np.zeros((stages, 3 * self.count))
        out = [(self.length, 0.0)]
        for step in range((len(times) - 1) * steps_per_sample):
            newton = lu_factor(np.kron(np.eye(stages), self.mass) + np.kron(aa, self.stiffness(u + 0.5 * h * v)))
            drift = u + h * np.outer(c, v)
            size, previous = 1e9, np.inf
            while size > 1e-14 and size < 0.5 * previous:  # down to rounding
                stage = drift + aa @ acceleration
                miss = acceleration @ self.mass - np.array([self.force(x) for x in stage])
                change = lu_solve(newton, miss.ravel()).reshape(acceleration.shape)
                acceleration -= change
                size, previous = h * h * np.abs(change).max(), size
            if size > 1e-9:
                raise RuntimeError("stage iterations did not converge: take more steps per sample")
            u, v = u + h * v + ba @ acceleration, v + h * b @ acceleration
            if (step + 1) % steps_per_sample == 0:
                out.append((self.length + self.tip @ u[: self.count], self.tip @ u[self.count : 2 * self.count]))
        return np.array(out)


def equilibrium_by_collocation(case, field, tolerance=1e-10):
    """Tip position from the balance of forces and moments; unknowns p (3), q (4) and the moment (3), world frame."""
    gravity, magnet = np.asarray(case.gravity), case.magnets[0]

    def axes(q):
        """Columns of the rotation matrix, each (3, points)."""
        w, x, y, z = q
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
                [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
                [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
            ]
        )

    def slopes(load, s, y):
        d = axes(y[3:7])
        n = load * gravity[:, None] * (case.density * case.area * (case.length - s) + magnet.mass)
        strain = np.einsum("aip,ip->ap", d, n) / case.c1[:, None]
        strain[0] += 1
        tangent = np.einsum("aip,ap->ip", d, strain)
        u1, u2, u3 = np.einsum("aip,ip->ap", d, y[7:]) / case.c2[:, None]
        w, x, y_, z = y[3:7]
        turn = 0.5 * np.array(
            [-x * u1 - y_ * u2 - z * u3, w * u1 + y_ * u3 - z * u2, w * u2 - x * u3 + z * u1, w * u3 + x * u2 - y_ * u1]
        )
        return np.concatenate([tangent, turn, -np.cross(tangent, n, axis=0)])

    def ends(load, left, right):
        moment = np.cross(np.tensordot(magnet.dipole, axes(right[3:7]), 1), load * field)
        return np.concatenate([left[:3], left[3:7] - [1, 0, 0, 0], right[7:] - moment])

    s = np.linspace(0, case.length, 41)
    y = np.zeros((10, 41))
    y[0], y[3] = s, 1.0
    for load in (0.25, 0.5, 0.75, 1.0):  # gravity and field together
        balance, clamp_and_tip = partial(slopes, load), partial(ends, load)
        done = solve_bvp(balance, clamp_and_tip, s, y, tol=tolerance, bc_tol=1e-12, max_nodes=20000)
        if not done.success:
            raise RuntimeError(done.message)
        s, y = done.x, done.y
    return y[:3, -1]


def main():
    stored = np.load(FILE)
    print("frequencies (rad/s): exact, spectral rod, relative difference")
    for exact, found in zip(exact_frequencies(ROUND, 6), mesh_frequencies(ROUND, 6)):
        print(f"  {exact:.6f}  {found:.6f}  {abs(found / exact - 1):.1e}")
    print("statics: tip distance from solve_bvp")
    for name, field in STATIC.items():
        print(f"  {name}  {np.linalg.norm(equilibrium_by_collocation(STIFFER, field) - stored[name + '_tip']):.1e} m")
    print("free decay: tip distance from planar Legendre-Galerkin with Gauss collocation, RMS and largest")
    for count, steps in ((20, 20), (32, 20), (44, 40)):
        tip = PlanarGalerkin(ROUND, count).run(TIMES, steps)
        distance = np.linalg.norm(tip - stored["free_decay_tip"][:, [0, 2]], axis=1)
        rms = np.sqrt(np.mean(distance**2))
        print(f"  {count} functions, step {0.01 / steps:.1e} s: {rms:.1e} m  {distance.max():.1e} m", flush=True)
    print("aluminium: tip distance from the same planar method, RMS and largest")
    tip = PlanarGalerkin(ALUMINIUM, 16).run(OWN_TIMES["aluminium"], 100)
    distance = np.linalg.norm(tip - stored["aluminium_tip"][:, [0, 2]], axis=1)
    print(f"  16 functions, step 2.5e-05 s: {np.sqrt(np.mean(distance**2)):.1e} m  {distance.max():.1e} m", flush=True)
    print("stiff rods, 20 ms: tip distance from the explicit method")
    for name, degree in (("aluminium", 13), ("niti", 10)):
        times = OWN_TIMES[name][OWN_TIMES[name] < 0.0201]
        position, _, _ = trajectory(DYNAMIC[name], times, elements=1, degree=degree, tolerance=1e-6)
        distance = np.linalg.norm(position[:, 0] - stored[f"{name}_tip"][: len(times)], axis=1)
        print(f"  {name}  {distance.max():.1e} m", flush=True)


if __name__ == "__main__":
    main()
