"""The scenes of all segments: some are kept, the others are made again from their segments when they are asked for.

The scenes of an hour of motion take more memory than the columns of its rows. Scenes in question are asked for often,
reference scenes rarely.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, overload

from acqd.models.effects.bodies import LINK_TORQUES
from acqd.models.effects.scene import Scene, segment_scene
from acqd.models.greybox.model import GreyBox
from acqd.models.segments import Segment

_KEPT_ROWS = 22_500
"""A quarter of an hour at 25 rows per second."""
_LARGE_ROWS = 5_000
"""Rows whose torques of bodies on links, some kB a row, are kept, too."""


class Scenes(Sequence[Scene]):
    """One scene per segment; what effects remember of a scene (`Scene.memory`) is always kept."""

    def __init__(self, model: GreyBox, segments: list[tuple[Segment, bool]]) -> None:
        """`segments` with whether they are in question."""
        self.segments = tuple(segment for segment, _ in segments)
        self.in_question = tuple(in_question for _, in_question in segments)
        self._model = model
        self._memory: list[dict[str, Any]] = [{} for _ in segments]
        self._kept: dict[int, Scene] = {}
        self._kept_rows = 0
        self._rows = sum(len(segment.P) for segment, in_question in segments if in_question)
        self._newest: Scene | None = None

    def __len__(self) -> int:
        return len(self.segments)

    @overload
    def __getitem__(self, index: int) -> Scene: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Scene]: ...
    def __getitem__(self, index: int | slice) -> Scene | Sequence[Scene]:
        if isinstance(index, slice):
            return [self[number] for number in range(*index.indices(len(self)))]
        number = range(len(self))[index]
        scene = self._kept.get(number) or self._made(number)
        if self._newest is not None and self._newest is not scene and self._rows > _LARGE_ROWS:
            self._newest.moved.pop(LINK_TORQUES, None)
        self._newest = scene
        return scene

    def _made(self, number: int) -> Scene:
        scene = segment_scene(self._model, self.segments[number])
        scene.memory = self._memory[number]
        if self.in_question[number] and self._kept_rows + scene.rows <= _KEPT_ROWS:
            self._kept[number] = scene
            self._kept_rows += scene.rows
        return scene

    def remember(self, number: int, known: dict[str, Any]) -> None:
        """Add to what effects remember of a scene."""
        self._memory[number].update(known)
