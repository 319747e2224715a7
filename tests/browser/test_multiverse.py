"""The multiverse in the lab: effects, counts of any part of it, and trials that run again."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from playwright.sync_api import Page, expect

from replication.evidence.sensitivity import level_table, outcome_shares
from replication.evidence.specifications import named_choices
from replication.evidence.sweep import PLAN, conditions_of, specifications
from replication.files import PROJECT
from replication.irl import METHODS
from replication.lab.multiverse import CLAIMS
from replication.lab.page import lab_page
from replication.lab.tasks import FIELDS
from tests.browser.computing import computed, task_of
from tests.browser.screen import NARROW, PATIENCE, Open

FIGURES = PROJECT / "figures"
FACTORS = PLAN.mazes.factorial.choices
RUNNING = 6 * PATIENCE
"""Milliseconds in which the trials of a specification end on any machine."""

expect.set_options(timeout=PATIENCE)

SELECT = """(rank) => {
  const range = document.getElementById("rank");
  range.value = rank;
  range.dispatchEvent(new Event("input"));
}"""
"""Select the specification with a rank, from 1 on, without running it."""

LEAVE = """(left) => [...document.querySelectorAll("#option-rows input")].forEach((box, place) => {
  if (box.checked === left.includes(place)) box.click();
})"""
"""Leave out the options at these places, and no other ones."""


@pytest.fixture
def lab(open_page: Open) -> Page:
    """Open the lab, and wait until it is there."""
    page = open_page("lab")
    expect(page.locator("#multiverse")).to_be_visible()
    return page


@pytest.fixture(scope="module")
def effects() -> pd.DataFrame:
    """Return the published effects, in the order in which they are drawn."""
    table = pd.read_csv(FIGURES / "sensitivity" / "effects.csv")
    table = table[(table["group"] == "factorial") & table["claim"].isin(CLAIMS)]
    return table.sort_values("effect", kind="stable")


def of_claim(page: Page, effects: pd.DataFrame, claim: str) -> pd.DataFrame:
    """Choose a claim in the page, and return its effects."""
    page.locator("#claim").select_option(str(CLAIMS.index(claim)))
    return effects[effects["claim"] == claim]


def numbers(text: str) -> list[float]:
    """Return the numbers that stand in a text."""
    plain = text.replace("\N{MINUS SIGN}", "-")
    return [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", plain)]


@pytest.mark.parametrize("claim", CLAIMS)
def test_effects_are_those_of_python(lab: Page, effects: pd.DataFrame, claim: str) -> None:
    """Each specification has its rank, its values, and the effect and interval published of it."""
    own = of_claim(lab, effects, claim)
    shown = lab.evaluate(
        f"""(n) => Array.from({{ length: n }}, (_, k) => {{
          ({SELECT})(k + 1);
          const saved = document.querySelector("#beside tr:last-child td").textContent;
          return [saved, [...document.querySelectorAll("#values b")].map((b) => b.textContent)];
        }})""",
        len(own),
    )
    texts = [dict(zip(FACTORS, values, strict=True)) for _, values in shown]
    for (saved, _), text, row in zip(shown, texts, own.itertuples(), strict=True):
        expected = [row.effect, row.low, row.high]
        np.testing.assert_allclose(numbers(saved), expected, rtol=0, atol=0.005 + 1e-7)
        values = named_choices(row.specification)
        assert float(text["ALPHA"]) == float(values["ALPHA"])
        assert text["ADABOOST-RULE"].replace(" ", "-") == values["ADABOOST-RULE"]
    assert len({tuple(text.values()) for text in texts}) == len(set(own["specification"]))


def options() -> list[tuple[str, str]]:
    """Return the choices and values, as text, in the order in which the page lists them."""
    return [(id, str(value)) for id, values in FACTORS.items() for value in values]


@pytest.mark.parametrize("claim", CLAIMS)
def test_counts_follow_what_is_left_out(lab: Page, effects: pd.DataFrame, claim: str) -> None:
    """Of any part, counts, shares, median and means are those that Python computes of it."""
    own = of_claim(lab, effects, claim)
    chosen = [named_choices(name) for name in own["specification"]]
    rng = np.random.default_rng(CLAIMS.index(claim))
    for some in [0, 1, 2, 3, 5, 8, 12, 20] * 3:
        out = rng.choice(len(options()), size=some, replace=False).tolist()
        left = [options()[place] for place in out]
        kept = own[[all(values[id] != value for id, value in left) for values in chosen]]
        lab.evaluate(LEAVE, out)
        text = lab.locator("#counts").inner_text()
        if kept.empty:
            assert text == "No specification is left."
            assert lab.locator("#rank").get_attribute("max") == "1"
            continue
        assert lab.locator("#rank").get_attribute("max") == str(len(kept))
        (whole,) = outcome_shares(kept).itertuples()
        counts = [whole.holds, whole.open, whole.reversed]
        shares = [100 * count / whole.specifications for count in counts]
        found = numbers(text)
        assert found[0] == whole.specifications
        assert found[1:6:2] == counts
        np.testing.assert_allclose(found[2:7:2], shares, rtol=0, atol=0.5 + 1e-9)
        assert found[7] == pytest.approx(whole.median, abs=0.005 + 1e-9)
        check_levels(lab, level_table(kept))
    lab.locator("#options summary").click()
    lab.locator("#take-all").click()
    assert numbers(lab.locator("#counts").inner_text())[0] == len(own)


def check_levels(page: Page, levels: pd.DataFrame) -> None:
    """Compare the table of options with Python's, in which what is left out has no row."""
    rows = page.evaluate(
        """[...document.querySelectorAll("#option-rows tr")].filter((row) => row.cells.length > 1)
        .map((row) => [...row.cells].slice(1).map((cell) => cell.textContent))"""
    )
    expected = {(level.choice, level.value): level for level in levels.itertuples()}
    for option, (number, holds, reversed, mean) in zip(options(), rows, strict=True):
        level: Any = expected.get(option)
        if level is None:
            assert [number, holds, reversed, mean] == ["0", "", "", ""]
            continue
        assert int(number) == level.specifications
        for text, share in ((holds, level.holds), (reversed, level.reversed)):
            count, percent = numbers(text)
            assert count == round(share * level.specifications)
            assert percent == pytest.approx(100 * share, abs=0.5 + 1e-9)
        assert numbers(mean)[0] == pytest.approx(level.mean_effect, abs=0.005 + 1e-9)


