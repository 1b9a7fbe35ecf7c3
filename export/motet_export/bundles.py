"""From a training run to a bundle: export the graphs, check parity, add golden vectors and the manifest."""

import logging
import platform
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from motet.bundle.bundle import Bundle, write_bundle
from motet.bundle.fields import Json
from motet.bundle.graph import GraphSpec, OnnxGraph, SessionOptions
from motet.bundle.manifest import Manifest
from motet.bundle.members import array_bytes
from motet.files import check_place
from motet.models.base import BundleModel
from motet.models.load import build, kind_of
from motet_export.commands import with_commands
from motet_export.decoded import differences, golden_vectors, whole_runs
from motet_export.exporter import ExportError, apart, export_graph, halved, quantised, renewed, round_weights
from motet_export.parity import (
    Examples,
    Once,
    check_carried,
    check_far,
    check_meaning,
    check_one_step,
    check_runs,
    examples,
)
from motet_train.runs import Run

log = logging.getLogger("motet.export")

Report = dict[str, Any]
"""The parity report of a manifest."""


def export_run(run: Run, out: str | Path, int8: bool = False, half: bool = False) -> Json:
    """Export a training run as the bundle ``out`` (a .zip or a new folder) and return the parity report.

    Nothing is written if a graph does not export or a rung of the parity ladder fails (ExportError). int8: then store
    weights in 8 bits; "int8" in the report is the difference that this makes. half: before export, round the run's
    weights to 16 bits, and store them so. ExportError for both.
    """
    check_place(out)
    if int8 and half:
        raise ExportError("weights are kept in 8 bits or in 16: export with --int8 or with --half")
    if half:
        round_weights(run.model)
    torch = run.bundle_model()
    files = _exported(run, torch.manifest, half)
    log.info("comparing it with torch")
    onnx = _loaded(torch, files)
    report = parity(onnx, torch)
    if half:
        report["weights"] = "float16"
    if int8:
        # parity is that of the exact weights; the effect of rounding is only reported
        exact = onnx
        files = {name: quantised(data) for name, data in files.items()}
        onnx = _loaded(torch, files)
        report["int8"] = differences(onnx, exact)
    _write(out, onnx, files, {**run.manifest, "parity": report}, examples(torch.manifest, torch.graphs, far=True))
    return report


def _exported(run: Run, manifest: Manifest, half: bool) -> dict[str, bytes]:
    """The graphs of a run as ONNX, by file name."""
    files = {}
    for role, (module, spec) in run.model.graphs().items():
        log.info("exporting the graph %s", role)
        graph = export_graph(module, spec, label(manifest, role, spec))
        files[f"{role}.onnx"] = halved(graph) if half else graph
    return files


def label(manifest: Manifest, role: str, spec: GraphSpec) -> dict[str, str]:
    """The metadata by which a graph is recognised without its bundle; "state=next_state" under "feedback"."""
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


def halve_bundle(bundle: Bundle, out: str | Path) -> Json:
    """Write a copy of a bundle with weights rounded to 16 bits, and return the differences of whole runs.

    For bundles whose run is gone. The golden vectors are those of the new graphs; nothing else changes. "half" in the
    parity report is the effect of the rounding on whole runs.
    """
    check_place(out)
    exact = kind_of(bundle.manifest).load(bundle)
    # the same graphs with rounded weights
    files = {f"{role}.onnx": halved(bundle.model(role), rounded=True) for role in exact.graphs}
    onnx = _loaded(exact, files)
    changes = differences(onnx, exact)
    report = {**bundle.manifest.parity, "weights": "float16", "half": changes}
    draws = examples(bundle.manifest, exact.graphs, far=True)
    _write(out, onnx, files, {**bundle.manifest.source, "parity": report}, draws)
    return changes


def renew_golden(bundle: Bundle, out: str | Path, commands: Path | None = None) -> None:
    """Copy a bundle to ``out`` with graphs stored, and golden vectors made, as by today's code; nothing else changes
    but, if they are given as a table, its commands (:func:`motet_export.commands.with_commands`)."""
    check_place(out)
    model = with_commands(bundle, commands) if commands else kind_of(bundle.manifest).load(bundle)
    manifest = model.manifest
    files = {f"{role}.onnx": renewed(bundle.model(role)) for role in manifest.graphs}
    model = _loaded(model, files)
    _write(out, model, files, manifest.source, examples(manifest, model.graphs, far=True))


