import json
import re
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.report import html
from selfmodel.report.document import Report
from tests.helpers.browser import built

HOSTILE = "</script><script>alert(1)</script><!-- \u2028 & <b>"


@built
def test_no_text_of_a_report_ends_its_data_or_becomes_markup():
    page = html.html_of(Report(HOSTILE, HOSTILE, (), ())).decode()

    (data,) = re.findall(r'<script type="application/json" id="report">(.*?)</script>', page)
    assert json.loads(data)["headline"] == HOSTILE
    assert "<title>&lt;/script&gt;" in page
    assert "<!--selfmodel" not in page


@built
def test_a_name_of_a_folder_that_is_no_utf_8_is_escaped():
    page = html.html_of(Report("caf\udce9", "caf\udce9", (), ())).decode()

    assert "<title>caf\\udce9</title>" in page


@built
def test_the_page_names_no_address_that_a_browser_would_fetch():
    page = html.html_of(Report("t", "h", (), ())).decode()

    assert not re.search(r"""(src|href)=["']?(https?:)?//""", page)
    assert "default-src 'none'" in page


def test_without_the_built_page_the_error_names_the_command_that_builds_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(html, "files", lambda _package: tmp_path)

    with pytest.raises(InputError, match="run `make page` in a checkout"):
        html.html_of(Report("t", "h", (), ()))
