"""Workflows and hooks are well formed, ask for no more rights than they need, and call what is there."""

import re

import pytest
from places import ROOT

yaml = pytest.importorskip("yaml")
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def read(path):
    return yaml.safe_load(path.read_text("utf-8"))


def jobs():
    for path in WORKFLOWS:
        for name, job in read(path)["jobs"].items():
            yield pytest.param(job, id=f"{path.name}:{name}")


def test_they_are_there():
    assert {"ci.yml", "wheels.yml", "weekly.yml"} <= {path.name for path in WORKFLOWS}


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_may_only_read(path):
    found = read(path)
    assert found["permissions"] == {"contents": "read"}
    assert True in found, "on: says when it runs (YAML reads the word as true)"


@pytest.mark.parametrize("job", list(jobs()))
def test_a_job_ends_in_time_and_has_few_rights(job):
    assert job["timeout-minutes"] <= 90
    if "permissions" in job:
        assert job["permissions"] == {"contents": "read", "id-token": "write"}
        assert job["environment"] == "release"
        assert "refs/tags/v" in job["if"], "only a tag publishes"


@pytest.mark.parametrize("job", list(jobs()))
def test_steps_use_pinned_actions_and_keep_no_credentials(job):
    for step in job["steps"]:
        assert ("run" in step) != ("uses" in step)
        if "uses" in step:
            assert re.search(r"@(v\d+|release/v\d+)$", step["uses"]), step["uses"]
            if step["uses"].startswith("actions/checkout@"):
                assert step["with"]["persist-credentials"] is False
        assert "secrets." not in str(step)


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_what_they_call_is_there(path):
    text = path.read_text("utf-8")
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    assert set(re.findall(r"\bmake ([a-z-]+)", text)) <= targets
    for file in re.findall(r"python ([\w/]+\.py)", text):
        assert (ROOT / file).is_file(), file


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_jobs_wait_for_jobs_that_exist(path):
    found = read(path)["jobs"]
    for job in found.values():
        needs = job.get("needs", [])
        assert set([needs] if isinstance(needs, str) else needs) <= set(found)


def test_wheels_are_made_of_every_system_and_every_one_is_tried():
    found = read(ROOT / ".github" / "workflows" / "wheels.yml")["jobs"]
    made = {row["name"] for row in found["wheels"]["strategy"]["matrix"]["include"]}
    tried = set(found["try"]["strategy"]["matrix"]["name"])
    tried |= {f"musl-{row['machine']}" for row in found["try-musl"]["strategy"]["matrix"]["include"]}
    assert made == tried
    assert {"wheels", "try", "try-musl", "sources"} == set(found["publish"]["needs"])


def test_hooks_are_local_and_call_tools_of_the_project():
    found = read(ROOT / ".pre-commit-config.yaml")["repos"]
    assert [group["repo"] for group in found] == ["local"]
    hooks = found[0]["hooks"]
    assert {hook["language"] for hook in hooks} == {"system"}
    assert all(hook["entry"].startswith((".venv/bin/", "cargo ")) for hook in hooks)