def ran(page: Page) -> None:
    """Wait until the trials of all methods have run, each with what is published."""
    expected = [re.compile("^10 of 10 trials, each as published$")] * len(METHODS)
    cells = page.locator("#beside td:last-child")
    expect(cells.nth(0)).to_have_text(expected[0], timeout=RUNNING)
    expect(cells.nth(1)).to_have_text(expected[1], timeout=RUNNING)
    expect(cells.nth(2)).to_have_text(expected[2], timeout=RUNNING)
    saved = page.locator("#beside tr:last-child td")
    expect(saved.nth(1)).to_have_text(saved.nth(0).inner_text())


def test_a_specification_runs_as_published(lab: Page, effects: pd.DataFrame) -> None:
    """Selected by mouse or keyboard, its trials take as many iterations here; another ends them."""
    own = of_claim(lab, effects, "SAVES-OPEN")
    canvas = lab.locator("#effects")
    canvas.scroll_into_view_if_needed()
    size = canvas.bounding_box()
    assert size is not None
    canvas.click(position={"x": 0.8 * size["width"], "y": 40})
    first = numbers(lab.locator("#ranked").inner_text())[0]
    assert abs(first / len(own) - 0.8) < 0.05
    lab.locator("#rank").press("ArrowRight")
    assert numbers(lab.locator("#ranked").inner_text()) == [first + 1, len(own)]
    ran(lab)
    lab.locator("#rank").press("Home")
    assert lab.locator("#ranked").inner_text() == f"1 of {len(own)}"
    ran(lab)
    of_claim(lab, effects, "FASTER")
    lab.locator("#rank").press("End")  # where AdaBoost-IRL does not converge
    ran(lab)


