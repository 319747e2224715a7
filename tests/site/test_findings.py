from __future__ import annotations

import re
from pathlib import Path

import jinja2
import pytest

from replication import files
from replication.site import findings
from replication.site.findings import TEMPLATE, render_findings

PAGE = "# Findings\n{% block answer -%}\n| {{ claim.verdict }} |\n{%- endblock %}\n{{ why }}\n"


@pytest.fixture
def template(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set up a project with a template of two names."""
    monkeypatch.setattr(files, "PROJECT", tmp_path)
    path = tmp_path / "docs" / TEMPLATE
    path.parent.mkdir()
    path.write_text(PAGE, encoding="utf-8")
    return path


def context(monkeypatch: pytest.MonkeyPatch, **names: object) -> None:
    """Give the template these names."""
    monkeypatch.setattr(findings, "findings_context", lambda figures: names)


def test_the_answer_is_a_part_of_the_page(template: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rows of the README and the page are rendered from the same lines and numbers."""
    context(monkeypatch, claim={"verdict": "holds"}, why="since < 1")
    page, answer = render_findings(Path("figures"))
    assert answer == "| holds |"
    assert page == "# Findings\n| holds |\nsince < 1\n"


def test_a_number_that_is_missing_stops(template: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A name that the numbers lack is an error that names it, not a gap in a sentence."""
    context(monkeypatch, claim={}, why="")
    with pytest.raises(jinja2.UndefinedError, match="verdict"):
        render_findings(Path("figures"))


def test_numbers_of_results_are_not_typed() -> None:
    """No interval, percentage or decimal stands in the template's prose, but for the margins."""
    text = (files.PROJECT / "docs" / TEMPLATE).read_text(encoding="utf-8")
    prose = re.sub(r"\{#.*?#\}|\{\{.*?\}\}|\{%.*?%\}|\]\(.*?\)", "", text, flags=re.DOTALL)
    assert set(re.findall(r"\d+\.\d+|\d+ ?%|\[-?\d", prose)) <= {"95 %"}
