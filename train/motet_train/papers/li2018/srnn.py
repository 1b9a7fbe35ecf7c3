"""The structural RNN of Jain et al. 2016: body parts as nodes of a graph, an RNN for each type of node and of edge.

Letters in shapes: T frames, B rows, D channels, K members of a type, F features, U units.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from motet_train.data.errors import DataError
from motet_train.papers.li2018.expmap import Layout
from motet_train.papers.li2018.stepwise import State, Taught

Tensors = dict[str, Tensor]
"""Name of a type -> what its members have, (T, B, K, F)."""

Halves = tuple[Tensor, Tensor]
"""Hidden units and memory of the members of a type, each (B, K, U)."""

LIMBS = ("arm", "leg")
NODES = {"spine": 1, "arm": 2, "leg": 2}
"""Type -> its members; of limbs the left one, then the right one."""

EDGES = {"spine": 1, "arm": 2, "leg": 2, "spine_arm": 3, "spine_leg": 3, "arm_arm": 2, "leg_leg": 2}
"""Type -> its members, the nodes that it leads to; the first three lead from the frame before."""


@dataclass(frozen=True)
class Config:
    """Sizes of the net; the defaults are the paper's (section 4.1).

    parts: which of the D channels are the spine, left arm, right arm, left leg and right leg; each is in one part.
    linear: units of the edges' two fully connected layers, and of the nodes' first one. units: of each LSTM. narrow:
    units of the nodes' second fully connected layer.
    """

    dimensions: int
    parts: tuple[tuple[int, ...], ...]
    linear: int = 256
    units: int = 512
    narrow: int = 100


def parts_of(layout: Layout, kept: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """The parts for :class:`Config`: places, among the kept columns, of the five parts.

    The layout's pairs are the legs and the arms; all else is the spine. DataError where it has no such pairs, or
    where left and right do not keep the same columns.
    """
    if len(layout.pairs) != 2:
        raise DataError(f"{layout.name} does not say which columns are legs and arms: its layout needs two pairs")
    limbs: list[tuple[int, ...]] = []
    for left, right, width in reversed(layout.pairs):
        both = [[n for n, c in enumerate(kept) if start <= c < start + width] for start in (left, right)]
        if [kept[n] - left for n in both[0]] != [kept[n] - right for n in both[1]]:
            raise DataError(f"{layout.name}: columns kept from {left} and from {right} on are not the same ones")
        limbs += map(tuple, both)
    return (tuple(n for n in range(len(kept)) if not any(n in limb for limb in limbs)), *limbs)


class Edge(nn.Module):
    """FC-FC-LSTM (section 4.1); the first layer is rectified, the second linear (the authors' code)."""

    def __init__(self, features: int, config: Config) -> None:
        super().__init__()
        self.inward = nn.Linear(features, config.linear)
        self.hidden = nn.Linear(config.linear, config.linear)
        self.lstm = nn.LSTM(config.linear, config.units)

    def forward(self, x: Tensor, state: Halves) -> tuple[Tensor, Halves]:
        """Features (T, B, K, F) and state to outputs (T, B, K, U) and the state after them."""
        return _along(self.lstm, self.hidden(_exact(self.inward, x).relu()), state)


class Node(nn.Module):
    """LSTM-FC-FC-FC (section 4.1); all but the last layer are rectified (the authors' code)."""

    def __init__(self, features: int, config: Config) -> None:
        super().__init__()
        self.lstm = nn.LSTM(features + 3 * config.units, config.units)
        layers = nn.Linear(config.units, config.linear), nn.ReLU(), nn.Linear(config.linear, config.narrow), nn.ReLU()
        self.hidden = nn.Sequential(*layers)
        self.outward = nn.Linear(config.narrow, features)

    def forward(self, x: Tensor, state: Halves) -> tuple[Tensor, Halves]:
        """Features and three edges' outputs (T, B, K, F + 3 U) and state to the next (T, B, K, F) and the state."""
        out, state = _along(self.lstm, x, state)
        return _exact(self.outward, self.hidden(out)), state


def _exact(layer: nn.Linear, x: Tensor) -> Tensor:
    """The layer in float32, in mixed precision too: a frame differs from the next by less than bfloat16 resolves."""
    if not torch.is_autocast_enabled(x.device.type):  # keeps the switch out of exported graphs
        return layer(x)  # type: ignore[no-any-return]
    with torch.autocast(x.device.type, enabled=False):
        return layer(x.float())  # type: ignore[no-any-return]


def _along(lstm: nn.LSTM, x: Tensor, state: Halves) -> tuple[Tensor, Halves]:
    """Members as rows of one LSTM: (T, B, K, F) and state to (T, B, K, U) and the state after them."""
    steps, rows, members, _ = x.shape
    before = tuple(half.reshape(1, -1, lstm.hidden_size).contiguous() for half in state)  # export needs the strides
    out, (hidden, memory) = lstm(x.flatten(1, 2), before)
    after = hidden.reshape(rows, members, -1), memory.reshape(rows, members, -1)
    return out.reshape(steps, rows, members, -1), after


class SRNN(Taught):
    """Seven edge RNNs and three node RNNs; the frame itself is predicted, not how it changes (section 4.1).

    Left and right share their RNNs. The state holds the last two frames, and hidden units and memory (2 U) of each
    member of each RNN before the last frame.
    """

    def __init__(self, config: Config) -> None:
        super().__init__()
        self.config = config
        spine, *limbs = config.parts
        widths = {"spine": len(spine), "arm": len(limbs[0]), "leg": len(limbs[2])}
        both = {name: sum(widths[end] for end in name.split("_")) for name in EDGES if "_" in name}
        features = {**{name: 2 * width for name, width in widths.items()}, **both}
        self.edges = nn.ModuleDict({name: Edge(features[name], config) for name in EDGES})
        self.nodes = nn.ModuleDict({name: Node(widths[name], config) for name in NODES})
        self.carried = {
            **dict.fromkeys(("previous", "last"), (config.dimensions,)),
            "edges": (sum(EDGES.values()), 2 * config.units),
            "nodes": (sum(NODES.values()), 2 * config.units),
        }
        for name, parts in {"spine": [spine], "arm": limbs[:2], "leg": limbs[2:]}.items():
            self.register_buffer(name, torch.tensor(parts), persistent=False)
        order = torch.tensor([channel for part in config.parts for channel in part])
        self.register_buffer("places", order.argsort(), persistent=False)

    def begin(self, seed: Tensor) -> State:
        """The RNNs have seen all of the seed frames, two at least, but the last one."""
        return {**self.follow(seed[:, :-1])[1], "previous": seed[:, -2], "last": seed[:, -1]}

    def predict(self, state: State) -> tuple[Tensor, State]:
        """What the RNNs say after the last frame, and their state."""
        found, after = self._run(state["last"][None], state["previous"][None], state["edges"], state["nodes"])
        return found[0], after

    def push(self, state: State, frame: Tensor) -> State:
        """The frame is the last one now; the RNNs' state is that of the prediction."""
        return {**state, "previous": state["last"], "last": frame}

    def follow(self, frames: Tensor) -> tuple[Tensor, State]:
        """As of all that are taught; before the first frame there was the same one."""
        before = torch.cat([frames[:, :1], frames[:, :-1]], dim=1)
        edges, nodes = (frames.new_zeros(frames.shape[0], *self.carried[name]) for name in ("edges", "nodes"))
        found, after = self._run(frames.transpose(0, 1), before.transpose(0, 1), edges, nodes)
        return found.transpose(0, 1), after

    def _run(self, now: Tensor, before: Tensor, edges: Tensor, nodes: Tensor) -> tuple[Tensor, State]:
        """Frames and those before them (T, B, D) and the RNNs' states to the predicted frames (T, B, D) and states."""
        features, earlier = ({n: frames[..., self.get_buffer(n)] for n in NODES} for frames in (now, before))
        told, edges = _each(self.edges, _concatenated(features, earlier), edges)
        found, nodes = _each(self.nodes, _known(features, told), nodes)
        frames = torch.cat([part.flatten(2) for part in found.values()], dim=2)
        return frames[..., self.get_buffer("places")], {"edges": edges, "nodes": nodes}


def _each(rnns: nn.ModuleDict, given: Tensors, state: Tensor) -> tuple[Tensors, Tensor]:
    """What each RNN makes of what it is given, and the states of all after it, from those before it (B, K, 2 U)."""
    members = [given[name].shape[2] for name in rnns]
    halves = [torch.split_with_sizes(half, members, dim=1) for half in state.chunk(2, dim=-1)]
    found, ends = {}, []
    for (name, rnn), hidden, memory in zip(rnns.items(), *halves, strict=True):
        found[name], after = rnn(given[name], (hidden, memory))
        ends.append(after)
    return found, torch.cat([torch.cat(half, dim=1) for half in zip(*ends, strict=True)], dim=-1).float()


def _concatenated(now: Tensors, before: Tensors) -> Tensors:
    """The edges' features: those of both nodes, summed over edges of one type to one node (the authors' code)."""
    found = {name: torch.cat([before[name], now[name]], dim=-1) for name in NODES}
    for limb in LIMBS:
        pair = now[limb]
        spine = torch.cat([now["spine"].expand(-1, -1, 2, -1), pair], dim=-1)
        found[f"spine_{limb}"] = torch.cat([spine.sum(2, keepdim=True), spine], dim=2)
        found[f"{limb}_{limb}"] = torch.cat([pair, pair.flip(2)], dim=-1)
    return found


def _known(features: Tensors, told: Tensors) -> Tensors:
    """What each node is given: its features and what the edges that lead to it tell."""
    spine = [told["spine"], *(told[f"spine_{limb}"][:, :, :1] for limb in LIMBS)]
    limbs = {limb: [told[limb], told[f"spine_{limb}"][:, :, 1:], told[f"{limb}_{limb}"]] for limb in LIMBS}
    return {name: torch.cat([features[name], *rest], dim=-1) for name, rest in {"spine": spine, **limbs}.items()}
