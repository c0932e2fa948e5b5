"""Many rods of one make in lane blocks: writing them, stepping them on several threads, reading them."""

import itertools

import numpy as np

from magrod_env._jit import PRESENT, Bound
from magrod_env.rod.energy import (
    ELASTIC,
    GRAVITATIONAL,
    KINETIC,
    LOADED,
    MAGNETIC,
    MEASURES,
    measure_blocks,
    watch_blocks,
)
from magrod_env.rod.implicit import run_implicit
from magrod_env.rod.layout import (
    DAMPING,
    DRAG,
    ENERGY,
    FIELD,
    GRADIENT,
    GRAVITY,
    LEAST_COSINE,
    PLANAR,
    SPATIAL,
    SPIN_DRAG,
    Terms,
    make_blocks,
    make_layout,
    rows_of,
)
from magrod_env.rod.loads.hub import SHARE, first_rows, load_terms, place_loads
from magrod_env.rod.mesh import RodValues, split_elements, write_rod
from magrod_env.rod.planes import PLANE_AXES
from magrod_env.rod.stepping import run_blocks
from magrod_env.rod.threads import Pool, checked_num_threads

LANES = {"float64": 8, "float32": 16}  # of a batch that one narrow block holds; larger ones get blocks twice as wide
RODS_PER_THREAD = {
    "float64": 32,
    "float32": 64,
}  # below this, handing a share to another thread costs more than it saves


def num_lanes(num_rods: int, precision: str) -> int:
    """Rods in a lane block: one vector register of a processor with AVX-512, or two.

    A rod's step is a long chain of operations that wait for each other; two registers side by side fill the waits.
    """
    if num_rods == 1:
        return 1
    return LANES[precision] if num_rods <= LANES[precision] else 2 * LANES[precision]


