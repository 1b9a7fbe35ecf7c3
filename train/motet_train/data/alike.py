"""Which motions show the same: those of which the same is said."""

from collections.abc import Hashable, Iterable, Sequence


def alike(said: Sequence[Iterable[Hashable]]) -> list[int]:
    """For each of N things the number of its group: equal where they have something in common, or a chain of such."""
    group, first = list(range(len(said))), dict[Hashable, int]()

    def root(one: int) -> int:
        while group[one] != one:
            group[one] = one = group[group[one]]
        return one

    for one, things in enumerate(said):
        for thing in things:
            group[root(one)] = root(first.setdefault(thing, one))
    return [root(one) for one in range(len(said))]
