"""LSTM-AE of Ghosh et al. 2017: LSTM-3LR, and an autoencoder of single frames that filters each frame it predicts.

Theirs: the autoencoder learns to restore frames of which a part was dropped out, so that it knows what a body can do;
predicted frames pass through it before they are shown and fed back, so that errors do not build up. Ours: its sizes and
the rate; that single channels are dropped, where theirs drops whole joints, of which this net knows nothing; and that
both parts learn side by side but apart, without the authors' tuning of the whole at the end.

Letters in shapes: B rows, T frames, D channels.
"""

from dataclasses import dataclass

from torch import Tensor, nn

from motet_train.papers.li2018 import lstm_3lr
from motet_train.papers.li2018.stepwise import State, squared_error


@dataclass(frozen=True)
class Config(lstm_3lr.Config):
    """Sizes of the net, those of LSTM-3LR first.

    autoencoder: units of its rectified layers; a linear one to the D channels comes last. dropout: of its inputs.
    """

    autoencoder: tuple[int, ...] = (1000, 500, 1000)
    dropout: float = 0.3


class LSTMAE(lstm_3lr.EncoderRecurrentDecoder):
    """What LSTM-3LR predicts, filtered."""

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        hidden = lstm_3lr.connected((config.dimensions, *config.autoencoder), rectified=True)
        outward = nn.Linear(config.autoencoder[-1], config.dimensions)
        self.filter = nn.Sequential(nn.Dropout(config.dropout), hidden, outward)

    def predict(self, state: State) -> tuple[Tensor, State]:
        """What the autoencoder makes of the LSTMs' frame; nothing else changes."""
        frame, carried = super().predict(state)
        return self.restored(frame), carried

    def loss(self, windows: Tensor, seed_frames: int) -> Tensor:
        """The LSTMs' error on the next frame, unfiltered, plus the autoencoder's on true frames: no weight has both."""
        return super().loss(windows, seed_frames) + squared_error(self.restored(windows), windows)

    def restored(self, frames: Tensor) -> Tensor:
        """Frames (..., D) as the autoencoder gives them back; in training, of what dropout leaves of them."""
        found: Tensor = self.filter(frames).float()
        return found
