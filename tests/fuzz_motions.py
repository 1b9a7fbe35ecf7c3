"""Mutated motion files: whatever is altered, only motet's own errors come out, soon and in little memory.

    python tests/fuzz_motions.py --count 5000 [--seed N] [--first N] [--seconds 2] [--megabytes 500]
    python tests/fuzz_motions.py --folder ../shared/data/figures

Small files of every format that motet reads, or those of a folder, are altered: bytes and numbers of all, words of
texts, values of the JSON of glTF, which also gets thousands of nodes, meshes or clips that share their parts, arrays of
.npz. Each is read, every clip of it that is not too many; what is read is
brought to the humanoid, measured and written, and the file is taken for the character of another motion.
"""

import base64
import io
import json
import re
import struct
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from fuzzing import Files, Generator, Mutant, altered, damaged, fuzz, options
from vrm_avatar import avatar

import motet
from motet.formats import CLIPPED, READABLE, clips, write_motion
from motet.formats.glb import container
from motet.motion.kinematics import positions
from motet.motion.motion import Motion

CLIP = Path(__file__).parents[1] / "train" / "motet_train" / "data" / "cmu" / "39_14.amc"

Mutate = Callable[[Generator], Mutant]

WORDS = [
    "1e308", "-1e308", "1e-320", "nan", "inf", "-1", "0", "1e400", "9" * 400, "9" * 5000, "0x10", "1_0", "\u0663",
    "\u00b2", "", "--", "1e", "1.5", "4294967296", "18446744073709551616", "1,5", "\x0b", "\u2028", "x", "x" * 5000,
]  # fmt: skip
"""What stands in the place of a word."""

MMM = """<?xml version='1.0'?><MMM><Motion name='a'><JointOrder><Joint name='LKx_joint'/><Joint name='RKx_joint'/>
</JointOrder><MotionFrames>{}</MotionFrames></Motion></MMM>"""
FRAME = """<MotionFrame><Timestep>{}</Timestep><RootPosition>1000 2000 900</RootPosition>
<RootRotation>0.1 0.2 0.3</RootRotation><JointPosition>0.5 -0.25</JointPosition></MotionFrame>"""


def own_files(frames: int = 24) -> dict[str, Files]:
    """A small file of each format, and those beside it."""
    motion, found = motet.read(CLIP)[:frames], dict[str, Files]()
    with tempfile.TemporaryDirectory() as folder:
        for kind in ("bvh", "npz", "csv", "glb", "vrma", "amc"):
            motet.write(Path(folder) / f"x.{kind}", motion)
            found[kind] = {f"x.{kind}": (Path(folder) / f"x.{kind}").read_bytes()}
        found["amc"]["x.asf"] = (Path(folder) / "x.asf").read_bytes()
    document, binary = parts(found["glb"]["x.glb"])
    animations = [{**document["animations"][0], "name": name} for name in ("Walk", "Walk", "Run")]
    found["clips"] = {"x.glb": container({**document, "animations": animations}, binary)}
    inside = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    found["sparse"] = {"x.glb": _sparse(document, binary)}
    found["gltf, inside"] = {"x.gltf": _gltf(document, binary, inside)}
    found["gltf, beside"] = {"x.gltf": _gltf(document, binary, "x.bin"), "x.bin": binary}
    found["vrm"] = {"x.vrm": avatar()}
    document, binary = parts(found["vrma"]["x.vrma"])
    bones = document["extensions"]["VRMC_vrm_animation"]["humanoid"]["humanBones"]
    old = {
        "VRM": {"humanoid": {"humanBones": [{"bone": bone, "node": place["node"]} for bone, place in bones.items()]}}
    }
    found["vrm 0"] = {"x.vrm": container({**document, "extensions": old}, binary)}
    found["xml"] = {"x.xml": MMM.format("".join(FRAME.format(time / 100) for time in range(8))).encode()}
    found["amass"] = {"x.npz": _amass()}
    return found


def _sparse(document: dict[str, Any], binary: bytes) -> bytes:
    """A GLB whose animation has sparse values: each replaces its first two by themselves."""
    document = json.loads(json.dumps(document))
    indices = {"bufferView": len(document["bufferViews"]), "componentType": 5123}
    document["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": 4})
    for index in {sampler["output"] for sampler in document["animations"][0]["samplers"]}:
        accessor = document["accessors"][index]
        accessor["sparse"] = {"count": 2, "indices": indices, "values": {"bufferView": accessor["bufferView"]}}
    binary += struct.pack("<HH", 0, 1)
    return container({**document, "buffers": [{"byteLength": len(binary)}]}, binary)


