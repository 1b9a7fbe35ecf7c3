"""Recordings as codes: every one once through a codec, as it is and mirrored."""

import numpy as np
import torch
from numpy.typing import NDArray

from motet.representation.base import FrameMirror
from motet_train.data.sentences import Actions
from motet_train.data.sixd_windows import CodedMotion, Codes, poses_of, with_way
from motet_train.data.store import Store
from motet_train.models.codec import MotionCodec

MIRRORED = (False, True)


@torch.no_grad()
def coded(
    store: Store, records: tuple[int, ...], codec: MotionCodec, actions: Actions, mirror: FrameMirror
) -> list[CodedMotion]:
    """Every span of some records, as it is and mirrored, by a codec."""
    found = []
    for record in records:
        entry = store.records[record]
        for start, stop in entry.spans:
            frames = np.array(store.frames[start:stop], np.float64)
            for mirrored in MIRRORED:
                codes = codes_of(codec, mirror(frames) if mirrored else frames, store.fps)
                if not len(codes):
                    continue
                ended = _end(codes, codec.config.moves) if entry.ends else codes
                found.append(CodedMotion(ended, actions.of[record, mirrored], entry.starts, start == entry.spans[0][0]))
    return found


def codes_of(codec: MotionCodec, frames: NDArray[np.float64], fps: float) -> Codes:
    """Frames (T, D) to codes (N, P), what is left over of the last step left out."""
    hop = codec.config.hop
    frames = frames[: len(frames) // hop * hop]
    if not len(frames):
        return np.empty((0, codec.config.groups + 1), dtype=np.int64)
    poses = poses_of(frames, fps)
    poses = np.concatenate([poses, 2 * poses[-1:] - poses[-2:-1]])  # goes on as it went
    _, moves, _ = with_way(frames, poses, codec.book.numpy().astype(np.float64), hop)
    body = codec.to_codes(codec.encode(torch.from_numpy(frames).float()[None]))[0].numpy()
    return np.concatenate([moves[:, None], body], axis=1)


def _end(codes: Codes, end: int) -> Codes:
    last = np.zeros((1, codes.shape[1]), dtype=np.int64)
    last[0, 0] = end
    return np.concatenate([codes, last])
