"""From a training run to a bundle: graphs exported, parity checked, figures and licences in the manifest."""

import platform
from collections.abc import Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from motet.bundle import Bundle, write_bundle
from motet.control import ControlModel
from motet.files import check_place
from motet.graph import Graph, OnnxGraph
from motet_export.exporter import export_graph
from motet_export.parity import Arrays, check_carried, check_one_step, check_runs
from motet_train.runs import Run


def export_run(run: Run, out: str | Path) -> dict[str, Any]:
    """Export a training run as the bundle ``out`` (a .zip or a new folder) and return the parity report.

    Nothing is written where a graph does not export or a rung of the parity ladder fails (ExportError).
    """
    check_place(out)
    modules = run.graphs()
    label = {"motet": version("motet"), "bundle": run.manifest["name"], "model": run.manifest["model"]}
    files = {
        f"{role}.onnx": export_graph(module, spec, {**label, "role": role}) for role, (module, spec) in modules.items()
    }
    onnx_graphs: dict[str, Graph] = {
        role: OnnxGraph(files[f"{role}.onnx"], spec) for role, (_, spec) in modules.items()
    }
    report = parity(run.manifest, onnx_graphs, run.torch_graphs())
    graphs = {role: {"file": f"{role}.onnx", **spec.to_json()} for role, (_, spec) in modules.items()}
    write_bundle(out, {**run.manifest, "graphs": graphs, "parity": report}, files)
    return report


def parity_of(run: Run, bundle: Bundle) -> dict[str, Any]:
    """The parity report of a bundle that is there against a run; ExportError at the first rung that fails."""
    return parity(bundle.manifest, {role: bundle.graph(role) for role in run.graphs()}, run.torch_graphs())


def parity(manifest: Mapping[str, Any], onnx: Mapping[str, Graph], torch: Mapping[str, Graph]) -> dict[str, Any]:
    """Climb the parity ladder; the report that goes into the manifest. ExportError at the first rung that fails."""
    report: dict[str, Any] = {f"{role}.one_step": check_one_step(role, onnx[role], torch[role]) for role in torch}
    report["step.carried"] = check_carried(onnx["step"], torch["step"])
    models = ControlModel(manifest, onnx), ControlModel(manifest, torch)
    report["runs"] = check_runs({name: partial(_control_runs, models, variety) for name, variety in _VARIETIES.items()})
    report["versions"] = {name: version(name) for name in ("torch", "onnx", "onnxruntime")}
    report["machine"] = f"{platform.system()} {platform.machine()}"
    return report


_VARIETIES = {"mean_field": 0.0, "sampled": 1.0}


def _control_runs(models: tuple[ControlModel, ControlModel], variety: float) -> tuple[Arrays, Arrays]:
    """Four characters go through all labels, one after the other, half a second of ramp between."""
    labels = len(models[0].labels)
    hold, ramp = round(2 * models[0].fps), round(models[0].fps / 2)
    corners = np.repeat(np.eye(labels), hold + ramp, axis=0)
    smooth = np.stack([np.convolve(column, np.ones(ramp) / ramp)[: len(corners)] for column in corners.T], axis=1)
    track = smooth.clip(0, 1)
    found, expected = (
        model.start(characters=4, seed=7, variety=variety, iterations=2 if model.has_free_units else 1).frames(track)
        for model in models
    )
    return {"frames": found}, {"frames": expected}
