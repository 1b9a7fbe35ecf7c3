"""Graphs that say what cannot be are refused, as a bundle is loaded or where a number is used."""

import json
from functools import reduce
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from motet.bundle.bundle import Bundle
from motet.bundle.graph import Arrays, Graph
from motet.bundle.manifest import Manifest
from motet.errors import BundleError
from motet.generate.model import CodesModel
from motet.models.base import BundleModel
from motet.models.load import build


class Lying:
    """A graph one of whose outputs has the same value everywhere, or in one row."""

    def __init__(self, graph: Graph, output: str, value: float, row: int | None = None) -> None:
        self.spec, self._graph, self._output, self._value, self._row = graph.spec, graph, output, value, row

    def __call__(self, feeds: Arrays) -> dict[str, NDArray[Any]]:
        found = dict(self._graph(feeds))
        found[self._output] = np.array(found[self._output])
        found[self._output][slice(None) if self._row is None else self._row] = self._value
        return found


def lying(name: str, role: str, output: str, value: float, row: int | None = None) -> BundleModel:
    bundle = Bundle.open(name)
    graphs: dict[str, Graph] = {one: bundle.graph(one) for one in bundle.manifest.graphs}
    return build(bundle.manifest, {**graphs, role: Lying(graphs[role], output, value, row)}, tables_of(bundle))


def tables_of(bundle: Bundle) -> dict[str, NDArray[Any]]:
    return {name: bundle.table(name) for name in bundle.manifest.tables}


@pytest.mark.parametrize(
    ("column", "value", "reason"),
    [
        (0, 257, "move"),
        (3, 625, "code"),
        (-2, 1 << 14, "action"),
        (-1, 1001, "age"),
        *((n, -1, "") for n in range(-6, 0)),
    ],
)
def test_a_memory_is_checked_before_its_use(column: int, value: int, reason: str) -> None:
    bundle = Bundle.open("generate")
    tables = tables_of(bundle)
    memory = tables["memory"].copy()
    memory[1000, column] = value
    graphs = {role: bundle.graph(role) for role in bundle.manifest.graphs}
    with pytest.raises(BundleError, match=f"table memory: {reason}.* is out of range"):
        build(bundle.manifest, graphs, {**tables, "memory": memory}).ready()
    for other in ({}, {**tables, "moves": tables["moves"][:-1]}, {**tables, "body": tables["body"][0]}):
        with pytest.raises(BundleError, match="manifest, tables"):
            build(bundle.manifest, graphs, other)


def test_a_context_of_no_log_probabilities_is_refused() -> None:
    model = lying("generate", "encoder", "context", 1e38)
    assert isinstance(model, CodesModel)
    with pytest.raises(BundleError, match="no log-probability"):
        model.understood("a person walks")


@pytest.mark.parametrize(
    ("name", "path", "value", "reason"),
    [
        ("control", ("motion", "channels"), None, r"motion\.channels: must be those of the humanoid"),
        ("control", ("settings", "steering", "velocity"), 0, r"settings\.steering\.velocity must be between 0\.01"),
        ("control", ("settings", "steering", "velocity"), -1, r"settings\.steering\.velocity must be between 0\.01"),
        ("control", ("settings", "steering", "search_every"), 2.5, r"search_every must be a whole number"),
        ("control", ("settings", "steering", "speed"), 1, r"settings\.steering\.speed: is unknown"),
        ("control", ("settings", "foot_lock", "fade"), 0, r"settings\.foot_lock\.fade must be between"),
        ("control", ("settings", "steering", "lasting"), 9999, r"no row of 'walk' is followed by 9999 more"),
        ("control", ("config", "speeds"), [[1, 2, 3, 4, -1]] * 5, r"config\.speeds: must hold a row of 5 speeds"),
        ("control", ("config", "speeds"), [[1, 2, 3, 4, 5]], r"config\.speeds: must hold a row of 5 speeds"),
        ("control", ("config", "odd"), 37, r"config\.odd: must be a whole number between 0 and 36"),
        ("generate", ("config", "codec", "moves"), 625, r"codec\.moves: must be at most 624"),
        ("generate", ("config", "codec", "moves"), 255, "tables: 'moves' is float32 .256, 3., expected"),
        ("generate", ("config", "codec", "ahead"), [1e9], r"codec\.ahead: must be 0 or 1 for each"),
    ],
)
def test_a_manifest_that_does_not_fit_its_graphs_is_refused(
    name: str, path: tuple[str, ...], value: object, reason: str
) -> None:
    bundle = Bundle.open(name)
    source = json.loads(json.dumps(bundle.manifest.source))
    *outer, key = path
    place = reduce(lambda found, one: found[one], outer, source)
    place[key] = place[key][::-1] if value is None else value
    with pytest.raises(BundleError, match=reason):
        build(
            Manifest.from_json(source),
            {role: bundle.graph(role) for role in bundle.manifest.graphs},
            tables_of(bundle),
        )


@pytest.mark.parametrize(
    ("name", "row", "value"),
    [
        *(("left", 1000, value) for value in (-1, 9569 - 1000)),
        ("moves", 1000, 1e38),
        ("shows", 1000, 2),
        *(("feature_scale", 3, value) for value in (0, -1, np.nan)),
        ("feature_mean", 3, np.inf),
    ],
)
def test_plain_arrays_are_checked_as_they_are_loaded(name: str, row: int, value: float) -> None:
    bundle = Bundle.open("control")
    tables = tables_of(bundle)
    wrong = np.array(tables[name])
    wrong[row] = value
    with pytest.raises(BundleError, match=f"table {name}: holds a number that is out of range"):
        build(bundle.manifest, {}, {**tables, name: wrong})
    with pytest.raises(BundleError, match=f"there is no table '{name}'"):
        build(bundle.manifest, {}, {one: table for one, table in tables.items() if one != name})
