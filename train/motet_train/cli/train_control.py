"""``motet train tdbn`` and ``motet train crbm``: models that are controlled live."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import click
import torch
from tqdm import tqdm

from motet_train.cli.places import command_line, refuse_existing
from motet_train.data.clips import Clips, read_clips
from motet_train.models.control.angle_crbm import AngleCRBMConfig
from motet_train.models.control.tdbn import TDBNConfig
from motet_train.recipes.control import About, Config, train_control
from motet_train.runs import Run

RECIPES: dict[str, Callable[[], TDBNConfig]] = {
    "default": TDBNConfig,
    "unclamped": lambda: TDBNConfig().unclamped(),
    "thesis": TDBNConfig.thesis,
}


@click.command()
@click.option(
    "--data",
    type=Path,
    help="Folder of clips LABEL.bvh and LABEL/*.bvh (or .amc .npz .csv). [default: three CMU trials]",
)
@click.option("--out", type=Path, default=Path("runs/tdbn"), show_default=True, help="Folder to write; must not exist.")
@click.option("--recipe", type=click.Choice(list(RECIPES)), default="default", show_default=True)
@click.option("--seed", default=6, show_default=True, help="The default is that of the bundle cmu-control.")
@click.option("--threads", default=1, show_default=True, help="More do not pay for a net of this size.")
@click.option("--name", default="cmu-control", show_default=True, help="Name of the bundle to be.")
@click.option("--licence", default="MIT", show_default=True, help="Licence of the weights.")
def tdbn(data: Path | None, out: Path, recipe: str, seed: int, threads: int, name: str, licence: str) -> None:
    """Train a temporal deep belief net that is controlled live, on short labelled clips."""
    config = RECIPES[recipe]()
    _train(read_clips(data, config.root_rotation), config, out, seed, threads, About(name, command_line(), licence))


@click.command()
@click.option("--data", type=Path, help="Folder of clips, as of tdbn. [default: three CMU trials]")
@click.option("--labels", help='Labels to train on, such as "walk,run". [default: all]')
@click.option("--out", type=Path, default=Path("runs/crbm"), show_default=True, help="Folder to write; must not exist.")
@click.option("--past-rate", default=AngleCRBMConfig.past_rate, show_default=True, help="Rate of past to angles.")
@click.option("--control-units", default=AngleCRBMConfig.control_units, show_default=True, help="For each label.")
@click.option("--epochs", default=AngleCRBMConfig().crbm.epochs, show_default=True)
@click.option("--seed", default=0, show_default=True)
@click.option("--name", default="crbm", show_default=True, help="Name of the bundle to be.")
@click.option("--licence", default="MIT", show_default=True, help="Licence of the weights.")
def crbm(
    data: Path | None,
    labels: str | None,
    out: Path,
    past_rate: float,
    control_units: int,
    epochs: int,
    seed: int,
    name: str,
    licence: str,
) -> None:
    """Train the baseline, a conditional RBM straight on the joint angles (Taylor 2007)."""
    plain = AngleCRBMConfig(past_rate=past_rate, control_units=control_units)
    config = replace(plain, crbm=replace(plain.crbm, epochs=epochs))
    clips = read_clips(data, config.root_rotation)
    clips = clips.only([label.strip() for label in labels.split(",")]) if labels else clips
    _train(clips, config, out, seed, 1, About(name, command_line(), licence))


def _train(clips: Clips, config: Config, out: Path, seed: int, threads: int, about: About) -> None:
    refuse_existing(out)
    torch.set_num_threads(threads)
    with _Bars() as progress:
        run = train_control(clips, config, seed, about, progress)
    _save(run, out)
    training = run.manifest["training"]
    click.echo(f"{out}: {training['seconds']:g} s, reconstruction {training['reconstruction']:.3f} z")


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
