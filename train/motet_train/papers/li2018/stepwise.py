"""Systems that predict frame by frame: their common interface, and their encoder and step graphs.

Letters in shapes: B rows, L seed frames, N predicted frames, T frames, C channels of the contract, D of them that vary.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import torch
from torch import Tensor, nn

from motet.bundle.graph import GraphSpec
from motet_train.models.net import Graphs, Net, constants, encoder_and_step, float_rows, normalised

State = dict[str, Tensor]
"""The state of a system by name, each part (B, ...)."""

Shapes = Mapping[str, tuple[int, ...]]


class System(nn.Module, ABC):
    """A published system, on normalised frames of D channels.

    carried, constant: name in the state -> shape of a row, of parts that change with every frame, and parts that depend
    on the seed alone.
    """

    carried: Shapes
    constant: Shapes = MappingProxyType({})

    @abstractmethod
    def begin(self, seed: Tensor) -> State:
        """The state after the seed frames (B, L, D), the last of which has been pushed."""

    @abstractmethod
    def predict(self, state: State) -> tuple[Tensor, State]:
        """The next frame (B, D), and changes of the state before that frame is pushed."""

    @abstractmethod
    def push(self, state: State, frame: Tensor) -> State:
        """The carried state after a frame (B, D), predicted or true."""

    def progress(self, share: float) -> None:
        """Called before each training step with the share of the training that is done, for settings that change."""

    def imagine(self, windows: Tensor, seed_frames: int) -> Tensor:
        """The frames (B, N, D) predicted in training for windows (B, L + N, D): by default those of a free run."""
        return free_run(self, windows[:, :seed_frames], windows.shape[1] - seed_frames)

    def error(self, predicted: Tensor, truth: Tensor) -> Tensor:
        """The training error of predicted frames (B, N, D): by default the mean square."""
        return (predicted - truth).square().mean()

    def loss(self, windows: Tensor, seed_frames: int) -> Tensor:
        """The training loss of whole windows (B, L + N, D): by default the :meth:`error` of :meth:`imagine`."""
        return self.error(self.imagine(windows, seed_frames), windows[:, seed_frames:])


class Taught(System):
    """A system trained by teacher forcing: it learns the frame after each true one, also within the seed.

    noise: std, in normalised units, of noise on the true frames in training (Jain et al. 2016, section 4.1), so that
    the net learns to recover from its own errors.
    """

    noise = 0.0

    @abstractmethod
    def follow(self, frames: Tensor) -> tuple[Tensor, State]:
        """The predictions (B, T, D) after each of true frames (B, T, D), and the carried state after all of them."""

    def progress(self, share: float) -> None:
        """The noise grows over the training."""
        self.noise = noise_at(share)

    def loss(self, windows: Tensor, seed_frames: int) -> Tensor:
        """The mean squared error of the predictions after each true frame; these are noisy in training."""
        seen = noisy(windows[:, :-1], self.noise if self.training else 0.0)
        return self.error(self.follow(seen)[0], windows[:, 1:])


def noise_at(share: float) -> float:
    """The std of the noise at a share of the training, 0 to 1, from the code of Jain et al. 2016.

    Their schedule is for 4,000 iterations, a number that the paper does not state.
    """
    # first iteration, and std from then on
    schedule = ((3300, 0.7), (2500, 0.5), (2000, 0.3), (1300, 0.2), (1000, 0.1), (500, 0.05), (250, 0.01))
    return next((std for iteration, std in schedule if share * 4000 >= iteration), 0.0)


def noisy(frames: Tensor, std: float) -> Tensor:
    """Frames (..., D) with Gaussian noise on a random half of them; unchanged if ``std`` is 0."""
    if std == 0:
        return frames
    chosen = torch.rand_like(frames[..., :1]) < 0.5  # as in the authors' code; not stated in the paper
    return frames + std * chosen * torch.randn_like(frames)


def free_run(system: System, seed: Tensor, count: int, truth: Tensor | None = None, share: float = 1.0) -> Tensor:
    """The ``count`` frames (B, N, D) that follow the seed frames (B, L, D).

    truth: true frames (B, N, D) to mix into those fed back, in which ``share`` is that of the predicted frame, eta in
    Li et al. 2018, eq. 10.
    """
    state = system.begin(seed)
    frames = []
    for n in range(count):
        frame, carried = system.predict(state)
        frames.append(frame)
        pushed = frame if truth is None else share * frame + (1 - share) * truth[:, n]
        state = {**state, **system.push({**state, **carried}, pushed)}
    return torch.stack(frames, dim=1)


class Stepwise(Net):
    """A system with its normalisation: frames of all channels, in the contract's units.

    kept: the channels that vary; others stay as in the last seed frame. mean, scale: (D,) of the kept ones.
    """

    kept: Tensor
    placing: Tensor

    def __init__(self, system: System, channels: int, kept: Sequence[int], seed_frames: int) -> None:
        super().__init__(len(kept))
        self.system = system
        self.channels = channels
        self.seed_frames = seed_frames
        constants(self, kept=torch.tensor(kept), placing=torch.eye(channels)[list(kept)])

    def normalised(self, frames: Tensor) -> Tensor:
        """Frames (..., C) in the contract's units to (..., D)."""
        return normalised(frames[..., self.kept], self.mean, self.scale)

    def _whole(self, normal: Tensor, still: Tensor) -> Tensor:
        """Frames (..., C) from normalised ones (..., D), and constant channels (..., C) in which the others are 0."""
        return still + (normal * self.scale + self.mean) @ self.placing

    def _still(self, frames: Tensor) -> Tensor:
        """The constant channels of the last of frames (B, L, C), and 0 for the others: (B, C)."""
        return frames[:, -1] * (1 - self.placing.sum(0))

    def forward(self, frames: Tensor, count: int) -> Tensor:
        """Seed frames (B, L, C) to the next ``count`` ones (B, N, C), both in the contract's units."""
        predicted = free_run(self.system, self.normalised(frames), count)
        return self._whole(predicted, self._still(frames)[:, None])

    def encode(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Seed frames (B, L, C) to the inputs of the step, context and state."""
        state = self.system.begin(self.normalised(frames))
        context = torch.cat([self._still(frames), *_rows(state, self.system.constant)], dim=1)
        return context, torch.cat(_rows(state, self.system.carried), dim=1)

    def step(self, context: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """Context and state to the next frame (B, C) and the next state."""
        system = self.system
        known = _parts(state, system.carried) | _parts(context[:, self.channels :], system.constant)
        frame, carried = system.predict(known)
        after = system.push({**known, **carried}, frame)
        whole = self._whole(frame, context[:, : self.channels])
        return whole, torch.cat(_rows(after, system.carried), dim=1)

    def graphs(self) -> Graphs:
        """The encoder and the step, each with its contract.

        The carried parts of the state are one tensor, ``state``; those that depend on the seed alone are another,
        ``context``, which begins with the constant channels.
        """
        # the widths of state and context
        carried = sum(map(math.prod, self.system.carried.values()))
        constant = sum(map(math.prod, self.system.constant.values()))
        # their tensors
        frames = float_rows("frames", self.seed_frames, self.channels)
        frame = float_rows("frame", self.channels)
        context = float_rows("context", self.channels + constant)
        state = float_rows("state", carried)
        next_state = float_rows("next_state", carried)
        step = GraphSpec((context, state), (frame, next_state), {"state": "next_state"})
        encoder = GraphSpec((frames,), (context, state))
        return encoder_and_step(self, encoder, step)


def _rows(state: State, shapes: Shapes) -> list[Tensor]:
    return [state[name].flatten(1) for name in shapes]


def _parts(rows: Tensor, shapes: Shapes) -> State:
    parts = torch.split_with_sizes(rows, [math.prod(shape) for shape in shapes.values()], dim=1)
    return {name: part.view(-1, *shapes[name]) for name, part in zip(shapes, parts, strict=True)}
