"""Training to fill gaps: windows, the net, the recipe, and how a model is measured."""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from codes_data import PREPARATION
from codes_data import small_store as own_figures
from language_data import small_store as angles_store
from stores import prepare
from trainings import done, refused, trained

from motet.bundle.manifest import Manifest
from motet.figures.humanoid.bones import BONES, HUMANOID
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.predict.fill import FillModel
from motet.representation.placed import PLACED_CHANNELS, bridge, mirror, placed, placed_by_way, pose_of, unplaced
from motet_train.data.batches import frame_mirror
from motet_train.data.corpus import Record
from motet_train.data.errors import DataError
from motet_train.data.sixd_windows import GapWindow, GapWindows, gap_window
from motet_train.data.store import Store, split
from motet_train.evaluate.fill import FILL_GOALS, fill_report
from motet_train.evaluate.tables import reached
from motet_train.models.filler import Filler, FillerConfig
from motet_train.models.kinematics import tree_of
from motet_train.runs import Run

SETTINGS = """
[training]
steps = 6
every = 3
batch = 4
warm_up = 0
precision = "float32"
[model]
width = 8
layers = 1
heads = 2
inner = 8
waves = 2
[visits]
context = 5
least = 2
gaps = [2, 30]
"""


def dancer(seed: int, frames: int) -> Motion:
    """The humanoid on its way, all its joints swinging."""
    rng, time = np.random.default_rng(seed), np.arange(frames)[:, None] / 30
    joints = [f"{bone}.r{axis}" for bone in BONES for axis in "xyz"]
    angles = 25 * np.sin(time * rng.uniform(2, 8, len(joints)) + rng.uniform(0, 6, len(joints)))
    root = [0.0, 0.95, 0.0] + time * rng.uniform(-1, 1, 3) * [1, 0, 1]
    names = (*(f"hips.t{axis}" for axis in "xyz"), *joints)
    return Motion(np.column_stack([root, angles]), names, ("m",) * 3 + ("deg",) * len(joints), 30.0, HUMANOID)


def records(count: int = 12, frames: int = 40) -> Iterator[Record]:
    for i in range(count):
        yield Record(f"{i:02}", f"{i}", dancer(i, frames + i), ("someone dances",), action="dance")


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    folder = tmp_path_factory.mktemp("store")
    return prepare(records(frames=75), folder / "store", PREPARATION)


