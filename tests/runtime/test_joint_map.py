import json
import re
from pathlib import Path

import pytest

from motet.errors import FormatError
from motet.formats import read_motion
from motet.formats.text import with_names
from motet.motion.humanoid.joint_map import conventions, map_by_names, read_map
from motet.motion.humanoid.retarget import to_humanoid
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion

SKELETONS = Path(__file__).parent / "skeletons"
DOCS = Path(__file__).parents[2] / "docs" / "formats.md"


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
