"""The scenes of all segments: some are kept, the others are made again from their segments when they are asked for.

The scenes of an hour of motion take more memory than the columns of its rows. Scenes in question are asked for often,
reference scenes rarely.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, overload

from acqd.arrays import Floats
from acqd.models.effects.scene import Scene, segment_scene
from acqd.models.greybox.model import GreyBox
from acqd.models.segments import Segment

_KEPT_ROWS = 22_500
"""A quarter of an hour at 25 rows per second."""
_LARGE_ROWS = 5_000
"""Rows whose torques of bodies, some kB a row, are kept, too."""


class Scenes(Sequence[Scene]):
    """One scene per segment; what effects remember of a scene (`Scene.memory`) is always kept."""

    def __init__(self, model: GreyBox, segments: list[tuple[Segment, bool]]) -> None:
        """`segments` with whether they are in question."""
        self.segments = tuple(segment for segment, _ in segments)
        self.in_question = tuple(in_question for _, in_question in segments)
        self._model = model
        self._memory: list[dict[str, Any]] = [{} for _ in segments]
        asked = [number for number, (_, in_question) in enumerate(segments) if in_question]
        self._rows = sum(len(segments[number][0].P) for number in asked)
        self.kept = frozenset(asked[:: max(1, math.ceil(self._rows / _KEPT_ROWS))])
        """Numbers of segments in question, spread over the recordings, whose scenes are kept."""
        self._scenes: dict[int, Scene] = {}
        self._newest: Scene | None = None
        self.levels: dict[str, list[Floats]] = {}
        """[T] W per segment, by id, of effects that are only switched on and off: every search asks for them."""

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
        scene = self._scenes.get(number) or self._made(number)
        if self._newest is not None and self._newest is not scene and self._rows > _LARGE_ROWS:
            self._newest.moved.clear()
            self._newest.computed.clear()
        self._newest = scene
        return scene

    def _made(self, number: int) -> Scene:
        scene = segment_scene(self._model, self.segments[number])
        scene.memory = self._memory[number]
        if number in self.kept:
            self._scenes[number] = scene
        return scene

    def drop_kept(self) -> None:
        """Keep no scene from now on, for who has asked for most of them: all are made again when asked for."""
        self.kept, self._newest = frozenset(), None
        self._scenes.clear()

    def memory(self, number: int) -> dict[str, Any]:
        """What effects remember of a scene, which is not made for that."""
        return self._memory[number]

    def remember(self, number: int, known: dict[str, Any]) -> None:
        """Add to what effects remember of a scene."""
        self._memory[number].update(known)
