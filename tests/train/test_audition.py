from motet_train.recipes.audition import audition
from torch import nn


def candidates(net: nn.Linear, values: list[float], seen: list[float]):
    for value in values:
        nn.init.constant_(net.bias, value)
        yield
        seen.append(value)


def chosen(misses: list[list[str]]) -> tuple[float, tuple[int, list[str]], list[int]]:
    net, seen, limits = nn.Linear(1, 1), [], []

    def missed(enough: int) -> list[str]:
        limits.append(enough)
        return misses[len(limits) - 1]

    found = audition(net, candidates(net, [float(n) for n in range(len(misses))], seen), missed)
    return net.bias.item(), found, limits


def test_the_first_that_misses_nothing_is_taken_and_no_other_is_trained() -> None:
    assert chosen([["a"], [], []])[:2] == (1.0, (2, []))


def test_else_the_one_that_misses_least_and_counting_stops_early() -> None:
    bias, found, limits = chosen([["a", "b", "c"], ["a"], ["b", "c"], ["c"]])
    assert (bias, found) == (1.0, (4, ["a"]))
    assert limits[1:] == [3, 1, 1]
