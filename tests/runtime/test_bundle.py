import json
import os
import pickle
import shutil
import zipfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from importlib import import_module
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, get_args, get_overloads, get_type_hints

import numpy as np
import onnxruntime
import pytest
from click.testing import CliRunner
from wire import field

import motet
from motet.bench.cases import cases
from motet.bundle.bundle import FORMAT, Bundle, entry, list_bundles, write_bundle
from motet.bundle.graph import SessionOptions
from motet.bundle.graph_safety import fields
from motet.bundle.members import Archive
from motet.cli import main
from motet.errors import BundleError, OutputError, SettingError
from motet.generate.model import CodesModel
from motet.models.load import KINDS, kind_of, load, load_as, verify
from motet.papers.tdbn_control import TdbnModel

PAPERS = ("convseq2seq", "language-to-motion", "motion-to-language", "tdbn")
"""Bundles of the papers' systems; the others have the names of their verbs."""

SHIPPED = list_bundles()["tdbn"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The shipped bundle, unpacked."""
    with zipfile.ZipFile(SHIPPED) as archive:
        archive.extractall(tmp_path / "bundle")
    return tmp_path / "bundle"


def edit(folder: Path, change: Callable[[dict[str, Any]], None]) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    change(manifest)
    (folder / "manifest.json").write_text(json.dumps(manifest))


def test_the_shipped_bundles_are_whole_and_give_their_golden_vectors() -> None:
    assert list(list_bundles()) == sorted([*KINDS, *PAPERS])
    for name, path in list_bundles().items():
        bundle = Bundle.open(name)
        assert bundle.name == name == path.stem
        found = verify(bundle)
        roles = kind_of(bundle.manifest).ROLES
        assert {*(f"{role}.onnx" for role in roles), "golden.npz"} <= set(found.files)
        assert {*roles, "run"} <= found.errors.keys()
        assert max(found.errors.values()) < 1e-4  # on every processor
        assert found.providers == (("CPUExecutionProvider",) if roles else ())


def test_the_type_of_a_bundle_loaded_by_name_is_known() -> None:
    kinds = {}
    names = {name: getattr(motet, name) for name in motet.__all__}
    for overload in get_overloads(load):
        hints = get_type_hints(overload, localns=names)
        kinds |= {name: hints["return"] for name in get_args(hints["name_or_path"]) if isinstance(name, str)}
    assert {name: type(load(name)) for name in list_bundles()} == kinds


def test_every_kind_of_model_is_measured_and_has_loops_of_its_own() -> None:
    loops = [loop for by_loop in KINDS.values() for loop in by_loop]
    assert len(loops) == len(set(loops))
    places = {place for by_loop in KINDS.values() for place in by_loop.values()}
    for place in places:
        module, _, name = place.rpartition(".")
        kind = getattr(import_module(f"motet.{module}"), name)
        assert kind.LOOPS
        assert cases.dispatch(kind) is not cases.dispatch(object)


def test_folder_and_zip_run_alike_and_pack_to_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    np.testing.assert_array_equal(load(folder).start().step(), load("tdbn").start().step())
    for name, source in (("a.zip", folder), ("b.zip", SHIPPED)):
        Bundle.open(source).pack(tmp_path / name)
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes() == SHIPPED.read_bytes()


def test_a_bundle_says_what_it_is() -> None:
    path = str(list_bundles()["tdbn"])
    assert repr(Bundle.open("tdbn")) == f"Bundle('tdbn', 'control' by 'session', {path!r})"


def test_an_unknown_name_lists_the_known() -> None:
    with pytest.raises(BundleError, match=r"unknown bundle '3'.*expected one of control"):
        load(3)  # type: ignore[call-overload]
    with pytest.raises(BundleError, match=r"unknown bundle 'nothing'.*expected one of control"):
        load("nothing")


def test_an_altered_file_is_refused(folder: Path) -> None:
    data = bytearray((folder / "step.onnx").read_bytes())
    data[-100] ^= 1
    (folder / "step.onnx").write_bytes(data)
    # refused when it is first called, whoever calls it and how often
    session = load(folder).start()
    for _ in range(2):
        with pytest.raises(BundleError, match=rf"bundle {folder}: the file 'step.onnx' was altered"):
            session.step()
    with pytest.raises(BundleError, match=r"'step.onnx' was altered"):
        load(folder).ready()


def test_a_table_that_is_altered_after_loading_is_refused_before_its_use(tmp_path: Path) -> None:
    with zipfile.ZipFile(list_bundles()["generate"]) as archive:
        archive.extractall(tmp_path)
    model = load(tmp_path)
    data = bytearray((tmp_path / "memory.npy").read_bytes())
    data[-1] ^= 1
    (tmp_path / "memory.npy").write_bytes(data)
    assert isinstance(model, CodesModel)
    assert model.parts("a person walks") == ["a person walks"]
    with pytest.raises(BundleError, match=f"bundle {tmp_path}: the file 'memory.npy' was altered"):
        model.generate("a person walks")


def test_a_bundle_is_read_as_it_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []
    unpack = Archive.read

    def noted(self: Archive, name: str, limit: int) -> bytes:
        read.append(name)
        return unpack(self, name, limit)

    monkeypatch.setattr(Archive, "read", noted)
    model = load("generate")
    assert read == ["manifest.json"]
    assert model.vocabulary.encode("a person walks")[1] == []
    assert read == ["manifest.json"]
    model.understood("a person walks")
    assert read == ["manifest.json", "encoder.onnx"]
    first = model.generate("a person walks", seconds=1.0)
    assert "tokens.onnx" not in read
    model.ready()
    model.generate("a person walks", seconds=1.0)
    assert sorted(read) == sorted({"manifest.json", *model.manifest.files} - {"golden.npz"})
    assert len(first) >= 1


def test_a_graph_is_made_once_by_threads_that_call_it_at_the_same_time() -> None:
    graph = Bundle.open("search").late_graph("text")
    with ThreadPoolExecutor(4) as threads:
        made = list(threads.map(lambda _: graph.ready(), range(8)))
    assert all(each is made[0] for each in made)


def test_weights_may_be_in_a_file_of_their_own(folder: Path) -> None:
    whole = load_as(TdbnModel, folder).run("walk 1s").values
    rest = b""
    weights = b""
    for number, value in fields(memoryview((folder / "step.onnx").read_bytes())):
        parts = [] if number != 7 else list(fields(memoryview(value)))  # of the graph
        weights += b"".join(field(5, part) for at, part in parts if at == 5)
        rest += field(number, b"".join(field(at, part) for at, part in parts if at != 5) if parts else value)
    files = {"step.onnx": rest, "weights.onnx": field(7, weights)}
    for name, data in files.items():
        (folder / name).write_bytes(data)
    edit(folder, lambda m: m["files"].update({name: entry(data)._asdict() for name, data in files.items()}))
    with pytest.raises(BundleError, match="step graph: ONNX Runtime rejected the graph"):
        load(folder).ready()
    edit(folder, lambda m: m["graphs"]["step"].update(weights="weights.onnx"))
    assert len(rest) < 0.1 * len(weights)
    np.testing.assert_array_equal(load_as(TdbnModel, folder).run("walk 1s").values, whole)
    # they are checked like all files
    (folder / "weights.onnx").write_bytes(field(7, weights[:-4] + b"\0\0\0\0"))
    with pytest.raises(BundleError, match=r"'weights.onnx' was altered"):
        load(folder).ready()
    (folder / "weights.onnx").unlink()
    with pytest.raises(BundleError, match=r"'weights.onnx' is missing"):
        load(folder)
    edit(folder, lambda m: m["graphs"]["step"].update(weights="other.onnx"))
    with pytest.raises(BundleError, match=r"graphs.step.weights: 'other.onnx' is not among its files"):
        load(folder)


def test_a_missing_file_is_refused(folder: Path) -> None:
    (folder / "encoder.onnx").unlink()
    with pytest.raises(BundleError, match=r"'encoder.onnx' is missing"):
        load(folder)


def test_a_file_that_does_not_belong_is_refused(folder: Path) -> None:
    (folder / "notes.txt").write_text("x")
    with pytest.raises(BundleError, match=r"not in its manifest: notes.txt"):
        Bundle.open(folder)


def set_at(manifest: dict[str, Any], path: str, value: Any) -> None:
    """Set what stands at a path such as "motion.skeleton.joints.3.parent"; None removes it."""
    *way, last = [int(key) if key.isdecimal() else key for key in path.split(".")]
    place: Any = manifest
    for key in way:
        place = place[key]
    if value is None:
        place.pop(last)
    else:
        place[last] = value


NAN, HUGE = float("nan"), 10**400


@pytest.mark.parametrize(
    ("path", "value", "reason"),
    [
        ("format", 1, "format 1, of an older motet: export its training run again"),
        ("format", 2, r"format 2, of an older motet: export its training run again \(motet export RUN\)"),
        ("format", 4, f"format 4; this motet reads format {FORMAT}"),
        ("format", True, "format True"),
        ("motion", None, "manifest, motion: is missing"),
        ("motion", [1], r"motion: must be an object, not \[1\]"),
        ("motion.fps", None, "motion.fps: is missing"),
        ("motion.fps", NAN, "JSON has no number NaN"),
        ("motion.mean", [HUGE] * 59, "motion.mean: must be numbers between"),
        ("motion.skeleton.joints.3.parent", 9, "the first has none|must come after its parent"),
        ("motion.skeleton.metres_per_unit", -1, "metres_per_unit: must be a number between 1e-06"),
        ("verb", "swim", "verb: 'swim' is unknown; expected one of control, describe, fill, generate, predict"),
        ("verb", ["swim"], "verb: must be a string"),
        ("verb", "describe", "loop: 'session' does not describe|text: is missing|beam"),
        ("loop", None, "loop: is missing"),
        ("loop", "beam", "loop: 'beam' does not control; expected one of matching, session"),
        ("control", None, "control: is missing"),
        ("control.labels", ["walk", "walk", "run"], "control.labels: holds a string twice"),
        ("control.labels", ["walk", "run"], "control.starts: must be frames for each of walk, run"),
        ("control.starts.walk", [[0.0] * 59], "control.starts.walk: must hold 3 frames, not 1"),
        ("control.starts.walk", [[0.0] * 58] * 3, "control.starts.walk.0: must hold 59 numbers, not 58"),
        ("control.starts.walk", 3, "control.starts.walk: must be a list"),
        ("defaults", {}, "defaults.temperature: is missing"),
        ("defaults.temperature", "x", "defaults.temperature must be between 0.01 and 100, not x"),
        ("defaults.temperature", True, "defaults.temperature must be between"),
        ("graphs", [], "graphs: must be an object"),
        ("graphs", {}, "it needs graphs or tables"),
        ("graphs.step", None, "no graph for the role 'step'"),
        ("graphs.step.inputs", None, "graphs.step.inputs: is missing"),
        ("graphs.step.inputs.0.shape", ["batch", 2, 150], "does not match its contract|does not fit the input"),
        (
            "graphs.step.inputs.0.shape",
            ["batch", -1, 150],
            r"graphs.step.inputs\[0\].shape: must be names, and numbers",
        ),
        ("graphs.step.inputs.0.shape", ["batch", 1 << 20, 150], "at most 8 axes with at most"),
        ("graphs.step.inputs.1.shape", ["batch", 2], "does not match its contract|expected"),
        ("graphs.step.inputs.0.dtype", "object", "dtype: must be one of float32"),
        ("graphs.step.outputs.0.name", "other", "graphs.step: the graph has no output 'next_codes', only other"),
        ("graphs.step.outputs.0.name", "frame", "two tensors have the same name"),
        ("graphs.step.feedback", {"history": "none"}, "the graph has no output 'none'"),
        ("graphs.step.feedback", {"none": "next_history"}, "the graph has no input 'none'"),
        (
            "graphs.step.feedback",
            {"noise": "next_codes", "history": "frame"},
            "'frame' does not fit the input 'history'",
        ),
        ("graphs.step.feedback", {}, "graphs.step.feedback: no output is fed back"),
        ("graphs.step.start", {"history": [3]}, "graphs.step.start: .* does not fit the state 'history'"),
        ("graphs.step.file", "manifest.json", "graphs.step.file: 'manifest.json' is not among its files"),
        ("golden", None, "graphs or tables, and golden vectors"),
        ("golden.file", "step.npz", "golden.file: 'step.npz' is not among its files"),
        ("files", None, "is not among its files"),
        ("files", [], "files: must be an object"),
        ("files", {"../x": {"size": 1, "sha256": ""}}, "'../x' is not a plain file name"),
        ("files.step.onnx", None, ""),
    ],
)
def test_a_manifest_that_does_not_fit_is_refused(folder: Path, path: str, value: Any, reason: str) -> None:
    if path == "files.step.onnx":
        edit(folder, lambda m: m["files"].pop("step.onnx"))
        reason = "'step.onnx' is not among its files"
    else:
        edit(folder, lambda m: set_at(m, path, value))
    with pytest.raises(BundleError, match=reason) as caught:
        load(folder).ready()
    assert str(caught.value).startswith(f"bundle {folder}")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (b"{", "not valid JSON"),
        (b"[" * 100_000, "not valid JSON"),
        (b'{"a":' * 100_000, "not valid JSON"),
        (b"\xff\xfe", "not valid JSON"),
        (b"[]", "format None"),
        (b" " * (5 << 20), "more than 4194304 bytes"),
    ],
)
def test_a_manifest_that_is_not_one_is_refused(tmp_path: Path, text: bytes, reason: str) -> None:
    (tmp_path / "manifest.json").write_bytes(text)
    with pytest.raises(BundleError, match=reason):
        load(tmp_path)


def test_what_is_not_a_bundle_is_refused(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.zip").write_text("hello")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "secret").mkdir()
    for name, reason in (
        ("empty", "is not a bundle: it holds no manifest.json"),
        ("text.zip", "not a zip"),
        ("pipe", "neither a folder nor a file"),
        ("loop", "no such path|symbolic links"),
        ("x" * 300, "no such path|too long"),
        ("a\0b", "null byte|no such path"),
    ):
        with pytest.raises(BundleError, match=reason):
            load(tmp_path / name)
    with pytest.raises(BundleError, match="neither a folder nor a file"):
        load("/dev/null")


def test_a_folder_that_cannot_be_listed_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: Path) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "iterdir", refuse)
    with pytest.raises(BundleError, match="cannot read the folder: Permission denied"):
        load(folder)


def test_a_path_loads_where_the_default_bundles_were_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motet.bundle.bundle.DEFAULT_BUNDLES", tmp_path / "gone")
    assert load(SHIPPED).manifest.name == "tdbn"
    with pytest.raises(BundleError, match="unknown bundle 'describe'"):
        load("describe")


def test_packages_bring_bundles_by_an_entry_point(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "more_motions"
    package.mkdir()
    (package / "__init__.py").touch()
    shutil.copy(SHIPPED, package / "bends.zip")
    shutil.copy(SHIPPED, package / "describe.zip")
    monkeypatch.syspath_prepend(tmp_path)
    points = (EntryPoint("more", "more_motions", "motet.bundles"),)
    monkeypatch.setattr("motet.bundle.bundle.entry_points", lambda group: points if group == "motet.bundles" else ())
    assert load("bends").manifest.name == "tdbn"
    assert load("describe").manifest.name == "describe"  # motet's own come first
    assert list(list_bundles()) == sorted([*KINDS, *PAPERS, "bends"])
    gone = EntryPoint("gone", "not_installed_any_more", "motet.bundles")
    monkeypatch.setattr("motet.bundle.bundle.entry_points", lambda group: (gone,))
    assert list(list_bundles()) == sorted([*KINDS, *PAPERS])
    with pytest.raises(BundleError, match="unknown bundle 'bends'"):
        load("bends")


@pytest.mark.parametrize(("old", "new"), [("cmu-control", "tdbn"), ("cmu-generate", "language-to-motion")])
def test_old_names_of_bundles_lead_to_the_new_ones(old: str, new: str) -> None:
    with pytest.raises(BundleError, match=f"the bundle '{old}' is '{new}' now"):
        load(old)
    assert load(new).manifest.name == new


def test_a_model_of_a_relative_path_pickles_to_another_folder(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder.parent)
    data = pickle.dumps(load(folder.name, SessionOptions(threads=2)))
    monkeypatch.chdir("/")
    model = pickle.loads(data)
    assert model.manifest.name == "tdbn"
    assert model._source == (folder, SessionOptions(threads=2))


def test_bombs_are_refused_before_a_member_is_read(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    zeros = tmp_path / "zeros.zip"
    with zipfile.ZipFile(zeros, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("manifest.json", "w") as member:
        for _ in range(30):
            member.write(bytes(1 << 20))
    many = tmp_path / "many.zip"
    with zipfile.ZipFile(many, "w") as archive:
        for number in range(3_000):
            archive.writestr(f"{number}", b"")
    monkeypatch.setattr(zipfile.ZipFile, "open", lambda *_: pytest.fail("a member was read"))
    for path, reason in ((zeros, "unpacks to more than 100 times"), (many, "too many files")):
        with pytest.raises(BundleError, match=reason):
            load(path)
    for number in range(70):
        (folder / f"{number}").touch()
    with pytest.raises(BundleError, match="it holds 74 files; a bundle has at most 64"):
        load(folder)


def test_a_member_longer_than_declared_is_not_read_to_its_end(folder: Path) -> None:
    with (folder / "step.onnx").open("ab") as file:
        file.truncate(1 << 27)  # of holes: it takes no room, and would take 128 megabytes of memory
    with pytest.raises(BundleError, match=r"has more than 3[0-9]+ bytes"):
        load(folder).ready()
    with (folder / "encoder.onnx").open("ab") as file:
        file.truncate(1 << 27)
    with pytest.raises(BundleError, match="total more than 268435456 bytes"):
        load(folder)


def test_damage_within_a_zip_is_a_bundle_error(tmp_path: Path) -> None:
    data, rng = SHIPPED.read_bytes(), np.random.default_rng(0)
    for number in range(60):
        damaged = bytearray(data)
        damaged[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
        (tmp_path / f"{number}.zip").write_bytes(damaged)
        with suppress(BundleError):
            load(tmp_path / f"{number}.zip").ready()


@pytest.mark.parametrize("name", ["../evil", "/evil", "a/b", "a\\b", "folder/"])
def test_a_zip_with_paths_is_refused(tmp_path: Path, name: str) -> None:
    with zipfile.ZipFile(tmp_path / "b.zip", "w") as archive:
        archive.writestr(name, b"")
    with pytest.raises(BundleError, match="not a plain file name"):
        Bundle.open(tmp_path / "b.zip")


def test_links_are_refused(folder: Path, tmp_path: Path) -> None:
    link = zipfile.ZipInfo("step.onnx")
    link.external_attr = 0o120777 << 16
    with zipfile.ZipFile(tmp_path / "b.zip", "w") as archive:
        archive.writestr(link, "/etc/passwd")
    with pytest.raises(BundleError, match="not a plain file"):
        Bundle.open(tmp_path / "b.zip")
    (folder / "step.onnx").unlink()
    (folder / "step.onnx").symlink_to("/etc/hostname")
    with pytest.raises(BundleError, match="not a plain file"):
        Bundle.open(folder)


def test_a_bundle_is_written_whole_or_not_at_all_and_its_graphs_are_looked_at_when_they_are_used(
    folder: Path, tmp_path: Path
) -> None:
    files = {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "manifest.json"}
    manifest = json.loads((folder / "manifest.json").read_text())
    with pytest.raises(OutputError, match="it exists"):
        write_bundle(tmp_path, manifest, files)
    with pytest.raises(OutputError, match="does not exist"):
        write_bundle(tmp_path / "no" / "b.zip", manifest, files)
    with pytest.raises(BundleError, match="manifest, motion: must be an object"):
        write_bundle(tmp_path / "b.zip", {**manifest, "motion": None}, files)
    write_bundle(tmp_path / "new", manifest, files)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bundle", "new"]
    assert (tmp_path / "new" / "manifest.json").read_bytes() == (folder / "manifest.json").read_bytes()
    write_bundle(tmp_path / "one.zip", manifest, files)
    write_bundle(tmp_path / "same.zip", manifest, dict(reversed(files.items())))
    assert (tmp_path / "one.zip").read_bytes() == (tmp_path / "same.zip").read_bytes()
    write_bundle(tmp_path / "b.zip", manifest, {**files, "step.onnx": b"no graph"})
    with pytest.raises(BundleError, match="step graph: the graph is not valid ONNX"):
        load(tmp_path / "b.zip").ready()


def test_long_figures_are_shown_as_json_alone(folder: Path) -> None:
    figures = {"place_cm": {"frame_1": 0.75}, "kinds": {"boxing": {"windows": 77}}}
    edit(folder, lambda manifest: manifest.update(quality=figures))
    shown, whole = (
        CliRunner().invoke(main, ["bundle", "info", str(folder), *more]).stdout for more in ([], ["--json"])
    )
    assert "frame_1: 0.75" in shown
    assert "boxing" not in shown
    assert json.loads(whole)["quality"] == figures


def test_a_session_is_configured_before_it_is_made() -> None:
    seen: list[Any] = []

    def configure(options: Any) -> None:
        assert options.intra_op_num_threads == 2
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL
        seen.append(options)

    model = load("search", SessionOptions(threads=2, configure=configure)).ready()
    assert len(seen) == len(model.graphs) == 2
    assert all(one.get_session_config_entry("session.load_model_format") == "ONNX" for one in seen)
    np.testing.assert_allclose(
        model.embed_text("a person walks"), load("search").embed_text("a person walks"), atol=1e-5
    )


def test_a_graph_alone_says_what_it_is() -> None:
    session = onnxruntime.InferenceSession(Bundle.open("generate").read("step.onnx"))
    told = session.get_modelmeta().custom_metadata_map
    assert (told["verb"], told["loop"], told["role"], told["fps"]) == ("generate", "codes", "step", "30")
    assert told["feedback"] == "past=next_past"
    assert told["channels"] == str(len(Bundle.open("generate").manifest.motion.channels))


@pytest.mark.parametrize("threads", [0, -1, 257, 10_000, True, 1.5])
def test_threads_are_bounded(threads: Any) -> None:
    with pytest.raises(SettingError, match="threads must be a whole number from 1 to 256"):
        SessionOptions(threads=threads)


def test_threads_may_be_numpys() -> None:
    assert load("tdbn", SessionOptions(threads=np.int64(2))).providers == ("CPUExecutionProvider",)  # type: ignore[arg-type]


def test_a_provider_that_is_not_here_is_refused() -> None:
    with pytest.raises(
        SettingError, match=r"no provider 'NoExecutionProvider' here; available: .*CPUExecutionProvider"
    ):
        SessionOptions(providers=("NoExecutionProvider",))
    with pytest.raises(SettingError, match="options for each provider or for none"):
        SessionOptions(provider_options=({}, {}))
    with pytest.raises(SettingError, match=r"a tuple of names, such as \('CPUExecutionProvider',\)"):
        SessionOptions(providers="CPUExecutionProvider")  # type: ignore[arg-type]
