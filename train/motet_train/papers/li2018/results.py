"""What was measured by the protocol: the figures of runs and of groups of seeds, as text and as JSON."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from motet_train.evaluate.predict.costs import cost_table, harness_table
from motet_train.evaluate.predict.floors import FLOORS
from motet_train.evaluate.predict.seed_groups import Models, Ready, SeedGroup, ready, seed_groups
from motet_train.papers.li2018.ablations import ablated, ablation_table
from motet_train.papers.li2018.curves import FEW, Curves, by_group, curves, spreads_of, to_json
from motet_train.papers.li2018.expmap_files import ExpmapCorpus
from motet_train.papers.li2018.protocol_table import protocol_table


@dataclass(frozen=True, eq=False)
class Results:
    """runs: of each model and floor. means, spreads: of groups of runs that differ in their seed alone, and floors."""

    models: Models
    corpus: ExpmapCorpus
    groups: Sequence[SeedGroup]
    runs: Curves
    means: Curves
    spreads: Curves


def results_of(models: Models, corpus: ExpmapCorpus, progress: Callable[[str], object] = lambda name: None) -> Results:
    """Measure models by the protocol, see :func:`motet_train.papers.li2018.curves.curves`."""
    groups = seed_groups(models)
    return from_curves(models, corpus, groups, curves(models, corpus, progress))


def from_curves(models: Models, corpus: ExpmapCorpus, groups: Sequence[SeedGroup], found: Curves) -> Results:
    """The results of errors that were measured."""
    return Results(models, corpus, groups, found, by_group(found, groups), spreads_of(found, groups))


def results_text(results: Results) -> str:
    """The tables: errors, training, costs, and the ablations where models were given that differ in their settings."""
    models, groups = results.models, results.groups
    parts = [protocol_table(results.means, results.corpus, results.spreads)]
    parts += [harness_table(models, groups), cost_table(models, groups)]
    if said := ablated(models, groups):
        parts.append(ablation_table(results.means, said, results.spreads))
    return "\n\n".join(parts)


def results_json(results: Results) -> Ready:
    """See :func:`ready`."""
    figures = (partial(to_json, found) for found in (results.runs, results.means, results.spreads))
    return ready(results.models, results.groups, [name for name in results.means[FEW] if name in FLOORS], *figures)