def _loaded(model: BundleModel, files: Mapping[str, bytes]) -> BundleModel:
    """The model with graphs from files, run by ONNX Runtime."""
    graphs = {role: OnnxGraph(files[f"{role}.onnx"], graph.spec) for role, graph in model.graphs.items()}
    return build(model.manifest, graphs, model.tables)


def _write(
    out: str | Path,
    model: BundleModel,
    graphs: Mapping[str, bytes],
    about: Json,
    draws: Mapping[str, Examples],
) -> None:
    """Write the bundle of a model, with golden vectors and tables."""
    # golden vectors, graphs and tables, each with its entry in the manifest
    vectors, golden = golden_vectors(model, draws)
    files, entries = _graph_files(model, graphs)
    tables = {}
    arrays = {}
    for name, array in model.tables.items():
        tables[name] = {"file": f"{name}.npy", "dtype": array.dtype.name, "shape": array.shape}
        arrays[f"{name}.npy"] = array_bytes(array)
    settings = {kind.FEATURE: asdict(model.settings(kind)) for kind in model.SETTINGS}
    manifest = {**about, "settings": settings, "graphs": entries, "tables": tables, "golden": golden}
    write_bundle(out, manifest, {**files, **arrays, golden["file"]: vectors})


def _graph_files(model: BundleModel, graphs: Mapping[str, bytes]) -> tuple[dict[str, bytes], Json]:
    """The files of graphs, with the weights that several hold in one of their own, and their entries in a manifest."""
    files, weights = apart(graphs)
    entries = {}
    for role, graph in model.graphs.items():
        file = f"{role}.onnx"
        shared = {"weights": "weights.onnx"} if files[file] != graphs[file] else {}
        entries[role] = {"file": file, **shared, **graph.spec.to_json()}
    if weights:
        files["weights.onnx"] = weights
    return files, entries


def parity_of(run: Run, bundle: Bundle, options: SessionOptions | None = None) -> Json:
    """The parity report of an existing bundle against its run; ExportError at the first rung that fails.

    options: of the ONNX Runtime sessions.
    """
    if "int8" in bundle.manifest.parity:
        raise ExportError(f"bundle {bundle.path} has 8-bit weights, which torch cannot check; export without --int8")
    if bundle.manifest.parity.get("weights") == "float16":
        round_weights(run.model)
    model = kind_of(bundle.manifest).load(bundle, options)
    return parity(model, run.bundle_model())


def _single_calls(onnx: BundleModel, torch: BundleModel, draws: Mapping[str, Examples]) -> Report:
    """The rungs of each graph alone: inputs like the data's, and inputs far from all data."""
    far = examples(torch.manifest, torch.graphs, far=True)
    report: Report = {}
    for role, graph in torch.graphs.items():
        report[f"{role}.one_step"] = check_one_step(role, onnx.graphs[role], graph, draws[role])
        report[f"{role}.far"] = check_far(role, onnx.graphs[role], graph, far[role])
    return report


def parity(onnx: BundleModel, torch: BundleModel) -> Report:
    """Climb the parity ladder and return the report for the manifest; ExportError at the first rung that fails."""
    check_meaning(onnx, torch)
    horizon = None
    if onnx.VERB == "predict":
        # its encoder is called again after its horizon, and for the inputs of its step
        horizon = int(onnx.defaults["horizon"])
        torch = build(torch.manifest, {**torch.graphs, "encoder": Once(torch.graphs["encoder"])}, torch.tables)
    draws = examples(torch.manifest, torch.graphs)
    report = _single_calls(onnx, torch, draws)
    if "step" in torch.graphs:
        report["step.carried"] = check_carried(onnx.graphs["step"], torch.graphs["step"], draws["step"], horizon)
    report["runs"] = check_runs(whole_runs(onnx, torch))
    report["versions"] = {name: version(name) for name in ("torch", "onnx", "onnxruntime")}
    report["machine"] = f"{platform.system()} {platform.machine()}"
    return report