@pytest.mark.parametrize("rule", FACTORS["ADABOOST-RULE"])
def test_every_rule_of_adaboost_has_the_published_bits(lab: Page, rule: str) -> None:
    """Of each reading of AdaBoost-IRL, some specifications' first trials have their digests."""
    trials = pd.read_csv(FIGURES / "sensitivity" / "trials.csv")
    trials = trials[(trials["part"] == "factorial") & (trials["method"] == "adaboost")]
    trials = trials[trials["trial"] == 0].set_index("number")
    jobs: list[dict[str, Any]] = []
    expected = []
    for number, specification in enumerate(specifications("factorial")):
        if len(jobs) < 4 and ("ADABOOST-RULE", rule) in specification.choices:
            condition = conditions_of("factorial", number)[0]
            values = condition.params.values()
            params = {name: values[name] for name in FIELDS}
            job = {"task": task_of(condition.demos), "method": "adaboost", "params": params}
            jobs.append({**job, "root": PLAN.root_seed, "trial": 0})
            row = trials.loc[number]
            expected.append([row["iterations"], row["steps"], row["digest"]])
    assert computed(lab, jobs, plainly=False) == expected


def test_a_first_trial_can_be_watched(open_page: Open, effects: pd.DataFrame) -> None:
    """On a telephone, too, what is tapped is played above, with the iterations published of it."""
    page = open_page("lab", size=NARROW, has_touch=True)
    own = of_claim(page, effects, "FASTER")
    page.locator("#effects").tap()
    rank = int(numbers(page.locator("#ranked").inner_text())[0])
    page.locator("#watch").tap()
    page.wait_for_function("document.getElementById('story').dataset.rate > 0", timeout=RUNNING)
    page.locator("#at").press("End")
    trials = pd.read_csv(FIGURES / "sensitivity" / "trials.csv")
    names = trials[(trials["part"] == "factorial") & (trials["trial"] == 0)]
    declared = pd.read_csv(FIGURES / "sensitivity" / "effects.csv").query("group == 'factorial'")
    order = declared[declared["claim"] == "FASTER"]["specification"].tolist()
    number = order.index(own["specification"].iloc[rank - 1])
    for method, caption in zip(METHODS, page.locator("#panels figcaption").all(), strict=True):
        ((_, row),) = names[(names["number"] == number) & (names["method"] == method)].iterrows()
        expect(caption).to_contain_text(f" after {row['iterations']} iterations")
    assert page.evaluate("document.documentElement.scrollWidth") <= NARROW["width"]


def test_a_forged_trial_is_shown(open_page: Open, tmp_path: Path) -> None:
    """A published count that the trial does not have is named beside the one that it has."""
    figures = tmp_path / "figures"
    for name in ("open_maze", "obstacle_maze", "sensitivity"):
        (figures / name).mkdir(parents=True)
        shutil.copy(FIGURES / name / "trials.csv", figures / name)
    table = figures / "sensitivity" / "trials.csv"
    trials = pd.read_csv(table, dtype=str, keep_default_na=False)
    forged = (trials["part"] == "factorial") & (trials["method"] == "unified")
    forged &= trials["trial"] == "3"
    trials.loc[forged, "iterations"] = "7"
    trials.to_csv(table, index=False)
    page = open_page("index")
    page.set_content(lab_page(figures))
    page.locator("#effects").click()
    row = page.locator("#beside tr").nth(2).locator("td").last
    expect(row).to_have_text(re.compile(r"^✗ trial 3: \d+, but 7 is published$"), timeout=RUNNING)


def test_nothing_is_offered_that_is_not_published(open_page: Open) -> None:
    """Without published results the section is hidden, and the rest of the page works."""
    page = open_page("index")
    page.set_content(lab_page())
    expect(page.locator("#part")).to_be_enabled()
    expect(page.locator("#multiverse")).to_be_hidden()
