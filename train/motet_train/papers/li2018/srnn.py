"""The structural RNN of Jain et al. 2016: body parts as nodes of a graph, an RNN for each type of node and of edge.

Letters in shapes: T frames, B rows, D channels, K members of a type, F features, U units.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import torch
from torch import Tensor, nn

from motet_train.data.errors import DataError
from motet_train.models.net import constants
from motet_train.papers.li2018.expmap import Layout
from motet_train.papers.li2018.stepwise import State, Taught

Tensors = dict[str, Tensor]
"""Name of a type -> values of its members, (T, B, K, F)."""

Halves = tuple[Tensor, Tensor]
"""Hidden units and memory of the members of a type, each (B, K, U)."""

LIMB_NODES = ("arm", "leg")
NODES = {"spine": 1, "arm": 2, "leg": 2}
"""Type of nodes -> number of members; of limbs the left one, then the right one."""

EDGES = {"spine": 1, "arm": 2, "leg": 2, "spine_arm": 3, "spine_leg": 3, "arm_arm": 2, "leg_leg": 2}
"""Type of edges -> number of members, by the nodes to which they lead; the first three lead from the frame before."""


@dataclass(frozen=True)
class Config:
    """Sizes of the net; the defaults are the paper's (section 4.1).

    parts: the channels of the spine, left arm, right arm, left leg and right leg; each of the D is in one part. linear:
    units of the edges' two fully connected layers, and of the nodes' first one. units: of each LSTM. narrow: units of
    the nodes' second fully connected layer.
    """

    dimensions: int
    parts: tuple[tuple[int, ...], ...]
    linear: int = 256
    units: int = 512
    narrow: int = 100


def parts_of(layout: Layout, kept: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """The parts for :class:`Config`: indices, among the kept columns, of the five parts.

    The layout's pairs are the legs and the arms; everything else is the spine. DataError if it lacks these pairs, or if
    left and right do not keep the same columns.
    """
    if len(layout.pairs) != 2:
        raise DataError(f"{layout.name} does not say which columns are legs and arms: its layout needs two pairs")
    # legs and arms
    limbs: list[tuple[int, ...]] = []
    for left, right, width in reversed(layout.pairs):
        left_limb = _within(kept, left, width)
        right_limb = _within(kept, right, width)
        if [kept[n] - left for n in left_limb] != [kept[n] - right for n in right_limb]:
            raise DataError(f"{layout.name}: columns kept from {left} and from {right} on are not the same ones")
        limbs += [left_limb, right_limb]
    # and the spine, which is all else
    of_limbs = set(chain.from_iterable(limbs))
    spine = tuple(n for n in range(len(kept)) if n not in of_limbs)
    return (spine, *limbs)


def _within(kept: Sequence[int], start: int, width: int) -> tuple[int, ...]:
    """The indices of the kept columns in a span."""
    return tuple(n for n, column in enumerate(kept) if start <= column < start + width)


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
        first = nn.Linear(config.units, config.linear)
        second = nn.Linear(config.linear, config.narrow)
        self.hidden = nn.Sequential(first, nn.ReLU(), second, nn.ReLU())
        self.outward = nn.Linear(config.narrow, features)

    def forward(self, x: Tensor, state: Halves) -> tuple[Tensor, Halves]:
        """Features and three edges' outputs (T, B, K, F + 3 U) and state to the next (T, B, K, F) and the state."""
        out, state = _along(self.lstm, x, state)
        return _exact(self.outward, self.hidden(out)), state


def _exact(layer: nn.Linear, x: Tensor) -> Tensor:
    """The layer in float32, also in mixed precision: frames differ by less than bfloat16 resolves."""
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


def _edge_width(name: str, widths: dict[str, int]) -> int:
    """The features of an edge: those of both its ends, two nodes of a frame, or a node in two frames."""
    start, _, end = name.partition("_")
    return widths[start] + widths[end or start]


