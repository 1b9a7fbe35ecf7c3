"""The recipe of the codec of motions, and its training from a store."""

from dataclasses import asdict, dataclass, replace

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from motet.generate.codec import RADIAN_METRES, seen_from
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet_train.data.batches import frame_mirror
from motet_train.data.errors import DataError
from motet_train.data.habits import without_habits
from motet_train.data.sixd_windows import SixdWindows, Window
from motet_train.data.store import Store, split
from motet_train.descent import GradientLearner, Term, Terms
from motet_train.evaluate.tables import Figures
from motet_train.models.codec import CodecConfig, MotionCodec, places_in_world
from motet_train.models.kinematics import joint_weights, tree_of
from motet_train.models.motion_codes import MotionCodes
from motet_train.recipes.recipe import MUON, Job, Recipe, data_of
from motet_train.runs import Run


@dataclass(frozen=True)
class CodecVisits:
    """frames: of a window. ends: weight of hands, feet and the head. sharp: weight of the sharpness of movement, which
    sets the jerk of decoded motions. settled: whether further training keeps the codes of a codec; if not, motions that
    it decodes badly are drawn more often (:func:`badly_shown`)."""

    frames: int = 64
    ends: float = 3.0
    sharp: float = 0.2
    settled: bool = True


CODEC_STEPS = replace(MUON, steps=9000, every=250, warm_up=200, cosine=True)

DEFAULT = Recipe("codec", "motion-codec", "codes", CodecConfig(0), ("channels", "tree"), CODEC_STEPS, CodecVisits())

DECODER = replace(DEFAULT, training=replace(CODEC_STEPS, steps=4000, learning_rate=1e-3), visits=CodecVisits(sharp=1.0))
"""Further training of the decoder of a codec that keeps its codes."""

SHARP = replace(DECODER, training=replace(CODEC_STEPS, steps=1000, learning_rate=1e-3, precision="float32"))
"""The last training of the decoder: the jerk of rounding to bfloat16 taught it to be too smooth."""

WIDER = replace(
    DEFAULT,
    training=replace(CODEC_STEPS, steps=3000, batch=48, learning_rate=1e-3, precision="float32"),
    visits=CodecVisits(frames=32, sharp=0.5, settled=False),
)
"""Further training of a whole codec on unfamiliar motions, such as hand-keyed ones; its codes change."""

RECIPES = {"default": DEFAULT, "decoder": DECODER, "sharp": SHARP, "wider": WIDER}


def train_codec(store: Store, job: Job, data: str, by: str, start: Run | None = None) -> Run:
    """Train on a store in ``root_sixd``, see :meth:`motet_train.recipes.recipe.Job.run`.

    Motions are encoded as recorded, and decoded with level heads and even collar bones.

    start: a codec to train further; if its codes are settled, only the decoder is trained.
    """
    store.needs_sixd("a codec is trained on")
    mended = without_habits(store)
    visits = job.recipe.visits
    parts = split(store.records, 0, by)
    contract = mended.contract(parts.train)
    started = None if start is None else _started(start, visits.settled)
    config = started.config if started else job.recipe.sized(channels=len(contract.channels), tree=tree_of(contract))
    mirror = frame_mirror(contract)
    train = SixdWindows(store, mended, parts.train, visits.frames, config.hop, mirror)
    validation = SixdWindows(store, mended, parts.validation, visits.frames, config.hop, mirror)

    # a new codec, or one that is trained further
    torch.manual_seed(job.about.seed)
    net = started or _untrained(config, contract, train, job.about.seed)
    if started and not visits.settled:
        train.favour(badly_shown(net, train))

    learner = _learner(net, job, contract, train, validation)
    about = data_of(store, data, by, parts, start)
    return job.run(net, learner, job.manifest(contract, asdict(config), {}, None, about))


def _untrained(config: CodecConfig, contract: MotionContract, windows: SixdWindows, seed: int) -> MotionCodec:
    """A new codec with its book of moves."""
    net = MotionCodec(config)
    net.measure_by(contract.mean, contract.std)
    moves = fit_book(windows.sequences(), config.hop, config.moves, seed)
    net.book.copy_(torch.from_numpy(moves))
    net.book_scale.copy_(torch.from_numpy(moves.std(axis=0)))
    return net


def _learner(
    net: MotionCodec, job: Job, contract: MotionContract, train: SixdWindows, validation: SixdWindows
) -> GradientLearner[MotionCodec]:
    """Learns to decode windows to their frames as they are to be shown."""
    visits = job.recipe.visits
    book = net.book.numpy().astype(np.float64)
    weights = joint_weights(contract, ("Foot", "Toes", "LowerArm", "Hand", "head"), visits.ends).to(job.device)
    validation_window = validation.draw(128, book, np.random.default_rng(0))
    return GradientLearner(
        net.to(job.device),
        job.training,
        lambda window: _loss(net, window, weights, visits.sharp),
        lambda rng: (train.draw(job.training.batch, book, rng),),
        lambda: _measured(net, validation_window),
    )


