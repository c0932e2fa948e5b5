"""What an observation holds: one list of entries, from which its size, the kernels' places and the tables follow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from magrod_env.envs.observing import Places

SPATIAL_STATE, PLANAR_STATE = 13, 7  # numbers a node


@dataclass(frozen=True, kw_only=True)
class Entry:
    """Some consecutive numbers of an observation.

    Args:
        name: a field of `Places`.
        size: how many numbers.
        unit: what a number of 1 means.
        meaning: what they are, in order.
    """

    name: str
    size: int
    unit: str
    meaning: str


@dataclass(frozen=True)
class ObservationLayout:
    """The entries of an observation in their order; those that an environment lacks are left out."""

    entries: tuple[Entry, ...]

    @classmethod
    def of(
        cls,
        *,
        num_tracked: int,
        length: float,
        axes: str,
        preview: tuple[float, ...],
        num_nodes: int,
        plane: str | None,
    ) -> ObservationLayout:
        """The layout of an environment.

        Args:
            num_tracked: tracked points: the magnets, from the tip inwards.
            length: of the rod, m.
            axes: letters of the coil axes.
            preview: s, how far ahead targets are shown.
            num_nodes: free nodes whose state is shown, if any.
            plane: of the motion; None for space.
        """
        points, count = "the tip" if num_tracked == 1 else "the tip, then of the middle magnet", 3 * num_tracked
        seen = f"position x, y, z of {points}, as the camera sees it, world"
        moved = "velocity, the difference of the last two frames"
        sensed = f"field along {_listed(axes)} by the coils' own sensors"
        entries = (
            Entry(name="position", size=count, unit=f"L = {1e3 * length:.4g} mm", meaning=seen),
            Entry(name="velocity", size=count, unit="L/s", meaning=moved),
            Entry(name="field", size=len(axes), unit="coils' limit", meaning=sensed),
            Entry(name="target", size=count, unit="L/10", meaning="target minus position"),
            Entry(name="preview", size=count * len(preview), unit="L/10", meaning=_preview_meaning(preview)),
            _state_entry(num_nodes, plane),
        )
        return cls(tuple(entry for entry in entries if entry.size))

    @property
    def size(self) -> int:
        """Numbers in an observation."""
        return sum(entry.size for entry in self.entries)

    @property
    def slices(self) -> dict[str, slice]:
        """Where each entry is, by its name."""
        found, at = {}, 0
        for entry in self.entries:
            found[entry.name] = slice(at, at + entry.size)
            at += entry.size
        return found

    @property
    def places(self) -> Places:
        """Where each entry begins, for the kernels; those that are left out are never written."""
        slices = self.slices
        return Places(*(slices[name].start if name in slices else self.size for name in Places._fields))

    def table(self) -> str:
        """The entries as a Markdown table."""
        lines = ["| entries | name | what | unit |", "|---|---|---|---|"]
        for entry in self.entries:
            place = self.slices[entry.name]
            lines.append(f"| {place.start}-{place.stop - 1} | {entry.name} | {entry.meaning} | {entry.unit} |")
        return "\n".join(lines)


def _preview_meaning(preview: tuple[float, ...]) -> str:
    first, *later = (f"{time:g} s" for time in preview) if preview else ("no time",)
    return f"target in {first} minus target now" + (f", then in {_listed(later)}" if later else "")


def _state_entry(num_nodes: int, plane: str | None) -> Entry:
    if plane is None:
        size = SPATIAL_STATE
        what = "position (L), quaternion w x y z, velocity (L/s), spin in the body frame (10 rad/s)"
    else:
        size = PLANAR_STATE
        what = f"position {', '.join(plane)} (L), half-angle cosine and sine, velocity (L/s), spin (10 rad/s)"
    meaning = f'with `observe="state"`: {size} numbers a free node, from the clamp outwards: {what}'
    return Entry(name="state", size=size * num_nodes, unit="", meaning=meaning)


def _listed(words: Sequence[str]) -> str:
    """Words as a list in a sentence."""
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else words[0]