@pytest.fixture(scope="module")
def run(store: Store, tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("runs")
    prepare(records(), folder / "store", PREPARATION)
    return trained("fill", SETTINGS, folder / "store", folder / "run", "--split", "subject")


def net(store: Store, **sizes: int) -> Filler:
    """A net whose last layer is not zero."""
    torch.manual_seed(0)
    small = {"width": 16, "layers": 1, "heads": 2, "inner": 16, "waves": 2, **sizes}
    found = Filler(FillerConfig(PLACED_CHANNELS, tree_of(store.contract((0,))), **small))
    torch.nn.init.normal_(found.outward.weight, std=0.3)
    return found.eval()


def test_weights_of_older_runs_are_loaded_by_the_names_of_today(store: Store) -> None:
    fresh = net(store)
    names = {"distances": "told", "qkv": "asked", "proj": "mixed", "mlp_in": "inward", "mlp_out": "outward"}
    state = {}
    for name, value in fresh.state_dict().items():
        old = ".".join(names.get(part, part) for part in name.split("."))
        state[old] = value + 1
    assert {"told.weight", "blocks.0.asked.weight", "blocks.0.outward.bias", "outward.bias"} <= state.keys()
    fresh.load_state_dict(state)
    assert all(value.equal(state[name]) for name, value in fresh.state_dict().items() if name in state)
    assert fresh.blocks[0].qkv.weight.equal(state["blocks.0.asked.weight"])  # type: ignore[union-attr, operator]


def drawn(store: Store, sizes: tuple[int, int, int], batch: int = 3) -> GapWindow:
    windows = GapWindows(store, (0, 1, 2), sum(sizes), frame_mirror(store.contract((0,))))
    return windows.draw(batch, sizes, np.random.default_rng(1))


def test_windows_are_parts_of_motions_seen_from_the_last_frame_before_the_gap(store: Store) -> None:
    motion = dancer(0, 40)
    window = gap_window(placed(motion)[None], 10, 20)
    np.testing.assert_allclose(pose_of(window.past[0, -1].double().numpy()), 0, atol=1e-6)
    whole = torch.cat([window.past, window.truth, window.after], dim=1)[0].double().numpy()
    # the distances of all joints, at all times, from the hips at the start
    seen, true = positions(unplaced(whole, motion)), positions(motion)
    apart = [np.linalg.norm(each - each[0, 0], axis=-1) for each in (seen, true)]
    np.testing.assert_allclose(apart[0], apart[1], atol=1e-5)
    plain = bridge(whole[:10], whole[30:], 20)
    np.testing.assert_allclose(window.plain[0], plain, atol=1e-6)


def test_windows_are_drawn_within_a_motion_and_as_often_mirrored(store: Store) -> None:
    window = drawn(store, (5, 6, 5), batch=64)
    frames = torch.cat([window.past, window.truth, window.after], dim=1)
    assert frames.shape == (64, 16, PLACED_CHANNELS)
    # within a motion nothing leaps: joints go 10 m/s at most
    places = net(store).joints(frames)
    assert places.diff(dim=1).norm(dim=-1).max() < 10 / 30
    with pytest.raises(DataError, match="shorter than 500 frames"):
        GapWindows(store, (0, 1, 2), 500, frame_mirror(store.contract((0,))))


def test_joints_are_where_numpy_says(store: Store) -> None:
    motion = dancer(3, 9)
    found = net(store).joints(torch.from_numpy(placed(motion)).float())
    np.testing.assert_allclose(found.numpy(), positions(motion), atol=1e-5)


def test_an_untrained_net_fills_plainly(store: Store) -> None:
    window = drawn(store, (5, 6, 5))
    torch.manual_seed(0)
    fresh = Filler(FillerConfig(PLACED_CHANNELS, tree_of(store.contract((0,)))))
    with torch.no_grad():
        np.testing.assert_allclose(fresh(window.past, window.plain, window.after), window.plain, atol=1e-6)


def test_what_is_filled_is_mirrored_as_the_sides_are(store: Store) -> None:
    window, one, sides = drawn(store, (5, 6, 4)), net(store), mirror()
    given = (window.past, window.plain, window.after)
    with torch.no_grad():
        found = one(*given)
        other = one(*(torch.from_numpy(sides(part.numpy())) for part in given))
    assert (found - window.plain).abs().max() > 0.01
    np.testing.assert_allclose(sides(found.numpy()), other, atol=1e-5)


def test_gaps_and_sides_may_have_any_length_and_rows_do_not_mix(store: Store) -> None:
    one = net(store)
    for sizes in ((2, 1, 3), (8, 30, 8)):
        window = drawn(store, sizes)
        with torch.no_grad():
            found = one(window.past, window.plain, window.after)
            alone = one(window.past[1:2], window.plain[1:2], window.after[1:2])
        assert found.shape == window.truth.shape
        np.testing.assert_allclose(found[1:2], alone, atol=1e-5)


def test_training_gives_a_model_that_fills(run: Run) -> None:
    assert (run.manifest["verb"], run.manifest["loop"]) == ("fill", "between")
    assert run.manifest["defaults"] == {"context": 5, "least": 2, "longest": 30}
    assert run.manifest["training"]["steps"] == 6
    model = run.bundle_model()
    assert isinstance(model, FillModel)
    motion = dancer(1, 30)
    found = model.fill(motion, [(0.5, 0.6)])
    changed = (found.values != motion.values).any(axis=1)
    assert np.flatnonzero(changed).tolist() == [15, 16, 17]


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (angles_store, "gaps are filled in root_sixd (motet prepare --for codes), not root_angles"),
        (own_figures, "gaps are filled on the humanoid (motet prepare --for codes --figure humanoid)"),
    ],
)
def test_a_store_of_another_kind_is_refused(make: Callable[[Path], Store], reason: str, tmp_path: Path) -> None:
    make(tmp_path)
    refused(reason, "train", "fill", "--data", tmp_path / "store", "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()


class Knowing(FillModel):
    """A model that knows what is to be filled."""

    truth: np.ndarray

    def frames_between(self, past: np.ndarray, after: np.ndarray, frames: int, pace: float = 1.0) -> np.ndarray:
        start = np.abs(self.truth - past[-1]).sum(axis=1).argmin() + 1
        return self.truth[start : start + frames]


def test_a_model_that_knows_has_no_error_and_standing_has_that_of_the_way(run: Run, store: Store) -> None:
    only = replace(store, records=store.records[:6])
    model = Knowing(Manifest.from_json(run.manifest), run.torch_graphs())
    tested = split(only.records, 0, "subject").test
    assert len(tested) == 1
    model.truth = placed_by_way(np.array(only.sequence(tested[0]), np.float64), 30.0)
    report = fill_report(model, only)
    half = report["gap_0.5"]
    frames = len(model.truth)
    windows = range(5, frames - 5 - 15 + 1, 15)
    assert half["gaps"] == (frames - 2 * 5) // 15
    assert half["cm"] < 1e-3 < half["cm_interpolation"] < half["cm_standing"]
    ways = [np.linalg.norm((model.truth[i + 15] - model.truth[i - 1])[[0, 2]]) for i in windows]
    assert half["gaps_going"] == sum(way / (16 / 30) > 0.5 for way in ways)
    assert half["jerk"] == pytest.approx(1, abs=1e-6)
    assert half["of_interpolation"] < 1e-3
    places = positions(unplaced(model.truth, dancer(0, 1)))
    expected = np.mean([np.linalg.norm(places[i : i + 15] - places[i - 1], axis=-1).mean() for i in windows])
    assert half["cm_standing"] == pytest.approx(100 * expected, rel=1e-4)
    assert reached(FILL_GOALS, "gap_1.of_interpolation", report["gap_1"]["of_interpolation"])


def test_evaluate_prints_the_table(run: Run, store: Store, tmp_path: Path) -> None:
    run.save(tmp_path)
    prepare(records(frames=75), tmp_path / "store", PREPARATION)
    result = done("evaluate", tmp_path, "--data", tmp_path / "store", "--json")
    assert set(json.loads(result.stdout)) == {"gap_0.5", "gap_1", "gap_2"}
    refused("need --data", "evaluate", tmp_path)
