"""What README and docs say works: Python blocks run, links lead somewhere, commands exist with their options."""

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from motet.cli import main
from motet.formats import read_motion, write_motion
from motet.models.load import load_as
from motet.steering.model import SteerModel

ROOT = Path(__file__).parents[1]
PAGES = {path.relative_to(ROOT).as_posix(): path for path in (*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"))}
CLIPS = {"walk": "39_14", "run": "09_07", "bend": "02_06"}
"""What files that pages only name, such as walk.bvh, are here."""


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE)


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with the folders of the repository, a character of the reader's, and a folder to write to."""
    for place in ROOT.iterdir():
        if place.is_dir() and place.name != "out" and not place.name.startswith("."):
            (tmp_path / place.name).symlink_to(place)
    (tmp_path / "out").mkdir()
    character = read_motion(ROOT / "tests/runtime/skeletons/mixamo.bvh", unit="cm")
    write_motion(tmp_path / "character.glb", character)  # with a simple body for a mesh
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def folder(clone: Path) -> Path:
    """The same with the files that pages only name."""
    for name, trial in CLIPS.items():
        motion = read_motion(ROOT / f"train/motet_train/data/cmu/{trial}.amc")
        for extension in ("amc", "bvh", "npz"):
            write_motion(clone / f"{name}.{extension}", motion)
    (clone / "acts.toml").write_text(blocks(PAGES["docs/keyed.md"].read_text(), "toml")[0])
    (clone / "character.bvh").symlink_to(ROOT / "tests/runtime/skeletons/mixamo.bvh")
    return clone


@pytest.mark.parametrize("page", [page for page, path in PAGES.items() if blocks(path.read_text(), "python")])
def test_python_blocks_run_one_after_the_other(page: str, folder: Path) -> None:
    namespace: dict[str, object] = {}
    for number, block in enumerate(blocks(PAGES[page].read_text(), "python"), start=1):
        exec(compile(block, f"{page}, Python block {number}", "exec"), namespace)


def test_the_readmes_python_type_checks_strictly(tmp_path: Path) -> None:
    found = blocks(PAGES["README.md"].read_text(), "python")
    assert found
    (tmp_path / "readme.py").write_text("\n".join(found))
    checked = [sys.executable, "-m", "mypy", "--strict", str(tmp_path / "readme.py")]
    done = subprocess.run(checked, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("page", PAGES)
def test_what_is_told_to_be_installed_is_the_clone(page: str) -> None:
    """motet is on no package index: a first install takes the clone, by its path."""
    code = "\n".join(re.findall(r"^ {4}.*$|^```.*?^```$", PAGES[page].read_text(), flags=re.DOTALL | re.MULTILINE))
    by_name = re.findall(r"(?:pip|npm) install(?: -\S+)* ['\"]?motet\b.*", code)
    assert by_name == []


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page: str) -> None:
    text = re.sub(r"^```.*?^```$", "", PAGES[page].read_text(), flags=re.DOTALL | re.MULTILINE)
    found = re.findall(r"\]\(([^)\s]+)\)", text)
    here = {target.partition("#")[0] for target in found if not re.match(r"\w+:", target)} - {""}
    assert [target for target in sorted(here) if not (PAGES[page].parent / target).exists()] == []


def commands(text: str) -> Iterator[str]:
    """The ``motet`` command lines in code blocks of a page, fenced or indented."""
    fenced = re.findall(r"^```\w*\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE)
    indented = re.findall(r"^ {4}.*$", text, flags=re.MULTILINE)
    lines = "\n".join([*fenced, *(line[4:] for line in indented)]).replace("\\\n", " ").splitlines()
    return (line[found.start(1) :] for line in lines if (found := re.search(r"(?:^|&& )(motet .*)", line)))


def mentions(text: str) -> list[str]:
    """What stands between backticks and begins with ``motet``: a command, or the beginning of one, or its synopsis."""
    found: list[str] = re.findall(r"`(motet [^`]+)`", text)
    return [re.sub(r"\.\.\.|[][]", " ", line) for line in found]


def check(line: str, whole: bool = True) -> None:
    """A command exists and has the options, and where it is whole those that it needs; nothing is run."""
    words = shlex.split(line, comments=True)[1:]
    command: click.Command = main
    context = click.Context(main, info_name="motet")
    while isinstance(command, click.Group) and words and not words[0].startswith("-"):
        found = command.get_command(context, words[0])
        assert found is not None, f"there is no command {words[0]!r}"
        command, context = found, click.Context(found, context, info_name=words.pop(0))
    given = {option.name for option in command.make_parser(context).parse_args(words)[2]}
    needed = {option.name for option in command.params if isinstance(option, click.Option) and option.required}
    assert not whole or needed <= given, f"it needs {', '.join(map(str, needed - given))}"


@pytest.mark.parametrize("page", [page for page in PAGES if page != "CHANGELOG.md"])  # which names what is gone
def test_commands_exist_with_their_options(page: str) -> None:
    text = PAGES[page].read_text()
    for line, whole in [*((line, True) for line in commands(text)), *((line, False) for line in mentions(text))]:
        try:
            check(line, whole)
        except (AssertionError, click.ClickException) as error:
            raise AssertionError(f"{line!r}: {error}") from error


def test_the_readmes_commands_run_in_their_order(clone: Path) -> None:
    """What one command reads an earlier one has written, but for a character and for the reader's recordings."""
    lines = list(commands(PAGES["README.md"].read_text()))
    runnable = [line for line in lines if not line.startswith(("motet train", "motet export"))]
    assert len(runnable) == len(lines) - 2
    for line in runnable:
        words = shlex.split(line)[1:]
        result = CliRunner().invoke(main, words)
        assert (line, result.exit_code, result.stderr) == (line, 0, "")
        assert "-o" not in words or (clone / words[words.index("-o") + 1]).stat().st_size > 0


def test_the_readmes_lines_of_the_papers_run(clone: Path) -> None:
    """The table has a line for each bundle that is a paper's system, and each runs."""
    rows = re.findall(r"^\|[^\n]*`(motet [^`]*--bundle [^`]*)`[^\n]*$", PAGES["README.md"].read_text(), re.MULTILINE)
    bundles = [re.findall(r"--bundle (\S+)", row)[0] for row in rows]
    assert sorted(bundles) == ["convseq2seq", "language-to-motion", "motion-to-language", "tdbn"]
    for row in rows:
        result = CliRunner().invoke(main, shlex.split(row)[1:])
        assert (row, result.exit_code, result.stderr) == (row, 0, "")
        assert result.stdout


def test_the_speeds_of_the_servers_first_message_are_the_models() -> None:
    model = load_as(SteerModel, "control")
    slowest, fastest = model.speeds["walk"]
    said = f'"walk": [{slowest:.2f}, {model.usual["walk"]:.2f}, {fastest:.2f}]'
    assert said in PAGES["docs/reference/live-protocol.md"].read_text()


def test_the_readme_names_commands_and_wrong_ones_are_found() -> None:
    assert len(list(commands(PAGES["README.md"].read_text()))) > 3
    check("motet describe walk.bvh --json  # as it is")
    with pytest.raises(click.NoSuchOption, match="--jsonn"):
        check("motet describe walk.bvh --jsonn")
    with pytest.raises(AssertionError, match="descibe"):
        check("motet descibe walk.bvh")
    with pytest.raises(AssertionError, match="needs out"):
        check('motet generate "a person walks"')
    check("motet generate", whole=False)
