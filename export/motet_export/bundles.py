"""From a training run to a bundle: graphs exported, parity checked, golden vectors, figures and licences."""

import logging
import platform
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from motet.bundle.bundle import Bundle, write_bundle
from motet.bundle.graph import GraphSpec, OnnxGraph, SessionOptions
from motet.bundle.manifest import Manifest
from motet.bundle.members import array_bytes
from motet.files import check_place
from motet.models.base import BundleModel
from motet.models.load import build, kind_of
from motet_export.decoded import differences, golden_vectors, whole_runs
from motet_export.exporter import ExportError, export_graph, halved, quantised, round_weights
from motet_export.parity import Examples, check_carried, check_one_step, check_runs, examples
from motet_train.runs import Run

log = logging.getLogger("motet.export")


def export_run(run: Run, out: str | Path, int8: bool = False, half: bool = False) -> dict[str, Any]:
    """Export a training run as the bundle ``out`` (a .zip or a new folder) and return the parity report.

    Nothing is written where a graph does not export or a rung of the parity ladder fails (ExportError).
    int8: keep weights in 8 bits after that; the report then has "int8", the difference that it makes.
    half: round the run's weights to 16 bits before that, and keep them so. ExportError for both.
    """
    check_place(out)
    if int8 and half:
        raise ExportError("weights are kept in 8 bits or in 16: export with --int8 or with --half")
    if half:
        round_weights(run.model)
    modules, torch = run.model.graphs(), run.bundle_model()
    manifest = torch.manifest
    files = {}
    for role, (module, spec) in modules.items():
        log.info("exporting the graph %s", role)
        graph = export_graph(module, spec, label(manifest, role, spec))
        files[f"{role}.onnx"] = halved(graph) if half else graph
    log.info("comparing it with torch")
    onnx = _served(torch, files)
    report = parity(onnx, torch)
    if half:
        report["weights"] = "float16"
    if int8:
        files, exact = {name: quantised(data) for name, data in files.items()}, onnx
        onnx = _served(torch, files)
        report["int8"] = differences(onnx, exact)
    _write(out, onnx, files, {**run.manifest, "parity": report}, examples(manifest, torch.graphs))
    return report


def label(manifest: Manifest, role: str, spec: GraphSpec) -> dict[str, str]:
    """The metadata of a graph, by which it can be told without its bundle; "state=next_state" under "feedback"."""
    contract = manifest.motion
    return {
        "motet": version("motet"),
        "bundle": manifest.name,
        "model": manifest.model,
        "role": role,
        "verb": manifest.verb,
        "loop": manifest.loop,
        "fps": f"{contract.fps:g}",
        "representation": contract.representation,
        "channels": str(len(contract.channels)),
        "feedback": " ".join(f"{name}={source}" for name, source in spec.feedback.items()),
        "start": " ".join(f"{name}={','.join(map(str, sizes))}" for name, sizes in spec.start.items()),
    }


def halve_bundle(bundle: Bundle, out: str | Path) -> dict[str, Any]:
    """Write a bundle anew as ``out``, its weights rounded to 16 bits, and return what that changes in whole runs.

    For bundles whose run is gone. Nothing else changes but the golden vectors, which are those of the new graphs; the
    parity report says what the rounding makes of the runs, under "half".
    """
    check_place(out)
    exact = kind_of(bundle.manifest).load(bundle)
    files = {f"{role}.onnx": halved(bundle.read(g.file), rounded=True) for role, g in bundle.manifest.graphs.items()}
    onnx = _served(exact, files)
    changes = differences(onnx, exact)
    report = {**bundle.manifest.parity, "weights": "float16", "half": changes}
    _write(out, onnx, files, {**bundle.manifest.source, "parity": report}, examples(bundle.manifest, exact.graphs))
    return changes


def _served(model: BundleModel, files: Mapping[str, bytes]) -> BundleModel:
    graphs = {role: OnnxGraph(files[f"{role}.onnx"], graph.spec) for role, graph in model.graphs.items()}
    return build(model.manifest, graphs, model.tables)


def _write(
    out: str | Path,
    model: BundleModel,
    graphs: Mapping[str, bytes],
    about: Mapping[str, Any],
    draws: Mapping[str, Examples],
) -> None:
    """Write the bundle of a model, with golden vectors and plain arrays."""
    vectors, golden = golden_vectors(model, draws)
    specs = {role: {"file": f"{role}.onnx", **graph.spec.to_json()} for role, graph in model.graphs.items()}
    tables = {
        name: {"file": f"{name}.npy", "dtype": array.dtype.name, "shape": array.shape}
        for name, array in model.tables.items()
    }
    arrays = {f"{name}.npy": array_bytes(array) for name, array in model.tables.items()}
    settings = {kind.FEATURE: asdict(model.settings(kind)) for kind in model.SETTINGS}
    manifest = {**about, "settings": settings, "graphs": specs, "tables": tables, "golden": golden}
    write_bundle(out, manifest, {**graphs, **arrays, golden["file"]: vectors})


def parity_of(run: Run, bundle: Bundle, options: SessionOptions | None = None) -> dict[str, Any]:
    """The parity report of an existing bundle, its graphs run as ``options`` say, against a run.

    ExportError at the first rung that fails.
    """
    if "int8" in bundle.manifest.parity:
        raise ExportError(f"bundle {bundle.path} has 8-bit weights, which torch cannot check; export without --int8")
    if bundle.manifest.parity.get("weights") == "float16":
        round_weights(run.model)
    model = kind_of(bundle.manifest).load(bundle, options)
    return parity(model, build(bundle.manifest, run.torch_graphs(), run.model.tables()))


def parity(onnx: BundleModel, torch: BundleModel) -> dict[str, Any]:
    """Climb the parity ladder; the report that goes into the manifest. ExportError at the first rung that fails."""
    draws = examples(onnx.manifest, torch.graphs)
    report: dict[str, Any] = {
        f"{role}.one_step": check_one_step(role, onnx.graphs[role], graph, draws[role])
        for role, graph in torch.graphs.items()
    }
    horizon = int(onnx.defaults["horizon"]) if onnx.VERB == "predict" else None
    if "step" in torch.graphs:
        report["step.carried"] = check_carried(onnx.graphs["step"], torch.graphs["step"], draws["step"], horizon)
    report["runs"] = check_runs(whole_runs(onnx, torch))
    report["versions"] = {name: version(name) for name in ("torch", "onnx", "onnxruntime")}
    report["machine"] = f"{platform.system()} {platform.machine()}"
    return report
