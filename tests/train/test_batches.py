from dataclasses import replace

import numpy as np
import pytest
import torch
from language_data import small_store, walker

from motet.motion.mirroring import mirror
from motet.representation.root_block import to_root_block
from motet.text.vocabulary import NEW_MODEL_RULES
from motet_train.data.batches import Batch, Examples, examples, frame_mirror
from motet_train.data.errors import DataError
from motet_train.data.sentences import mirror_text
from motet_train.data.store import Store
from motet_train.recipes.language import divided


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    return small_store(tmp_path_factory.mktemp("corpus"))


@pytest.fixture(scope="module")
def data(store: Store) -> Examples:
    found = divided(store, mirror=False)
    return found.examples(found.parts.train)


def rows(batches: list[Batch]) -> list[tuple[bytes, tuple[int, ...]]]:
    """The frames and words of every row, without padding."""
    found = []
    for batch in batches:
        for frames, length, words in zip(
            batch.frames.numpy(), batch.lengths.tolist(), batch.words.tolist(), strict=True
        ):
            assert not frames[length:].any()
            found.append((frames[:length].tobytes(), tuple(word for word in words if word)))
    return found


def expected(data: Examples, record: int, offset: int) -> tuple[bytes, set[tuple[int, ...]]]:
    frames = data.store.sequence(data.records[record], offset)
    return frames.tobytes(), {tuple(ids.tolist()) for ids in data.sentences[record]}


def test_an_epoch_visits_every_motion_at_every_offset_once(data: Examples) -> None:
    batches = list(data.epoch(np.random.default_rng(0), 5))
    assert max(len(batch.lengths) for batch in batches) == 5
    assert batches[0].frames.dtype == torch.float32
    sentences = {expected(data, i, k)[0]: expected(data, i, k)[1] for i in range(len(data.records)) for k in range(3)}
    found = rows(batches)
    assert sorted(frames for frames, _ in found) == sorted(sentences)
    assert all(words in sentences[frames] for frames, words in found)


def test_an_epoch_of_pairs_visits_every_sentence_of_every_motion_at_every_offset_once(data: Examples) -> None:
    pairs = []
    for i in range(len(data.records)):
        for k in range(3):
            frames, _ = expected(data, i, k)
            pairs += [(frames, tuple(ids.tolist())) for ids in data.sentences[i]]
    assert sorted(rows(list(data.epoch(np.random.default_rng(0), 5, pairs=True)))) == sorted(pairs)


def test_batches_depend_on_the_generator_alone_and_differ_between_epochs(data: Examples) -> None:
    one, same, other = (rows(list(data.epoch(np.random.default_rng(seed), 4))) for seed in (1, 1, 2))
    assert one == same
    assert one != other


def test_so_many_offsets_are_drawn(data: Examples) -> None:
    rng = np.random.default_rng(0)
    drawn = [{frames for frames, _ in rows(list(data.epoch(rng, 8, offsets=1)))} for _ in range(8)]
    assert {len(frames) for frames in drawn} == {len(data.records)}
    assert len(set.union(*drawn)) > 2 * len(data.records)


def frame_size(data: Examples) -> int:
    """Bytes of a frame."""
    return data.store.frames.itemsize * data.store.frames.shape[1]


def test_of_a_long_motion_a_part_is_taken(data: Examples) -> None:
    rng = np.random.default_rng(0)
    whole = [data.store.sequence(record, k).tobytes() for record in data.records for k in range(3)]
    places: list[set[int]] = [set() for _ in whole]
    batches = [batch for _ in range(9) for batch in data.epoch(rng, 8, windows=(9, 9))]
    ends = [end for batch in batches for end in batch.ended.tolist()]  # type: ignore[union-attr]
    for (frames, _), ended in zip(rows(batches), ends, strict=True):
        found = next(i for i, motion in enumerate(whole) if frames in motion)
        assert len(frames) == min(len(whole[found]), 9 * frame_size(data))
        assert ended == whole[found].endswith(frames)
        places[found].add(whole[found].index(frames))
    assert max(map(len, places)) > 1
    limits = {batch.frames.shape[1] for _ in range(9) for batch in data.epoch(rng, 8, windows=(2, 6))}
    assert limits == {2, 3, 4, 5, 6}
    assert [len(motion) for motion, _ in rows(list(data.everything(4, longest=9)))] == sorted(
        min(9, len(data.store.sequence(r, 0))) * frame_size(data) for r in data.records for _ in range(3)
    )


