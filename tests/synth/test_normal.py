import numpy as np

from synth.normal import standard_normal

TAIL = 3.6542
"""Beyond it numbers are drawn by another method."""


def test_the_numbers_are_numpys_bit_for_bit():
    # 4 million numbers: some thousand in the tail, and thousands of every way to accept or reject a point
    drawn = standard_normal(np.random.default_rng(3), (4_000_000,))
    expected = np.random.default_rng(3).standard_normal(4_000_000, dtype=np.float32)
    np.testing.assert_array_equal(drawn, expected)
    assert (np.abs(drawn) > TAIL).sum() > 900


def test_few_numbers_and_many_seeds_are_numpys_too():
    for seed in range(300):
        drawn = standard_normal(np.random.default_rng(seed), (7, 11, 3))
        expected = np.random.default_rng(seed).standard_normal((7, 11, 3), dtype=np.float32)
        np.testing.assert_array_equal(drawn, expected)
    assert standard_normal(np.random.default_rng(0), (0, 3)).shape == (0, 3)


def test_more_words_are_drawn_where_a_frames_words_do_not_suffice(monkeypatch):
    monkeypatch.setattr("synth.normal._SPARE", 0.5)
    drawn = standard_normal(np.random.default_rng(5), (20_000,))
    np.testing.assert_array_equal(drawn, np.random.default_rng(5).standard_normal(20_000, dtype=np.float32))
