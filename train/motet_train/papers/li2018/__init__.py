"""Li et al. 2018: ConvSeq2Seq, the systems it is compared with, and the protocol; its page is docs/predict.md."""

from collections.abc import Mapping
from typing import Any

from motet.bundle.fields import Json
from motet_train.models.net import configured
from motet_train.papers.li2018 import convseq2seq, recurrent, srnn
from motet_train.papers.li2018.stepwise import Stepwise

SYSTEMS: Mapping[str, tuple[type[Any], type[Any], str]] = {
    "convseq2seq": (
        convseq2seq.ConvSeq2Seq,
        convseq2seq.Config,
        "the convolutional sequence-to-sequence model (Li et al. 2018)",
    ),
    "rrnn": (recurrent.RRNN, recurrent.RRNNConfig, "the residual recurrent net (Martinez et al. 2017)"),
    "erd": (
        recurrent.EncoderRecurrentDecoder,
        recurrent.LSTM3LRConfig,
        "the encoder-recurrent-decoder (Fragkiadaki et al. 2015)",
    ),
    "lstm-3lr": (
        recurrent.EncoderRecurrentDecoder,
        recurrent.LSTM3LRConfig,
        "three LSTMs between linear maps (Fragkiadaki et al. 2015)",
    ),
    "srnn": (srnn.SRNN, srnn.Config, "the structural RNN (Jain et al. 2016)"),
    "lstm-ae": (recurrent.LSTMAE, recurrent.LSTMAEConfig, "the LSTMs with a denoising autoencoder (Ghosh et al. 2017)"),
}
"""Name of a model -> the system, its configuration (a dataclass), and its name in help texts."""


def from_config(name: str, config: Json) -> Stepwise:
    """The net of a manifest's configuration."""
    kind, sizes, _ = SYSTEMS[name]
    system = kind(configured(sizes, config["system"]))
    return Stepwise(system, config["channels"], config["kept"], config["seed_frames"])
