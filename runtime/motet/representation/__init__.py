"""What the channels of a model mean: from a motion to frames, and from frames to a motion that can be played."""

from motet.errors import BundleError
from motet.representation.angles import Angles
from motet.representation.base import Representation
from motet.representation.root_block import RootAngles
from motet.representation.root_sixd import RootSixd
from motet.representation.root_vectors import RootVectors

_ALL: tuple[Representation, ...] = (Angles(), RootAngles(), RootSixd(), RootVectors())

REPRESENTATIONS = {found.name: found for found in _ALL}
"""By the names that manifests have."""


def named(name: str) -> Representation:
    """The representation of a name as manifests have it; BundleError for another."""
    if name not in REPRESENTATIONS:
        raise BundleError(f"representation must be one of {', '.join(REPRESENTATIONS)}, not {name!r}")
    return REPRESENTATIONS[name]
