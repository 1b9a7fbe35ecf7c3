"""Systems that predict frame by frame: what all of them have in common, and their encoder and step graphs.

Letters in shapes: B rows, L seed frames, N predicted frames, T frames, C channels of the contract, D of them that vary.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import torch
from torch import Tensor, nn

from motet.bundle.graph import GraphSpec, TensorSpec
from motet_train.models.net import Net, Part, normalised

State = dict[str, Tensor]
"""What a system knows, by name; each (B, ...)."""

Shapes = Mapping[str, tuple[int, ...]]


class System(nn.Module, ABC):
    """What a published system computes, on normalised frames of D channels.

    carried, constant: name in the state -> shape of a row; of what changes with every frame, and what the seed decides.
    """

    carried: Shapes
    constant: Shapes = MappingProxyType({})

    @abstractmethod
    def begin(self, seed: Tensor) -> State:
        """The state after the seed frames (B, L, D), the last of which has been pushed."""

    @abstractmethod
    def predict(self, state: State) -> tuple[Tensor, State]:
        """The next frame (B, D), and what changes in the state before that frame is pushed."""

    @abstractmethod
    def push(self, state: State, frame: Tensor) -> State:
        """What is carried over after a frame (B, D), a predicted or a true one."""

    def progress(self, share: float) -> None:
        """Told before each step of training which share of it is done; for what changes on the way."""

    def imagine(self, windows: Tensor, seed_frames: int) -> Tensor:
        """The frames (B, N, D) that training predicts for whole windows (B, L + N, D): here those of a free run."""
        return free_run(self, windows[:, :seed_frames], windows.shape[1] - seed_frames)

    def error(self, predicted: Tensor, truth: Tensor) -> Tensor:
        """How far predicted frames (B, N, D) are from true ones, in training: here the mean square."""
        return (predicted - truth).square().mean()

    def loss(self, windows: Tensor, seed_frames: int) -> Tensor:
        """What training makes small, of whole windows (B, L + N, D): here the :meth:`error` of :meth:`imagine`."""
        return self.error(self.imagine(windows, seed_frames), windows[:, seed_frames:])


class Taught(System):
    """A system that learns the frame after each true one, those of the seed too.

    noise: std, in normalised units, of what is added to the true frames in training (Jain et al. 2016, section 4.1), so
    that the net learns to return from its own errors.
    """

    noise = 0.0

    @abstractmethod
    def follow(self, frames: Tensor) -> tuple[Tensor, State]:
        """For true frames (B, T, D) what is predicted after each (B, T, D), and what is carried over after all."""

    def progress(self, share: float) -> None:
        """The noise grows over the training."""
        self.noise = noise_at(share)

    def loss(self, windows: Tensor, seed_frames: int) -> Tensor:
        """The mean squared error of the frame after each of the true ones, which are noisy in training."""
        seen = noisy(windows[:, :-1], self.noise if self.training else 0.0)
        return self.error(self.follow(seen)[0], windows[:, 1:])


def noise_at(share: float) -> float:
    """The std at this share of the training, 0 to 1, by the settings that Jain et al. 2016 published with their code.

    (iteration from which it holds, std), of 4,000 iterations, which the paper does not say; so the last fifth has most.
    """
    schedule = ((3300, 0.7), (2500, 0.5), (2000, 0.3), (1300, 0.2), (1000, 0.1), (500, 0.05), (250, 0.01))
    return next((std for iteration, std in schedule if share * 4000 >= iteration), 0.0)


def noisy(frames: Tensor, std: float) -> Tensor:
    """Frames (..., D), half of them, drawn afresh at each call, with Gaussian noise; as they are where ``std`` is 0."""
    if std == 0:
        return frames
    chosen = torch.rand_like(frames[..., :1]) < 0.5  # as in the authors' code; the paper does not say
    return frames + std * chosen * torch.randn_like(frames)


def free_run(system: System, seed: Tensor, count: int, truth: Tensor | None = None, own: float = 1.0) -> Tensor:
    """The ``count`` frames (B, N, D) that follow the seed frames (B, L, D).

    truth: the true frames (B, N, D), mixed into those that are fed back, of which ``own`` is the share that was
        predicted (Li et al. 2018, eq. 10).
    """
    state, frames = system.begin(seed), []
    for n in range(count):
        frame, carried = system.predict(state)
        frames.append(frame)
        pushed = frame if truth is None else own * frame + (1 - own) * truth[:, n]
        state = {**state, **system.push({**state, **carried}, pushed)}
    return torch.stack(frames, dim=1)


class Stepwise(Net):
    """A system with its units: frames of all channels, in those of the contract.

    kept: the channels that vary; others stay as they are in the last seed frame. mean, scale: (D,) of the kept ones.
    """

    kept: Tensor
    placing: Tensor

    def __init__(self, system: System, channels: int, kept: Sequence[int], seed_frames: int) -> None:
        super().__init__(len(kept))
        self.system, self.channels, self.seed_frames = system, channels, seed_frames
        self.register_buffer("kept", torch.tensor(kept), persistent=False)
        self.register_buffer("placing", torch.eye(channels)[list(kept)], persistent=False)

    def normalised(self, frames: Tensor) -> Tensor:
        """Frames (..., C) in the contract's units to (..., D)."""
        return normalised(frames[..., self.kept], self.mean, self.scale)

    def _whole(self, normal: Tensor, still: Tensor) -> Tensor:
        """Normalised frames (..., D) and channels that do not vary (..., C), the others 0 there, to frames (..., C)."""
        return still + (normal * self.scale + self.mean) @ self.placing

    def _still(self, frames: Tensor) -> Tensor:
        """The channels of the last of the frames (B, L, C) that do not vary, and 0 for the others: (B, C)."""
        return frames[:, -1] * (1 - self.placing.sum(0))

    def forward(self, frames: Tensor, count: int) -> Tensor:
        """Seed frames (B, L, C) to the next ``count`` ones (B, N, C), both in the contract's units."""
        return self._whole(free_run(self.system, self.normalised(frames), count), self._still(frames)[:, None])

    def encode(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Seed frames (B, L, C) to all that the step takes, context and state."""
        state = self.system.begin(self.normalised(frames))
        context = torch.cat([self._still(frames), *_rows(state, self.system.constant)], dim=1)
        return context, torch.cat(_rows(state, self.system.carried), dim=1)

    def step(self, context: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """Context and state to the next frame (B, C) and the next state."""
        system, channels = self.system, self.channels
        known = {**_parts(state, system.carried), **_parts(context[:, channels:], system.constant)}
        frame, carried = system.predict(known)
        after = system.push({**known, **carried}, frame)
        return self._whole(frame, context[:, :channels]), torch.cat(_rows(after, system.carried), dim=1)

    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """The encoder and the step, each with its contract.

        What carries over is one tensor, ``state``; what the seed alone decides another, ``context``, which begins with
        the channels that do not vary.
        """
        carried, constant = (sum(map(math.prod, s.values())) for s in (self.system.carried, self.system.constant))
        frames = TensorSpec("frames", ("batch", self.seed_frames, self.channels))
        frame = TensorSpec("frame", ("batch", self.channels))
        context = TensorSpec("context", ("batch", self.channels + constant))
        state, following = (TensorSpec(name, ("batch", carried)) for name in ("state", "next_state"))
        step = GraphSpec((context, state), (frame, following), {state.name: following.name})
        encoder = GraphSpec((frames,), (context, state))
        return {"encoder": (Part(self, self.encode), encoder), "step": (Part(self, self.step), step)}


def _rows(state: State, shapes: Shapes) -> list[Tensor]:
    return [state[name].flatten(1) for name in shapes]


def _parts(rows: Tensor, shapes: Shapes) -> State:
    parts = torch.split_with_sizes(rows, [math.prod(shape) for shape in shapes.values()], dim=1)
    return {name: part.view(-1, *shapes[name]) for name, part in zip(shapes, parts, strict=True)}
