"""Parts of a benchmark on disk: read back as they were, and made again where they are not whole."""

import numpy as np
from femupdate.benchmarks.kept_parts import KeptParts
from femupdate.benchmarks.shear4dof.comparison import Comparison
from femupdate.benchmarks.shear4dof.observations import ObservationResult, result_back
from femupdate.benchmarks.shear4dof.samplers import SamplerRow, Spread, row_back

ROW = SamplerRow(
    *("latent", "mixture", 500, 31_333.0),
    *(Spread(0.1, 0.01), Spread(0.2, 0.02), Spread(0.3, 0.03), Spread(np.nan, np.nan)),
    *(1.0, 2.5),
)


def comparison(shift):
    table = np.array([[1.0, np.nan], [0.5, 2.0]]) + shift
    return Comparison(np.array([0.4, 0.6]) + shift, table, -table, 0.01, 0.02, np.nan)


RESULT = ObservationResult(
    2, comparison(0.0), comparison(1.0), -0.01, 0.02, 0.6, False, 70_000, 60, 15_000, 1.5, 0.7
)


def refuse():
    raise AssertionError("it was made already")


def same(one, other):
    for name, value in vars(one).items():
        if isinstance(value, Comparison | Spread):
            same(value, getattr(other, name))
        else:
            np.testing.assert_array_equal(value, getattr(other, name))


def test_parts_come_back_as_they_were(tmp_path):
    path = tmp_path / "folder" / "parts.jsonl"
    first = KeptParts(path, "a plan")
    assert first("row", lambda: ROW, row_back) is ROW
    first("result", lambda: RESULT, result_back)
    again = KeptParts(path, "a plan")
    same(again("row", refuse, row_back), ROW)
    same(again("result", refuse, result_back), RESULT)


def test_half_a_line_and_another_plan_are_made_again(tmp_path):
    path = tmp_path / "parts.jsonl"
    first = KeptParts(path, "a plan")
    first("row", lambda: ROW, row_back)
    first("result", lambda: RESULT, result_back)
    text = path.read_text()
    path.write_text(text[:-40])
    cut = KeptParts(path, "a plan")
    same(cut("row", refuse, row_back), ROW)
    made = []
    cut("result", lambda: made.append(1) or RESULT, result_back)
    KeptParts(path, "another plan")("row", lambda: made.append(2) or ROW, row_back)
    assert made == [1, 2]
