"""How the systems of a table were trained, in sentences computed from their manifests."""

from collections.abc import Mapping, Sequence
from typing import Any

from motet_train.evaluate.predict.ablations import difference
from motet_train.evaluate.predict.costs import AUGMENTATION, AVERAGE, harness_of
from motet_train.evaluate.predict.results import Results
from motet_train.evaluate.predict.sentences import Figures
from motet_train.evaluate.predict.words import listed

FRAME_BY_FRAME = ("erd", "lstm-3lr", "lstm-ae")
"""Systems that predict frames, not changes."""


def training_sentences(figures: Figures) -> list[str]:
    """What the rows have in common and what not: files, augmentation, seeds, ends of training, sizes."""
    results = figures.results
    trained = {figures.name(title): _trainings(results, group.runs) for title, group in figures.groups.items()}
    if not trained:
        return []
    said = [_alike("files", {name: _files(runs[0]) for name, runs in trained.items()})]
    said.append(_alike("augmentation", {name: _augmentation(runs[0]) for name, runs in trained.items()}))
    said.append(_alike("running mean of the weights", {name: _average(runs[0]) for name, runs in trained.items()}))
    said.append(_alike("number of seeds", {name: str(len(runs)) for name, runs in trained.items()}))
    said += [line for name, runs in trained.items() if (line := _stopped(name, runs))]
    return [*said, *_sizes(trained), *_settings(figures), *_leaps(figures)]


def _trainings(results: Results, runs: Sequence[str]) -> list[Mapping[str, Any]]:
    return [results.models[run].manifest.training for run in runs]


def _files(training: Mapping[str, Any]) -> str:
    _, data = harness_of(training)
    held = len(data.get("validation", ()))
    return f"{data.get('files', '?')} trained on, {held or 'none'} held out"


def _augmentation(training: Mapping[str, Any]) -> str:
    recipe, _ = harness_of(training)
    return listed([f"{key} {recipe.get(key) or 0:g}" for key in AUGMENTATION if key != AVERAGE])


def _average(training: Mapping[str, Any]) -> str:
    kept = harness_of(training)[0].get(AVERAGE) or 0
    return f"{kept:g}" if kept else "none"


def _alike(what: str, found: Mapping[str, str]) -> str:
    """One sentence where all rows have the same, else what each has."""
    if len(set(found.values())) == 1:
        return f"All rows have the same {what}: {next(iter(found.values()))}."
    by: dict[str, list[str]] = {}
    for name, words in found.items():
        by.setdefault(words, []).append(name)
    return f"Not all rows have the same {what}: {'; '.join(f'{listed(names)} {w}' for w, names in by.items())}."


def _stopped(name: str, runs: Sequence[Mapping[str, Any]]) -> str:
    """Of training that ended before its last step."""
    ends = [(run["steps"], harness_of(run)[0].get("steps")) for run in runs if "steps" in run]
    early = [end for end, of in ends if of and end < of]
    if not early:
        return ""
    ended = listed([f"{end:,}" for end in sorted(set(early))])
    return f"{name} stopped early, after {ended} of {ends[0][1]:,} steps."


def _sizes(trained: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[str]:
    sizes = {name: int(runs[0]["parameters"]) for name, runs in trained.items() if "parameters" in runs[0]}
    if len(sizes) < 2:
        return []
    (small, least), *_, (large, most) = sorted(sizes.items(), key=lambda item: item[1])
    if least == most:
        return [f"All nets have {least:,} parameters."]
    return [f"The smallest net is {small} with {least:,} parameters, the largest {large} with {most:,}."]


def _settings(figures: Figures) -> list[str]:
    """How rows of one model differ."""
    models, said = figures.results.models, []
    by: dict[str, list[str]] = {}
    for title, group in figures.groups.items():
        by.setdefault(models[group.runs[0]].manifest.model, []).append(title)
    for first, *others in by.values():
        for other in others:
            pair = (models[figures.groups[title].runs[0]].manifest for title in (first, other))
            if words := difference(*pair):
                said.append(f"{figures.name(other)} differs from {figures.name(first)} in: {words}.")
    return said


def _leaps(figures: Figures) -> list[str]:
    rows = [figures.name(row) for row in figures.models(*FRAME_BY_FRAME)]
    if not rows:
        return []
    verb = "predict" if len(rows) > 1 else "predicts"
    return [f"{listed(rows)} {verb} frames, not changes: nothing holds their first frame to the last one given."]
