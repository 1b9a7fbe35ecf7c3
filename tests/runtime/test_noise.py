import numpy as np

from motet.decode.loop import RowNoise


def test_a_row_does_not_depend_on_its_batch() -> None:
    together = RowNoise([3, 4, 5], width=7)
    alone = RowNoise([4], width=7)
    for tick in (0, 1, RowNoise.BLOCK - 1, RowNoise.BLOCK, 5 * RowNoise.BLOCK + 2, 0):
        np.testing.assert_array_equal(together.at(tick)[1], alone.at(tick)[0])


def test_ticks_and_seeds_differ_and_are_uniform() -> None:
    noise = np.stack([RowNoise([0, 1], width=500).at(tick) for tick in range(2 * RowNoise.BLOCK)])
    assert noise.dtype == np.float32
    assert len(np.unique(noise)) > 0.99 * noise.size
    counts, _ = np.histogram(noise, bins=10, range=(0, 1))
    np.testing.assert_allclose(counts / noise.size, 0.1, atol=0.01)
