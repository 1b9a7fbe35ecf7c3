"""``motet bench``: how fast models run here, beside torch, the machine's ceilings and figures of before."""

import importlib
import importlib.util
import json
import logging
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import Any

import click

from motet.bench.cases import cases
from motet.bench.machine import Machine, begun
from motet.bench.measure import LESS, Case, Row, compared
from motet.bench.profile import with_profiles
from motet.bundle.bundle import list_bundles
from motet.bundle.graph import SessionOptions
from motet.cli.options import json_option, session_options
from motet.errors import FormatError, TextWarning, collected
from motet.files import Json
from motet.models.load import load

log = logging.getLogger(__name__)


@click.command()
@click.option("--bundle", default="control", show_default=True, help="Name or path of a bundle; all: all that ship.")
@click.option("--motion", type=Path, help="Motion file to read.  [default: a generated one of 2.8 s]")
@click.option("--seconds", default=1.0, show_default=True, help="How long to measure each row.")
@click.option("--torch/--no-torch", default=True, help="Measure torch too, if it is installed.  [default: --torch]")
@click.option("--compile", is_flag=True, help="Measure torch.compile too, which takes minutes.")
@click.option("--profile", is_flag=True, help="Print which kernels take the time.")
@click.option("--compare", type=Path, metavar="OLD", help="What --json printed: also how much better each row is.")
@click.option("--force", is_flag=True, help="Measure though other programs want more cores than there are.")
@session_options
@json_option("Print the machine and, of each bundle, a list of rows.")
def bench(
    bundle: str,
    compare: Path | None,
    profile: bool,
    force: bool,
    as_json: bool,
    session: SessionOptions,
    **measure_options: Any,
) -> None:
    """Measure a bundle's speed, and torch's where it is installed, in turn; and the machine's own ceilings."""
    old = {} if compare is None else _earlier(compare)
    machine = Machine.here()
    busy = f"the machine is busy (load {machine.load} on {machine.cores} cores)"
    if machine.overloaded and not force:
        raise click.UsageError(f"{busy}: wait until other programs are done, or measure with --force")
    if machine.busy:
        log.warning("%s: figures are too low; times of the processor (cpu) are disturbed least", busy)
    for key in ("processor", "cores", "versions"):
        if old and old["machine"].get(key) != (now := getattr(machine, key)):
            log.warning("%s: another machine or version: %s %s, now %s", compare, key, old["machine"].get(key), now)
    measurements = {}
    for name in list_bundles() if bundle == "all" else [bundle]:
        measurements[name] = measured(name, session, machine, **measure_options)
        if not as_json:
            click.echo(f"{name} on {', '.join(load(name, session).providers) or 'numpy'}, threads: {session.threads}")
            old_rows = old.get("bundles", {}).get(name, [])
            _print(measurements[name], {row["name"]: row["value"] for row in old_rows}, profile)
    if as_json:
        rows = {name: list(map(asdict, of)) for name, of in measurements.items()}
        click.echo(json.dumps({"machine": asdict(machine), "bundles": rows}))
        return
    products = ", ".join(f"{speed:.0f} GFLOP/s by {count}" for count, speed in machine.gflops.items())
    click.echo(f"{machine.processor}: float32 products {products} threads, copies {machine.gigabytes:.1f} GB/s")


def measured(
    name: str,
    options: SessionOptions,
    machine: Machine,
    motion: Path | None = None,
    seconds: float = 1.0,
    torch: bool = True,
    compile: bool = False,
) -> list[Row]:
    """The rows of a bundle, beside torch where that is wanted, installed, and has graphs to run; with profiles."""
    model = load(name, options)
    models = {"motet": model}
    if torch and model.graphs and importlib.util.find_spec("torch"):
        # by name: the runtime does not depend on the training package
        runs = importlib.import_module("motet_train.runs")
        for torch_mode in ("eager", "compiled") if compile else ("eager",):
            models[torch_mode] = runs.torch_model(model, options.threads, compiled=torch_mode == "compiled")
    with collected(TextWarning):
        rows = compared({torch_mode: cases(candidate, motion) for torch_mode, candidate in models.items()}, seconds)
        if model.graphs:

            def cases_with(profile_options: SessionOptions) -> list[Case]:
                return cases(load(name, profile_options), motion)

            rows = with_profiles(rows, options, cases_with, machine, seconds / 5)
    return rows + begun(name, options)


def _print(rows: list[Row], before: dict[str, float], profile: bool) -> None:
    for row in rows:
        click.echo(_line(row, before.get(row.name)))
        if profile and row.parts:
            whole = sum(row.parts.values())
            parts = [(name, of / whole) for name, of in row.parts.items() if of > 0.02 * whole]
            click.echo("    " + ", ".join(f"{name} {100 * of:.0f} %" for name, of in parts))


def _line(row: Row, before: float | None) -> str:
    """A row, beside its value of before."""
    line = f"{row.name:<24} {row.value:>10,.1f} {row.unit:<9}"
    if row.batch > 1:
        line += f" of {row.batch}"
    if row.times is not None:
        times = row.times
        line += f"  p95 {times.p95:,.3g} p99 {times.p99:,.3g} mean {times.mean:,.3g} cpu {times.processor:,.3g} ms"
    for rival, comparison in row.beside.items():
        line += f"  x{comparison.ratio:.2f} (cpu x{comparison.processor_ratio:.2f})"
        line += f" of {rival} {comparison.value:,.1f}"
    if row.share is not None:
        line += f"  {row.gflop:.3g} GFLOP, {100 * row.share:.0f} % of peak"
    if before:
        gain = row.value / before
        line += f"  x{1 / gain if row.unit in LESS else gain:.2f} of before"
    return line


def _earlier(file: Path) -> Json:
    """What ``--json`` printed."""
    try:
        report: Json = json.loads(file.read_text(encoding="utf-8"))
        rows = list(chain(*report["bundles"].values()))
        known = [(row["name"], float(row["value"])) for row in rows]
        if not known or not isinstance(report["machine"], dict):
            raise ValueError("no rows")
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise FormatError(file, f"not what motet bench --json prints: {error}") from error
    return report
