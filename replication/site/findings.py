"""The findings in words: ``docs/findings.md.jinja`` with the numbers of the published tables."""

from __future__ import annotations

from pathlib import Path

import jinja2

from replication import files
from replication.report.findings import findings_context

TEMPLATE = "findings.md.jinja"


def render_findings(figures: Path) -> tuple[str, str]:
    """Return the page of findings, and the rows of its answer, as Markdown.

    A name that the template uses and the numbers lack raises `jinja2.UndefinedError`.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(files.PROJECT / "docs"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,
    )
    template = environment.get_template(TEMPLATE)
    context = findings_context(figures)
    answer = "".join(template.blocks["answer"](template.new_context(context)))
    return template.render(context), answer
