"""``motet evaluate --says``: do the motions what the prompts say?"""

from collections.abc import Mapping
from pathlib import Path

from motet.bundle.manifest import Manifest
from motet.models.generate import GenerateModel
from motet.models.search import SearchModel
from motet_train.data.errors import DataError
from motet_train.evaluate.tables import Report
from motet_train.evaluate.text_adherence.prompts import outside, prompts
from motet_train.evaluate.text_adherence.table import Best, said_to_be_outside, says_table
from motet_train.evaluate.text_adherence.trials import Trial, read_trials


def says_reports(
    models: Mapping[str, GenerateModel], data: Path | None, unit: str | None, search: SearchModel
) -> dict[str, Report]:
    """The table of each model. data: a store or a corpus of motion files, for the real trials and the look-up."""
    trials = [] if data is None else list(read_trials(data, unit))
    if data is not None and not trials:
        raise DataError(f"{data} has no motion that can be used")
    reports = {}
    for name, model in models.items():
        reports[name] = says_table(Best(model), trials, trained_on(model.manifest, trials), search=search)
        asked = {"outside": outside(), "prompts": [prompt.text for prompt in prompts()]}
        reports[name]["said_outside"] = {key: said_to_be_outside(model, texts) for key, texts in asked.items()}
    return reports


def trained_on(manifest: Manifest, trials: list[Trial]) -> set[str]:
    """The names of the trials that are neither validation nor test motions of a model; all, where it does not say."""
    split = manifest.training.get("split", {})
    held_out = {name for part in ("validation", "test") for name in split.get(part, ())}
    return {trial.name for trial in trials} - held_out
