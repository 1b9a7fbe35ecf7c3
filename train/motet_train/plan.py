"""Train all shipped kinds of models on your own recordings: one store, and a run for each stage."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from motet.bundle.fields import Json
from motet.errors import MotetError
from motet_train.data.corpus import Corpus
from motet_train.data.predict_data import store_material
from motet_train.data.preparation import PARTS_OF_ALL_VERBS, preparation
from motet_train.data.store import Store, part, prepare_parts
from motet_train.progress import log, preparing
from motet_train.recipes import actions, codec, codes, fill, known, language, matching, predict, search
from motet_train.recipes.actions import WordVectors
from motet_train.recipes.recipe import Job, Recipe
from motet_train.run_folder import is_finished, trained
from motet_train.runs import About, Run, RunError
from motet_train.settings import changed
from motet_train.trainer import LOG


def kind_for(recipe: Recipe) -> str:
    """The kind of store that a recipe trains on, see :func:`motet_train.data.preparation.preparation`."""
    if recipe.loop == "codes" or recipe.verb in ("control", "fill"):
        return "codes"
    return "predict" if recipe.verb == "predict" else "describe"


def store_for(place: Path, recipe: Recipe) -> Path:
    """The path of the store that a recipe trains on: ``place``, or its part in the representation."""
    return part(place, preparation(kind_for(recipe), kit=False).representation)


@dataclass(frozen=True)
class Stage:
    """One training.

    verb: the verb of the model that it contributes to. train: trains on a store, with a job, the store's name, the way
    to divide it, and the runs that it needs. needs: the stages of these runs, by the name of the argument.
    """

    verb: str
    recipe: Recipe
    train: Callable[..., Run]
    needs: Mapping[str, str] = field(default_factory=dict)


STAGES: Mapping[str, Stage] = {
    "control": Stage(
        "control", matching.DEFAULT, lambda store, job, data, by: matching.train_matching(store, job, data)
    ),
    "search": Stage("search", search.DEFAULT, search.train_search),
    "predict": Stage(
        "predict",
        predict.FIGURE_RECIPE,
        lambda store, job, data, by: predict.train_predict(store_material(store, data, by), job),
    ),
    "actions": Stage("generate", actions.DEFAULT, actions.train_actions),
    "codec": Stage("generate", codec.DEFAULT, codec.train_codec),
    "decoder": Stage("generate", codec.DECODER, codec.train_codec, {"start": "codec"}),
    "sharp": Stage("generate", codec.SHARP, codec.train_codec, {"start": "decoder"}),
    "generate": Stage("generate", codes.DEFAULT, codes.train_codes, {"codec": "sharp", "actions": "actions"}),
    "fill": Stage("fill", fill.DEFAULT, fill.train_fill),
    "describe": Stage("describe", language.DEFAULT, language.train_language),
    "known": Stage("describe", known.DEFAULT, known.train_known, {"writer": "describe"}),
}
"""The stages by name: each after those that it needs, short ones first."""

PLANNED_VERBS = tuple(dict.fromkeys(stage.verb for stage in STAGES.values()))


@dataclass(frozen=True)
class Plan:
    """The trainings of some verbs.

    data: a corpus (:func:`motet_train.data.corpus.read_corpus`), or the path of its store. out: the folder of the runs,
    and of the corpus' store. by: how motions are divided, see :func:`motet_train.data.store.split`. vectors: word
    vectors from which the action net starts. changes: settings of stages by name
    (:func:`motet_train.settings.read_stages`). about: of the runs, but for their names.
    """

    data: Corpus | Path
    out: Path
    verbs: tuple[str, ...] = PLANNED_VERBS
    by: str = "trial"
    device: str = "cpu"
    vectors: WordVectors | None = None
    changes: Mapping[str, Mapping[str, Json]] = field(default_factory=dict)
    about: About = field(default_factory=lambda: About("", "motet_train.plan"))

    def train(self) -> None:
        """Train all stages that are not finished, each from its checkpoint if it has one; a failure stops no other.

        RunError says how many stages failed.
        """
        stages = self._stages()
        log.info("%d trainings into %s: %s", len(stages), self.out, ", ".join(stages))
        place = self.store()
        failed = set[str]()
        # each after those that it needs
        for name, stage in stages.items():
            if is_finished(self.out / name):
                log.info("%s is trained already", name)
                continue
            try:
                if lacking := failed.intersection(stage.needs.values()):
                    raise RunError(f"it needs {lacking.pop()}")
                log.info("training %s", name)
                self._train(name, stage, place)
            except MotetError as error:
                failed.add(name)
                hint = f"; see {self.out / name / LOG}" if (self.out / name / LOG).is_file() else ""
                log.error("%s failed: %s%s", name, error, hint)
        if failed:
            raise RunError(f"of {len(stages)} trainings {len(failed)} failed; the same command tries them again")

    def _stages(self) -> dict[str, Stage]:
        """The stages of the verbs, with changed recipes."""
        stages = {}
        for name, stage in STAGES.items():
            if stage.verb in self.verbs:
                stages[name] = replace(stage, recipe=changed(stage.recipe, self.changes.get(name, {}), {}))
        return stages

    def store(self) -> Path:
        """The path of the store; that of a corpus is prepared for all verbs if it does not exist."""
        if isinstance(self.data, Path):
            return self.data
        place = self.out / "store"
        if place.exists():
            log.info("the store %s exists: remove it to prepare the recordings anew", place)
        else:
            log.info("preparing %d motion files into %s", len(self.data), place)
            with preparing(len(self.data)) as done:
                prepare_parts(self.data, place, PARTS_OF_ALL_VERBS, done)
        return place

    def _train(self, name: str, stage: Stage, place: Path) -> None:
        store = Store.open(store_for(place, stage.recipe))
        needs = {key: self.out / need for key, need in stage.needs.items()}
        inputs: dict[str, Any] = {key: Run.load(folder) for key, folder in needs.items()}
        vectors = self.vectors if name == "actions" else None
        if name == "actions":
            inputs["vectors"] = vectors
        about = replace(self.about, name=name)
        # the options of the command that trains this stage alone
        options = {
            "data": place,
            "split": None if name == "control" else self.by,
            **needs,
            "word-vectors": vectors and vectors.file,
            "vectors-from": vectors and vectors.origin,
            "seed": about.seed,
            "device": self.device,
            "licence": about.licence,
            "data-licence": about.data_licence,
        }
        job = Job(stage.recipe, about, self.out / name, self.device)
        trained(job, lambda job: stage.train(store, job, place.name, self.by, **inputs), options, resume=True)
