"""Mutated motion files as uploads: whatever is altered, motet serve answers, and an error is the client's, as JSON.

    python tests/fuzz_uploads.py --count 300 [--seed N] [--first N] [--seconds 2] [--megabytes 500]

The mutants are those of tests/fuzz_motions.py. Each is described, continued, and taken for the character of another
motion, by the application in a process of its own. An answer with a status of 500 or more is a failure.
"""

import sys
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path

from fuzz_motions import mutants, own_files
from fuzzing import fuzz, options
from starlette.testclient import TestClient

from motet.formats import ONTO
from motet.serve.application import app
from motet.serve.uploads import RequestError

mutate = mutants(own_files(frames=48))
"""Of motions that are long enough to be continued."""

WALK = "text=a+person+walks&seconds=0.5"


@cache
def client() -> TestClient:
    """Asks the application, which runs until its process ends."""
    found = TestClient(app(), base_url="http://localhost", raise_server_exceptions=False)
    return found.__enter__()


def asked(address: str, name: str, path: Path) -> None:
    """Send a file; RequestError where it is refused in JSON, AssertionError where that is not so."""
    answer = client().post(address, files={name: (path.name, path.read_bytes())})
    assert answer.status_code < 500, answer.text
    if answer.status_code != 200:
        error = answer.json()
        assert error["type"].endswith("Error"), error
        raise RequestError(error["error"])
    assert answer.content


def steps(path: Path) -> Iterator[Callable[[], object]]:
    """Upload a file as a motion and as a character."""
    yield partial(asked, "/describe?beams=1", "file", path)
    yield partial(asked, "/predict.csv?frames=2", "file", path)
    yield partial(asked, f"/generate.bvh?{WALK}", "like", path)
    if path.suffix in ONTO:
        yield partial(asked, f"/generate{path.suffix}?{WALK}", "onto", path)


def main() -> int:
    """The command."""
    return fuzz(options(__doc__).parse_args(), mutate, steps)


if __name__ == "__main__":
    sys.exit(main())
