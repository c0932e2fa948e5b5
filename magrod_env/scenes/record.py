"""What the paper states about one of its scenes, beyond the rod and its loads."""

from __future__ import annotations

from dataclasses import dataclass

from magrod_env.scene import Rod, Scene


def nodal_stiffening(rod: Rod, num_elements: int) -> float:
    """Return the factor by which the paper's element is too stiff in bending: 1 + GA h^2 / (4 EI), h = length
    / elements.

    The element measures shear against the section at each of its ends. In pure bending the ends are turned
    against the chord by half the bending angle, which the element takes for shear. The reciprocal of the
    factor is the correction gamma that section 5 of the paper fits to the frequency of motion.
    """
    h = rod.length / num_elements
    return 1.0 + rod.shear_stiffness * h**2 / (4.0 * rod.bending_stiffness)


@dataclass(frozen=True, kw_only=True, slots=True)
class ReportedError:
    """Absolute position error of one point along one direction (Table 8), m."""

    point: str
    """"tip" or "middle", a magnet's place for the rod with two."""
    direction: str
    """As printed: an axis "E1", "E2", "E3", "both" transverse axes, or "distance"."""
    largest: float
    mean: float


@dataclass(frozen=True, kw_only=True, slots=True)
class PaperScene:
    """A scene of Tariverdi et al. 2020 (PLoS ONE 15(7): e0236121) with what the paper says of its run. SI
    units.

    `None` means that the paper does not state a value or that it does not apply. Fields are magnitudes.
    """

    name: str
    scene: Scene
    source: str
    """Section, table and figure of the paper."""
    num_elements: int | None = None
    paper_time_step: float | None = None
    """Time step of the paper, s; in scenes 1, 2 and 6 beyond the limit of its own scheme."""
    duration: float | None = None
    initial_tip_deflection_deg: float | None = None
    """Printed initial deflection of the tip, degrees; whether of the chord or the tangent is not said."""
    initial_tip_offset: tuple[float, float] | None = None
    """Printed initial distances of the tip from its rest position along two transverse axes, m."""
    gravity_compensation_field: float | None = None
    """Constant field against the sag under gravity, upwards, T."""
    rotating_field: float | None = None
    """Field that turns across the rod and leads the tip in a circle, T."""
    initial_field: float | None = None
    """Field at the start of a quasi-static motion, T."""
    final_field: float | None = None
    """Field at its end, T; the path between the two is not stated."""
    field_limit: float | None = None
    """Largest field of the coils, T."""
    filter_R: float | None = None
    """Weight of the prediction filter on the error, R = filter_R * identity."""
    filter_W: float | None = None
    """Weight of the prediction filter on the damping capacity, W = filter_W * identity."""
    reported_errors: tuple[ReportedError, ...] = ()
    why_no_effective_modulus: str | None = None
    """Why the modulus that follows from the paper's element describes no rod; None where it does."""
    notes: str = ""

    @property
    def stiffening(self) -> float | None:
        """`nodal_stiffening` at the paper's number of elements; None where the paper states no number."""
        return None if self.num_elements is None else nodal_stiffening(self.scene.rod, self.num_elements)
