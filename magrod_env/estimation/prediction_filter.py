"""The distributed prediction filter of Tariverdi et al. 2020: damping that brings the model to what cameras saw."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from magrod_env import _checks
from magrod_env.estimation.arrivals import check_arrival
from magrod_env.estimation.damping_choice import LEAST_NOISE, DampingChoice
from magrod_env.estimation.history import Piece, replay, set_state_rows, split, state_rows
from magrod_env.estimation.innovation_spread import InnovationSpread
from magrod_env.estimation.measurement import SAME_TIME, Measurement, marker_arc_lengths, marker_nodes
from magrod_env.rod.batch import PLANE_AXES
from magrod_env.rod.energy import ENERGETIC
from magrod_env.scene import Scene
from magrod_env.simulation import Simulation, SimulationDiverged, StabilityError
from magrod_env.simulation.resolution import EXPECTED_FIELD
from magrod_env.simulation.starts import Shape

LAWS = ("replay", "extrapolated")
DAMPED = ("all", "seen")


class PredictionFilter:
    """Estimates rods from frames by the damping K of their nodes, after section 3.2 of the paper.

    Between two exposures every node a gets a force -diag(K_a) v_a, K_a three numbers along the world axes. At a frame
    the filter chooses the K that minimises e^T R e + K^T W K, e being predicted minus measured positions of the
    markers. K may be negative: it stands for all that the model lacks. It acts on nodes that move only, so an error at
    rest stays. docs/prediction_filter.md derives the law, compares it with the printed equations and measures it.

    Args:
        scene: the model of the rods.
        num_rods: rods in the batch, each with its own estimate.
        num_elements: of the model; a node must sit at every marker. None takes 6.
        markers: "tip", "magnets" or arc lengths, m.
        law: "replay" (default): the frame itself tells the K of the interval that ends with its exposure; the interval
            is then run again with it. "extrapolated": the paper's, K of the interval to come, towards where the last
            two frames, extended to first order, put the markers.
        damped: "all" nodes get a K, by the sensitivity of the markers to each of them (default), or the "seen" ones.
        measurement_weight: R, 1/m^2, for every coordinate; None for the inverse of the measurement's covariance.
        damping_weight: W, (s/kg)^2, for every K; None for (m_a damping_spread)^-2.
        damping_spread: 1/s: standard deviation of K_a/m_a from which None makes W.
        largest_change: bound on |K_a| T/m_a over an interval T: by itself, K changes a velocity by a factor between
            e^-largest_change and e^largest_change, so that a negative K cannot blow the motion up.
        hold: run on with the last K until the next frame, as the paper does, instead of with K = 0 (default); the
            extrapolated law always does.
        initial_uncertainty: standard deviation of a marker's position, m, after a reset.
        history: seconds kept for late frames and for going back over an interval.
        time_step, axial_softening, rotary_scaling, expected_field, plane, on_failure, num_threads: of the model, as in
            `Simulation`. A rise of its energy is no failure here, since K may bring it about.

    Raises:
        ValueError: on bad input, as `Simulation`, or a marker at no node.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        num_rods: int = 1,
        num_elements: int | None = None,
        markers: str | ArrayLike = "tip",
        law: str = "replay",
        damped: str = "all",
        measurement_weight: float | None = None,
        damping_weight: float | None = None,
        damping_spread: float = 20.0,
        largest_change: float = 1.0,
        hold: bool = False,
        initial_uncertainty: float = 1e-3,
        history: float = 0.5,
        time_step: float | None = None,
        axial_softening: float | None = None,
        rotary_scaling: float | None = None,
        expected_field: float = EXPECTED_FIELD,
        plane: str | None = None,
        on_failure: str = "raise",
        num_threads: int | None = None,
    ) -> None:
        for name, value, choices in (
            ("law", law, LAWS),
            ("damped", damped, DAMPED),
            ("on_failure", on_failure, ("raise", "report")),
        ):
            if value not in choices:
                words = " or ".join(f'"{choice}"' for choice in choices)
                raise ValueError(f"{name} must be {words}, but got {value!r}: choose one.")
        self.law, self.damped, self.on_failure = law, damped, on_failure
        self.hold = bool(hold) or law == "extrapolated"
        self._kept = _checks.number("history", history, above=0.0, advice="give it in seconds, half a second is plenty")
        model = partial(
            Simulation,
            scene,
            axial_softening=axial_softening,
            rotary_scaling=rotary_scaling,
            expected_field=expected_field,
            plane=plane,
            on_failure="report",
            num_threads=num_threads,
        )
        self._model = model(num_rods=num_rods, num_elements=num_elements, time_step=time_step)
        self._model.rods.batch.use_node_damping()
        self.scene, self.num_rods, num_elements = scene, self._model.num_rods, self._model.num_elements
        self.places = np.array(marker_arc_lengths(scene, markers))
        self._marker_nodes = marker_nodes(self._model.arc_lengths, tuple(self.places))
        axes, nodes = PLANE_AXES[plane], np.arange(1, num_elements + 1)
        if damped == "seen":
            nodes = np.unique(self._marker_nodes)
        self._nodes, self._axes = np.repeat(nodes, len(axes)), np.tile(axes, len(nodes))
        masses = self._model.node_masses[0, self._nodes]
        spread = _checks.number(
            "damping_spread", damping_spread, above=0.0, advice="give it in 1/s, 20 is a good start"
        )
        weight = _positive("damping_weight", damping_weight, "(s/kg)^2, or None for one from damping_spread")
        self._W = (masses * spread) ** -2.0 if weight is None else np.full(len(masses), weight)
        self._choice = DampingChoice(
            model(num_rods=num_rods * (1 + len(masses)), num_elements=num_elements, time_step=self._model.time_step),
            num_rods,
            nodes=self._nodes,
            axes=self._axes,
            marker_nodes=self._marker_nodes,
            W=self._W,
            weight=_positive("measurement_weight", measurement_weight, "1/m^2, or None for the inverse covariance"),
            largest_change=_checks.number("largest_change", largest_change, above=0.0, advice="1 is a good start"),
        )
        initial = _checks.number(
            "initial_uncertainty", initial_uncertainty, at_least=0.0, advice="give it in metres, a millimetre is 1e-3"
        )
        self._spread = InnovationSpread(self.num_rods, self.places, initial)
        self._damping = np.zeros((self.num_rods, self._model.num_elements + 1, 3))
        self._deviation = np.zeros((self.num_rods, len(self._nodes)))
        self._before = np.zeros((self.num_rods, len(self.places), 3))  # what the last frame saw, m
        self._born = np.zeros(self.num_rods)
        self.reset()

    # ---- the contract of an estimator

    def reset(self, field: ArrayLike | None = None, mask: ArrayLike | None = None, shape: Shape | None = None) -> None:
        """Start again at rest at time 0: straight, in the static equilibrium of a field, or in a shape.

        Args:
            field: (3,) or (num_rods, 3), T, or None.
            mask: (num_rods,) bool: only those rods start again; the clock then runs on. None for all.
            shape: positions and rotations of the nodes, as `Simulation.reset` takes them, or None.

        Raises:
            ValueError: on a wrong shape or field.
            StabilityError: as `Simulation.reset`.
        """
        rods = np.ones(self.num_rods, bool) if mask is None else np.asarray(mask)
        if rods.shape != (self.num_rods,) or rods.dtype != bool:
            raise ValueError(
                f"mask must be bool of shape ({self.num_rods},), but got {mask!r}: give True for a rod to start again."
            )
        if not rods.any():
            return
        fields = None if field is None else self._model.checked_field(field)
        if fields is not None:
            fields = np.where(rods[:, None], fields, fields[rods][0])  # the others' may have no equilibrium
        before = state_rows(self._model)
        try:
            self._model.reset(fields, shape)
        except (ValueError, StabilityError):
            set_state_rows(self._model, before)
            raise
        set_state_rows(self._model, np.where(rods[:, None], state_rows(self._model), before))
        if mask is None:
            self._time = 0.0
            self._pieces: list[Piece] = []
            self._field = np.zeros((self.num_rods, 3))
            self._forget_scores()
        self._innovation[rods], self._normalised[rods], self._dof[rods] = np.nan, np.nan, 0
        self._field[rods] = 0.0 if fields is None else fields[rods]
        self._born[rods], self._before[rods] = self._time, np.nan
        self._damping[rods], self._deviation[rods] = 0.0, 1.0 / np.sqrt(self._W)
        self._model.rods.batch.set_node_damping(self._running)
        self._model.rods.batch.mark(rods)
        self._spread.reset(rods, self._time)

    def predict(self, field: ArrayLike, duration: float) -> None:
        """Advance the estimate under a field.

        Args:
            field: T, world, (3,) or (num_rods, 3).
            duration: s.

        Raises:
            ValueError: on a wrong shape, as `Simulation.advance`.
            SimulationDiverged: if a model fails and `on_failure` is "raise".
        """
        duration = _checks.number("duration", duration, at_least=0.0, advice="give it in seconds")
        fields = self._model.checked_field(field)
        piece = Piece(self._time, duration, fields, state_rows(self._model))
        self._model.advance(duration, field=fields)
        self._field = fields
        if duration > 0.0:
            self._pieces.append(piece)
            self._time += duration
        while self._pieces and self._pieces[0].end < self._time - self._kept - SAME_TIME:
            self._pieces.pop(0)
        self._check_models()

    def update(self, measurement: Measurement | None) -> None:
        """Take in the markers' positions at one exposure; None, or a rod none of whose markers was seen: coast.

        A late frame, exposed before `time`, is compared with the state at its exposure; what followed is run again.

        Raises:
            ValueError: if the shape is wrong, or the exposure is in the future, before that of an update already taken
                in, or before the history kept.
            SimulationDiverged: as `predict`.
        """
        self._forget_scores()
        if measurement is None:
            return
        oldest = self._pieces[0].start if self._pieces else self._time
        check_arrival(measurement, (self.num_rods, len(self.places)), self._time, oldest, oldest)
        exposure = min(measurement.time, self._time)
        present = state_rows(self._model)
        before, after = split(self._pieces, exposure)
        rows = self._rows_at(before, after)
        live = self._born <= exposure + SAME_TIME  # a rod that was reset since is not the one that was seen
        seen = measurement.seen & live[:, None]
        goal = np.where(seen[..., None], measurement.positions, np.nan)
        self._innovation = goal - self._model.positions[:, self._marker_nodes]
        started = before[0].start if before else exposure
        lengths = np.where(live, exposure - np.maximum(started, self._born), 0.0)
        told = seen.any(axis=1) & (lengths > SAME_TIME)
        pieces, start = before, before[0].rows if before else rows
        last, self._before = self._before, goal
        if self.law == "extrapolated":
            told &= (np.isfinite(last).all(axis=-1) | ~seen).all(axis=1)
            goal = 2.0 * goal - last
            pieces, start = self._coming(exposure, after, rows, exposure - started), rows
        followed = np.zeros(goal.shape)
        if told.any():
            running = self._running.copy()
            choice = self._choice.choose(start, pieces, goal, measurement.covariance, told, lengths, self._born)
            self._damping[np.flatnonzero(told)[:, None], self._nodes, self._axes] = choice.damping
            self._deviation[told], followed[told] = choice.deviation, choice.followed
            if self.law == "replay":
                replay(self._model, start, before, np.where(told[:, None, None], self._damping, running), self._born)
                rows = state_rows(self._model)
        self._score(measurement, seen, followed, exposure, lengths)
        replay(self._model, rows, after, self._running, self._born, note=True)
        newborn = self._born >= self._time - SAME_TIME
        if newborn.any():
            set_state_rows(self._model, np.where(newborn[:, None], present, state_rows(self._model)))
        self._pieces = after
        self._check_models()

    @property
    def time(self) -> float:
        """Time since the last reset of all rods, s."""
        return self._time

    @property
    def positions(self) -> np.ndarray:
        """Estimated positions of the nodes, m, world, (num_rods, num_nodes, 3)."""
        return self._model.positions

    @property
    def velocities(self) -> np.ndarray:
        """Estimated velocities of the nodes, m/s, world, (num_rods, num_nodes, 3)."""
        return self._model.velocities

    @property
    def tip_position(self) -> np.ndarray:
        """Estimated position of the tip, m, world, (num_rods, 3)."""
        return self._model.tip_position

    @property
    def arc_lengths(self) -> np.ndarray:
        """Arc length of every node, m, (num_nodes,)."""
        return self._model.arc_lengths

    @property
    def node_masses(self) -> np.ndarray:
        """Lumped masses of the nodes, kg, (num_rods, num_nodes), for the rates K_a/m_a; the clamp's is 0."""
        return self._model.node_masses

    @property
    def uncertainty(self) -> np.ndarray:
        """Standard deviation of the nodes' positions, m, (num_rods, num_nodes, 3), from the innovations so far.

        The law has no covariance of its own; docs/prediction_filter.md says what this is and how honest.
        """
        return self._spread.deviation(self._model.arc_lengths, self._time)

    @property
    def innovation(self) -> np.ndarray:
        """Last frame minus the forecast of it, m, (num_rods, num_markers, 3), NaN where nothing was seen."""
        return self._innovation.copy()

    @property
    def normalised_innovation(self) -> np.ndarray:
        """Sum of the squared innovations over their expected variances, (num_rods,), NaN where nothing was seen."""
        return self._normalised.copy()

    @property
    def innovation_dof(self) -> np.ndarray:
        """Degrees of freedom of `normalised_innovation`: three for each marker seen, (num_rods,)."""
        return self._dof.copy()

    @property
    def parameters(self) -> dict[str, np.ndarray]:
        """None: K stands for what the model lacks in one interval, and is no constant of the rod."""
        return {}

    @property
    def parameter_uncertainty(self) -> dict[str, np.ndarray]:
        """None."""
        return {}

    # ---- the damping

    @property
    def damping(self) -> np.ndarray:
        """K of the last interval in which it was found, kg/s, world axes, (num_rods, num_nodes, 3); 0 where none."""
        return self._damping.copy()

    @property
    def damping_uncertainty(self) -> np.ndarray:
        """Its standard deviation if R and W are inverse covariances, kg/s, (num_rods, num_nodes, 3); 0 where none."""
        full = np.zeros(self._damping.shape)
        full[:, self._nodes, self._axes] = self._deviation
        return full

    @property
    def status(self) -> np.ndarray:
        """0 for a model that is well, else as `Simulation.status`, (num_rods,)."""
        return self._model.status

    @property
    def _running(self) -> np.ndarray:
        """K with which the models run on."""
        return self._damping if self.hold else np.zeros(self._damping.shape)

    # ---- the past

    def _rows_at(self, before: list[Piece], after: list[Piece]) -> np.ndarray:
        """State at the exposure between these pieces; the model is left in it, a piece cut in two gets it."""
        if not after:
            return state_rows(self._model)
        if before and after[0].rows is before[-1].rows:
            replay(self._model, before[-1].rows, before[-1:])
            after[0].rows = state_rows(self._model)
        set_state_rows(self._model, after[0].rows)
        return after[0].rows

    def _coming(self, exposure: float, after: list[Piece], rows: np.ndarray, length: float) -> list[Piece]:
        """The interval after an exposure: the fields known, then the last one."""
        known, _ = split(after, exposure + length)
        end = known[-1].end if known else exposure
        if end < exposure + length - SAME_TIME:
            known.append(Piece(end, exposure + length - end, self._field, rows))
        return known

    # ---- checks and scores

    def _forget_scores(self) -> None:
        self._innovation = np.full((self.num_rods, len(self.places), 3), np.nan)
        self._normalised, self._dof = np.full(self.num_rods, np.nan), np.zeros(self.num_rods, int)

    def _score(self, measurement, seen, followed, exposure, lengths) -> None:
        """Compare the innovation with what was expected, then learn from it."""
        noise = np.diagonal(measurement.covariance, axis1=-2, axis2=-1) + LEAST_NOISE**2
        squares = np.where(seen[..., None], self._innovation**2 / self._spread.expected(noise), 0.0)
        self._dof = 3 * seen.sum(axis=1)
        self._normalised = np.where(self._dof > 0, squares.sum(axis=(1, 2)), np.nan)
        self._spread.take_in(self._innovation, noise, followed, exposure, lengths)

    def _check_models(self) -> None:
        batch = self._model.rods.batch
        if (batch.status == ENERGETIC).any():
            batch.mark(batch.status == ENERGETIC)
        failed = np.flatnonzero(batch.status)
        if len(failed) and self.on_failure == "raise":
            raise SimulationDiverged(
                f"rod {failed[0]} of the filter's model left the stable range by t = {self._time:.4g} s with status "
                f"{batch.status[failed[0]]}: lower time_step, damping_spread or largest_change."
            )


def _positive(name: str, value: float | None, unit: str) -> float | None:
    return None if value is None else _checks.number(name, value, above=0.0, advice=f"give it in {unit}")
