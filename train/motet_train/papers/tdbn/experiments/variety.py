"""Stochastic variety: sampled runs differ, but arrive, and keep walking (thesis 5.3, figure 5.7c)."""

import numpy as np

from motet_train.papers.tdbn.experiments.gaits import nearer_to_run
from motet_train.papers.tdbn.experiments.study import ControlStudy
from motet_train.papers.tdbn.period import period


def sampled_runs(study: ControlStudy, variety: float = 1.0, runs: int = 4) -> dict[str, float]:
    """Four sampled runs of one transition, and four sampled minutes of walking.

    differ: the least RMS z between two transitions in their first second. arrive: the share that runs in the last
    half second of two. kept: the share of walking frames nearer to the walking loop. energy: of the walk's legs.
    """
    history = study.phases("walk", 1)[0].repeat(runs, axis=0)
    frames = study.hold(history, "run", 2.0, variety=variety).frames
    z = study.reference.z(frames[: study.frames(1.0)])
    pairs = [np.sqrt(((z[:, i] - z[:, j]) ** 2).mean()) for i in range(runs) for j in range(i)]
    walk = study.hold(history, "walk", 60.0, variety=variety).frames
    last = walk[-study.frames(20.0) :]
    return {
        "variety": variety,
        "differ": float(min(pairs)),
        "arrive": float(nearer_to_run(study, frames[-study.frames(0.5) :]).all(axis=0).mean()),
        "kept": float(1 - nearer_to_run(study, walk).mean()),
        "period_s": float(np.median([period(study.reference.leg_angles(last[:, row])) for row in range(runs)]))
        / study.fps,
        "energy": float(np.mean([study.reference.energy_ratio(last[:, row], study.walk) for row in range(runs)])),
    }
