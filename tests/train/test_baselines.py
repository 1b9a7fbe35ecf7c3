"""The models in torch that ``motet bench`` measures beside those of bundles."""

import numpy as np
import pytest

import motet
from motet.bench.cases import cases
from motet_train.runs import TorchGraph, torch_model


@pytest.mark.parametrize("name", ["describe", "predict", "search"])
def test_a_bundles_model_in_torch_has_its_tables_and_does_the_same_calls(name: str) -> None:
    model = motet.load(name)
    found = torch_model(model, 1)
    assert type(found) is type(model)
    assert found.graphs.keys() == model.graphs.keys()
    assert all(isinstance(graph, TorchGraph) for graph in found.graphs.values())
    for role, graph in model.graphs.items():
        assert found.graphs[role].spec.inputs == graph.spec.inputs
    assert all(np.array_equal(found.tables[table], array) for table, array in model.tables.items())
    ours, theirs = ([(case.name, case.count) for case in cases(of)] for of in (model, found))
    assert ours == theirs
    next(case for case in cases(found) if case.name in ("describe.file", "predict.motion", "search.motion")).call()
