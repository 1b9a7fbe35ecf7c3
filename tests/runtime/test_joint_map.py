import json
import re
from collections.abc import Sequence
from pathlib import Path

import pytest
from renamed import names_of

from motet.errors import FormatError
from motet.figures.humanoid.joint_map import JointMap, conventions, map_by_names, read_map
from motet.figures.humanoid.retarget import to_humanoid
from motet.formats import read_motion
from motet.formats.text import with_names
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion

SKELETONS = Path(__file__).parent / "skeletons"
DOCS = Path(__file__).parents[2] / "docs" / "reference" / "formats.md"


def numbered() -> tuple[Motion, dict[str, object]]:
    """A figure with names that say nothing, and the map that says it."""
    motion = read_motion(SKELETONS / "rokoko.bvh")
    found = map_by_names(skeleton_of(motion))
    assert found is not None
    names = [f"bone{i}" for i in range(len(skeleton_of(motion).names))]
    entries: dict[str, object] = {bone: names[joint] for bone, joint in found.joints.items()}
    entries |= {"spine": [names[i] for i in found.spine], "neck": [names[i] for i in found.neck]}
    return with_names(motion, names), entries


def write_map(folder: Path, entries: object) -> Path:
    (folder / "map.json").write_text(json.dumps(entries))
    return folder / "map.json"


def test_a_users_map_is_followed(tmp_path: Path) -> None:
    motion, entries = numbered()
    given = to_humanoid(motion, read_map(write_map(tmp_path, entries), skeleton_of(motion)))
    known = to_humanoid(read_motion(SKELETONS / "rokoko.bvh"))
    assert (given.convention, given.confidence) == ("map.json", 1.0)
    assert abs(positions(given.motion) - positions(known.motion)).max() < 1e-9


def test_maps_that_cannot_be_followed_are_refused(tmp_path: Path) -> None:
    motion, entries = numbered()
    skeleton = skeleton_of(motion)
    cases: list[tuple[dict[str, object], str]] = [
        ({"leftTail": "bone3"}, "'leftTail' is not a bone of the humanoid"),
        ({"hips": "nothing"}, "no joint 'nothing'"),
        ({"hips": entries["head"]}, "only one bone; named twice"),
        ({"hips": ["bone0", "bone1"], "spine": ["bone2"]}, "only spine and neck take a list"),
        ({"hips": 3}, "expected the name of a joint"),
        ({"leftUpperArm": entries["leftLowerArm"], "leftLowerArm": entries["leftUpperArm"]}, "out of order"),
    ]
    for change, reason in cases:
        with pytest.raises(FormatError, match=reason):
            read_map(write_map(tmp_path, entries | change), skeleton)
    without = {bone: name for bone, name in entries.items() if bone != "rightUpperLeg"}
    with pytest.raises(FormatError, match="one side only: rightUpperLeg"):
        read_map(write_map(tmp_path, without), skeleton)
    (tmp_path / "map.json").write_text('{"hips": "bone0", "hips": "bone1"}')
    with pytest.raises(FormatError, match="hips appears twice"):
        read_map(tmp_path / "map.json", skeleton)
    for content in ("[1, 2]", "[" * 100_000):
        (tmp_path / "map.json").write_text(content)
        with pytest.raises(FormatError, match="joint map"):
            read_map(tmp_path / "map.json", skeleton)


def test_tables_of_conventions_are_whole() -> None:
    tables = conventions()
    assert len({table.title for table in tables}) >= 20
    for table in tables:
        assert {"hips", "spine", "head", "leftUpperLeg", "rightHand"} <= set(table.names)
        assert all(names for names in table.names.values())


def test_the_docs_say_of_every_convention_what_it_was_tested_on() -> None:
    found = re.search("<!-- conventions -->\n(.*?)<!-- /conventions -->", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in found[1].splitlines()[2:]]
    assert sorted(title for title, _ in rows) == sorted({table.title for table in conventions()})
    skeletons = [map_by_names(skeleton_of(read_motion(path))) for path in SKELETONS.glob("*.bvh")]
    written = {title for title, tested in rows if tested.startswith("written down")}
    assert written == {joint_map.convention for joint_map in skeletons if joint_map}


