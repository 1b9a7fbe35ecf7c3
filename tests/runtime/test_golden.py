"""Golden vectors: what is replayed, and what is not taken for golden vectors."""

import io
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from motet.bundle.bundle import Bundle, archive_bytes
from motet.bundle.golden import difference, read, replay, vectors
from motet.bundle.manifest import Golden
from motet.errors import BundleError
from motet.models.base import BundleModel
from motet.models.load import load

pytestmark = pytest.mark.numeric

NAMES = ["convseq2seq", "describe", "fill", "generate", "language-to-motion", "motion-to-language", "predict", "tdbn"]


def golden_of(name: str) -> tuple[BundleModel, Golden, dict[str, Any]]:
    """A shipped model, what its manifest says of its golden vectors, and these."""
    bundle = Bundle.open(name)
    golden = bundle.manifest.golden
    assert golden is not None
    return load(name), golden, read(bundle.read(golden.file))


def packed(arrays: Mapping[str, Any]) -> bytes:
    """An .npz as numpy writes it."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


@pytest.mark.parametrize("name", NAMES)
def test_each_output_counts_and_the_meaning_may_lack(name: str) -> None:
    """A golden output that is a little other is noticed, whichever it is, and so are frames of another size."""
    model, golden, arrays = golden_of(name)
    errors = replay(model, packed(arrays), golden)
    assert max(errors.values()) < golden.tolerance
    assert errors["meaning"] <= 1e-9
    older = {key: value for key, value in arrays.items() if not key.startswith("meaning.")}
    assert set(replay(model, packed(older), golden)) == {*model.graphs, "run"}
    frames = arrays["meaning.in.frames"]
    for other, reason in ((frames[:, :-1], "channels, not"), (frames[0], "no meaning.in.frames"), (frames[:0], "no")):
        with pytest.raises(BundleError, match=reason):
            replay(model, packed({**arrays, "meaning.in.frames": other}), golden)
    outputs = [key for key in arrays if ".out." in key]
    assert {key.partition(".")[0] for key in outputs} == {*model.graphs, "run", "meaning"}
    for key in outputs:
        other = arrays[key] + (
            1 if arrays[key].dtype.kind == "i" else np.float32(0.1) * (1 + np.abs(arrays[key]).max())
        )
        with pytest.raises(BundleError, match=f"golden vectors, {key.partition('.')[0]}: off by"):
            replay(model, packed({**arrays, key: other.astype(arrays[key].dtype)}), golden)


@pytest.mark.parametrize("name", NAMES)
def test_a_run_follows_from_its_inputs_and_noise(name: str) -> None:
    """Other inputs give another run: none of them is ignored."""
    model, golden, arrays = golden_of(name)
    given = {key.removeprefix("run.in."): value for key, value in arrays.items() if key.startswith("run.in.")}
    plain = model.replay(given, golden.run)
    rng = np.random.default_rng(0)
    for key, value in given.items():
        other = model.replay({**given, key: rng.permuted(value, axis=-1)}, golden.run)
        assert any(other[k].shape != v.shape or np.abs(other[k] - v).max() > 1e-3 for k, v in plain.items()), key


def test_what_does_not_fit_a_model_is_refused() -> None:
    model, golden, arrays = golden_of("language-to-motion")
    for change, reason in (
        ({"run.in.normal": arrays["run.in.normal"][:3]}, "lack normal numbers of shape"),
        ({"run.in.uniform": arrays["run.in.uniform"][:, :1]}, "lack uniform numbers of shape"),
        ({"step.in.frame": arrays["step.in.frame"][:, :5]}, "the graph cannot be run"),
        ({"run.out.ids": arrays["run.out.ids"][:2]}, "'ids' does not have the expected shape or dtype"),
        ({"run.out.more": arrays["run.out.ids"]}, "'more' does not have the expected shape or dtype"),
    ):
        with pytest.raises(BundleError, match=reason):
            replay(model, packed({**arrays, **change}), golden)
    for prefix in ("step.in.", "encoder.out.", "run.in."):
        fewer = {key: value for key, value in arrays.items() if not key.startswith(prefix)}
        with pytest.raises(BundleError, match=r"have no|golden run cannot be replayed"):
            replay(model, packed(fewer), golden)
    for settings in ({}, {**golden.run, "text": 3}, {**golden.run, "hypotheses": "x"}):
        with pytest.raises(ValueError, match=r".") as caught:
            replay(model, packed(arrays), Golden("golden.npz", 1e-3, settings))
        assert type(caught.value).__module__ == "motet.errors"


def header(shape: str, dtype: str = "<f4") -> bytes:
    text = f"{{'descr': {dtype!r}, 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x93NUMPY",
        header("(10**14,)"),
        header("(100000000000000,)"),
        header("(-1, -2)") + bytes(8),
        header("(2,)") + bytes(7),
        header("(2,)") + bytes(9),
        header("(2,)", "|O") + bytes(16),
        header("(" * 3000 + ")" * 3000),
        header("2.5") + bytes(8),
        b"\x93NUMPY\x02\x00" + bytes(100),
    ],
)
def test_what_is_not_an_array_is_refused(content: bytes) -> None:
    with pytest.raises(BundleError, match=r"golden vectors, x.npy' is not a plain array"):
        read(archive_bytes({"x.npy": content}))


def test_an_npz_that_is_too_large_or_none_is_refused() -> None:
    rng = np.random.default_rng(0)
    buffer = io.BytesIO()
    np.savez(buffer, *(rng.random(6 << 17) for _ in range(3)))
    with pytest.raises(BundleError, match="larger than 16777216 bytes"):
        read(buffer.getvalue())
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("x.npy", bytes(100))
    with pytest.raises(BundleError, match="not compressed with deflate"):
        read(buffer.getvalue())
    with pytest.raises(BundleError, match="not a zip"):
        read(b"x")


def test_vectors_are_the_same_bytes_every_time() -> None:
    model = load("predict")
    size = len(model.contract.channels)
    given = {"frames": np.ones((model.seed_frames, size), np.float32)}
    feeds = {"encoder": {"frames": np.ones((2, model.seed_frames, size), np.float32)}}
    made = [vectors(model, feeds, given, {"frames": 3}, np.ones((2, size))) for _ in range(2)]
    assert made[0] == made[1]
    assert read(made[0])["run.out.frames"].shape == (3, size)


def test_a_difference_is_relative_to_large_outputs() -> None:
    assert difference({"a": np.array([0.3, 0.2])}, {"a": np.array([0.3, 0.1])}) == pytest.approx(0.1)
    assert difference({"a": np.array([30.0, -30.6])}, {"a": np.array([30.0, -30.0])}) == pytest.approx(0.02)
    assert difference({"a": np.array([40.4, *[0.0] * 99])}, {"a": np.array([40.0, *[0.0] * 99])}) == pytest.approx(0.01)
    assert difference({"a": np.array([1, 2])}, {"a": np.array([1, 3])}) == np.inf
    for bad in (np.array([np.nan]), np.zeros(2), np.zeros(1, np.float32)):
        with pytest.raises(BundleError, match=r"not finite|expected shape"):
            difference({"a": bad}, {"a": np.zeros(1)})
