import json
import math

from selfmodel.report.charts import Item, LineChart, Series, Table
from selfmodel.report.document import Report, Section, as_json


def report_of(*items: Item) -> Report:
    return Report("title", "What happened.", ("More.",), (Section("one", "One", (), items),))


def test_a_number_that_is_not_finite_is_null():
    chart = LineChart("t", "x", "y", (Series("a", (0.0, 1.0), (math.nan, math.inf)),))

    values = as_json(report_of(chart))

    assert values["sections"][0]["items"][0]["series"][0]["y"] == [None, None]
    json.dumps(values, allow_nan=False)


def test_an_item_has_its_kind_and_other_records_have_none():
    values = as_json(report_of(Table("t", ("a",), ((1,),))))

    assert values["sections"][0]["items"][0]["kind"] == "table"
    assert "kind" not in values["sections"][0]


def test_numbers_keep_all_their_digits():
    values = as_json(report_of(Table("t", ("a",), ((0.1 + 0.2,),))))

    assert json.loads(json.dumps(values))["sections"][0]["items"][0]["rows"] == [[0.1 + 0.2]]
