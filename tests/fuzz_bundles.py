"""Mutated bundles: whatever is altered, only motet's own errors come out, soon and in little memory.

    python tests/fuzz_bundles.py --count 5000 [--seed N] [--first N] [--seconds 2] [--megabytes 500]

The bundles that come with motet are altered in six ways: bytes of the zip, values and keys of the manifest, bytes of a
graph, its weights moved out of it, what one of its outputs says, and bytes of golden vectors; in all but the first the
manifest lists the hashes of what is there, as who makes a bundle on purpose would. Each is loaded, asked for all that
its verb can do, and verified.
"""

import hashlib
import io
import json
import sys
import zipfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from fuzzing import Files, Generator, Mutant, altered, damaged, fuzz, options
from wire import field

import motet
from motet.bundle.bundle import Bundle, archive_bytes, list_bundles
from motet.bundle.graph import SessionOptions
from motet.bundle.graph_safety import Value, fields
from motet.generate.model import CodesModel
from motet.models.load import verify
from motet.motion.motion import Motion

CLIP = Path(__file__).parents[1] / "train" / "motet_train" / "data" / "cmu" / "39_14.amc"

LIES: dict[str, list[tuple[float, float]]] = {
    "float32": [
        *((0, value) for value in (np.nan, np.inf, -np.inf, 3e38, -3e38, 1e9, 1, 0, -1)),
        *((factor, 0) for factor in (-1, 1e-30, 1e6, 1e30)),
    ],
    "int64": [
        *((0, value) for value in (-1, 0, 1, 1 << 20, 1 << 40, 1 << 62, -(1 << 62))),
        *((1, value) for value in (-1, 1)),
        *((factor, 0) for factor in (-1, 1000)),
    ],
}
"""By what an output is multiplied, and what is added then."""

Change = Callable[[Generator, dict[str, Any], Files], str]


def mutate(rng: Generator) -> Mutant:
    """A mutated bundle."""
    zips = shipped()
    name = str(rng.choice(sorted(zips)))
    kind = str(rng.choice(list(_KINDS), p=[0.1, 0.4, 0.15, 0.05, 0.2, 0.1]))
    if kind == "zip":
        return f"{name}, zip", {"mutated.zip": damaged(rng, zips[name])}
    with zipfile.ZipFile(io.BytesIO(zips[name])) as archive:
        files = {member: archive.read(member) for member in archive.namelist()}
    manifest = json.loads(files.pop("manifest.json"))
    change = _KINDS[kind]
    if change in (_outside, _lie) and not manifest["graphs"]:
        change = _in_graph  # a table of a bundle that has no graph
    said = change(rng, manifest, files)
    return f"{name}, {kind}: {said}", {"mutated.zip": _zipped(manifest, files)}


@cache
def shipped() -> dict[str, bytes]:
    """The bundles that come with motet."""
    return {name: path.read_bytes() for name, path in list_bundles().items()}


def _zipped(manifest: dict[str, Any], files: Files) -> bytes:
    """The zip with hashes made right, where the manifest still has a place for them."""
    listed = manifest.get("files")
    for name, data in files.items():
        if isinstance(listed, dict) and isinstance(listed.get(name), dict):
            listed[name].update(size=len(data), sha256=hashlib.sha256(data).hexdigest())
    return archive_bytes({"manifest.json": json.dumps(manifest).encode(), **files})


def _in_manifest(rng: Generator, manifest: dict[str, Any], files: Files) -> str:
    return altered(rng, manifest, seldom={"training", "quality", "parity", "config", "actions"})


def _in_graph(rng: Generator, manifest: dict[str, Any], files: Files) -> str:
    """A graph or a table."""
    name = str(rng.choice([file for file in files if file.endswith((".onnx", ".npy"))]))
    files[name] = damaged(rng, files[name])
    return name


def _outside(rng: Generator, manifest: dict[str, Any], files: Files) -> str:
    """A graph with one tensor more, at its start or end, whose data is in some file of the machine."""
    name = str(rng.choice([file for file in files if file.endswith(".onnx")]))
    place = str(rng.choice(["/etc/passwd", "weights.bin", "../weights.bin", "manifest.json"]))
    entry = field(13, field(1, "location") + field(2, place))
    tensor = field(1, 1) + field(2, 1) + field(8, "w") + field(14, 1) + entry
    graph = field(7, field(5, tensor))
    files[name] = files[name] + graph if rng.random() < 0.5 else graph + files[name]
    return f"{name} reads {place}"


def _lie(rng: Generator, manifest: dict[str, Any], files: Files) -> str:
    """An output says something else."""
    roles = manifest["graphs"]
    entry = roles[str(rng.choice(sorted(roles)))]
    output = entry["outputs"][int(rng.integers(len(entry["outputs"])))]
    factor, more = LIES[output["dtype"]][int(rng.integers(len(LIES[output["dtype"]])))]
    files[entry["file"]] = lying(files[entry["file"]], output["name"], np.dtype(output["dtype"]), factor, more)
    return f"{entry['file']} {output['name']} times {factor:g} plus {more:g}"