class SRNN(Taught):
    """Seven edge RNNs and three node RNNs, which predict the frame itself rather than its change (section 4.1).

    Left and right share their RNNs. The state holds the last two frames, and hidden units and memory (2 U) of each
    member of each RNN before the last frame.
    """

    def __init__(self, config: Config) -> None:
        super().__init__()
        self.config = config
        # the channels of each type
        channels = {"spine": config.parts[:1], "arm": config.parts[1:3], "leg": config.parts[3:]}
        widths = {name: len(parts[0]) for name, parts in channels.items()}
        self.edges = nn.ModuleDict({name: Edge(_edge_width(name, widths), config) for name in EDGES})
        self.nodes = nn.ModuleDict({name: Node(widths[name], config) for name in NODES})
        # the state, and where the channels are
        self.carried = {
            "previous": (config.dimensions,),
            "last": (config.dimensions,),
            "edges": (sum(EDGES.values()), 2 * config.units),
            "nodes": (sum(NODES.values()), 2 * config.units),
        }
        order = torch.tensor(list(chain.from_iterable(config.parts)))
        constants(self, places=order.argsort(), **{name: torch.tensor(parts) for name, parts in channels.items()})

    def begin(self, seed: Tensor) -> State:
        """The RNNs have seen all seed frames, of which there are at least two, but the last."""
        return {**self.follow(seed[:, :-1])[1], "previous": seed[:, -2], "last": seed[:, -1]}

    def predict(self, state: State) -> tuple[Tensor, State]:
        """The prediction of the RNNs for the last frame, and their state."""
        frames, after = self._run(state["last"][None], state["previous"][None], state["edges"], state["nodes"])
        return frames[0], after

    def push(self, state: State, frame: Tensor) -> State:
        """The frame becomes the last one; the RNNs' state is that after the prediction."""
        return {**state, "previous": state["last"], "last": frame}

    def follow(self, frames: Tensor) -> tuple[Tensor, State]:
        """As in any :class:`Taught` system; the first frame counts as its own predecessor."""
        before = torch.cat([frames[:, :1], frames[:, :-1]], dim=1)
        edges, nodes = (frames.new_zeros(frames.shape[0], *self.carried[name]) for name in ("edges", "nodes"))
        predicted, after = self._run(frames.transpose(0, 1), before.transpose(0, 1), edges, nodes)
        return predicted.transpose(0, 1), after

    def _run(self, now: Tensor, before: Tensor, edges: Tensor, nodes: Tensor) -> tuple[Tensor, State]:
        """Frames and those before them (T, B, D) and the RNNs' states to the predicted frames (T, B, D) and states."""
        features = self._features(now)
        # first the edges, then the nodes to which they lead
        messages, edges = _each(self.edges, _concatenated(features, self._features(before)), edges)
        parts, nodes = _each(self.nodes, _node_inputs(features, messages), nodes)
        # put the channels of all parts back in order
        frames = torch.cat([part.flatten(2) for part in parts.values()], dim=2)
        return frames[..., self.get_buffer("places")], {"edges": edges, "nodes": nodes}

    def _features(self, frames: Tensor) -> Tensors:
        """The channels of each node (T, B, K, F)."""
        return {name: frames[..., self.get_buffer(name)] for name in NODES}


def _each(rnns: nn.ModuleDict, inputs: Tensors, state: Tensor) -> tuple[Tensors, Tensor]:
    """The outputs of each RNN for its inputs, and the states of all after them, from those before them (B, K, 2 U)."""
    # split the states, run each, and join them
    members = [inputs[name].shape[2] for name in rnns]
    hidden, memory = (torch.split_with_sizes(half, members, dim=1) for half in state.chunk(2, dim=-1))
    outputs = {}
    hidden_after = []
    memory_after = []
    for number, (name, rnn) in enumerate(rnns.items()):
        outputs[name], after = rnn(inputs[name], (hidden[number], memory[number]))
        hidden_after.append(after[0])
        memory_after.append(after[1])
    states = torch.cat([torch.cat(hidden_after, dim=1), torch.cat(memory_after, dim=1)], dim=-1)
    return outputs, states.float()


def _concatenated(now: Tensors, before: Tensors) -> Tensors:
    """The features of edges: those of both ends, summed over edges of a type to the same node (the authors' code)."""
    features = {name: torch.cat([before[name], now[name]], dim=-1) for name in NODES}
    for limb in LIMB_NODES:
        pair = now[limb]
        spine = torch.cat([now["spine"].expand(-1, -1, 2, -1), pair], dim=-1)
        features[f"spine_{limb}"] = torch.cat([spine.sum(2, keepdim=True), spine], dim=2)
        features[f"{limb}_{limb}"] = torch.cat([pair, pair.flip(2)], dim=-1)
    return features


def _node_inputs(features: Tensors, messages: Tensors) -> Tensors:
    """The inputs of nodes: their features and the outputs of the edges that lead to them."""
    # the first member of an edge between spine and limb leads to the spine
    to_spine = [messages["spine"], *(messages[f"spine_{limb}"][:, :, :1] for limb in LIMB_NODES)]
    inputs = {"spine": torch.cat([features["spine"], *to_spine], dim=-1)}
    for limb in LIMB_NODES:
        to_limb = [messages[limb], messages[f"spine_{limb}"][:, :, 1:], messages[f"{limb}_{limb}"]]
        inputs[limb] = torch.cat([features[limb], *to_limb], dim=-1)
    return inputs