def _started(start: Run, settled: bool) -> MotionCodec:
    """The codec of a run, or of a run of a model that writes its codes, to be trained further; DataError for others."""
    codec = start.model.codec if isinstance(start.model, MotionCodes) else start.model
    if not isinstance(codec, MotionCodec):
        raise DataError(f"a codec is trained further (motet train codec), not {start.manifest['model']}")
    codec.decoder.requires_grad_(True)
    codec.encoder.requires_grad_(not settled)
    return codec


@torch.no_grad()
def badly_shown(net: MotionCodec, windows: SixdWindows) -> Array:
    """For each span of windows the square of a codec's mean error of joints in its middle (m), relative to the root:
    spans with twice the error are drawn four times as often."""
    book = net.book.numpy().astype(np.float64)
    net.eval()
    errors = []
    for window in windows.middles(book):
        frames = net.decode(window.moves, net.encode(window.inputs))
        places = places_in_world(net, frames, window.way)
        true_places = places_in_world(net, window.frames, window.way)
        difference = _from_root(places) - _from_root(true_places)
        errors.append(float(difference.norm(dim=-1).mean()))
    net.train()
    return np.square(errors)


def _from_root(places: Tensor) -> Tensor:
    """Joints (B, T, J, 3) relative to the root."""
    return places - places[:, :, :1]


def fit_book(poses: list[Array], hop: int, size: int, seed: int) -> Array:
    """A book (size, 3) of the moves over ``hop`` frames of poses (T, 3): x, z, facing. Standing still is entry 0.

    The error of a move does not accumulate: the next one starts from where the moves so far have led.
    """
    from sklearn.cluster import MiniBatchKMeans  # imported here, so that other trainings do not load it

    moves = np.concatenate([seen_from(way[:-hop], way[hop:]) for way in poses if len(way) > hop])
    scaled = moves * (1, 1, RADIAN_METRES)
    clusters = MiniBatchKMeans(size - 1, random_state=seed, n_init=3, batch_size=4096).fit(scaled)
    centres = clusters.cluster_centers_ / (1, 1, RADIAN_METRES)
    return np.concatenate([np.zeros((1, 3)), centres])


def _loss(net: MotionCodec, window: Window, weights: Tensor, sharp: float) -> Terms:
    """Errors of decoded frames in standard deviations, of positions (m), speeds (m/s) and the logarithm of the jerk."""
    # decoded frames, channel by channel
    frames = net.decode(window.moves, net.encode(window.inputs)).float()
    scale = torch.cat([net.path_scale, torch.where(net.scale > 0, net.scale, torch.inf)[3:]])
    frame_errors = functional.smooth_l1_loss(frames / scale, window.frames / scale, beta=0.2, reduction="none")

    # the joints that they place, and how these move
    with torch.autocast(frames.device.type, enabled=False):
        places = places_in_world(net, frames, window.way)
        true_places = places_in_world(net, window.frames, window.way)
        place, speed, jerk = _joint_errors(places, true_places, weights[:, None])
    return (Term(frame_errors.mean() + 5.0 * place + 0.5 * speed + sharp * jerk, len(window)),)


def _joint_errors(places: Tensor, true_places: Tensor, weights: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Mean errors of joints (B, T, J, 3) in place (m), speed (m/s) and the logarithm of the jerk. weights: (J, 1)."""
    errors = (places - true_places).abs() * weights
    speed_errors = (places.diff(dim=1) - true_places.diff(dim=1)).abs() * 30 * weights
    jerk_errors = (_sharpness(places) / _sharpness(true_places)).log().abs()
    return errors.mean(), speed_errors.mean(), jerk_errors.mean()


def _sharpness(places: Tensor) -> Tensor:
    """The mean magnitude (B, J) of the third difference of joints (B, T, J, 3), metres per frame cubed."""
    third = places.diff(dim=1).diff(dim=1).diff(dim=1)
    return (third.square().sum(-1) + 1e-10).sqrt().mean(dim=1) + 1e-4


@torch.no_grad()
def _measured(net: MotionCodec, validation: Window) -> Figures:
    """On validation windows: the mean error of joints in cm, the sharpness of movement relative to the true one, and
    the share of codes in use."""
    # how far decoded joints are from the true ones
    window = validation.to(net.mean.device)
    values = net.encode(window.inputs)
    places = places_in_world(net, net.decode(window.moves, values), window.way)
    true_places = places_in_world(net, window.frames, window.way)
    # how many of the codes occur
    codes = net.to_codes(values).cpu().numpy()
    used = [len(np.unique(codes[..., group])) / net.config.codes for group in range(net.config.groups)]
    return {
        "validation": round(100 * float((places - true_places).norm(dim=-1).mean()), 4),
        "sharpness": round(float(_sharpness(places).mean() / _sharpness(true_places).mean()), 4),
        "used": round(float(np.mean(used)), 3),
    }
