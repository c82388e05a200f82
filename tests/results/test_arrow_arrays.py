"""Arrow arrays and numpy arrays have the same values, also where values are absent, sliced, in parts or none at all."""

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest

from interdrive.storage.arrow_arrays import numbers, texts, truths, values_of
from interdrive.storage.columns import Column
from interdrive.storage.tables import arrow_table

ABSENT = np.array([False, True, False, False, True, False, False, False, True, False])


def test_numbers_come_back_with_nan_where_they_are_absent():
    values = np.linspace(-1.0, 2.0, 10)
    made = numbers(values, ABSENT)
    made.validate(full=True)
    assert made.to_pylist() == [None if gone else one for one, gone in zip(values, ABSENT, strict=True)]
    np.testing.assert_array_equal(values_of(made), np.where(ABSENT, np.nan, values))


def test_integers_come_back_with_what_stands_for_absence():
    made = numbers(np.arange(10), ABSENT)
    assert made.type == pa.int64()
    found = values_of(made, -1)
    assert found.dtype == np.int64
    assert found.tolist() == [0, -1, 2, 3, -1, 5, 6, 7, -1, 9]


def test_every_second_value_is_taken_from_where_it_lies():
    wide = np.arange(20.0).reshape(10, 2)
    assert values_of(numbers(wide[:, 1])).tolist() == wide[:, 1].tolist()


@pytest.mark.parametrize(("begin", "n"), [(0, 3), (1, 9), (8, 2), (5, 0)])
def test_a_slice_has_its_own_values(begin, n):
    expected = [None if gone else k % 3 == 0 for k, gone in enumerate(ABSENT)][begin : begin + n]
    made = truths(np.arange(10) % 3 == 0, ABSENT).slice(begin, n)
    assert made.to_pylist() == expected
    assert values_of(made, False).tolist() == [bool(one) for one in expected]
    names = texts([None if one is None else str(one) for one in expected])
    assert values_of(names, "").tolist() == ["" if one is None else str(one) for one in expected]


def test_texts_may_be_empty_absent_and_of_several_bytes():
    given = ["", None, "Kreuzung", "Straße", "𝄞", None]
    made = texts(given)
    made.validate(full=True)
    assert made.to_pylist() == given
    assert values_of(made).tolist() == given


def test_labels_in_parts_are_joined():
    some = pa.array(["idm", None, "frenet"]).dictionary_encode()
    more = pa.array(["rollout", "idm"]).dictionary_encode()
    assert values_of(pa.chunked_array([some, more]), "none").tolist() == ["idm", "none", "frenet", "rollout", "idm"]


def test_a_label_may_be_absent_among_the_labels_and_there_may_be_as_many_as_their_type_counts():
    many = pa.DictionaryArray.from_arrays(pa.array([0, 127, None], pa.int8()), pa.array([None, *map(str, range(127))]))
    assert values_of(many, "none").tolist() == ["none", "126", "none"]


@pytest.mark.parametrize(
    "kind",
    [
        pa.int64(),
        pa.float64(),
        pa.bool_(),
        pa.string(),
        pa.large_string(),
        pa.dictionary(pa.int32(), pa.string()),
        pa.dictionary(pa.int8(), pa.large_string()),
    ],
)  # fmt: skip
def test_a_column_without_rows_has_no_values(kind):
    found = values_of(pa.chunked_array([], type=kind))
    assert found.shape == (0,)
    assert found.dtype == {"int64": np.int64, "double": np.float64, "bool": np.bool_}.get(str(kind), object)


def test_values_are_ones_own_to_change():
    table = pa.table({"speed": np.array([1.0, 2.0])})
    values_of(table["speed"])[0] = 7.0
    assert table["speed"].to_pylist() == [1.0, 2.0]


ROUTE = Column("lanelets", "integer", "number of lanelets", null="no route")
SPEED = Column("speed", "number", "speed", unit="m/s")


@pytest.mark.parametrize(
    ("column", "values", "found"),
    [
        (ROUTE, np.array([3, -1]), [3, None]),
        (ROUTE, [3, None], [3, None]),
        (ROUTE, [3, float("nan")], [3, None]),
        (ROUTE, np.array([]), []),
        (ROUTE, np.array([3.0, -1.0, np.nan]), [3, None, None]),
        (ROUTE, np.array([3, 4], dtype=np.int32), [3, 4]),
        (replace(ROUTE, null=""), np.array([3, -1]), [3, -1]),
        (SPEED, np.array([3, 4]), [3.0, 4.0]),
        (replace(SPEED, null="unknown"), np.array([3.0, np.nan]), [3.0, None]),
        (replace(SPEED, null="unknown"), [None, 4], [None, 4.0]),
        (Column("is_agent", "truth", "whether it plans", null="unknown"), [True, None], [True, None]),
        (Column("reason", "text", "why", null="none"), ["", None], ["", None]),
        (Column("planner", "label", "name", labels=("a", "b"), coded=True, null="none"), [1, -1], ["b", None]),
    ],
)  # fmt: skip
def test_a_column_takes_arrays_and_lists_and_what_is_absent_in_them_is_null(column, values, found):
    assert arrow_table([column], {column.name: values})[column.name].to_pylist() == found


def test_nan_is_a_value_where_every_row_has_one():
    (made,) = arrow_table([SPEED], {"speed": [float("nan"), 4.0]})["speed"].chunks
    assert made.null_count == 0
    assert np.isnan(made[0].as_py())


@pytest.mark.parametrize("given", [np.array([1.5]), [1.5], [1.5, None], (2, 0.5)])
def test_fractions_are_refused_where_integers_are_meant(given):
    with pytest.raises(TypeError, match="column lanelets: float64 with fractions is no integer"):
        arrow_table([ROUTE], {"lanelets": given})


@pytest.mark.parametrize(
    ("column", "given"),
    [(ROUTE, ["3"]), (SPEED, ["fast"]), (SPEED, [True]), (Column("is_agent", "truth", "whether it plans"), ["no"])],
)
def test_values_of_another_kind_are_refused(column, given):
    with pytest.raises(TypeError, match=f"column {column.name}: .* is no {column.kind}"):
        arrow_table([column], {column.name: given})
