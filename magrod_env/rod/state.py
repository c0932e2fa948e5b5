"""The motion of a batch of rods in space, whatever its kernel computes in: read from its rows and written to them."""

import numpy as np

from magrod_env.rod.batch import RodBatch
from magrod_env.rod.layout import LEAST_COSINE
from magrod_env.rod.planes import (
    quaternions_in_plane,
    quaternions_in_space,
    spins_in_plane,
    spins_in_space,
    vectors_in_plane,
    vectors_in_space,
)
from magrod_env.rotations import rotation_matrices


class BatchState:
    """Positions, rotations and motion of every node of a batch, float64; what leaves the plane of a planar one is 0."""

    def __init__(self, batch: RodBatch) -> None:
        self.batch, self.rows, self.plane = batch, batch.node_rows, batch.plane

    @property
    def positions(self) -> np.ndarray:
        """m, world, (num_rods, num_nodes, 3)."""
        return self._vectors(self.rows.position)

    @property
    def velocities(self) -> np.ndarray:
        """m/s, world, (num_rods, num_nodes, 3)."""
        return self._vectors(self.rows.velocity)

    @property
    def quaternions(self) -> np.ndarray:
        """Rotations of the sections, body to world, scalar first, (num_rods, num_nodes, 4)."""
        numbers = 4 if self.plane is None else 2
        return quaternions_in_space(self.batch.nodes(self.rows.rotation, numbers), self.plane)

    @property
    def rotations(self) -> np.ndarray:
        """Rotation matrices of the sections, body to world, (num_rods, num_nodes, 3, 3)."""
        return rotation_matrices(self.quaternions)

    @property
    def momenta(self) -> np.ndarray:
        """Angular momentum of the sections, kg m^2/s, body frame, (num_rods, num_nodes, 3)."""
        numbers = 3 if self.plane is None else 1
        return spins_in_space(self.batch.nodes(self.rows.momentum, numbers), self.plane)

    @property
    def angular_velocities(self) -> np.ndarray:
        """rad/s, body frame, (num_rods, num_nodes, 3)."""
        return self.momenta * (2.0 * self.compliance)

    @property
    def masses(self) -> np.ndarray:
        """Lumped mass of each node, magnets included, kg, (num_rods, num_nodes); 0 for the clamp's, which is fixed."""
        masses = 1.0 / self.batch.nodes(self.rows.inverse_mass, 1)[..., 0]
        masses[:, 0] = 0.0
        return masses

    @property
    def compliance(self) -> np.ndarray:
        """1/(2 J) about each body axis, (num_rods, num_nodes, 3)."""
        if self.plane is None:
            return self.batch.nodes(self.rows.compliance, 2)[..., [0, 1, 1]]
        return np.repeat(self.batch.nodes(self.rows.compliance, 1), 3, axis=-1)

    def momenta_of(self, angular_velocities: np.ndarray) -> np.ndarray:
        """Angular momenta, kg m^2/s, of angular velocities, rad/s, both in the body frame, (num_rods, num_nodes, 3)."""
        return angular_velocities / (2.0 * np.where(self.compliance > 0.0, self.compliance, 1.0))

    def set_momenta(self, momenta: np.ndarray) -> None:
        """Set the angular momenta, kg m^2/s, body frame, (num_rods, num_nodes, 3)."""
        self.batch.set_nodes(self.rows.momentum, spins_in_plane(momenta, self.plane))

    def _vectors(self, row: int) -> np.ndarray:
        return vectors_in_space(self.batch.nodes(row, len(self.batch.axes)), self.plane)

    def write(
        self,
        positions: np.ndarray,
        quaternions: np.ndarray,
        velocities: np.ndarray | None = None,
        momenta: np.ndarray | None = None,
    ) -> None:
        """Put every rod into a state: units and shapes as above; at rest where no motion is given."""
        batch, rows, plane = self.batch, self.rows, self.plane
        still = np.zeros(positions.shape)
        batch.set_nodes(rows.position, vectors_in_plane(positions, plane))
        batch.set_nodes(rows.rotation, quaternions_in_plane(quaternions, plane))
        batch.set_nodes(rows.velocity, vectors_in_plane(still if velocities is None else velocities, plane))
        self.set_momenta(still if momenta is None else momenta)
        batch.rows[:, LEAST_COSINE] = 1.0
