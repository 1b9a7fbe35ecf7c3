"""The published systems that predict, by the name of their model."""

from collections.abc import Mapping
from typing import Any

from motet_train.models.net import tuples
from motet_train.papers.li2018 import convseq2seq, lstm_3lr, lstm_ae, rrnn, srnn
from motet_train.papers.li2018.stepwise import Stepwise, System

SYSTEMS: Mapping[str, tuple[type[Any], type[Any]]] = {
    "convseq2seq": (convseq2seq.ConvSeq2Seq, convseq2seq.Config),
    "rrnn": (rrnn.RRNN, rrnn.Config),
    "erd": (lstm_3lr.EncoderRecurrentDecoder, lstm_3lr.ERDConfig),
    "lstm-3lr": (lstm_3lr.EncoderRecurrentDecoder, lstm_3lr.Config),
    "srnn": (srnn.SRNN, srnn.Config),
    "lstm-ae": (lstm_ae.LSTMAE, lstm_ae.Config),
}
"""Name -> the system and its configuration, a dataclass."""

SYSTEM_TITLES = {
    "convseq2seq": "the convolutional sequence-to-sequence model (Li et al. 2018)",
    "rrnn": "the residual recurrent net (Martinez et al. 2017)",
    "erd": "the encoder-recurrent-decoder (Fragkiadaki et al. 2015)",
    "lstm-3lr": "three LSTMs between linear maps (Fragkiadaki et al. 2015)",
    "srnn": "the structural RNN (Jain et al. 2016)",
    "lstm-ae": "the LSTMs with a denoising autoencoder (Ghosh et al. 2017)",
}
"""Model -> how help calls it."""


def stepwise(name: str, config: Mapping[str, Any]) -> Stepwise:
    """The net of a configuration as it stands in a manifest."""
    kind, sizes = SYSTEMS[name]
    system: System = kind(sizes(**tuples(config["system"])))
    return Stepwise(system, config["channels"], config["kept"], config["seed_frames"])
