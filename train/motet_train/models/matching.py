"""What a figure that is steered by motion matching is made of: recorded poses in few codes, and the table of rows.

See :mod:`motet.steering.matching`, whose letters are used here; P = 4 J + 1 are the numbers of a pose.
"""

from dataclasses import dataclass, field

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.steering.tables import DTYPE_OF_TABLE, Speeds
from motet_train.models.kinematics import SixdPlaces, Tree
from motet_train.models.net import Graphs, Net, Tables


@dataclass(frozen=True)
class MatchingConfig:
    """rows: N. even, odd: codes of a pose that a mirror image has alike, and with the other sign. features: F. gaits:
    their names. speeds: of each gait."""

    channels: int
    tree: Tree = field(default_factory=Tree)
    rows: int = 1
    even: int = 20
    odd: int = 16
    features: int = 1
    gaits: tuple[str, ...] = ()
    speeds: tuple[Speeds, ...] = ()


class Matching(Net):
    """Codes (N, K) and the poses that they stand for, which are trained, and the rest of the table."""

    CONFIG = MatchingConfig
    pose_mean: Tensor

    def __init__(self, config: MatchingConfig) -> None:
        super().__init__(config.channels)
        self.config = config
        codes = config.even + config.odd
        poses = 4 * len(config.tree.bones) + 1
        rows = config.rows
        # trained: the codes, and how they become poses
        self.codes = nn.Parameter(torch.zeros(rows, codes))
        self.pose_basis = nn.Parameter(torch.zeros(codes, poses))
        # the rest of the table
        for name, width in {"moves": 6, "features": config.features, "shows": len(config.gaits)}.items():
            self.register_buffer(name, torch.zeros(rows, width))
        lengths = {"left": rows, "feature_mean": config.features, "feature_scale": config.features, "pose_mean": poses}
        for name, length in lengths.items():
            self.register_buffer(name, torch.zeros(length))
        self.places = SixdPlaces(config.tree)

    def values(self, codes: Tensor) -> Tensor:
        """Codes (..., K) to the numbers (..., P) of a pose: quaternions of any length, and the hips' height."""
        return self.pose_mean + codes @ self.pose_basis

    def poses(self, codes: Tensor) -> tuple[Tensor, Tensor]:
        """Codes (..., K) to unit quaternions (..., J, 4) of the bones and the hips' height (..., 1)."""
        values = self.values(codes)
        quats = values[..., :-1].reshape(*values.shape[:-1], -1, 4)
        return functional.normalize(quats, dim=-1), values[..., -1:]

    def points(self, quats: Tensor, height: Tensor) -> Tensor:
        """Places (..., J', 3) of all joints in metres, seen from the facing, of poses as :meth:`poses` gives them."""
        points = self.places(quat_to_sixd(quats).flatten(-2))
        return torch.cat([points[..., :1], points[..., 1:2] + height[..., None], points[..., 2:]], dim=-1)

    def graphs(self) -> Graphs:
        """None: the loop is springs, a search and a linear map."""
        return {}

    def tables(self) -> Tables:
        """All that the loop plays."""
        return {
            name: getattr(self, name).detach().cpu().numpy().astype(dtype) for name, dtype in DTYPE_OF_TABLE.items()
        }


def quat_to_sixd(quats: Tensor) -> Tensor:
    """Unit quaternions (..., 4) in (x, y, z, w) to the x and y axes (..., 6) of their frames."""
    x, y, z, w = quats.unbind(dim=-1)
    axis_x = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)]
    axis_y = [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)]
    return torch.stack(axis_x + axis_y, dim=-1)
