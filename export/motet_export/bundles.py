"""From a training run to a bundle: graphs exported, parity checked, golden vectors, figures and licences."""

import logging
import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from motet.bundle.bundle import Bundle, write_bundle
from motet.bundle.graph import Graph, OnnxGraph
from motet.bundle.manifest import Manifest
from motet.bundle.session import SessionOptions
from motet.files import check_place
from motet_export.decoded import whole_runs
from motet_export.examples import examples
from motet_export.exporter import ExportError, export_graph
from motet_export.golden import FILE, golden_vectors
from motet_export.half import HALF, halved, round_weights
from motet_export.parity import check_carried, check_one_step, check_runs
from motet_export.quantise import difference, quantised
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
    manifest, modules, torch = Manifest.from_json(run.manifest), run.graphs(), run.torch_graphs()
    label = {"motet": version("motet"), "bundle": manifest.name, "model": manifest.model}
    files = {}
    for role, (module, spec) in modules.items():
        log.info("exporting the graph %s", role)
        graph = export_graph(module, spec, {**label, "role": role})
        files[f"{role}.onnx"] = halved(graph) if half else graph
    log.info("comparing it with torch")
    onnx = _sessions(files, torch)
    report = parity(manifest, onnx, torch)
    if half:
        report["weights"] = HALF
    if int8:
        files, exact = {name: quantised(data) for name, data in files.items()}, onnx
        onnx = _sessions(files, torch)
        report["int8"] = difference(manifest, onnx, exact)
    files[FILE], golden = golden_vectors(manifest, onnx, examples(manifest, torch))
    graphs = {role: {"file": f"{role}.onnx", **spec.to_json()} for role, (_, spec) in modules.items()}
    write_bundle(out, {**run.manifest, "graphs": graphs, "golden": golden, "parity": report}, files)
    return report


def halve_bundle(bundle: Bundle, out: str | Path) -> dict[str, Any]:
    """Write a bundle anew as ``out``, its weights rounded to 16 bits, and return what that changes in whole runs.

    For bundles whose run is gone. Nothing else changes but the golden vectors, which are those of the new graphs; the
    parity report says what the rounding makes of the runs, under "half".
    """
    check_place(out)
    manifest = bundle.manifest
    exact: dict[str, Graph] = {role: bundle.graph(role, SessionOptions()) for role in manifest.graphs}
    files = {f"{role}.onnx": halved(bundle.read(entry.file), rounded=True) for role, entry in manifest.graphs.items()}
    onnx = _sessions(files, exact)
    changes = difference(manifest, onnx, exact)
    files[FILE], golden = golden_vectors(manifest, onnx, examples(manifest, exact))
    graphs = {role: {"file": f"{role}.onnx", **graph.spec.to_json()} for role, graph in exact.items()}
    report = {**manifest.parity, "weights": HALF, "half": changes}
    write_bundle(out, {**manifest.source, "graphs": graphs, "golden": golden, "parity": report}, files)
    return changes


def _sessions(files: Mapping[str, bytes], torch: Mapping[str, Graph]) -> dict[str, Graph]:
    return {role: OnnxGraph(files[f"{role}.onnx"], graph.spec) for role, graph in torch.items()}


def parity_of(run: Run, bundle: Bundle, options: SessionOptions | None = None) -> dict[str, Any]:
    """The parity report of an existing bundle, its graphs run as ``options`` say, against a run.

    ExportError at the first rung that fails.
    """
    if "int8" in bundle.manifest.parity:
        raise ExportError(f"bundle {bundle.path} has 8-bit weights, which torch cannot check; export without --int8")
    if bundle.manifest.parity.get("weights") == HALF:
        round_weights(run.model)
    onnx = {role: bundle.graph(role, options or SessionOptions()) for role in run.graphs()}
    return parity(bundle.manifest, onnx, run.torch_graphs())


def parity(manifest: Manifest, onnx: Mapping[str, Graph], torch: Mapping[str, Graph]) -> dict[str, Any]:
    """Climb the parity ladder; the report that goes into the manifest. ExportError at the first rung that fails."""
    draws = examples(manifest, torch)
    report: dict[str, Any] = {
        f"{role}.one_step": check_one_step(role, onnx[role], graph, draws[role]) for role, graph in torch.items()
    }
    horizon = manifest.defaults["horizon"] if manifest.verb == "predict" else None
    if "step" in torch:
        report["step.carried"] = check_carried(onnx["step"], torch["step"], draws["step"], horizon)
    report["runs"] = check_runs(whole_runs(manifest, onnx, torch))
    report["versions"] = {name: version(name) for name in ("torch", "onnx", "onnxruntime")}
    report["machine"] = f"{platform.system()} {platform.machine()}"
    return report