def _gltf(document: dict[str, Any], binary: bytes, uri: str) -> bytes:
    return json.dumps({**document, "buffers": [{"byteLength": len(binary), "uri": uri}]}).encode()


def _amass() -> bytes:
    content, poses = io.BytesIO(), np.random.default_rng(0).normal(size=(8, 156)) / 10
    np.savez(content, trans=np.zeros((8, 3)), poses=poses, mocap_framerate=60.0, betas=np.zeros(16), gender="male")
    return content.getvalue()


def files_of(folder: Path) -> dict[str, Files]:
    """The motion files of a folder, each with a skeleton that is beside it."""
    found = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in READABLE:
            beside = [other for other in (path.with_suffix(".asf"),) if other.exists()]
            found[path.name] = {one.name: one.read_bytes() for one in (path, *beside)}
    return found


def mutants(originals: Mapping[str, Files]) -> Mutate:
    """What makes a mutant of one of some files."""

    def mutate(rng: Generator) -> Mutant:
        name = str(rng.choice(sorted(originals)))
        files = dict(originals[name])
        member = str(rng.choice(list(files)))
        files[member], how = _mutated(rng, files[member], Path(member).suffix)
        return f"{name}, {how}", files

    return mutate


def _mutated(rng: Generator, data: bytes, kind: str) -> tuple[bytes, str]:
    bytewise = rng.random() < 0.25
    if bytewise or kind in (".bin", ".fbx"):
        return damaged(rng, data), "bytes"
    if kind in (".glb", ".vrm", ".vrma", ".gltf"):
        return _in_gltf(rng, data)
    if kind == ".npz":
        return _in_arrays(rng, data)
    return _in_words(rng, data), "words"


def parts(glb: bytes) -> tuple[dict[str, Any], bytes]:
    """The JSON document and the binary part of a .glb."""
    length = struct.unpack_from("<I", glb, 12)[0]
    return json.loads(glb[20 : 20 + length]), glb[28 + length :]


def _in_gltf(rng: Generator, data: bytes) -> tuple[bytes, str]:
    if data[:4] != b"glTF":
        document = json.loads(data)
        said = altered(rng, document)
        return json.dumps(document).encode(), said
    document, binary = parts(data)
    way = rng.random()
    if way < 0.2:
        return container(document, damaged(rng, binary)), "binary"
    if way < 0.3:
        return container(multiplied(rng, document), binary), "multiplied"
    said = altered(rng, document)
    return container(document, binary), said


def multiplied(rng: Generator, document: dict[str, Any]) -> dict[str, Any]:
    """A document in which thousands share what one had: nodes a mesh and skin, meshes a primitive, files a clip."""
    skinned = {key: 0 for key, parts in (("mesh", "meshes"), ("skin", "skins")) if document.get(parts)}
    shared: list[tuple[list[Any], Any]] = [(document["nodes"], skinned), (document["nodes"], {"name": "a"})]
    for mesh in document.get("meshes", []):
        shared.append((mesh["primitives"], mesh["primitives"][0]))
    for animation in document.get("animations", []):
        shared.append((document["animations"], animation))
        shared.append((animation["channels"], animation["channels"][0]))
    places, thing = shared[int(rng.integers(len(shared)))]
    places.extend([thing] * int(rng.integers(1, 8_000)))
    return document


