"""The codec of motions: where its joints are, its codes, what its decoder sees, its windows, and its training."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from codes_data import CODEC, humanoid_contract, small_store, without_actions
from language_data import SKELETON
from language_data import small_store as angles_store
from sklearn.cluster import KMeans
from trainings import check_resumed, log_of, rebuilt, refused, same, trained

from motet.figures.humanoid.bones import BONES, HUMANOID
from motet.generate.codec import RADIAN_METRES, moved, seen_from, way_of
from motet.motion.kinematics import positions
from motet.motion.rotations import axis_to_rotmat, rotvec_to_rotmat
from motet.representation.root_block import poses_of
from motet_train.data.errors import DataError
from motet_train.data.sixd_windows import SixdWindows, window_of, with_way
from motet_train.data.store import Store
from motet_train.models.codec import CodecConfig, MotionCodec, places_in_world
from motet_train.models.kinematics import SixdPlaces, tree_of
from motet_train.recipes.codec import badly_shown, fit_book

CONTRACT = humanoid_contract()
D = len(CONTRACT.channels)


def frames_of(count: int, seed: int = 0) -> np.ndarray:
    """Frames (T, D) of a humanoid that goes about with joints turned by chance."""
    rng = np.random.default_rng(seed)
    turned = rotvec_to_rotmat(rng.normal(size=(count, len(BONES), 3)))
    axes = np.swapaxes(turned[..., :2], 2, 3).reshape(count, -1)
    return np.column_stack([rng.normal([1.0, 0.1, 0.5, 0.9], [0.3, 0.1, 0.5, 0.05], (count, 4)), axes])


def codec(seed: int = 0, **changes: object) -> MotionCodec:
    torch.manual_seed(seed)
    sizes = {"moves": 8, "groups": 2, "levels": (3, 5), "width": 12, "blocks": 1, "ahead": (1, 1, 0), "fine": 6}
    net = MotionCodec(CodecConfig(D, tree_of(CONTRACT), **{**sizes, **changes}))  # type: ignore[arg-type]
    net.book.copy_(torch.from_numpy(np.random.default_rng(1).normal(size=(8, 3)) * [0.2, 0.05, 0.2]))
    return net.eval()


def test_places_are_those_of_the_motion_that_plays() -> None:
    frames = frames_of(7)
    frames[:, :3] = 0  # it stays and faces z
    world = positions(CONTRACT.motion(frames, plant=False)) * HUMANOID.unit_factor(1.0)
    found = SixdPlaces(tree_of(CONTRACT))(torch.from_numpy(frames[None, :, 4:]).float())
    np.testing.assert_allclose(found[0], world - world[:, :1], atol=1e-5)
    # axes of any length will do
    again = SixdPlaces(tree_of(CONTRACT))(2 * torch.from_numpy(frames[None, :, 4:]).float())
    np.testing.assert_allclose(again, found, atol=1e-5)


def test_places_in_the_world_are_those_of_numpy() -> None:
    net, rng = codec(), np.random.default_rng(2)
    frames, along = frames_of(6), rng.normal(size=(6, 3))
    frames[:, :3] = rng.normal(size=(6, 3))
    found = places_in_world(net, torch.tensor(frames[None]).float(), torch.tensor(along[None]).float())[0]
    local = net.places(torch.tensor(frames[:, 4:]).float()).numpy()
    pose = moved(along, frames[:, :3])
    for frame in range(6):
        root = [pose[frame, 0], frames[frame, 3], pose[frame, 1]]
        expected = local[frame] @ axis_to_rotmat("y", pose[frame, 2]).T + root
        np.testing.assert_allclose(found[frame], expected, atol=1e-5)


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_window_puts_the_root_back_where_it_was(mirrored: bool) -> None:
    """Frames relative to the way of a coarse book, and that way, are the places of the motion itself."""
    net, frames = codec(), frames_of(33)
    frames = CONTRACT.mirror(frames) if mirrored else frames
    window = window_of(frames[None], frames[None], 30.0, net.book.numpy().astype(np.float64), 4)
    found = places_in_world(net, window.frames, window.way)[0]
    expected = positions(CONTRACT.motion(frames[:-1], plant=False)) * HUMANOID.unit_factor(1.0)
    np.testing.assert_allclose(found, expected, atol=1e-4)
    led = way_of(np.zeros(3), net.book.numpy()[window.moves[0]].astype(np.float64))
    np.testing.assert_allclose(window.way[0], np.repeat(led[:-1], 4, axis=0), atol=1e-5)
    np.testing.assert_array_equal(window.inputs[0], frames[:-1].astype(np.float32))
    assert len(window[:1]) == len(window) == 1


def test_with_way_chooses_moves_to_where_the_root_goes_next() -> None:
    poses = poses_of(frames_of(9), 30.0)
    exact = seen_from(poses[:-4:4], poses[4::4])
    seen, moves, along = with_way(frames_of(9)[:-1], poses, np.concatenate([np.zeros((1, 3)), exact]), 4)
    assert moves.tolist() == [1, 2]
    np.testing.assert_allclose(along[::4], poses[:-1:4], atol=1e-12)
    np.testing.assert_allclose(moved(along, seen[:, :3]), poses[:-1], atol=1e-12)


def test_every_code_stands_for_numbers_of_its_own() -> None:
    net = codec()
    codes = torch.arange(15)[None, :, None].expand(1, 15, 2)
    values = net.from_codes(codes)
    assert values.shape == (1, 15, 4)
    assert len(values[0, :, :2].unique(dim=0)) == 15
    assert sorted({round(float(value), 6) for value in values[0, :, 0]}) == [-1, 0, 1]
    assert sorted({round(float(value), 6) for value in values[0, :, 1]}) == [-1, -0.5, 0, 0.5, 1]
    assert torch.equal(net.to_codes(values), codes)
    with pytest.raises(DataError, match="odd"):
        codec(levels=(4, 5))


def test_what_is_encoded_is_what_its_codes_stand_for_and_has_a_gradient() -> None:
    net = codec()
    net.encoder.outward.weight.data *= 20  # so that all levels occur
    frames = torch.tensor(frames_of(40)[None]).float().requires_grad_()
    values = net.encode(frames)
    assert values.shape == (1, 10, 4)
    codes = net.to_codes(values)
    assert len(codes.unique()) > 5
    torch.testing.assert_close(net.from_codes(codes), values)
    values.square().sum().backward()
    assert frames.grad.abs().sum() > 0


def test_codes_are_made_on_any_device() -> None:
    net = codec().to("meta")
    codes = net.to_codes(net.encode(torch.zeros(2, 8, D, device="meta")))
    assert net.decode(codes[..., 0], net.from_codes(codes)).device.type == "meta"


@pytest.mark.parametrize("ahead", [(1, 1, 0), (0, 0), (1, 0, 0, 1)])
@torch.no_grad()
def test_the_decoder_looks_as_far_as_it_says(ahead: tuple[int, ...]) -> None:
    net, hop, at = codec(ahead=ahead), 4, 20
    moves = torch.randint(8, (1, 40), generator=torch.Generator().manual_seed(0))
    values = torch.randn(1, 40, 4, generator=torch.Generator().manual_seed(1))
    other = values.clone()
    other[:, at] += 1
    apart = (net.decode(moves, values) - net.decode(moves, other)).abs().amax(dim=2)[0] > 0
    changed = apart.nonzero().flatten().tolist()
    assert changed[0] // hop == at - sum(ahead)
    # and back: each layer two steps less what it looks ahead, those of frames by four frames in all
    assert changed[-1] // hop == at + sum(2 - one for one in ahead) + 1
    # so of a part of the codes that is as long, the frames are the same
    start, stop = at - sum(2 - one for one in ahead) - 1, at + sum(ahead) + 1
    part = net.decode(moves[:, start:stop], values[:, start:stop])[:, (at - start) * hop : (at - start + 1) * hop]
    torch.testing.assert_close(part, net.decode(moves, values)[:, at * hop : (at + 1) * hop], atol=1e-5, rtol=1e-5)


def test_a_codec_comes_back_from_its_configuration() -> None:
    net = codec()
    again = rebuilt("motion-codec", net)
    frames = torch.tensor(frames_of(8)[None]).float()
    assert torch.equal(again.encode(frames), net.encode(frames))
    assert again.graphs() == {}


def walks(count: int = 4, frames: int = 200) -> list[np.ndarray]:
    """Poses of people who go on, turn now and then, and stand."""
    rng = np.random.default_rng(3)
    moves = rng.normal([0.03, 0.0, 0.0], [0.02, 0.005, 0.02], (count, frames, 3))
    moves[:, 50:80] = 0
    return list(way_of(np.zeros((count, 3)), moves))


def test_a_book_is_about_as_near_to_moves_as_can_be() -> None:
    found = fit_book(walks(), 4, 24, seed=0)
    assert found.shape == (24, 3)
    assert not found[0].any()
    scale = np.array([1, 1, RADIAN_METRES])
    moves = np.concatenate([seen_from(way[:-4], way[4:]) for way in walks()]) * scale

    def cost(book: np.ndarray) -> float:
        return float(((moves[:, None] - book) ** 2).sum(axis=2).min(axis=1).sum())

    other = KMeans(23, random_state=0, n_init=1).fit(moves)
    assert cost(found * scale) < 1.5 * cost(other.cluster_centers_)
    np.testing.assert_array_equal(found, fit_book(walks(), 4, 24, seed=0))
    assert cost(found * scale) != cost(fit_book(walks(), 4, 24, seed=1) * scale)


def test_a_book_has_each_of_a_few_moves() -> None:
    moves = np.random.default_rng(0).normal(size=(5, 3)) * 0.1
    path = way_of(np.zeros(3), np.tile(moves, (30, 1)))
    found = fit_book([path, path[:1]], 1, 6, seed=0)  # a path that is too short says nothing
    assert found[0].tolist() == [0, 0, 0]
    order = np.argsort(found[1:, 0])
    np.testing.assert_allclose(found[1:][order], moves[np.argsort(moves[:, 0])], atol=1e-9)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("codec")
    small_store(folder)
    return folder / "store"


def test_windows_are_parts_of_recordings_half_of_them_mirrored(store: Path) -> None:
    opened = Store.open(store)
    contract = opened.contract(range(20))
    mended = replace(opened, frames=opened.frames + np.float32(1))
    windows = SixdWindows(opened, mended, (3, 5, 8), 16, 4, contract.mirror)
    book = fit_book(windows.sequences(), 4, 8, 0)
    drawn = windows.draw(60, book, np.random.default_rng(0))
    parts = {}
    for record in (3, 5, 8):
        found = opened.sequence(record)
        for start in range(len(found) - 16):
            part = np.array(found[start : start + 16])
            parts[part[:, 3:].tobytes()] = record, False
            parts[contract.mirror(part)[:, 3:].astype(np.float32).tobytes()] = record, True
    seen = [parts[given[:, 3:].numpy().tobytes()] for given in drawn.inputs]
    assert {record for record, _ in seen} == {3, 5, 8}
    # what is shown is the same part of the mended motions
    offset = (drawn.frames - drawn.inputs)[..., 3:].abs()
    torch.testing.assert_close(offset, torch.ones_like(offset))
    assert 15 < sum(mirrored for _, mirrored in seen) < 45
    assert drawn.moves.max() < 8
    with pytest.raises(DataError, match="shorter than 101 frames"):
        SixdWindows(opened, opened, (3, 5), 100, 4, contract.mirror)


def test_windows_of_rare_actions_are_drawn_oftener(store: Path) -> None:
    opened = Store.open(store)
    mirror = opened.contract(range(20)).mirror
    chosen = (0, 4, 8, 1)  # "walk" three times, "turn left" once
    lengths = np.array([len(opened.sequence(record)) - 16 for record in chosen], dtype=float)
    shown = np.sqrt([*[lengths[:3].sum()] * 3, lengths[3]])
    expected = lengths / shown / (lengths / shown).sum()
    np.testing.assert_allclose(SixdWindows(opened, opened, chosen, 16, 4, mirror).chances, expected)
    # where nothing is said of actions, each recording is one
    alone = SixdWindows(without_actions(opened), opened, chosen, 16, 4, mirror).chances
    np.testing.assert_allclose(alone, np.sqrt(lengths) / np.sqrt(lengths).sum())


def test_windows_of_what_is_badly_shown_are_drawn_oftener(store: Path) -> None:
    opened = Store.open(store)
    windows = SixdWindows(opened, opened, (0, 4, 8), 16, 4, opened.contract(range(20)).mirror)
    book, before = fit_book(windows.sequences(), 4, 8, 0), windows.chances
    middles = list(windows.middles(book))
    for record, window in zip((0, 4, 8), middles, strict=True):
        sequence = opened.sequence(record)
        np.testing.assert_array_equal(window.inputs[0], sequence[(len(sequence) - 16) // 2 :][:16])
    windows.favour(np.array([1.0, 4.0, 9.0]))
    np.testing.assert_allclose(windows.chances / before, np.array([1, 4, 9]) / (before @ [1, 4, 9]))
    tree = tree_of(opened.contract(range(20)))
    net = MotionCodec(CodecConfig(middles[0].inputs.shape[-1], tree, moves=8, width=12, blocks=1, fine=6)).eval()
    net.book.copy_(torch.from_numpy(book))
    off = []
    for window in middles:
        places = (net.decode(window.moves, net.encode(window.inputs)), window.frames)
        found, true = (places_in_world(net, one, window.way).detach().numpy()[0] for one in places)
        off.append(np.linalg.norm((found - found[:, :1]) - (true - true[:, :1]), axis=-1).mean() ** 2)
    np.testing.assert_allclose(badly_shown(net, windows), off, rtol=1e-4)


def test_a_run_learns_and_comes_back(store: Path, tmp_path: Path) -> None:
    longer = CODEC.replace("steps = 6", "steps = 120").replace("every = 3", "every = 40")
    run = trained("codec", longer, store, tmp_path / "run")
    lines = log_of(tmp_path / "run")
    assert [line["step"] for line in lines] == [40, 80, 120]
    assert lines[-1]["loss"] < 0.9 * lines[0]["loss"]
    assert lines[-1]["validation"] < lines[0]["validation"]
    assert 0 < lines[-1]["used"] <= 1
    net = run.model
    assert isinstance(net, MotionCodec)
    assert not net.book[0].any()
    assert len(net.book.unique(dim=0)) == 8
    assert (run.manifest["verb"], run.manifest["model"]) == ("codec", "motion-codec")
    assert len(net.config.tree.parents) == len(SKELETON.joints)


def test_resumed_training_is_the_same_to_the_bit(store: Path, tmp_path: Path) -> None:
    check_resumed(partial(trained, "codec", CODEC, store), tmp_path, "--steps", 3)


def test_a_decoder_is_trained_on_while_its_codes_stay(store: Path, tmp_path: Path) -> None:
    first = trained("codec", CODEC, store, tmp_path / "first")
    second = trained("codec", CODEC, store, tmp_path / "second", "--preset", "decoder", "--start", tmp_path / "first")
    before, after = (run.model.state_dict() for run in (first, second))
    kept = [name for name in before if not name.startswith("decoder.")]
    assert all(torch.equal(before[name], after[name]) for name in kept)
    assert {"book", "encoder.spread.running_mean"} <= set(kept)
    assert not same(before, after)
    assert second.manifest["training"]["start"]["command"] == first.manifest["training"]["command"]


def test_a_whole_codec_is_trained_on_but_for_its_moves(store: Path, tmp_path: Path) -> None:
    first = trained("codec", CODEC, store, tmp_path / "first")
    second = trained("codec", CODEC, store, tmp_path / "second", "--preset", "wider", "--start", tmp_path / "first")
    before, after = (run.model.state_dict() for run in (first, second))
    changed = {name.partition(".")[0] for name in before if not torch.equal(before[name], after[name])}
    assert changed == {"encoder", "decoder"}


def test_only_frames_that_can_be_coded_are_trained_on(tmp_path: Path) -> None:
    angles_store(tmp_path)
    command = ("train", "codec", "--data", tmp_path / "store", "--out", tmp_path / "run")
    refused("a codec is trained on root_sixd", *command)
    assert not (tmp_path / "run").exists()
