"""What both nets between motion and language share: their losses."""

from abc import abstractmethod
from typing import Any

from torch import Tensor

from motet_train.data.batch import Batch
from motet_train.models.language.summary import SummaryHead
from motet_train.models.net import Net
from motet_train.models.normalised import normalised


class LanguageNet(Net):
    """A net in either direction. summary: its head, if any, whose loss weighs ``config.summary``."""

    config: Any
    summary: SummaryHead | None

    @abstractmethod
    def terms(self, batch: Batch) -> tuple[Tensor, Tensor | None]:
        """The losses of all active steps (N,), and the weighted loss of its summary head, a mean over the B rows.

        The latter in training only, and None without such a head.
        """

    def summary_loss(self, batch: Batch, context: Tensor) -> Tensor | None:
        """The second of the :meth:`terms`, from contexts (B, C)."""
        if self.summary is None or not self.training:
            return None
        normal = normalised(batch.frames, self.mean, self.scale)
        weighed: Tensor = self.config.summary * self.summary.loss(context, normal, batch.lengths)
        return weighed

    def losses(self, batch: Batch) -> Tensor:
        """The loss of every active step of the batch (N,)."""
        return self.terms(batch)[0]

    def loss(self, batch: Batch) -> Tensor:
        """The mean of :meth:`losses`."""
        return self.losses(batch).mean()
