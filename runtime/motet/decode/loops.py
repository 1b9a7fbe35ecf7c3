"""All decoding loops, by the names that manifests use. A new one is a file here and a line in this table."""

from collections.abc import Mapping

from motet.decode import beam, codes, consensus, free_run, in_betweening, mixture, nearest, session, steering
from motet.decode.loop import Loop

LOOPS: Mapping[str, Loop] = {
    "beam": beam.LOOP,
    "consensus": consensus.LOOP,
    "mixture": mixture.LOOP,
    "codes": codes.LOOP,
    "free_run": free_run.LOOP,
    "session": session.LOOP,
    "matching": steering.LOOP,
    "nearest": nearest.LOOP,
    "between": in_betweening.LOOP,
}
