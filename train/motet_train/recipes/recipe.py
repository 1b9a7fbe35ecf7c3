"""A recipe, and the job of training by it: from a learner and a manifest to a run."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from motet.bundle.fields import Json
from motet.files import write_whole
from motet.representation.contract import MotionContract
from motet.settings import Settings
from motet_train import distributed
from motet_train.data.store import Split, Store
from motet_train.descent import Training
from motet_train.models.net import Net
from motet_train.progress import SILENT, Watcher
from motet_train.runs import RUN_MANIFEST, About, Run, refuse_other, surroundings
from motet_train.trainer import Learner, Line, kept, train

SETTINGS = "run.toml"


@dataclass(frozen=True)
class Visits:
    """How a predictor's training windows vary, see :class:`motet_train.data.predict_data.Windows`."""

    warp: float = 0.0
    reverse: float = 0.0
    mirror: float = 0.0


AUGMENTED = Visits(warp=0.15, reverse=0.3, mirror=0.5)
"""For every predictor that is trained on poses, motet's own and those it is compared with."""


ADAMW = Training(optimiser="adamw", learning_rate=2e-3, keep="last")
MUON = Training(
    batch=32, optimiser="muon", learning_rate=2e-3, weight_decay=0.01, clip=1.0, keep="last", precision="bfloat16"
)
"""Shared by the trainings of motet's own nets."""


@dataclass(frozen=True)
class Recipe:
    """A net, its data and its training.

    verb, model, loop: as in the manifest. config: the model's sizes, a dataclass, whose fields ``derived`` come from
    the data. training: None if the config has it. visits: how the data is visited, a dataclass. defaults: of the loop.
    settings: of features whose numbers differ from their code's.
    """

    verb: str
    model: str
    loop: str
    config: Any
    derived: tuple[str, ...] = ()
    training: Training | None = None
    visits: Any = None
    defaults: Json = field(default_factory=dict)
    settings: tuple[Settings, ...] = ()

    def sized(self, **derived: Any) -> Any:
        """The config with the sizes derived from the data."""
        assert set(derived) == set(self.derived)
        return replace(self.config, **derived)

    def to_json(self) -> Json:
        """The training, for the manifest."""
        fields: dict[str, Any] = {}
        for part in (self.training, self.visits):
            if part is not None:
                fields |= asdict(part)
        return fields


@dataclass(frozen=True)
class Job:
    """Training by a recipe in an existing folder. settings: the text of ``run.toml``, which repeats the run."""

    recipe: Recipe
    about: About
    folder: Path
    device: str = "cpu"
    progress: Watcher = SILENT
    settings: str | None = None

    @property
    def training(self) -> Training:
        """The gradient training of its recipe."""
        assert self.recipe.training is not None
        return self.recipe.training

    def manifest(
        self,
        contract: MotionContract,
        config: Json,
        defaults: Json,
        data_licence: str | None,
        training: Json | None = None,
        **more: Any,
    ) -> dict[str, Any]:
        """The manifest of a new run, ready for JSON; the bundle's begins with it.

        data_licence: the data's own, unless the user states another. training: the data that is trained on. more:
        entries of some verbs only.
        """
        about = self.about
        recipe = self.recipe
        trained = {} if recipe.training is None else {"recipe": recipe.to_json()}
        manifest = {
            "name": about.name,
            "version": "1",
            "verb": recipe.verb,
            "model": recipe.model,
            "loop": recipe.loop,
            "motion": contract.to_json(),
            **more,
            "defaults": dict(defaults),
            "settings": by_feature(recipe.settings),
            "config": dict(config),
            "licence": {"weights": about.licence, "data": about.data_licence or data_licence},
            "training": {"command": about.command, "seed": about.seed, **trained, **(training or {})},
        }
        plain: dict[str, Any] = json.loads(json.dumps(manifest))
        return plain

    def run(
        self,
        net: Net,
        learner: Learner,
        manifest: Json,
        more: Callable[[Sequence[Line]], Json] = lambda log: {},
        tuned: Callable[[Run], Sequence[Settings]] = lambda run: (),
    ) -> Run:
        """Train; the folder is a run after the first chunk, and a stopped run resumes.

        net: the net of the run. more: further entries of the manifest's training, from its log. tuned: settings of
        features that are tuned with the trained net.
        RunError if the folder holds a run that was started with other settings; more epochs or steps are allowed.
        """
        is_first = distributed.rank() == 0
        if is_first:
            self._begin(manifest)
        log = train(learner, self.about.seed, self.folder, self.progress)

        # the run with the figures of its training
        results = _results(log, learner, net)
        training = {**manifest["training"], **results, **more(log), **surroundings(self.device)}
        run = Run({**manifest, "training": training}, net.cpu())

        # and with the settings that are tuned by it
        if is_first:
            settings = {**manifest["settings"], **by_feature(tuned(run))}
            run = Run({**run.manifest, "settings": settings}, run.model)
            run.save(self.folder)
        return run

    def _begin(self, manifest: Json) -> None:
        """Write the manifest and the settings of a new run."""
        refuse_other(self.folder / RUN_MANIFEST, manifest)
        write_whole(self.folder / RUN_MANIFEST, json.dumps(manifest, indent=1) + "\n")
        if self.settings is not None:
            write_whole(self.folder / SETTINGS, self.settings)


def _results(log: Sequence[Line], learner: Learner, net: Net) -> Json:
    """The figures of a training, from its log."""
    best = kept(log, learner.keep)
    seconds = sum(line["seconds"] for line in log)
    steps = sum(line["seconds"] * line["steps_per_second"] for line in log)
    return {
        f"{learner.unit}s": log[-1][learner.unit],
        f"kept_{learner.unit}": best[learner.unit],
        **{key: best[key] for key in ("loss", "validation") if key in best},
        "seconds": round(seconds, 1),
        "steps_per_second": round(steps / seconds, 3),
        "parameters": parameter_count(net),
    }


def data_of(store: Store, name: str, by: str, parts: Split, start: Run | None = None) -> Json:
    """The data of a training, for the manifest, and the training of the run from which it starts."""
    about: dict[str, Any] = {
        "data": {"name": name, "motions": len(store.records)},
        "split": {"by": by, "train": len(parts.train)},
    }
    if start is not None:
        about["start"] = start.manifest["training"]
    return about


def origin(training: Json) -> Json:
    """How a part of a net was trained, and what it started from, by its manifest's training."""
    keys = ("command", "seed", "epochs", "steps", "seconds", "word_vectors")
    parts = {key: training[key] for key in keys if key in training}
    if "start" in training:
        parts["start"] = origin(training["start"])
    return parts


def parameter_count(net: Net) -> int:
    """The number of parameters of a net."""
    return sum(parameter.numel() for parameter in net.parameters())


def by_feature(settings: Sequence[Settings]) -> dict[str, dict[str, Any]]:
    """Settings as in a manifest: the fields of each by the name of its feature."""
    return {feature.FEATURE: asdict(feature) for feature in settings}
