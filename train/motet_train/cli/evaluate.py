"""``motet evaluate``."""

import json
from pathlib import Path

import click
import torch
from tqdm import tqdm

from motet.models.control import ControlModel
from motet.models.describe import DescribeModel
from motet.models.generate import GenerateModel
from motet.models.load import VERBS, Model, load
from motet.models.predict import PredictModel
from motet_train.cli.evaluate_language import by_subject, language_reports
from motet_train.cli.evaluate_predict import predict_reports
from motet_train.data.clips import read_clips
from motet_train.evaluate.control.report import GOALS, control_report, lab_of
from motet_train.evaluate.language.report import GOALS as LANGUAGE_GOALS
from motet_train.evaluate.tables import Report, json_ready, table
from motet_train.runs import Run


@click.command()
@click.argument("models", nargs=-1, required=True)
@click.option(
    "--data",
    type=Path,
    help="Control: the clips it was trained on [default: three CMU trials]. Describe and generate: the store. "
    "Predict: text files of the protocol, or motion files.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one nested object with stable keys.")
@click.option("--plots", type=Path, help="Folder for the figures of the papers.")
@click.option("--save", is_flag=True, help="Keep the figures in each run; export puts them into the bundle.")
def evaluate(models: tuple[str, ...], data: Path | None, as_json: bool, plots: Path | None, save: bool) -> None:
    """Run the papers' experiments on MODELS: run folders, or names and paths of bundles.

    Control: the thesis' experiments. Describe and generate: BLEU, floors, attributes, measures; with both, of the
    same split, also the chain from sentence to motion and back. Predict: the protocol's Euler errors on its text files,
    beside zero velocity and published rows, or distances in held out motion files.
    """
    torch.set_num_threads(1)
    runs = {name: Run.load(Path(name)) for name in models if (Path(name) / "run.json").is_file()}
    loaded = {name: _model(runs[name]) if name in runs else load(name) for name in models}
    controls = {name: model for name, model in loaded.items() if isinstance(model, ControlModel)}
    others = {name: model for name, model in loaded.items() if isinstance(model, DescribeModel | GenerateModel)}
    predicts = {name: model for name, model in loaded.items() if isinstance(model, PredictModel)}
    if sum(map(bool, (controls, others, predicts))) > 1:
        raise click.UsageError("evaluate models that control, that predict, and others apart: their data differ")
    if predicts:
        ready, text = predict_reports(predicts, data, plots)
    else:
        reports = _control(controls, data, plots) if controls else language_reports(others, data, plots)
        ready = {name: json_ready(report) for name, report in reports.items()}
        for name in others:
            if (other := by_subject(others, name)) is not None:
                ready[name]["people_unseen"] = json_ready(reports[other])
        text = table(reports, GOALS if controls else LANGUAGE_GOALS)
    for name in runs if save else ():
        Run({**runs[name].manifest, "quality": ready[name]}, runs[name].model).save(Path(name))
    if as_json:
        click.echo(json.dumps(ready[models[0]] if len(models) == 1 else ready))
    else:
        click.echo(text)


def _model(run: Run) -> Model:
    return VERBS[run.manifest["verb"]](run.manifest, run.torch_graphs())


def _control(models: dict[str, ControlModel], data: Path | None, plots: Path | None) -> dict[str, Report]:
    reports: dict[str, Report] = {}
    for name, model in models.items():
        lab = lab_of(model, read_clips(data))
        bar = tqdm(desc=name, unit=" experiments", disable=None, leave=False)
        reports[name] = control_report(lab, lambda key, bar=bar: bar.update())  # type: ignore[misc]
        bar.close()
        if plots is not None:
            from motet_train.evaluate.control.plots import draw_all

            draw_all(lab, plots)
    return reports