def _in_words(rng: Generator, data: bytes) -> bytes:
    """A text with words replaced, swapped, doubled or taken out, those of its head more often, or lines so."""
    split = re.compile(r"(\s+|[,<>{}\"=/()])") if rng.random() < 0.85 else re.compile(r"(\n)")
    words = split.split(data.decode("utf-8", "replace"))
    for _ in range(int(rng.integers(1, 4))):
        places = [place for place, word in enumerate(words) if word.strip()] or [0]
        head = places[: max(30, len(places) // 8)]
        place, other = (int(rng.choice(head if rng.random() < 0.6 else places)) for _ in range(2))
        kind = int(rng.integers(6))
        if kind <= 1:
            words[place] = WORDS[int(rng.integers(len(WORDS)))]
        elif kind == 2:
            words[place] = ""
        elif kind == 3:
            words[place], words[other] = words[other], words[place]
        elif kind == 4:
            words[place] = f"{words[place]}{words[place - 1] if place else ' '}{words[place]}"
        else:
            words[place] = words[other]
    return "".join(words).encode("utf-8", "surrogatepass")


def _in_arrays(rng: Generator, data: bytes) -> tuple[bytes, str]:
    """An .npz one of whose arrays has another dtype, shape, header, or other values."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        found = {name: archive.read(name) for name in archive.namelist()}
    name = str(rng.choice(sorted(found)))
    array = np.load(io.BytesIO(found[name]))
    found[name], how = _other_array(rng, array, found[name])
    if rng.random() < 0.1:
        del found[str(rng.choice(sorted(found)))]
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED if rng.random() < 0.5 else zipfile.ZIP_STORED) as archive:
        for member, one in found.items():
            archive.writestr(member, one)
    return content.getvalue(), f"{name} {how}"


def _other_array(rng: Generator, array: Any, data: bytes) -> tuple[bytes, str]:
    """An .npy file, and what is other about it."""
    kind = int(rng.integers(7))
    if kind == 0:
        shape = rng.choice(["(1000000000000,)", "(-1,)", "(0, 999999999999)", "()", "(True,)", "((1,),)", "(1e3,)"])
        return re.sub(rb"'shape': \([^)]*\)", f"'shape': {shape}".encode(), data), "shape"
    if kind == 1:
        return damaged(rng, data), "bytes"
    if kind <= 3 and array.dtype.kind == "U" and array.size:
        return _npy(_other_words(rng, array)), "words"
    if kind <= 4 and array.dtype.kind == "f":
        return _npy(np.full_like(array, [np.nan, np.inf, 1e308, -1, 0][int(rng.integers(5))])), "values"
    if kind == 5:
        return _npy([array[..., None], array[None], array[:0] if array.ndim else array][int(rng.integers(3))]), "axes"
    others = [
        str,
        object,
        np.complex128 if array.dtype.kind == "f" else "S9",
        "<f4" if array.dtype.kind == "f" else "U1",
    ]
    return _npy(array.astype(others[int(rng.integers(4))])), "dtype"


def _other_words(rng: Generator, array: Any) -> Any:
    """Texts of which one is another; a JSON document in another way."""
    if str(array).startswith("{"):
        document = json.loads(str(array))
        altered(rng, document)
        return np.array(json.dumps(document))
    words = array.copy().reshape(-1)
    words[int(rng.integers(words.size))] = WORDS[int(rng.integers(len(WORDS)))][:20]
    return words.reshape(array.shape)


def _npy(array: Any) -> bytes:
    content = io.BytesIO()
    np.save(content, array, allow_pickle=True)
    return content.getvalue()


def steps(path: Path) -> Iterator[Callable[[], object]]:
    """Read a file and its clips, write what was read, and take it for a character."""
    read, names = list[Motion](), list[str]()
    yield lambda: read.append(motet.read(path))
    yield lambda: names.extend(clips(path))
    for name in names[1:4]:
        yield partial(motet.read, path, clip=name)
    for motion in read:
        yield partial(motet.to_humanoid, motion)
        yield partial(positions, motion)
        for kind in ("bvh", "npz", "csv", "glb", "vrma", "html"):
            yield partial(write_motion, io.BytesIO(), motion[:100], format=kind)
        yield partial(write_motion, path.with_name("out.amc"), motion[:100])
    yield partial(write_motion, io.BytesIO(), other(), format="bvh", like=path)
    if path.suffix in CLIPPED:
        yield partial(write_motion, io.BytesIO(), other(), format="glb", like=path)
        yield partial(write_motion, io.BytesIO(), other(), format="glb", onto=path)


@cache
def other() -> Motion:
    """A motion for the characters."""
    return motet.read(CLIP)[:8]


def main() -> int:
    """The command."""
    parser = options(__doc__)
    parser.add_argument("--folder", type=Path, help="of the files to alter; else small ones of motet's own")
    parser.add_argument("--only", help="part of the names of the files to alter")
    given = parser.parse_args()
    files = own_files() if given.folder is None else files_of(given.folder)
    files = {name: one for name, one in files.items() if given.only is None or given.only in name}
    return fuzz(given, mutants(files), steps)


if __name__ == "__main__":
    sys.exit(main())
