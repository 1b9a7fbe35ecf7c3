import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from motet.bundle.bundle import FORMAT, Bundle, list_bundles, write_bundle, zip_bytes
from motet.errors import BundleError, OutputError
from motet.models.load import load

SHIPPED = list_bundles()["cmu-control"]


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


def test_the_shipped_bundles_are_whole() -> None:
    assert list(list_bundles()) == ["cmu-control", "cmu-describe", "cmu-generate", "cmu-predict"]
    for name, path in list_bundles().items():
        bundle = Bundle.open(name)
        assert bundle.name == name == path.stem
        assert {"encoder.onnx", "step.onnx"} <= set(bundle.verify())


def test_folder_and_zip_run_alike_and_pack_to_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    np.testing.assert_array_equal(load(folder).start().step(), load("cmu-control").start().step())
    for name, source in (("a.zip", folder), ("b.zip", SHIPPED)):
        Bundle.open(source).pack(tmp_path / name)
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes() == SHIPPED.read_bytes()


def test_an_unknown_name_lists_the_known() -> None:
    with pytest.raises(BundleError, match=r"unknown bundle 'nothing'.*known names are cmu-control"):
        load("nothing")


def test_an_altered_file_is_refused(folder: Path) -> None:
    data = bytearray((folder / "step.onnx").read_bytes())
    data[-100] ^= 1
    (folder / "step.onnx").write_bytes(data)
    with pytest.raises(BundleError, match=r"'step.onnx' was altered"):
        load(folder)


def test_a_missing_file_is_refused(folder: Path) -> None:
    (folder / "encoder.onnx").unlink()
    with pytest.raises(BundleError, match=r"'encoder.onnx' is missing"):
        load(folder)


def test_verify_names_a_file_that_does_not_belong(folder: Path) -> None:
    (folder / "notes.txt").write_text("x")
    with pytest.raises(BundleError, match=r"not in its manifest: notes.txt"):
        Bundle.open(folder).verify()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda m: m.update(format=FORMAT + 1), f"this motet reads format {FORMAT}"),
        (lambda m: m.pop("motion"), "lacks motion"),
        (lambda m: m["motion"].pop("fps"), "motion.fps: numbers are needed"),
        (
            lambda m: m["motion"]["skeleton"]["joints"][3].update(parent=9),
            "motion.skeleton: .*after its parent",
        ),
        (lambda m: m.update(verb="swim"), "for 'swim'"),
        (lambda m: m.pop("control"), "no control model"),
        (lambda m: m["graphs"].pop("step"), "no graph for the role 'step'"),
        (lambda m: m["graphs"]["step"].pop("inputs"), "step graph"),
        (lambda m: m["graphs"]["step"]["inputs"][0].update(shape=["batch", 2, 150]), "does not keep its contract"),
        (lambda m: m["graphs"]["step"]["outputs"][0].update(name="other"), "does not keep its contract"),
        (lambda m: m["graphs"]["step"].update(file="manifest.json"), "not in its manifest"),
    ],
)
def test_a_manifest_that_does_not_fit_is_refused(
    folder: Path, change: Callable[[dict[str, Any]], None], reason: str
) -> None:
    edit(folder, change)
    with pytest.raises(BundleError, match=reason):
        load(folder)


def test_what_is_no_bundle_is_refused(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.zip").write_text("hello")
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "manifest.json").write_text("{")
    for name, reason in (("empty", "no manifest.json"), ("text.zip", "not a zip"), ("broken", "is no JSON")):
        with pytest.raises(BundleError, match=reason):
            load(tmp_path / name)


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
    with pytest.raises(BundleError, match="is a link"):
        Bundle.open(tmp_path / "b.zip")
    (folder / "step.onnx").unlink()
    (folder / "step.onnx").symlink_to("/etc/hostname")
    with pytest.raises(BundleError, match="not a plain file"):
        Bundle.open(folder)


def test_a_graph_that_is_none_is_refused(folder: Path, tmp_path: Path) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    files = {"encoder.onnx": (folder / "encoder.onnx").read_bytes(), "step.onnx": b"no graph"}
    write_bundle(tmp_path / "b.zip", manifest, files)
    with pytest.raises(BundleError, match="refuses the graph"):
        load(tmp_path / "b.zip")


def test_a_bundle_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="it exists"):
        write_bundle(tmp_path, {}, {})
    with pytest.raises(OutputError, match="does not exist"):
        write_bundle(tmp_path / "no" / "b.zip", {}, {})
    write_bundle(tmp_path / "new", {"name": "x"}, {"a.onnx": b"1"})
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new"]
    assert zip_bytes({"a": b"1", "b": b"2"}, b"m") == zip_bytes({"b": b"2", "a": b"1"}, b"m")
