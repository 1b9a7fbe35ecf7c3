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
from motet.models.base import BundleModel
from motet.models.generate_codes import CodesModel
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
    return build(bundle.manifest, {**graphs, role: Lying(graphs[role], output, value, row)})


@pytest.mark.parametrize(
    ("name", "role", "output", "value"),
    [
        *(("generate", "memory", "age", value) for value in (-1, 1001, 1 << 62)),
        *(("generate", "memory", "action", value) for value in (-1, 374, 1 << 62)),
        *(("generate", "memory", "codes", value) for value in (-1, 625, 1 << 62)),
        *(("generate", "memory", "numbers", value) for value in (np.nan, np.inf, 1e38)),
        *(("control", "rows", "left", value) for value in (-1, 9569 - 1000, 1 << 62)),
        *(("control", "rows", "gaits", value) for value in (-1, 2, np.nan)),
        *(("control", "rows", "features", value) for value in (np.nan, 1e38)),
        *(("control", "rows", "frames", value) for value in (np.inf, -1e38)),
    ],
)
def test_tables_are_checked_as_they_are_loaded(name: str, role: str, output: str, value: float) -> None:
    with pytest.raises(BundleError, match=f"the table's '{output}' is out of range"):
        lying(name, role, output, value, row=1000)


def test_a_context_of_no_log_probabilities_is_refused() -> None:
    model = lying("generate", "encoder", "context", 1e38)
    assert isinstance(model, CodesModel)
    with pytest.raises(BundleError, match="no log-probability"):
        model.understood("a person walks")


@pytest.mark.parametrize(
    ("name", "path", "value", "reason"),
    [
        ("control", ("motion", "channels"), None, r"motion\.channels: must be those of the humanoid"),
        ("control", ("config", "steering", "velocity"), 0, r"config\.steering\.velocity: must be a number between"),
        ("control", ("config", "scale"), [0] * 34, r"config\.scale: must be numbers between"),
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
        build(Manifest.from_json(source), {role: bundle.graph(role) for role in bundle.manifest.graphs})
