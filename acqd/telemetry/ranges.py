"""Sets of integers that mostly follow one another, as sorted ranges: the `seq` of rows that wait, or are sent."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence


class Ranges:
    """A set of integers. Memory and time grow with the number of ranges, not of integers."""

    __slots__ = ("_bounds", "_count")

    def __init__(self, pairs: Iterable[tuple[int, int]] = ()) -> None:
        """`pairs`: first and last integer of each range."""
        self._bounds: list[int] = []  # starts and ends in turn; an end is the first integer that is not in
        self._count = 0
        for first, last in pairs:
            self.add(first, last)

    def add(self, first: int, last: int) -> int:
        """Add first..last; how many of them are new."""
        end, bounds = last + 1, self._bounds
        if not bounds or first >= bounds[-1]:  # numbers that rise
            if bounds and first == bounds[-1]:
                bounds[-1] = end
            else:
                bounds += (first, end)
            self._count += end - first
            return end - first
        low, high, inside = self._inside(first, end)
        self._bounds[low:high] = ([] if low % 2 else [first]) + ([] if high % 2 else [end])
        self._count += (new := end - first - inside)
        return new

    def add_all(self, numbers: Sequence[int]) -> None:
        """Add all these; numbers that rise by one cost one addition."""
        if numbers and numbers == list(range(numbers[0], numbers[0] + len(numbers))):
            self.add(numbers[0], numbers[-1])
            return
        for number in numbers:
            self.add(number, number)

    def remove(self, first: int, last: int) -> int:
        """Remove first..last; how many of them were in."""
        end, bounds = last + 1, self._bounds
        if bounds and first <= bounds[0] < end <= bounds[1]:  # in order, from the first one on
            inside = end - bounds[0]
            bounds[0] = end
            if end == bounds[1]:
                del bounds[:2]
            self._count -= inside
            return inside
        low, high, inside = self._inside(first, end)
        if inside:
            self._bounds[low:high] = ([first] if low % 2 else []) + ([end] if high % 2 else [])
            self._count -= inside
        return inside

    def __contains__(self, number: int) -> bool:
        return bisect_right(self._bounds, number) % 2 == 1

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[tuple[int, int]]:
        """First and last integer of each range, in order."""
        bounds = self._bounds
        return iter([(bounds[k], bounds[k + 1] - 1) for k in range(0, len(bounds), 2)])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Ranges) and self._bounds == other._bounds

    __hash__ = None  # type: ignore[assignment] # it changes

    def __repr__(self) -> str:
        return f"Ranges({list(self)})"

    def _inside(self, first: int, end: int) -> tuple[int, int, int]:
        """Bounds that lie within first..end as a slice, and how many integers of it are in the set."""
        bounds = self._bounds
        low, high = bisect_left(bounds, first), bisect_right(bounds, end)
        points = bounds[low:high]
        if low % 2:
            points.insert(0, first)
        if high % 2:
            points.append(end)
        return low, high, sum(points[1::2]) - sum(points[::2])