@pytest.mark.parametrize("prefix", ["mixamorig:", "mixamorig1:", "mixamorig", "Character1_", "MyHero:mixamorig:", ""])
def test_prefixes_and_separators_do_not_count(prefix: str) -> None:
    motion = read_motion(SKELETONS / "mixamo.bvh")
    names = [prefix + name.removeprefix("mixamorig:") for name in skeleton_of(motion).names]
    found = map_by_names(skeleton_of(with_names(motion, names)))
    assert found is not None
    assert found.convention == "Mixamo"


def mapped(names: Sequence[str]) -> JointMap:
    """The map of Mixamo's figure with other names; they have to tell its joints as its own do."""
    motion = read_motion(SKELETONS / "mixamo.bvh")
    known, found = (map_by_names(skeleton_of(each)) for each in (motion, with_names(motion, names)))
    assert known is not None
    assert found is not None
    assert (found.joints, found.spine, found.neck) == (known.joints, known.spine, known.neck)
    return found


NAMES = tuple(name.removeprefix("mixamorig:") for name in skeleton_of(read_motion(SKELETONS / "mixamo.bvh")).names)


@pytest.mark.parametrize(
    "written",
    [
        "mixamorig:{name}_{i:03}",  # Sketchfab
        "mixamorig{name}_{i}",  # three.js' loader of it
        "mixamorig:{name}.001",
        "mixamorig:{name}_0{i}.002",
        "{name}7",
        "{name}_7",
        "Remy:{name}",
        "Armature|mixamorig:{name}",
        "Armature|{name}",
        "12:{name}",
        "12_{name}",
        "3{name}",
        "Group_Remy_mixamorig_{name}",
        "|root|{name}",
    ],
)
def test_numbers_at_the_end_and_namespaces_do_not_count(written: str) -> None:
    found = mapped([written.format(name=name, i=i) for i, name in enumerate(NAMES)])
    assert (found.convention, found.confidence) == ("Mixamo", 1.0)


@pytest.mark.parametrize("changed", ["Head", "LeftHand", "Hips", "RightLeg"])
@pytest.mark.parametrize("number", ["_1", ".001", " 2"])
def test_a_name_that_a_program_made_unique_is_known(changed: str, number: str) -> None:
    assert mapped([name + number if name == changed else name for name in NAMES]).convention == "Mixamo"


def test_numbers_that_belong_to_names_are_kept() -> None:
    motion = read_motion(SKELETONS / "rigify.bvh")
    found = map_by_names(skeleton_of(motion))
    names = [f"{name}_{i}" for i, name in enumerate(skeleton_of(motion).names)]
    numbered = map_by_names(skeleton_of(with_names(motion, names)))
    assert found is not None
    assert numbered is not None
    assert (numbered.joints, numbered.spine, numbered.neck) == (found.joints, found.spine, found.neck)
    assert numbered.convention == "Blender Rigify"


@pytest.mark.parametrize("title", ["Blender metarig", "MikuMikuDance", "VRChat (CATS)", "VRM add-on for Blender"])
@pytest.mark.parametrize("written", ["{name}", "{name}_{i:02}", "Remy:{name}"])
def test_conventions_of_blender_and_mikumikudance_have_their_own_titles(title: str, written: str) -> None:
    motion = read_motion(SKELETONS / "mixamo.bvh")
    names = [written.format(name=name, i=i) for i, name in enumerate(names_of(motion, title))]
    found, known = (map_by_names(skeleton_of(each)) for each in (with_names(motion, names), motion))
    assert found is not None
    assert known is not None
    assert (found.convention, found.joints, found.neck) == (title, known.joints, known.neck)


def test_names_are_told_apart_by_what_only_one_convention_has() -> None:
    assert mapped(NAMES).convention == "Mixamo"
    assert mapped(["LeftHandThumb" if name == "LeftHand_end" else name for name in NAMES]).convention == "Mixamo"
    motion = read_motion(SKELETONS / "bandai-namco.bvh")
    names = [name.replace("joint_Root", "root") for name in skeleton_of(motion).names]
    found = map_by_names(skeleton_of(with_names(motion, names)))
    assert found is not None
    assert found.convention != "Bandai-Namco Research motion data"
