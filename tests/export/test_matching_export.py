"""A figure that is steered as a bundle: plain arrays without a graph, which play what the run plays."""

import json
import zipfile
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from motet import to_humanoid
from motet.bundle.bundle import Bundle
from motet.figures.humanoid import HUMANOID
from motet.formats import read_motion
from motet.models.load import load, load_as, verify
from motet.representation.contract import MotionContract, named
from motet.steering.model import SteerModel
from motet.steering.recorded import Recording
from motet.steering.rows import rows_of
from motet.steering.settings import SteeringSettings
from motet_export.bundles import export_run, parity_of
from motet_export.exporter import ExportError
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.models.kinematics import tree_of
from motet_train.models.matching import Matching, MatchingConfig
from motet_train.recipes.matching import take
from motet_train.runs import Run


@pytest.fixture(scope="module")
def run() -> Run:
    walk = to_humanoid(read_motion(CMU_FOLDER / "39_14.amc")).motion.resample(30.0)
    features = named("root_sixd").features(walk)
    how = SteeringSettings(lasting=15, blend=0.2)
    rows = rows_of([Recording(features, frozenset({"walk"}))], ("walk",), how)
    measured = features.values.mean(axis=0), features.values.std(axis=0)
    contract = MotionContract("root_sixd", features.channels, features.units, 30.0, *measured, HUMANOID)
    speeds = ((0.5, 1.3, 2.0, 0.0, 0.0),)
    width, tree = rows.features.shape[1], tree_of(contract)
    net = Matching(MatchingConfig(136, tree, len(rows), 10, 8, width, ("walk",), speeds))
    take(net, rows)
    about = {"name": "walk", "verb": "control", "model": "motion-matching", "loop": "matching", "defaults": {}}
    known = {"config": asdict(net.config), "settings": {"steering": asdict(how)}, "motion": contract.to_json()}
    manifest = {**about, **known, "licence": {}, "training": {}}
    return Run(json.loads(json.dumps(manifest)), net)


@pytest.fixture(scope="module")
def bundle(run: Run, folder: Path) -> Path:
    export_run(run, folder / "walk.zip")
    return folder / "walk.zip"


def test_it_holds_plain_arrays_and_no_graph(run: Run, bundle: Path) -> None:
    assert not [name for name in zipfile.ZipFile(bundle).namelist() if name.endswith(".onnx")]
    opened = Bundle.open(bundle)
    for name, table in run.model.tables().items():
        np.testing.assert_array_equal(opened.table(name), table)
    assert set(verify(opened).errors) == {"meaning", "run"}
    model = load_as(SteerModel, bundle)
    assert (model.matcher.settings.lasting, model.matcher.settings.blend) == (15, 0.2)
    session = model.start()
    session.control(speed=1.3)
    assert [session.tick() for _ in range(60)][-1].ground[0, 1] > 1.5
    assert load(bundle).providers == ()


def test_a_bundle_of_another_run_is_told_apart(run: Run, bundle: Path) -> None:
    assert parity_of(run, Bundle.open(bundle))["runs"]["error"] == 0
    other = Matching(run.model.config)  # type: ignore[arg-type]
    other.load_state_dict(run.model.state_dict())
    other.pose_mean += 0.01
    with pytest.raises(ExportError, match="parity runs"):
        parity_of(Run(run.manifest, other), Bundle.open(bundle))
