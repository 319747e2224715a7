from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import jinja2
import pandas as pd
import pytest

from replication import files
from replication.evidence.verdicts import ABSENT, INCONCLUSIVE, SHOWN
from replication.files import write_file
from replication.site import findings
from replication.site.findings import TEMPLATE, found, render_findings

PAGE = "# Findings\n{% block answer -%}\n| {{ claim.verdict }} |\n{%- endblock %}\n{{ why }}\n"


@pytest.fixture
def render(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[str, str]]:
    """Render a template of two names."""
    monkeypatch.setattr(files, "PROJECT", tmp_path)
    write_file(tmp_path / "docs" / TEMPLATE, PAGE)

    def render(**names: object) -> tuple[str, str]:
        monkeypatch.setattr(findings, "numbers", lambda figures: names)
        return render_findings(tmp_path / "figures")

    return render


def test_the_answer_is_a_part_of_the_page(render: Callable[..., tuple[str, str]]) -> None:
    """The rows of the README and the page are rendered from the same lines and numbers."""
    page, answer = render(claim={"verdict": "holds"}, why="since < 1")
    assert answer == "| holds |"
    assert page == "# Findings\n| holds |\nsince < 1\n"


def test_a_number_that_is_missing_stops(render: Callable[..., tuple[str, str]]) -> None:
    """A name that the numbers lack is an error that names it, not a gap in a sentence."""
    with pytest.raises(jinja2.UndefinedError, match="verdict"):
        render(claim={}, why="")


def test_numbers_of_results_are_not_typed() -> None:
    """No interval, percentage or decimal stands in the template's prose, but for the margins."""
    text = (files.PROJECT / "docs" / TEMPLATE).read_text(encoding="utf-8")
    prose = re.sub(r"\{#.*?#\}|\{\{.*?\}\}|\{%.*?%\}|\]\(.*?\)", "", text, flags=re.DOTALL)
    assert set(re.findall(r"\d+\.\d+|\d+ ?%|\[-?\d", prose)) <= {"95 %"}


@pytest.mark.parametrize(
    ("verdicts", "words"),
    [
        ((SHOWN, SHOWN), "shown"),
        ((ABSENT, ABSENT), "absent"),
        ((ABSENT, INCONCLUSIVE), "not shown"),
        ((SHOWN, ABSENT, SHOWN), "shown in 2 of 3 cells"),
    ],
)
def test_what_was_found_is_said_plainly(verdicts: tuple[str, ...], words: str) -> None:
    """Cells that agree have one word; a claim that is shown in some of them says in how many."""
    assert found(pd.DataFrame({"verdict": verdicts})) == words