def test_little_is_padding(data: Examples) -> None:
    batches = list(data.epoch(np.random.default_rng(0), 4))
    padding = sum(batch.frames.shape[0] * batch.frames.shape[1] - int(batch.lengths.sum()) for batch in batches)
    assert padding < 0.05 * sum(int(batch.lengths.sum()) for batch in batches)


def test_validation_sees_every_sentence_of_every_motion(data: Examples) -> None:
    found = rows(list(data.everything(7)))
    pairs = [expected(data, i, 0) for i in range(len(data.records))]
    assert sorted(found) == sorted((frames, words) for frames, sentences in pairs for words in sentences)


def test_frames_are_mirrored_as_the_motion_is(store: Store) -> None:
    motion = walker(3, 30).resample(10)
    contract = store.contract(range(4))
    frames, expected = (to_root_block(m).select(contract.channels).values for m in (motion, mirror(motion)))
    np.testing.assert_allclose(frame_mirror(contract)(frames), expected, atol=1e-9)


def test_motion_and_sentence_are_mirrored_together(store: Store) -> None:
    found = divided(store, mirror=True)
    data = found.examples(found.parts.train)
    batch = next(data.epoch(np.random.default_rng(0), len(data.records), offsets=1))
    plain = {data.store.sequence(r, k).tobytes(): store.records[r] for r in data.records for k in range(3)}
    mirrored = {
        found.mirror(data.store.sequence(r, k)).tobytes(): store.records[r] for r in data.records for k in range(3)
    }  # type: ignore[misc]
    seen = [0, 0]
    for frames, words in rows([batch]):
        side = int(frames in mirrored)
        seen[side] += 1
        texts = [
            (NEW_MODEL_RULES.normalise, mirror_text)[side](s) for s in (mirrored if side else plain)[frames].sentences
        ]
        assert found.vocabulary.decode(words) in texts
    assert min(seen) > 0.2 * sum(seen)


def test_vocabulary_and_statistics_are_the_training_parts(store: Store) -> None:
    found = divided(store, mirror=False)
    odd = {f"odd{chr(97 + i)}" for i in found.parts.train if i % 5 == 0}
    assert {word for word in found.vocabulary.words if word.startswith("odd")} == odd
    frames = np.concatenate([store.sequence(r, k) for r in found.parts.train for k in range(3)], dtype=np.float64)
    np.testing.assert_allclose(found.contract.mean, frames.mean(axis=0), atol=1e-6)


def test_sentences_that_cannot_be_used_are_left_out(store: Store) -> None:
    vocabulary = divided(store, mirror=False).vocabulary
    entries = [replace(store.records[0], sentences=s) for s in (("?!", "walks"), ("zzz",), ("walks " * 41,))]
    kept = examples(replace(store, records=tuple(entries)), (0, 1, 2), vocabulary, None)
    assert kept.records == (0,)
    assert [len(sentences) for sentences in kept.sentences] == [1]
    with pytest.raises(DataError, match="none of 2 motions has a sentence of 1 to 40 words"):
        examples(replace(store, records=tuple(entries)), (1, 2), vocabulary, None)


def test_what_cannot_be_mirrored_is_refused(store: Store) -> None:
    contract = store.contract((0,))
    with pytest.raises(DataError, match="no skeleton"):
        frame_mirror(replace(contract, skeleton=None))
    one_sided = tuple(name for name in contract.channels if name != "left_leg.rx")
    with pytest.raises(DataError, match="cannot be mirrored"):
        frame_mirror(replace(contract, channels=one_sided, units=contract.units[: len(one_sided)]))


@pytest.mark.parametrize(
    ("sentence", "mirrored"),
    [
        ("A person turns Left.", "a person turns right"),
        ("walks to the right after 2 steps", "walks to the left after 2 steps"),
        ("turns left at a right angle", "turns right at a right angle"),
        ("leans rightwards, leftmost, and counter-clockwise", "leans leftwards rightmost and clockwise"),
        ("turns clockwise", "turns counterclockwise"),
        ("jumps upright", "jumps upright"),
    ],
)
def test_sentences_are_mirrored(sentence: str, mirrored: str) -> None:
    assert mirror_text(sentence) == mirrored
    assert mirror_text(mirrored) == NEW_MODEL_RULES.normalise(sentence)
