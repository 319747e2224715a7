from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from replication.evidence.claims import load_claims
from replication.export import verdicts
from replication.export.about import About
from replication.export.crate import payload
from replication.export.entity import ids_in
from replication.export.write import contents
from replication.files import PROJECT, write_file
from tests.export.names import NAMES


def test_every_file_is_described_as_it_is(
    exported: Mapping[str, bytes], entities: Mapping[str, dict[str, Any]]
) -> None:
    """The files of the export are those of the crate, with size and hash; so are all published."""
    files = payload(entities.values())
    assert {*files, "ro-crate-metadata.json"} == exported.keys()
    for name in files:
        content = exported[name]
        assert entities[name]["sha256"] == hashlib.sha256(content).hexdigest()
        assert entities[name]["contentSize"] == str(len(content))
    published = PROJECT.glob("figures/*/[!.]*")
    assert {*files} >= {path.relative_to(PROJECT).as_posix() for path in published}


def mentioned(value: Any) -> Iterator[str]:
    """Yield all ids that a value refers to."""
    if isinstance(value, list):
        for item in value:
            yield from mentioned(item)
    elif isinstance(value, dict):
        yield value["@id"]


def test_no_reference_leads_nowhere(entities: Mapping[str, dict[str, Any]]) -> None:
    """Whatever an entity refers to is described, but for the standard itself; nothing is nested."""
    standard = {"https://w3id.org/ro/crate/1.2"}
    for entity in entities.values():
        for value in entity.values():
            assert {*mentioned(value)} - standard <= entities.keys()
            nested = value if isinstance(value, list) else [value]
            assert all(each.keys() == {"@id"} for each in nested if isinstance(each, dict))


def test_every_file_is_part_of_the_whole(entities: Mapping[str, dict[str, Any]]) -> None:
    """From the root, each file is reached through its parts, once."""
    reached, waiting = [], ["./"]
    while waiting:
        parts = ids_in(entities[waiting.pop()].get("hasPart", []))
        reached += parts
        waiting += parts
    assert sorted(id for id in reached if not id.endswith("/")) == payload(entities.values())


def test_a_changed_figure_changes_its_hash(
    linked: Path, about: About, exported: Mapping[str, bytes]
) -> None:
    """Other bytes of one file change the facts of that file in the crate, and nothing else."""
    name = "figures/soccer/fig12.png"
    assert contents(about, NAMES) == exported
    (linked / name).unlink()
    write_file(linked / name, exported[name] + b"x")
    changed = contents(about, NAMES)
    assert {each for each in exported if changed[each] != exported[each]} == {
        "ro-crate-metadata.json",
        name,
    }
    before, after = (
        {each["@id"]: each for each in json.loads(files["ro-crate-metadata.json"])["@graph"]}
        for files in (exported, changed)
    )
    assert [id for id in before if before[id] != after[id]] == [name]
    assert before[name]["sha256"] != after[name]["sha256"]


UNKNOWN = {
    # the paper's authors: their employers are not in the text that we have
    "The author SHOULD have an organizational affiliation.",
    "The author SHOULD have a Contextual Entity which specifies the organizational `affiliation`.",
    "A Person entity SHOULD have an ORCID identifier as its @id "
    "(e.g., https://orcid.org/0000-0001-2345-6789)",
    # the package's authors: a group without an address
    "The organization SHOULD have a URL.",
    "An Organization entity SHOULD have a ROR identifier as its @id "
    "(e.g., https://ror.org/03f0f6041)",
    "An Organization's contactPoint SHOULD reference a ContactPoint contextual entity",
    "At least one author or publisher Person/Organization SHOULD have a contactPoint property",
    # the repository has no address
    "The Application SHOULD have a url",
    "The SoftwareApplication id SHOULD be an absolute URI",
    # identical runs give identical files
    "The Action SHOULD have an endTime in ISO 8601 format",
}
"""What the standards recommend, in their validator's words, and is not known here."""


@pytest.fixture(params=["few", pytest.param("all", marks=pytest.mark.long)])
def folder(
    request: pytest.FixtureRequest,
    linked: Path,
    about: About,
    exported: Mapping[str, bytes],
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
) -> Path:
    """Write an export, of all or of one claim and two notebooks, which is checked much faster."""
    if request.param == "few":
        table = linked / verdicts.TABLE
        rows = table.read_text("utf-8").splitlines(keepends=True)
        table.unlink()
        write_file(table, "".join(rows[:3]))
        claims = load_claims()
        one = claims.model_copy(update={"claim": claims.claim[:1]})
        monkeypatch.setattr(verdicts, "load_claims", lambda: one)
        exported = contents(about, ["claims", "method"])
    folder = tmp_path_factory.mktemp("crate")
    for name, content in exported.items():
        write_file(folder / name, content)
    return folder


@pytest.mark.usefixtures("no_network")
@pytest.mark.filterwarnings("ignore")  # of the validator's own making
@pytest.mark.parametrize("profile", ["ro-crate-1.2", "process-run-crate-0.5"])
def test_it_is_valid(
    folder: Path, profile: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The validator of the standard finds what it requires, and misses only what nobody knows."""
    context = pytest.importorskip("rocrate", reason="it has the context of the standard")
    requests = pytest.importorskip("requests")
    services = pytest.importorskip("rocrate_validator.services")
    http = pytest.importorskip("rocrate_validator.utils.http")

    def get(_: object, url: str, **__: object) -> Any:
        assert url == "https://w3id.org/ro/crate/1.2/context"
        response = requests.Response()
        response.status_code = 200
        response.headers["Content-Type"] = "application/ld+json"
        file = Path(context.__file__).parent / "data" / "ro-crate.jsonld"
        response._content = file.read_bytes()  # of a later version, which has all our terms
        return response

    monkeypatch.setattr(http.HttpRequester, "get", get, raising=False)
    settings = services.ValidationSettings(
        rocrate_uri=str(folder),
        profile_identifier=profile,
        requirement_severity="RECOMMENDED",
        disable_inherited_profiles_issue_reporting=True,
        offline=True,
        cache_path=tmp_path / "cache",
    )
    issues = services.validate(settings).get_issues()
    assert [issue.message for issue in issues if issue.severity.name == "REQUIRED"] == []
    assert {issue.message for issue in issues} <= UNKNOWN
