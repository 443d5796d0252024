"""Spoilt profile files end in a sentence, never in another error; not proven: that the sentence names the cause."""

import numpy as np
import pytest

from geometry import PerceptronEmuError
from tests.profiles.mutants import mutants, samples
from workbench.profiles import Told, read_scan_lines
from workbench.profiles.source import cell_value


def read_all(tmp_path, count, seed):
    """How many spoilt files were read and refused."""
    rng = np.random.default_rng(seed)
    (tmp_path / "good").mkdir()
    read = refused = 0
    for path in samples(tmp_path / "good"):
        data = path.read_bytes()
        target = tmp_path / path.name
        if path.suffix in (".xml", ".dat"):
            for suffix in (".xml", ".dat"):
                target.with_suffix(suffix).write_bytes(path.with_suffix(suffix).read_bytes())
        told = Told("auto", 0.25, -4.0, unit=40)
        for spoilt in mutants(data, rng, count):
            target.write_bytes(spoilt)
            try:
                lines = read_scan_lines(target, told)
                worst = max(np.max(np.abs(s.z_mm[s.present]), initial=0.0) for s in lines)
            except PerceptronEmuError as error:
                refused, length = refused + 1, len(str(error))
            else:
                read, length = read + 1, 1
                assert worst < 1e6
            assert 0 < length < 600
        target.unlink()
    return read, refused


def test_spoilt_files_are_read_or_refused_in_a_sentence(tmp_path):
    read, refused = read_all(tmp_path, 60, 0)
    assert read > 100
    assert refused > 100


@pytest.mark.slow
def test_a_hundred_thousand_spoilt_files(tmp_path):
    read, refused = read_all(tmp_path, 5600, 1)
    assert read + refused >= 100_000


def test_a_word_that_breaks_a_line_is_told_in_one_line():
    with pytest.raises(PerceptronEmuError) as said:
        cell_value("0.\n1", "s.xml: scale")
    assert str(said.value) == 's.xml: scale: "0. 1" is not a number'
