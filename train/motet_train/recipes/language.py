"""Training between motion and language: from a store and a recipe to a run, the same for both directions."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import torch

from motet.files import write_whole
from motet.models.text import Vocabulary
from motet.representation.base import FrameMirror
from motet.representation.contract import MotionContract
from motet_train.checkpoint import refuse_other
from motet_train.data.batches import Examples, examples, frame_mirror, usable
from motet_train.data.errors import DataError
from motet_train.data.mirror_text import mirror_text
from motet_train.data.split import Split, split
from motet_train.data.store import Store
from motet_train.fit import Fitted, Fitting, Progress, fit
from motet_train.runs import MODELS, Run, surroundings


@dataclass(frozen=True)
class Recipe:
    """What is trained, and how.

    verb, model: as in the manifest. config: gives the model's configuration, a dataclass, for a number of channels and
    of words. defaults: the verb's. mirror: whether half of all visits are to left-right mirrored motions.
    """

    verb: str
    model: str
    config: Callable[[int, int], Any]
    fitting: Fitting
    defaults: Mapping[str, float]
    mirror: bool = False


@dataclass(frozen=True)
class About:
    """What else a run is made from and says.

    by: how motions are split, see :func:`motet_train.data.split.split`; the split is drawn with seed 0 whatever the
    seed of the training is, so that runs can be compared and chained.
    """

    name: str
    command: str
    weights_licence: str
    data_licence: str
    data: str
    seed: int = 0
    by: str = "trial"


@dataclass(frozen=True, eq=False)
class Material:
    """A store, divided, with all that is taken from its training part alone."""

    store: Store
    parts: Split
    contract: MotionContract
    vocabulary: Vocabulary
    mirror: FrameMirror | None

    def examples(self, records: tuple[int, ...]) -> Examples:
        """The examples of some records."""
        return examples(self.store, records, self.vocabulary, self.mirror)

    def names(self, records: tuple[int, ...]) -> list[str]:
        """The names of some records."""
        return [self.store.records[record].name for record in records]


def material(store: Store, mirror: bool, by: str = "trial") -> Material:
    """Divide a store; contract and vocabulary are those of its training part. DataError where that is not possible."""
    parts = split(store.records, 0, by)
    contract = store.contract(parts.train)
    sentences = [s for record in parts.train for s in store.records[record].sentences if usable(s)]
    mirrored = map(mirror_text, sentences) if mirror else ()
    vocabulary = Vocabulary.of(chain(sentences, mirrored))
    return Material(store, parts, contract, vocabulary, frame_mirror(contract) if mirror else None)


def train_language(
    store: Store,
    recipe: Recipe,
    about: About,
    folder: Path,
    device: str = "cpu",
    progress: Progress = lambda epoch, epochs: None,
) -> Run:
    """Train by a recipe in an existing folder, which is a run after the first epoch, with the weights to keep so far.

    A folder with a run that was stopped is continued, see :func:`motet_train.fit.fit`; RunError names what is not as
    it was when it was started (more epochs are allowed). DataError where the data cannot be trained on.
    """
    found = material(store, recipe.mirror, about.by)
    config = asdict(recipe.config(len(found.contract.channels), len(found.vocabulary)))
    torch.manual_seed(about.seed)
    net = MODELS[recipe.model](config)
    net.mean.copy_(torch.tensor(found.contract.mean).float())  # type: ignore[operator]
    net.scale.copy_(torch.tensor(found.contract.std).float())  # type: ignore[operator]
    manifest = _manifest(found, recipe, about, config)
    refuse_other(folder / "run.json", manifest, _essence)
    write_whole(folder / "run.json", json.dumps(manifest, indent=1) + "\n")
    data = found.examples(found.parts.train), found.examples(found.parts.validation)
    fitted = fit(net, data, recipe.fitting, about.seed, folder, device, progress)
    training = {**manifest["training"], **_results(fitted, device)}
    run = Run({**manifest, "training": training}, net)
    run.save(folder)
    return run


def _manifest(found: Material, recipe: Recipe, about: About, config: Mapping[str, Any]) -> dict[str, Any]:
    manifest = {
        "name": about.name,
        "version": "1",
        "verb": recipe.verb,
        "model": recipe.model,
        "motion": found.contract.to_json(),
        "vocabulary": found.vocabulary.to_json(),
        "defaults": dict(recipe.defaults),
        "config": dict(config),
        "licence": {"weights": about.weights_licence, "data": about.data_licence},
        "training": {
            "command": about.command,
            "seed": about.seed,
            "fitting": asdict(recipe.fitting),
            "mirror": recipe.mirror,
            "data": _data(found, about.data),
            "split": {
                "by": about.by,
                "train": len(found.parts.train),
                "validation": found.names(found.parts.validation),
                "test": found.names(found.parts.test),
            },
        },
    }
    plain: dict[str, Any] = json.loads(json.dumps(manifest))
    return plain


def _data(found: Material, data: str) -> dict[str, Any]:
    records = found.store.records
    return {
        "name": data,
        "motions": len(records),
        "sentences": sum(len(entry.sentences) for entry in records),
        "skipped": len(found.store.skipped),
        "unusable_sentences": sum(not usable(s) for entry in records for s in entry.sentences),
    }


def _results(fitted: Fitted, device: str) -> dict[str, Any]:
    seconds = sum(line["seconds"] for line in fitted.log)
    steps = sum(line["seconds"] * line["steps_per_second"] for line in fitted.log)
    return {
        "epochs": len(fitted.log),
        "kept_epoch": fitted.kept["epoch"],
        "train_loss": fitted.kept["train_loss"],
        "validation_loss": fitted.kept["validation_loss"],
        "seconds": round(seconds, 1),
        "steps_per_second": round(steps / seconds, 3),
        **surroundings(device),
    }


def _essence(manifest: Mapping[str, Any]) -> dict[str, Any]:
    training = manifest["training"]
    fitting = {**training["fitting"], "epochs": None}
    return {
        **{key: manifest[key] for key in ("model", "config", "motion", "vocabulary")},
        **{key: training[key] for key in ("seed", "mirror", "split")},
        **fitting,
    }


def check_device(device: str) -> None:
    """DataError if torch cannot use the device here."""
    if device == "cuda" and not torch.cuda.is_available():
        raise DataError("torch finds no CUDA device here: use --device cpu")