class RodBatch:
    """State and constants of ``num_rods`` rods with the same terms, magnets' nodes and numbers of elements.

    Args: ``values`` of the nominal rod; ``magnet_segments`` (num_magnets,) the segment at whose end each magnet sits;
    ``plane`` None, "xy" or "xz"; the scene's terms are present where they are not None or False; ``loads`` those that
    the scene lists.
    """

    def __init__(
        self,
        values: RodValues,
        magnet_segments,
        *,
        num_rods: int,
        num_elements: int,
        nodal: bool,
        precision: str,
        plane: str | None,
        gravity,
        drag_rate: float | None,
        spin_drag_rate: float | None,
        internal_damping: float | None,
        loads=(),
        slew: bool = False,
        lag: bool = False,
        turned: bool = False,
        num_threads: int | None = None,
    ):
        def present(flag):
            return PRESENT if flag else None

        self.num_threads = checked_num_threads(num_threads)
        self.num_rods, self.plane, self.axes = num_rods, plane, PLANE_AXES[plane]
        self.dtype = np.dtype(precision)
        self.counts = split_elements(values.ends, num_elements)
        ends = np.cumsum(self.counts)
        self.terms = Terms(
            lanes=(0,) * num_lanes(num_rods, precision),
            planar=present(plane is not None),
            nodal=present(nodal),
            gravity=present(gravity is not None),
            magnets=present(len(magnet_segments) > 0),
            drag=present(drag_rate is not None),
            spin_drag=present(spin_drag_rate is not None),
            internal_damping=present(internal_damping is not None),
            slew=present(slew),
            lag=present(lag),
            turned=present(turned),
            loads=load_terms(loads),
        )
        self.loads, self._ends = loads, values.ends
        self.layout = self._placed(make_layout(num_elements, tuple(int(ends[s]) for s in magnet_segments), self.terms))
        self.node_rows = SPATIAL if plane is None else PLANAR
        self.blocks = make_blocks(num_rods, self.layout, self.terms, self.dtype)
        self.rows = rows_of(self.blocks, len(self.terms.lanes))
        self.measures = np.zeros((len(self.blocks), MEASURES * len(self.terms.lanes)), self.dtype)
        self.travel = np.zeros(num_rods)
        self.status = np.zeros(num_rods, np.int64)
        for rod in range(self.rows.shape[0] * self.rows.shape[2]):
            write_rod(
                self.rows[rod // self.width],
                rod % self.width,
                self.layout,
                self.counts,
                self._in_plane(values),
                self.terms.planar,
                self.terms.nodal,
            )
        self.rows[:, LEAST_COSINE] = 1.0
        self.rows[:, DRAG] = drag_rate or 0.0
        self.rows[:, SPIN_DRAG] = spin_drag_rate or 0.0
        self.rows[:, DAMPING] = internal_damping or 0.0
        if gravity is not None:
            self.rows[:, GRAVITY : GRAVITY + len(self.axes)] = np.asarray(gravity, float)[list(self.axes), None]
        if loads:
            self.rows[:, self.layout.loads.own + SHARE] = 1.0
            for load, first in zip(loads, first_rows(self.layout, loads), strict=True):
                self.scatter(first, load.rows(plane, num_rods))
        self._pool, self._bound = Pool(self.num_threads), {}

    def _placed(self, layout):
        """A layout with the rows of the listed loads."""
        return place_loads(layout, self.terms, self.loads, self._ends, self.counts)

    def write_load(self, number: int, rods=slice(None), **values) -> None:
        """Write the rows of one of the listed loads for some rods, and let the watchdog take their energy anew.

        ``values`` replace those of the scene by the names of the load's fields: one for all of these rods, or one more
        axis with one for each. Raises ValueError where they are no values of it or leave the plane.
        """
        load, first = self.loads[number], first_rows(self.layout, self.loads)[number]
        rows, least = self.gather(first, load.ROWS), self.gather(ENERGY, 1)
        rows[rods] = load.rows(self.plane, len(rows[rods]), **values)
        least[rods] = np.inf
        self.scatter(first, rows)
        self.scatter(ENERGY, least)

    @property
    def width(self) -> int:
        """Rods in a lane block."""
        return len(self.terms.lanes)

    def _in_plane(self, values: RodValues) -> RodValues:
        """Values with the magnets' moments in the plane's axes first."""
        if self.plane is None:
            return values
        moments = np.zeros_like(values.magnet_moments)
        moments[:, :2] = values.magnet_moments[:, list(self.axes)]
        return values._replace(magnet_moments=moments)

    def use_gradient(self, used: bool = True) -> None:
        """From now on, compute the force that a field gradient makes, or leave it out."""
        if used != (self.terms.gradient is not None):
            self.terms = self.terms._replace(gradient=PRESENT if used else None)

    def use_node_damping(self) -> None:
        """From now on, every node has a damping of its own, zero until ``set_node_damping``."""
        before, state = self.layout, self.rows
        self.terms = self.terms._replace(node_damping=PRESENT)
        bare = make_layout(before.num_elements, before.magnet_nodes, self.terms)
        self.layout = self._placed(bare)
        self.blocks = make_blocks(self.num_rods, self.layout, self.terms, self.dtype)
        self.rows = rows_of(self.blocks, self.width)
        self.rows[:, : self.layout.node_damping] = state[:, : before.node_damping]
        listed = self.layout.size - bare.size
        self.rows[:, bare.size :] = state[:, before.size - listed :]

    def set_node_damping(self, damping) -> None:
        """Set the damping K of every node (num_rods, num_nodes, 3), kg/s, world axes: a force -K_k v_k along each."""
        inside = np.asarray(damping)[..., list(self.axes)]
        self.scatter(self.layout.node_damping, inside.reshape(self.num_rods, -1))

    def share(self, kernel, *arguments) -> None:
        """Call ``kernel(blocks, first, last, ...)`` on all blocks, shared out over the threads; it releases the GIL."""
        key = (kernel, self.terms, *(argument is None for argument in arguments))
        if key not in self._bound:
            self._bound[key] = Bound(kernel)
        self._share_out(self._bound[key], self.blocks, RODS_PER_THREAD[self.dtype.name] // self.width, *arguments)

    def share_out(self, kernel, blocks, *arguments) -> None:
        """The same with blocks of another kind, whose kernel takes far longer than a step."""
        self._share_out(kernel, blocks, 1, *arguments)

    def _share_out(self, kernel, blocks, least: int, *arguments) -> None:
        """Call a bound kernel on blocks, at least ``least`` of them in a thread."""
        total = len(blocks)
        workers = min(self.num_threads, max(1, total // max(1, least)))
        if workers == 1:
            kernel(blocks, 0, total, *arguments)
            return
        cuts = [total * k // workers for k in range(workers + 1)]
        others = [
            self._pool.submit(kernel, blocks, first, last, *arguments) for first, last in itertools.pairwise(cuts[1:])
        ]
        kernel(blocks, 0, cuts[1], *arguments)
        for other in others:
            other.result()

    def run(
        self, num_steps: int, time_step: float, blend: float = 0.0, largest_change: float = 0.0, fields=None
    ) -> None:
        """Step every rod ``num_steps`` times (see ``run_blocks``); ``fields`` as ``field_table`` makes it."""
        scalar = self.dtype.type
        self.share(
            run_blocks,
            self.layout,
            self.terms,
            num_steps,
            scalar(time_step),
            scalar(blend),
            scalar(largest_change),
            fields,
        )

    def run_implicit(self, num_steps: int, time_step: float, shares, fields=None) -> None:
        """The same with the implicit scheme made of ``shares`` of a step (see ``run_implicit`` of the kernels)."""
        parts = np.array(shares)
        self.share(run_implicit, self.layout, self.terms, num_steps, time_step, parts, fields, self.status)

    def field_table(self, fields) -> np.ndarray:
        """Fields of every step (num_steps, num_rods, 3) T in the order of the blocks; counts their travel."""
        steps, lanes = len(fields), self.width
        flat = np.zeros((steps, len(self.blocks) * lanes, 3))
        flat[:, : self.num_rods, : len(self.axes)] = fields[..., list(self.axes)]
        flat[:, self.num_rods :] = flat[:, self.num_rods - 1 : self.num_rods]
        first = np.abs(flat[0, : self.num_rods] - self.gather(FIELD, 3)).sum(axis=1)
        self.travel += first + np.abs(np.diff(flat[:, : self.num_rods], axis=0)).sum(axis=(0, 2))
        table = flat.reshape(steps, len(self.blocks), lanes, 3).transpose(1, 0, 3, 2)
        return np.ascontiguousarray(table, self.dtype).reshape(len(self.blocks), steps, 3 * lanes)

    @property
    def shown_terms(self) -> Terms:
        """Those on which the layout of a state and its energies depend: kernels that only look are shared by scenes
        that differ in the others.
        """
        terms = self.terms
        return Terms(
            lanes=terms.lanes,
            planar=terms.planar,
            nodal=terms.nodal,
            magnets=terms.magnets,
            gradient=terms.gradient,
            loads=terms.loads,
        )

    def watch(self) -> None:
        """Bring ``status`` up to date (see ``watch_blocks``)."""
        self.share(watch_blocks, self.layout, self.shown_terms, self.measures, self.travel, self.status)

    def mark(self, rods=slice(None)) -> None:
        """Take the present energy of some rods as the watchdog's start, and their status as well."""
        self.status[rods] = 0
        least = self.gather(ENERGY, 1)
        least[rods] = np.inf
        self.scatter(ENERGY, least)
        status = self.status.copy()
        self.watch()
        self.status[:] = status

    def gather(self, first: int, count: int) -> np.ndarray:
        """Rows ``first`` to ``first + count`` of all rods as float64, shape (num_rods, count)."""
        rows = self.rows[:, first : first + count].transpose(0, 2, 1).reshape(-1, count)
        return rows[: self.num_rods].astype(np.float64)

    def scatter(self, first: int, values) -> None:
        """Write rows of all rods from ``values`` (num_rods, count)."""
        values = np.asarray(values)
        count = values.shape[1]
        full = np.empty((self.rows.shape[0] * self.width, count), self.dtype)
        full[: self.num_rods] = values
        full[self.num_rods :] = values[-1]
        self.rows[:, first : first + count] = full.reshape(-1, self.width, count).transpose(0, 2, 1)

    def nodes(self, offset: int, count: int) -> np.ndarray:
        """A quantity of all nodes, shape (num_rods, num_nodes, count), float64."""
        size, num_nodes = self.node_rows.size, self.layout.num_elements + 1
        every = self.gather(self.layout.nodes, size * num_nodes).reshape(self.num_rods, num_nodes, size)
        return every[..., offset : offset + count]

    def set_nodes(self, offset: int, values) -> None:
        """Write a quantity of all nodes from (num_rods, num_nodes, count)."""
        size, num_nodes = self.node_rows.size, self.layout.num_elements + 1
        every = self.gather(self.layout.nodes, size * num_nodes).reshape(self.num_rods, num_nodes, size)
        every[..., offset : offset + np.shape(values)[-1]] = values
        self.scatter(self.layout.nodes, every.reshape(self.num_rods, -1))

    def set_field(self, field) -> None:
        """Set the field of every rod (num_rods, 3) T at once, and count its travel for the watchdog."""
        flat = np.zeros((self.num_rods, 3))
        flat[:, : len(self.axes)] = field[:, list(self.axes)]
        self.travel += np.abs(flat - self.gather(FIELD, 3)).sum(axis=1)
        for first in (FIELD, FIELD + 3, FIELD + 6):
            self.scatter(first, flat)

    def set_gradient(self, gradient, reach: float) -> None:
        """Set the gradient of every rod (num_rods, 3, 3) T/m; ``reach`` (m) turns it into the watchdog's travel."""
        inner = np.zeros((self.num_rods, 3, 3))
        axes = np.array(self.axes)
        inner[:, : len(axes), : len(axes)] = gradient[:, axes[:, None], axes]
        flat = inner.reshape(self.num_rods, 9)
        self.travel += reach * np.abs(flat - self.gather(GRADIENT, 9)).sum(axis=1)
        self.scatter(GRADIENT, flat)

    def energies(self) -> dict[str, np.ndarray]:
        """Kinetic, elastic, gravitational and magnetic energy of every rod and, where the scene lists loads, the
        potential energy of the dead forces among them; J, shape (num_rods,) each.
        """
        self.share(measure_blocks, self.layout, self.shown_terms, self.measures)
        seen = self.measures.reshape(len(self.blocks), -1, self.width).transpose(1, 0, 2)
        seen = seen.reshape(seen.shape[0], -1)[:, : self.num_rods].astype(np.float64)
        names = {"kinetic": KINETIC, "elastic": ELASTIC, "gravitational": GRAVITATIONAL, "magnetic": MAGNETIC}
        names |= {"loads": LOADED} if self.loads else {}
        return {name: seen[row] for name, row in names.items()}

    def __getstate__(self):
        return {**self.__dict__, "_bound": {}, "rows": None}

    def __setstate__(self, state):
        self.__dict__.update(state)
        self.rows = rows_of(self.blocks, self.width)
