"""``motet evaluate`` of models that predict."""

from pathlib import Path

import click

from motet_train.cli.evaluate_mocap import mocap_reports
from motet_train.cli.train_predict import read_expmap_files
from motet_train.evaluate.predict.seed_groups import Models, Ready
from motet_train.papers.li2018.expmap_files import is_expmap
from motet_train.papers.li2018.report import protocol_results


def predict_reports(models: Models, data: Path | None, plots: Path | None) -> tuple[Ready, str]:
    """The figures of each model, ready for JSON, and the tables.

    By the protocol where ``data`` has its text files, else the joints' distances in trials that were held out. Runs
    that differ in their seed alone are one row of the table.
    """
    if data is None:
        raise click.UsageError("predictors need --data: text files of the protocol, or the store they were trained on")
    if not is_expmap(data):
        return mocap_reports(models, data, plots)
    results = protocol_results(models, read_expmap_files(data))
    if plots is not None:
        from motet_train.evaluate.figures import save
        from motet_train.papers.li2018.figures import drawings

        save(drawings(results), plots)
    return results.to_json(), results.text()
