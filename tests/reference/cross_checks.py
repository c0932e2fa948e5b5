"""Second methods, 1 to 3 without equations in common with spectral_rod.py: python -m tests.reference.cross_checks

1. Small vibrations: frequencies of the clamped Timoshenko beam with a tip mass, from its transfer matrix.
2. Free decay: planar angle theta(s, t), hierarchical Legendre basis with consistent mass, Gauss quadrature, and the
   four-stage Gauss collocation method in time (order 8, implicit, symplectic). The undamped metal rod, too.
3. Statics: the rod's balance equations as a two-point boundary value problem (scipy's solve_bvp).
4. Stiff rods, which the reference takes in implicit steps: the first 20 ms with the explicit method.
"""

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import solve_bvp
from scipy.linalg import block_diag, eigh, expm, lu_factor, lu_solve
from scipy.optimize import brentq

from scripts.reference.spectral_rod import Mesh

from .cases import ALUMINIUM, DYNAMIC, EQUILIBRIA, OWN_TIMES, ROUND, TIMES, inner_cuts
from .make_reference import FILE, REFERENCE, trajectory
from .solving import gauss_collocation


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


def axes(q):
    """Columns of the rotation matrix of quaternions (4, ...), each (3, ...)."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
            [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
            [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


class Balance:
    """Balance of forces and moments along a rod, from magnet to magnet, as a two-point boundary value problem.

    Unknowns of every segment: p, q, force n and moment m on the section in the world frame (13), in units of the length
    L, EI / L^2 and EI / L; x from 0 to 1 along each segment. weight and pull: shares of gravity and of the field.
    """

    def __init__(self, case):
        self.case, moment = case, case.c2[1] / case.length
        self.force, self.moment = moment / case.length, moment
        self.stops = sorted({case.length, *(magnet.s for magnet in case.magnets)})
        self.lengths = np.diff([0.0, *self.stops]) / case.length
        self.weight, self.pull = 0.0, 0.0

    def slopes(self, x, y):
        out = np.empty_like(y)
        weight = self.weight * np.array(self.case.gravity) * self.case.density * self.case.area
        for k, length in enumerate(self.lengths):
            part = y[13 * k : 13 * k + 13]
            d, n, m = axes(part[3:7]), part[7:10], part[10:]
            strain = np.einsum("aip,ip->ap", d, n) * self.force / self.case.c1[:, None]
            strain[0] += 1
            tangent = np.einsum("aip,ap->ip", d, strain)
            u1, u2, u3 = np.einsum("aip,ip->ap", d, m) * self.case.c2[1] / self.case.c2[:, None]
            q0, q1, q2, q3 = part[3:7]
            turn = [-q1 * u1 - q2 * u2 - q3 * u3, q0 * u1 + q2 * u3 - q3 * u2]
            turn += [q0 * u2 - q1 * u3 + q3 * u1, q0 * u3 + q1 * u2 - q2 * u1]
            lost = np.broadcast_to(-weight[:, None] * self.case.length / self.force, n.shape)
            rows = [tangent, 0.5 * np.array(turn), lost, -np.cross(tangent, n, axis=0)]
            out[13 * k : 13 * k + 13] = length * np.concatenate(rows)
        return out

    def point_load(self, stop, end):
        """Force and moment (6,) of what sits at arc length stop, where the segment's state is end (13,)."""
        load, gradient = np.zeros(6), self.pull * np.asarray(self.case.gradient)
        for magnet in self.case.magnets:
            if magnet.s == stop:
                dipole = np.tensordot(magnet.dipole, axes(end[3:7]), 1)
                field = self.pull * self.case.field(0.0) + gradient @ end[:3] * self.case.length
                load[:3] += (magnet.mass * self.weight * np.array(self.case.gravity) + dipole @ gradient) / self.force
                load[3:] += np.cross(dipole, field) / self.moment
        return load

    def ends(self, start, end):
        start, end = start.reshape(-1, 13), end.reshape(-1, 13)
        out = [start[0, :7] - [0, 0, 0, 1, 0, 0, 0]]
        for k, stop in enumerate(self.stops):
            beyond = start[k + 1, 7:] if k + 1 < len(start) else np.zeros(6)
            out.append(end[k, 7:] - beyond - self.point_load(stop, end[k]))
            if k + 1 < len(start):
                out.append(start[k + 1, :7] - end[k, :7])
        return np.concatenate(out)

    def tip(self, tolerance):
        """Tip position, m: gravity rises first, then the field."""
        x, rising = np.linspace(0, 1, 21), (0.003, 0.01, 0.03, 0.1, 0.25, 0.5, 0.75, 1.0)
        y = np.zeros((13 * len(self.stops), 21))
        y[3::13] = 1.0
        for k, length in enumerate(self.lengths):
            y[13 * k] = sum(self.lengths[:k]) + length * x
        for self.weight, self.pull in [(share, 0.0) for share in rising] + [(1.0, share) for share in rising]:
            last = (self.weight, self.pull) == (1.0, 1.0)
            done = solve_bvp(
                self.slopes, self.ends, x, y, tol=tolerance if last else 1e-3, bc_tol=1e-11, max_nodes=20000
            )
            if not done.success:
                raise RuntimeError(done.message)
            x, y = done.x, done.y
        return y[-13:-10, -1] * self.case.length


def main():
    stored = np.load(FILE)
    print("frequencies (rad/s): exact, spectral rod, relative difference")
    for exact, found in zip(exact_frequencies(ROUND, 6), mesh_frequencies(ROUND, 6)):
        print(f"  {exact:.6f}  {found:.6f}  {abs(found / exact - 1):.1e}")
    print("statics: tip distance from solve_bvp")
    for name, case in EQUILIBRIA.items():
        distance = np.linalg.norm(Balance(case).tip(1e-8) - stored[name + "_tip"])
        print(f"  {name}  {distance:.1e} m", flush=True)
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
