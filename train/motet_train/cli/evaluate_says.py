"""``motet evaluate --says``: do the motions what the prompts say?"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from motet.bundle.manifest import Manifest
from motet.models.codes import CodesModel
from motet.models.generate import GenerateModel
from motet.models.search import SearchModel
from motet.motion.motion import Motion
from motet_train.data.errors import DataError
from motet_train.evaluate.tables import Report
from motet_train.evaluate.text_adherence.outside import OUTSIDE, said_to_be_outside
from motet_train.evaluate.text_adherence.prompts import prompts
from motet_train.evaluate.text_adherence.table import says_table
from motet_train.evaluate.text_adherence.trials import Trial, read_trials


@dataclass(frozen=True)
class Best:
    """A model as users get it: the first of its motions, with its default settings."""

    model: GenerateModel

    def generate(self, text: str, seed: int) -> Motion:
        """The motion at 30 frames a second, its feet planted."""
        return self.model.generate(text, seed=seed)[0].motion


def says_reports(
    models: Mapping[str, GenerateModel], data: Path | None, unit: str | None, search: SearchModel
) -> dict[str, Report]:
    """The table of each model. data: a store or a corpus of motion files, for the real trials and the look-up."""
    trials = [] if data is None else list(read_trials(data, unit))
    if data is not None and not trials:
        raise DataError(f"{data} has no motion that can be used")
    reports = {}
    with tqdm(total=len(models) * len(prompts()), unit=" prompts", disable=None, leave=False) as bar:
        for name, model in models.items():
            bar.set_description(name)
            training = trained_on(model.manifest, trials)
            reports[name] = says_table(Best(model), trials, training, progress=lambda text: bar.update(), search=search)
            if isinstance(model, CodesModel):
                asked = {"outside": OUTSIDE, "prompts": [prompt.text for prompt in prompts()]}
                reports[name]["said_outside"] = {key: said_to_be_outside(model, texts) for key, texts in asked.items()}
    return reports


def trained_on(manifest: Manifest, trials: list[Trial]) -> set[str]:
    """The names of the trials that are neither validation nor test motions of a model; all, where it does not say."""
    split = manifest.training.get("split", {})
    held_out = {name for part in ("validation", "test") for name in split.get(part, ())}
    return {trial.name for trial in trials} - held_out
