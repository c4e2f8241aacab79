"""The two published formats, by small files in them."""

import numpy as np

from agonic.field.published import read_cof, read_shc


def test_shc_is_linear_between_its_epochs() -> None:
    text = """# a comment
1 2 3 2 1 2000.0 2008.0
 2000.0 2004.0 2008.0
1  0  -10  -6  -6
1  1    1   2   3
1 -1    4   8   0
2 -2    0   0   1
"""
    model = read_shc(text)
    assert model.starts.tolist() == [2000.0, 2004.0]
    assert model.until == 2008.0
    assert model.value[0, 0, 1, :2].tolist() == [-10.0, 1.0]
    assert model.rate[:, 0, 1, 0].tolist() == [1.0, 0.0]
    assert model.rate[:, 1, 1, 1].tolist() == [1.0, -2.0]
    assert model.rate[1, 1, 2, 2] == 0.25


def test_cof_holds_five_years() -> None:
    text = """    2025.0    MODEL    01/01/2025
  1  0  -29351.8       0.0       12.0        0.0
  1  1   -1410.8    4545.4        9.7      -21.5
999999999999999999999999999999999999999999999999
"""
    model = read_cof(text)
    assert (model.starts.tolist(), model.until) == ([2025.0], 2030.0)
    assert np.array_equal(model.value[0, :, 1], [[-29351.8, -1410.8], [0.0, 4545.4]])
    assert np.array_equal(model.rate[0, :, 1], [[12.0, 9.7], [0.0, -21.5]])
