"""What both nets between motion and language share: their losses."""

from abc import abstractmethod

from torch import Tensor

from motet_train.data.batch import Batch
from motet_train.models.net import Net


class LanguageNet(Net):
    """A net in either direction. mean, scale: (D,) of the channels, set before training."""

    @abstractmethod
    def terms(self, batch: Batch) -> tuple[Tensor, Tensor | None]:
        """The losses of all active steps (N,), and the weighted loss of its summary head, a mean over the B rows.

        The latter in training only, and None without such a head.
        """

    def losses(self, batch: Batch) -> Tensor:
        """The loss of every active step of the batch (N,)."""
        return self.terms(batch)[0]

    def loss(self, batch: Batch) -> Tensor:
        """The mean of :meth:`losses`."""
        return self.losses(batch).mean()
