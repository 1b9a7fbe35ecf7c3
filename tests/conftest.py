import os
import zipfile
from pathlib import Path

import pytest

# before torch is imported: two threads in each of two test processes on two cores wait for each other, which takes a
# test of many small products from 4 s to 70
os.environ.setdefault("OMP_NUM_THREADS", "1")

SHARED = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of real motion beside the project; tests that need it are skipped where it is absent."""
    if not SHARED.is_dir():
        pytest.skip("../shared/data is not here")
    return SHARED


@pytest.fixture(scope="session")
def cmu(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """CMU's trials unpacked: folders asf, amc and bvh."""
    folder = tmp_path_factory.mktemp("cmu")
    for name, kinds in (("cmu-asfamc.zip", (".asf", ".amc")), ("cmu-bvh.zip", (".bvh",))):
        with zipfile.ZipFile(shared / name) as archive:
            for entry in archive.namelist():
                path = Path(entry)
                if path.suffix in kinds:
                    place = folder / path.suffix[1:] / path.name
                    place.parent.mkdir(exist_ok=True)
                    place.write_bytes(archive.read(entry))
    return folder
