"""From a scene to what the kernels take: the rod's values, shaped or conditioned if asked, and its magnets' places."""

from __future__ import annotations

from typing import Any

import numpy as np

from magrod_env.rod.batch import PLANE_AXES
from magrod_env.rod.mesh import RodValues
from magrod_env.scene import Scene


def rod_values(
    scene: Scene, axial_softening: float = 1.0, rotary_scaling: float = 1.0
) -> tuple[RodValues, tuple[int, ...]]:
    """The kernels' view of a scene: its values, conditioned, and the segment at whose end each magnet sits."""
    rod, ends = scene.rod, scene.segment_ends
    values = RodValues(
        ends=np.array(ends),
        axial=rod.axial_stiffness / axial_softening,
        shear=rod.shear_stiffness,
        bending=rod.bending_stiffness,
        torsion=rod.torsional_stiffness,
        mass_per_length=rod.mass_per_length,
        rotary=rod.rotary_inertia_per_length * rotary_scaling,
        polar=2.0 * rod.rotary_inertia_per_length * rotary_scaling,
        magnet_masses=np.array([magnet.mass for magnet in scene.magnets] or [0.0]),
        magnet_moments=np.array([magnet.dipole_moment for magnet in scene.magnets] or [np.zeros(3)]),
    )
    return values, tuple(ends.index(magnet.position) for magnet in scene.magnets)


def scene_terms(scene: Scene, rotary_scaling: float) -> dict[str, Any]:
    """Terms of a scene as `RodBatch` takes them, None where the scene leaves one out."""
    return {
        "gravity": scene.gravity,
        "drag_rate": scene.drag_rate,
        "spin_drag_rate": scaled_spin_drag(scene, rotary_scaling),
        "internal_damping": scene.damping_time,
        "loads": scene.acting_loads,
    }


def scaled_spin_drag(scene: Scene, rotary_scaling: float) -> float | None:
    """Rate of the spin drag, 1/s, that leaves its torque unchanged where the rotary inertia is scaled."""
    return None if scene.spin_drag_rate is None else scene.spin_drag_rate / rotary_scaling


def relative_load(scene: Scene, field_magnitude: float) -> float:
    """Moments of the loads at the clamp of the straight rod over EI/L, none: magnets in a field across (T),
    weights, listed loads."""
    rod = scene.rod
    weight = 0.5 * rod.mass * rod.length + sum(magnet.mass * magnet.position for magnet in scene.magnets)
    turning = sum(magnet.moment for magnet in scene.magnets) * field_magnitude
    pulling = 0.0 if scene.gravity is None else weight * float(np.linalg.norm(scene.gravity))
    loading = sum(load.clamp_moment(rod.length) for load in scene.acting_loads)
    return (turning + pulling + loading) * rod.length / rod.bending_stiffness


def locking_factor(values: RodValues, num_elements: int) -> float:
    """1 + GA h^2/(4 EI): how much stiffer the paper's element bends than the rod."""
    h = values.ends[-1] / num_elements
    return 1.0 + values.shear * h**2 / (4.0 * values.bending)


def axis_across(plane: str | None) -> int | None:
    """World axis across a plane of motion; None in space."""
    return None if plane is None else ({0, 1, 2} - set(PLANE_AXES[plane])).pop()


def check_plane(scene: Scene, plane: str | None) -> None:
    """Refuse a scene whose loads leave the plane."""
    if plane not in tuple(PLANE_AXES):  # anything may come, hashable or not
        raise ValueError(f'plane must be "xy", "xz" or None for motion in space, but got {plane!r}: choose one.')
    across = axis_across(plane)
    if across is None:
        return
    for what, vector in [("gravity", scene.gravity or (0, 0, 0))] + [
        ("direction of a magnet", magnet.direction) for magnet in scene.magnets
    ]:
        if vector[across] != 0.0:
            raise ValueError(
                f"{what} must lie in the plane {plane!r} of a planar simulation, but got {vector!r}: "
                "turn it into the plane, or leave plane=None."
            )
    for load in scene.acting_loads:
        load.rows(plane)


def shaped(values: RodValues, element: str, num_elements: int) -> RodValues:
    """Values with E divided by the locking factor of the paper's element (every stiffness is proportional to E)."""
    if element != "nodal":
        raise ValueError(
            f"frequency_shaping must be False with element={element!r}, which does not lock: "
            'use it with element="nodal".'
        )
    factor = 1.0 / locking_factor(values, num_elements)
    return values._replace(
        axial=values.axial * factor,
        shear=values.shear * factor,
        bending=values.bending * factor,
        torsion=values.torsion * factor,
    )
