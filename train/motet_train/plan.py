"""The plan by which all that ships is trained on one's own recordings: one store, and stage after stage a run."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from motet.errors import MotetError
from motet_train.data.corpus import Corpus
from motet_train.data.predict_data import store_material
from motet_train.data.preparation import ALL, preparation
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
    """What a store is prepared for that a recipe trains on, see :func:`motet_train.data.preparation.preparation`."""
    if recipe.loop == "codes" or recipe.verb in ("control", "fill"):
        return "codes"
    return "predict" if recipe.verb == "predict" else "describe"


def store_for(place: Path, recipe: Recipe) -> Path:
    """Where the store that a recipe trains on is, if one is there: the place, or its part in the representation."""
    return part(place, preparation(kind_for(recipe), kit=False).representation)


@dataclass(frozen=True)
class Stage:
    """One training. verb: what it is for. train: its recipe's function of a store, a job, the store's name, how it is
    divided, and the runs that it needs. needs: the stage that each of these comes from, by the argument's name."""

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
        predict.FILES,
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
"""By their names, those that take least time first, each after those that it needs."""

PLANNED_VERBS = tuple(dict.fromkeys(stage.verb for stage in STAGES.values()))


@dataclass(frozen=True)
class Plan:
    """What is trained on, and where to.

    data: a corpus (:func:`motet_train.data.corpus.read_corpus`), or where its store is. out: the folder of the runs,
    and of the corpus' store. verbs: which. by: how motions are divided, see :func:`motet_train.data.store.split`.
    vectors: of words, from which the net of actions starts. changes: of stages' recipes, by name
    (:func:`motet_train.settings.read_stages`). about: of the runs but for their names.
    """

    data: Corpus | Path
    out: Path
    verbs: tuple[str, ...] = PLANNED_VERBS
    by: str = "trial"
    device: str = "cpu"
    vectors: WordVectors | None = None
    changes: Mapping[str, Mapping[str, Mapping[str, Any]]] = field(default_factory=dict)
    about: About = field(default_factory=lambda: About("", "motet_train.plan"))

    def train(self) -> None:
        """Train all that is not trained yet, each from its checkpoint if it has one; one that fails stops no other.

        RunError names the stages that failed.
        """
        stages = {
            name: replace(stage, recipe=changed(stage.recipe, self.changes.get(name, {}), {}))
            for name, stage in STAGES.items()
            if stage.verb in self.verbs
        }
        log.info("%d trainings into %s: %s", len(stages), self.out, ", ".join(stages))
        place, failed = self.store(), set[str]()
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
                seen = f"; see {self.out / name / LOG}" if (self.out / name / LOG).is_file() else ""
                log.error("%s failed: %s%s", name, error, seen)
        if failed:
            raise RunError(f"of {len(stages)} trainings {len(failed)} failed; the same command tries them again")

    def store(self) -> Path:
        """Where the store is; of a corpus, prepared for every verb if it is not there."""
        if isinstance(self.data, Path):
            return self.data
        place = self.out / "store"
        if place.exists():
            log.info("the store %s is there already: remove it to have recordings prepared anew", place)
        else:
            log.info("preparing %d motion files into %s", len(self.data), place)
            with preparing(len(self.data)) as done:
                prepare_parts(self.data, place, ALL, done)
        return place

    def _train(self, name: str, stage: Stage, place: Path) -> None:
        store = Store.open(store_for(place, stage.recipe))
        needs = {key: self.out / need for key, need in stage.needs.items()}
        given: dict[str, Any] = {key: Run.load(folder) for key, folder in needs.items()}
        vectors = self.vectors if name == "actions" else None
        if name == "actions":
            given["vectors"] = vectors
        about = replace(self.about, name=name)
        options = {  # of the command of this stage alone
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
        trained(job, lambda job: stage.train(store, job, place.name, self.by, **given), options, resume=True)
