"""What the package says of itself on an index."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
HOME = "https://example.org/motet"


@pytest.fixture
def described(monkeypatch: pytest.MonkeyPatch) -> dict[str, dict[str, str]]:
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setenv("MOTET_HOME", HOME)
    metadata: dict[str, dict[str, str]] = {}
    module.RepositoryMetadata(str(ROOT), {}).update(metadata)
    return metadata


def test_links_and_pictures_of_the_description_lead_to_files_of_the_repository(described: dict) -> None:
    text = re.sub(r"```.*?```|`[^`]*`", "", described["readme"]["text"], flags=re.DOTALL)
    targets = [*re.findall(r"\]\(([^)]+)\)", text), *re.findall(r'src="([^"]+)"', text)]
    own = [target.removeprefix(HOME) for target in targets if target.startswith(HOME)]
    assert len(own) > 30
    assert all(re.match(r"https?:|#", target) for target in targets)
    paths = [re.sub(r"^/(raw|blob)/main/|#.*", "", target) for target in own]
    assert [path for path in paths if not (ROOT / path).is_file()] == []
    assert {target.rsplit(".", 1)[1] for target in own if target.startswith("/raw")} <= {"png", "gif"}