def lying(model: bytes, output: str, dtype: np.dtype[Any], factor: float, more: float) -> bytes:
    """An ONNX model one of whose outputs is multiplied, and has something added."""
    name, true = output.encode(), b"fuzz.true"

    def renamed(tensor: bytes) -> bytes:
        return true if tensor == name else tensor

    def constant(called: bytes, value: float) -> bytes:
        kind = field(2, 1 if dtype.kind == "f" else 7)
        return field(5, kind + field(8, called) + field(9, np.array(value, dtype).tobytes()))

    def node(operator: bytes, one: bytes, other: bytes, found: bytes) -> bytes:
        return field(1, field(1, one) + field(1, other) + field(2, found) + field(4, operator))

    def of_graph(graph: bytes) -> bytes:
        more_nodes = node(b"Mul", true, b"fuzz.factor", b"fuzz.scaled") + node(
            b"Add", b"fuzz.scaled", b"fuzz.more", name
        )
        old = _changed(graph, 1, lambda one: _changed(_changed(one, 1, renamed), 2, renamed))
        return old + more_nodes + constant(b"fuzz.factor", factor) + constant(b"fuzz.more", more)

    return _changed(model, 7, of_graph)


def _changed(message: bytes, number: int, change: Callable[[bytes], bytes]) -> bytes:
    """A message of protocol buffers, without numbers of fixed size, in which fields of one number are changed."""
    parts: list[tuple[int, Value]] = list(fields(memoryview(message)))
    return b"".join(
        field(at, change(bytes(value)) if at == number else value if isinstance(value, int) else bytes(value))
        for at, value in parts
    )


def _in_golden(rng: Generator, manifest: dict[str, Any], files: Files) -> str:
    """Bytes of the .npz, or of one array with the zip around it made right."""
    if rng.random() < 0.3:
        files["golden.npz"] = damaged(rng, files["golden.npz"])
        return "bytes"
    with zipfile.ZipFile(io.BytesIO(files["golden.npz"])) as archive:
        arrays = {name: archive.read(name) for name in archive.namelist()}
    name = str(rng.choice(sorted(arrays)))
    arrays[name] = damaged(rng, arrays[name])
    if rng.random() < 0.2:
        del arrays[str(rng.choice(sorted(arrays)))]
    files["golden.npz"] = archive_bytes(arrays)
    return name


_KINDS: dict[str, Change] = {
    "zip": lambda rng, manifest, files: "",
    "manifest": _in_manifest,
    "graph": _in_graph,
    "outside": _outside,
    "lie": _lie,
    "golden": _in_golden,
}


def steps(path: Path) -> Iterator[Callable[[], object]]:
    """Load a bundle and ask for all that its verb can do; verify it."""
    yield lambda: _with_sessions_kept(lambda: use(path))
    yield lambda: _with_sessions_kept(lambda: verify(Bundle.open(path)))


def use(path: Path) -> None:
    """Load a bundle and ask for all that its verb can do."""
    model, given = motet.load(path), motion()
    if isinstance(model, motet.SteerModel):
        session = model.start(characters=2)
        session.control(speed=1.0, direction=[0, 90])
        for _ in range(20):
            session.tick()
        model.run(f"{model.gaits[0]} .3s", start=given)
        motet.write_live_page(io.BytesIO(), model)
    elif isinstance(model, motet.TdbnModel):
        model.start(variety=0.5).step()
        model.run(f"{model.labels[0]} .2s")
    elif isinstance(model, CodesModel):
        model.story(["a person walks", "a person sits"], seconds=0.4, after=given)
        model.generate("a person walks", memory=1.0, seconds=0.5)
        next(model.stream("a person walks", seconds=1.0))
    elif isinstance(model, motet.GenerateModel):
        for found in model.generate("a person walks", max_seconds=0.3, hypotheses=2, candidates=2):
            motet.write(io.BytesIO(), found.motion, format="bvh")
    elif isinstance(model, motet.PredictModel):
        model.predict(given, frames=30)
        if model.knows_errors:
            model.expected_errors(given)
    elif isinstance(model, motet.FillModel):
        model.fill(given, [(1.0, 1.3)])
    elif isinstance(model, motet.SearchModel):
        model.embed(given)
        model.embed_text("a person walks")
    else:
        model.describe(given)
        model.timeline(given)


@cache
def motion() -> Motion:
    """What is described, predicted, continued."""
    return motet.read(CLIP)[:300]


def _with_sessions_kept(run: Callable[[], None]) -> None:
    """Run something while the sessions of graphs that nobody altered are made once."""
    with patch.object(SessionOptions, "session", _session):
        run()


@cache
def _whole() -> frozenset[bytes]:
    """The hashes of the graphs that come with motet."""
    found = set()
    for data in shipped().values():
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            found |= {hashlib.sha256(archive.read(name)).digest() for name in archive.namelist()}
    return frozenset(found)


def _session(self: SessionOptions, model: bytes) -> Any:
    whole = hashlib.sha256(model).digest() in _whole()
    return _kept(model) if whole else _real(self, model)


_real = SessionOptions.session


@cache
def _kept(model: bytes) -> Any:
    return _real(SessionOptions(), model)


if __name__ == "__main__":
    sys.exit(fuzz(options(__doc__).parse_args(), mutate, steps))
