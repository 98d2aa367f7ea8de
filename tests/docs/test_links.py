"""The documentation: every link leads somewhere, every command and every example is one that the program takes."""

from __future__ import annotations

import re
import shlex
import tomllib
from pathlib import Path

import pytest

from sma_bayes.cli import command_of_verb
from sma_bayes.parameters.priors_file import parse_priors, shipped_priors
from sma_bayes.records.declaration import read_declaration
from sma_bayes.records.split import SplitSettings
from sma_bayes.studies.plan.candidates import Setting, declared
from sma_bayes.studies.registry import VERBS
from sma_bayes.studies.run.study_file import read_study

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
LINK = re.compile(r"\]\(([^)\s]+)\)")
PATH = re.compile(r"`((?:sma_bayes|docs|tests|scripts|priors)/[\w./-]+)`")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
OPTION = re.compile(r"(?<![\w-])(--[a-z][a-z-]+)")
COMMANDS = {verb: command_of_verb(verb) for verb in VERBS}


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


pages = pytest.mark.parametrize("page", PAGES, ids=name)


def blocks(page: Path, *languages: str) -> list[str]:
    return [text for kind, text in BLOCK.findall(page.read_text(encoding="utf-8")) if kind in languages]


def anchors(page: Path) -> set[str]:
    titles = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", t.lower()).replace(" ", "-") for t in titles}


@pages
def test_every_relative_link_leads_to_a_file_and_to_a_heading_in_it(page):
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", target):
            assert target.startswith("https://"), target
            continue
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        assert there.is_relative_to(ROOT), target
        assert there.exists(), f"{name(page)} links to {target}"
        assert not anchor or anchor in anchors(there), f"{name(page)} links to {target}"


@pages
def test_every_path_of_the_project_that_is_mentioned_exists(page):
    for path in PATH.findall(page.read_text(encoding="utf-8")):
        assert (ROOT / path).exists(), f"{name(page)} mentions {path}"


def test_every_page_can_be_reached_from_the_index():
    seen: set[Path] = set()
    open_pages = [ROOT / "README.md"]
    while open_pages:
        page = open_pages.pop()
        if page in seen:
            continue
        seen.add(page)
        for target in LINK.findall(page.read_text(encoding="utf-8")):
            there = (page.parent / target.partition("#")[0]).resolve()
            if there.suffix == ".md" and there.exists():
                open_pages.append(there)
    assert seen >= set(PAGES)


def calls(page: Path) -> list[list[str]]:
    """Calls of sma-bayes in the shell blocks of a page, as lists of words."""
    lines = [line for text in blocks(page, "console", "bash") for line in text.splitlines()]
    return [shlex.split(line.partition(">")[0]) for line in lines if line.startswith("sma-bayes ")]


@pages
def test_every_command_shown_is_one_that_the_program_takes(page):
    for call in calls(page):
        if call[1] == "hysteresis":  # which docs/howto/add_a_verb.md adds, and its own test runs
            continue
        context = COMMANDS[call[1]].make_context(call[1], call[2:])
        assert context.params, call


def test_the_page_of_questions_has_every_verb_and_calls_that_the_program_takes():
    page = ROOT / "docs" / "which_command.md"
    found = re.findall(r"`sma-bayes ([^`]+)`", page.read_text(encoding="utf-8"))
    for call in found:
        verb, *arguments = shlex.split(call)
        assert COMMANDS[verb].make_context(verb, arguments).params, call
    assert {call.split()[0] for call in found} == set(VERBS)


@pages
def test_every_option_and_verb_mentioned_exists(page):
    known = {o for c in COMMANDS.values() for p in c.params for o in (*p.opts, *p.secondary_opts)}
    known |= {"--help", "--version", "--install-completion", "--show-completion"}
    known |= {"--slow", "--thorough", "--ignore"}  # of scripts/test, and of pytest by way of it
    known |= {"--against", "--cases", "--runs"}  # of scripts/benchmark_end_to_end.py
    known |= {"--most"}  # of the verb in docs/howto/add_a_verb.md
    known |= {"--nthreads", "--nworkers", "--memory-limit", "--host", "--no-dashboard"}  # of dask
    text = page.read_text(encoding="utf-8")
    unknown = {o for o in OPTION.findall(re.sub(r"https://\S+", "", text)) if o not in known}
    assert not unknown, f"{name(page)} mentions {sorted(unknown)}"
    for verb in re.findall(r"`sma-bayes ([a-z]+)", text):
        assert verb in COMMANDS, f"{name(page)} mentions sma-bayes {verb}"


@pages
def test_every_toml_example_is_understood(page, tmp_path):
    for text in blocks(page, "toml"):
        document = tomllib.loads(text)
        if "condition" in document:
            place = tmp_path / "campaign.toml"
            place.write_text(text, encoding="utf-8")
            for condition in document["condition"]:
                files = condition["file"] if isinstance(condition["file"], list) else [condition["file"]]
                for file in files:
                    (tmp_path / file.replace("*", "x")).write_text("", encoding="utf-8")
            assert read_declaration(place, None, SplitSettings()).conditions
        elif "study" in document:
            place = tmp_path / "study.toml"
            place.write_text(text, encoding="utf-8")
            assert read_study(place).steps
        elif "candidate" in document:
            place = tmp_path / "candidates.toml"
            place.write_text(text, encoding="utf-8")
            measured = Setting("a", 30.0, 70.0, 0.02, 30, None, "degC", False)
            assert declared(place, {"a": measured}, ["a"], 0.0, None)
        elif document.get("schema", "").startswith("sma-bayes/priors"):
            assert parse_priors(text, name(page)).entries["both"]
        else:
            assert set(document) - {"tool"} == {"project"}, f"{name(page)}: {text}"
            assert set(document.get("tool", ())) <= {"setuptools"}, f"{name(page)}: {text}"


@pages
def test_every_python_example_compiles(page):
    for text in blocks(page, "python"):
        compile(text, name(page), "exec")


def test_the_reference_of_the_command_line_names_every_verb_and_option():
    text = (ROOT / "docs" / "reference" / "command_line.md").read_text(encoding="utf-8")
    for verb, command in COMMANDS.items():
        assert f"`sma-bayes {verb}" in text
        for parameter in command.params:
            for option in parameter.opts:
                if option.startswith("--"):
                    assert f"{option}" in text, f"{verb} {option}"


def test_the_reference_of_python_names_every_public_name():
    import sma_bayes

    text = (ROOT / "docs" / "reference" / "api.md").read_text(encoding="utf-8")
    for public in sma_bayes.__all__:
        if public != "__version__":
            assert f"`{public}" in text, public


def test_the_guide_to_priors_names_the_shipped_sets_and_every_family():
    from sma_bayes.parameters.distributions import FAMILIES

    text = (ROOT / "docs" / "howto" / "choose_priors.md").read_text(encoding="utf-8")
    for word in (*shipped_priors(), *FAMILIES):
        assert f"`{word}`" in text, word


def test_the_guides_to_noise_name_every_noise_model():
    from sma_bayes.noise import NOISE_MODELS

    for page in ("docs/howto/choose_noise.md", "docs/explanation/noise.md", "docs/reference/command_line.md"):
        text = (ROOT / page).read_text(encoding="utf-8")
        for model in NOISE_MODELS:
            assert f"`{model}`" in text, (page, model)
