"""``motet train`` and ``motet evaluate``."""

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import click
import torch
from tqdm import tqdm

from motet.control import ControlModel
from motet.errors import OutputError
from motet.models import load
from motet_train.control import About, train_control
from motet_train.data.clips import read_clips
from motet_train.evaluate.report import Report, control_report, json_ready, lab_of, table
from motet_train.models.tdbn import TDBNConfig
from motet_train.runs import Run

RECIPES: dict[str, Callable[[], TDBNConfig]] = {
    "default": TDBNConfig,
    "unclamped": lambda: TDBNConfig().unclamped(),
    "thesis": TDBNConfig.thesis,
}


@click.group()
def train() -> None:
    """Train a model; the run goes into a new folder that evaluate and export take."""


@train.command()
@click.option(
    "--data",
    type=Path,
    help="Folder of clips LABEL.bvh and LABEL/*.bvh (or .amc .npz .csv). [default: three CMU trials]",
)
@click.option("--out", type=Path, default=Path("runs/tdbn"), show_default=True, help="Folder to write; must not exist.")
@click.option("--recipe", type=click.Choice(list(RECIPES)), default="default", show_default=True)
@click.option("--seed", default=0, show_default=True)
@click.option("--threads", default=1, show_default=True, help="More do not pay for a net of this size.")
@click.option("--name", default="cmu-control", show_default=True, help="Name of the bundle to be.")
@click.option("--licence", default="MIT", show_default=True, help="Licence of the weights.")
def tdbn(data: Path | None, out: Path, recipe: str, seed: int, threads: int, name: str, licence: str) -> None:
    """Train a temporal deep belief net that is controlled live, on short labelled clips."""
    _refuse_existing(out)
    torch.set_num_threads(threads)
    config = RECIPES[recipe]()
    clips = read_clips(data, config.root_rotation)
    command = " ".join(["motet", *sys.argv[1:]])
    with _Bars() as progress:
        run = train_control(clips, config, seed, About(name, command, licence), progress)
    _save(run, out)
    training = run.manifest["training"]
    click.echo(f"{out}: {training['seconds']:g} s, reconstruction {training['reconstruction']:.3f} z")


@click.command()
@click.argument("models", nargs=-1, required=True)
@click.option("--data", type=Path, help="The clips it was trained on. [default: three CMU trials]")
@click.option("--json", "as_json", is_flag=True, help="Print one nested object with stable keys.")
@click.option("--plots", type=Path, help="Folder for figures 5.2 to 5.7 and 5.10 of the thesis.")
@click.option("--save", is_flag=True, help="Keep the figures in each run; export puts them into the bundle.")
def evaluate(models: tuple[str, ...], data: Path | None, as_json: bool, plots: Path | None, save: bool) -> None:
    """Run the thesis' experiments on MODELS: run folders, or names and paths of bundles."""
    torch.set_num_threads(1)
    reports: dict[str, Report] = {}
    for name in models:
        run, model = _load(name)
        lab = lab_of(model, read_clips(data))
        bar = tqdm(desc=name, unit=" experiments", disable=None, leave=False)
        reports[name] = control_report(lab, lambda key, bar=bar: bar.update())  # type: ignore[misc]
        bar.close()
        if plots is not None:
            from motet_train.evaluate.plots import draw_all

            draw_all(lab, plots)
        if save and run is not None:
            Run({**run.manifest, "quality": json_ready(reports[name])}, run.model).save(Path(name))
    ready = {name: json_ready(report) for name, report in reports.items()}
    if as_json:
        click.echo(json.dumps(ready[models[0]] if len(models) == 1 else ready))
    else:
        click.echo(table(reports))


def _load(name: str) -> tuple[Run | None, ControlModel]:
    if (Path(name) / "run.json").is_file():
        run = Run.load(Path(name))
        return run, ControlModel(run.manifest, run.torch_graphs())
    return None, load(name)


def _refuse_existing(out: Path) -> None:
    if out.exists():
        raise OutputError(f"cannot write the run {out}: it exists; remove it first or choose another folder")


def _save(run: Run, out: Path) -> None:
    temporary = out.with_name(f".{out.name}.partial")
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    run.save(temporary)
    temporary.rename(out)


class _Bars:
    """A progress bar for each layer, quiet where nobody watches."""

    def __enter__(self) -> Callable[[str, int, int], None]:
        self._bars: dict[str, tqdm] = {}  # type: ignore[type-arg]
        return self._update

    def _update(self, layer: str, done: int, total: int) -> None:
        if layer not in self._bars:
            self._bars[layer] = tqdm(desc=layer, total=total, unit="epoch", disable=None)
        self._bars[layer].update()

    def __exit__(self, *exception: object) -> None:
        for bar in self._bars.values():
            bar.close()
