"""The documentation says what the program does: commands, options, variables, pages and examples."""

from __future__ import annotations

import hashlib
import json
import re
import runpy
import subprocess
import tarfile
import tomllib
from pathlib import Path

import click
import pytest
import typer.main
import yaml
from quick_figures import figures_not_drawn
from slow_cases import slow_but

import sloshlab
from pipelines.command_line import application
from sloshlab import __version__
from sloshlab.experiments import EXPERIMENTS
from sloshlab.quantities import QUANTITIES

REPOSITORY = Path(__file__).resolve().parents[2]
DOCS = REPOSITORY / "docs"
GENERATED = DOCS / "generated"
PAGES = sorted(page for page in DOCS.rglob("*.md") if GENERATED not in page.parents)
QUICK_EXAMPLES = [page for page in PAGES if page.stem != "own_twin_gallery"]
"""The twins of that page are those of tests/unit/user_twin, too, and take a loop each to compile."""
OLD_TRIALS = REPOSITORY / "sealed_trial" / "archive" / "trials_1_to_13.tar.xz"
COMMANDS = typer.main.get_command(application()).commands
FENCE = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
NAMED_FILE = re.compile(r"^`([\w.]+\.\w+)`:[^`]*?\n\n```\w+\n(.*?)^```", re.MULTILINE | re.DOTALL)
BARE_LINK = re.compile(r"\s*(?:[-*] |\[[^\]]*\]: )?<?https?://\S+")
LOCAL_LINK = re.compile(r"\]\((?!https?://|#)([^)#\s]+)")


def section_of(command: str) -> str:
    """The part of docs/commands.md about one command."""
    text = (DOCS / "commands.md").read_text(encoding="utf-8")
    parts = re.split(r"^## ", text, flags=re.MULTILINE)
    return next((part for part in parts if part.startswith(f"sloshlab {command}\n")), "")


def parameters_of(command: str) -> list[click.Parameter]:
    """Parameters of a command, or of all steps of one that has steps."""
    steps = getattr(COMMANDS[command], "commands", {}).values()
    return [parameter for step in steps or [COMMANDS[command]] for parameter in step.params]


def tracked_text_files() -> list[Path]:
    """Files that git tracks and that are text."""
    try:
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=REPOSITORY, capture_output=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout: tracked files are not known")
    paths = [REPOSITORY / name for name in listed.decode().split("\0") if name]
    return [path for path in paths if path.is_file() and b"\0" not in path.read_bytes()[:4096]]


def test_the_documented_commands_are_those_of_the_program() -> None:
    text = (DOCS / "commands.md").read_text(encoding="utf-8")
    assert re.findall(r"^## sloshlab ([\w-]+)$", text, flags=re.MULTILINE) == list(COMMANDS)
    assert set(re.findall(r"^\| `sloshlab ([\w-]+)", text, flags=re.MULTILINE)) == set(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_is_documented_and_no_other(command: str) -> None:
    options = {name for parameter in parameters_of(command) for name in parameter.opts if name.startswith("-")} - {
        "-h",
        "--help",
        "--quiet",
    }
    section = section_of(command)
    rows = "\n".join(line.split("|")[1] for line in section.splitlines() if line.startswith("| `-"))
    assert set(re.findall(r"(?<![\w-])(--?[a-z][a-z-]*)", rows)) == options


@pytest.mark.parametrize("command", COMMANDS)
def test_documented_defaults_are_those_of_the_program(command: str) -> None:
    rows = [line.split("|") for line in section_of(command).splitlines() if line.startswith("| `-")]
    for parameter in parameters_of(command):
        if not isinstance(parameter.default, int | float) or isinstance(parameter.default, bool):
            continue
        [row] = [row for row in rows if re.search(rf"`{parameter.opts[0]}[ `]", row[1])]
        assert row[-3].strip() == str(parameter.default)


def test_every_variable_of_the_results_is_documented() -> None:
    text = (DOCS / "results.md").read_text(encoding="utf-8")
    missing = [name for name in QUANTITIES if f"`{name}`" not in text]
    # standard errors of maps are described together
    assert [name for name in missing if not name.endswith("_std")] == []


@pytest.mark.parametrize("page", slow_but(QUICK_EXAMPLES, PAGES), ids=lambda page: page.stem)
def test_python_examples_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of one page share their names; files that the page shows under their names are there."""
    text = page.read_text(encoding="utf-8")
    blocks = [code for language, code in FENCE.findall(text) if language == "python"]
    if not blocks:
        pytest.skip("no Python on this page")
    for name, content in NAMED_FILE.findall(text):
        (tmp_path / name).write_text(content, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "documentation"}
    with figures_not_drawn():
        for code in blocks:
            exec(compile(code, str(page), "exec"), names)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_toml_examples_are_toml(page: Path) -> None:
    for language, code in FENCE.findall(page.read_text(encoding="utf-8")):
        if language == "toml":
            tomllib.loads(code)


def test_the_map_shown_for_the_f16_sweeps_is_in_the_example() -> None:
    shown = next(
        code for language, code in FENCE.findall((DOCS / "f16.md").read_text("utf-8")) if language == "toml"
    )
    example = tomllib.loads((DOCS / "examples" / "f16_sweep.toml").read_text(encoding="utf-8"))
    part = tomllib.loads(shown)
    assert part["source"] == example["source"]
    assert part["channels"] == {name: example["channels"][name] for name in part["channels"]}
    assert part["channels"]


def test_the_navigation_lists_every_page_but_single_trials() -> None:
    def pages(entry: object) -> list[str]:
        if isinstance(entry, str):
            return [entry]
        nested = entry.values() if isinstance(entry, dict) else entry
        return [page for part in nested for page in pages(part)]

    settings = yaml.safe_load((REPOSITORY / "mkdocs.yml").read_text(encoding="utf-8"))
    trials = sorted((DOCS / "blind_trials").glob("*/blind_trial.md"))
    listed = [*pages(settings["nav"]), *(str(trial.relative_to(DOCS)) for trial in trials)]
    # the gallery's own page and those of its scripts are made when the site is
    expected = [str(page.relative_to(DOCS)) for page in PAGES if page != DOCS / "gallery" / "README.md"]
    assert sorted(listed) == sorted([*expected, "generated/gallery"])
    assert settings["not_in_nav"].split() == ["blind_trials/*/blind_trial.md"]
    everything = (DOCS / "blind_trial.md").read_text(encoding="utf-8")
    assert [trial.parent.name for trial in trials if f"{trial.parent.name}/blind_trial.md" not in everything] == []


def test_the_reference_has_everything_that_python_programs_are_offered() -> None:
    text = (DOCS / "api" / "interface.md").read_text(encoding="utf-8")
    shown = {name.rpartition(".")[2] for name in re.findall(r"(?:^::: |\]\[)([\w.]+)", text, flags=re.MULTILINE)}
    assert set(sloshlab.__all__) - {"__version__"} <= shown


def test_the_reference_has_every_room() -> None:
    pages = "\n".join(page.read_text(encoding="utf-8") for page in (DOCS / "api").glob("*.md"))
    shown = set(re.findall(r"^::: sloshlab\.(\w+)$", pages, flags=re.MULTILINE))
    rooms = {path.parent.name for path in (REPOSITORY / "sloshlab").glob("*/__init__.py")}
    assert rooms - shown == set()


def test_the_paper_cites_what_its_bibliography_has_and_says_what_a_paper_has_to() -> None:
    paper = (REPOSITORY / "paper.md").read_text(encoding="utf-8")
    entries = set(re.findall(r"^@\w+\{(\w+),", (REPOSITORY / "paper.bib").read_text("utf-8"), flags=re.MULTILINE))
    assert set(re.findall(r"@(\w+)", paper)) == entries
    sections = re.findall(r"^# (.+)$", paper, flags=re.MULTILINE)
    assert sections == ["Summary", "Statement of need", "State of the field", "Functionality", "Research use",
                        "References"]  # fmt: skip
    assert 250 <= len(paper.split()) <= 1000


def test_pages_load_nothing_from_elsewhere() -> None:
    settings = yaml.safe_load((REPOSITORY / "mkdocs.yml").read_text(encoding="utf-8"))
    assert settings["theme"]["font"] is False
    assert "extra_javascript" not in settings
    assert [style for style in settings["extra_css"] if not (DOCS / style).is_file()] == []


def test_the_citation_file_is_complete_and_of_this_version() -> None:
    citation = yaml.safe_load((REPOSITORY / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0"
    assert str(citation["version"]) == __version__
    assert {"message", "title", "authors"} <= citation.keys()
    assert all({"type", "title", "authors"} <= reference.keys() for reference in citation["references"])


def test_the_first_screen_of_the_readme_has_two_commands_and_a_picture() -> None:
    first_screen = (REPOSITORY / "README.md").read_text(encoding="utf-8").partition("\n## ")[0]
    [(language, code)] = FENCE.findall(first_screen)
    assert language == "sh"
    assert [line.split("#")[0].strip() for line in code.splitlines()] == ["make demo", "make shaker"]
    assert len(re.findall(r"!\[", first_screen)) == 1
    assert len(first_screen.splitlines()) <= 25
    assert len((REPOSITORY / "README.md").read_text(encoding="utf-8").splitlines()) <= 45


@pytest.mark.parametrize(
    "page", [REPOSITORY / "README.md", REPOSITORY / "CONTRIBUTING.md", *PAGES], ids=lambda page: page.stem
)
def test_local_links_lead_somewhere(page: Path) -> None:
    targets = LOCAL_LINK.findall(page.read_text(encoding="utf-8"))
    assert [target for target in targets if not source_of(page.parent / target).exists()] == []


def source_of(target: Path) -> Path:
    """What a page is made of: pages of the gallery are made of its scripts when the site is."""
    if target.parent != GENERATED / "gallery":
        return target
    script = DOCS / "gallery" / target.with_suffix(".py").name
    return DOCS / "gallery" / "README.md" if target.name == "index.md" else script


def test_the_archive_of_old_trials_has_the_hashes_that_are_published() -> None:
    text = (OLD_TRIALS.parent / "README.md").read_text(encoding="utf-8")
    assert re.findall(r"^    ([0-9a-f]{64})$", text, flags=re.MULTILINE) == [
        hashlib.sha256(OLD_TRIALS.read_bytes()).hexdigest()
    ]
    published = set(re.findall(r"^\| (\w+) \| `([0-9a-f]{64})` \|$", text, flags=re.MULTILINE))
    with tarfile.open(OLD_TRIALS) as archive:
        content = {name: archive.extractfile(name) for name in archive.getnames() if name.endswith(".json")}
        hashes = {
            (name.split("/")[1], hashlib.sha256(file.read()).hexdigest())
            for name, file in content.items()
            if file is not None and not name.endswith("truths.json")
        }
    assert len(hashes) == 26
    assert published == hashes


def test_the_table_of_all_trials_says_what_their_scores_say() -> None:
    rows = re.findall(r"^\| \d+ \| \d{4} \|.*$", (DOCS / "blind_trial.md").read_text("utf-8"), flags=re.MULTILINE)
    shown = sorted(tuple(cell.strip() for cell in row.split("|")[4:-2]) for row in rows)
    with tarfile.open(OLD_TRIALS) as archive:
        members = [archive.extractfile(name) for name in archive.getnames() if name.endswith("scores.json")]
        scores = [json.loads(file.read()) for file in members if file is not None]
    scores.append(json.loads((DOCS / "blind_trials" / "fourteenth" / "scores.json").read_text(encoding="utf-8")))

    def counts(score: dict[str, list[dict[str, object]]]) -> tuple[str, ...]:
        marks, held = score["marks"], score["held"]
        right = [mark["kind"] for mark in marks if mark["right"]]
        return (
            str(len(right)),
            str(sum(bool(mark["false_alarm"]) for mark in marks)),
            *(str(right.count(kind)) for kind in ("single", "pair", "look_alike", "outside", "masked")),
            str(sum(bool(mark["wrong_name"]) for mark in marks)),
            str(sum(mark["column"] == "no answer" for mark in marks)),
            f"{sum(bool(number['inside']) for number in held)} of {len(held)}",
        )

    assert len(rows) == 14
    assert shown == sorted(counts(score) for score in scores)


def test_lines_of_markdown_are_not_longer_than_120_characters() -> None:
    long = [
        f"{path.relative_to(REPOSITORY)}:{number}"
        for path in tracked_text_files()
        if path.suffix == ".md"
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if len(line) > 120 and not BARE_LINK.fullmatch(line)
    ]
    assert long == []


def test_a_row_that_begins_with_an_ellipsis_goes_on_with_the_row_above() -> None:
    hook = runpy.run_path(str(DOCS / "table_rows.py"))["joined_rows"]
    head, code = "| a | b |\n|---|---|\n", "| z | |\n\n```\n| c |\n| … |\n```"
    page = f"{head}| `x` | one, |\n| … | two \\| 2 |\n| … y | three |\n{code}"
    assert hook(page) == f"{head}| `x`<br>y | one, two \\| 2<br>three |\n{code}"


def test_a_page_of_the_gallery_shows_what_its_script_says_and_no_progress() -> None:
    hook = runpy.run_path(str(DOCS / "gallery_pages.py"))["without_clutter"]
    made = "\n!!! note\n\n    Click [here](#x)\n    to download\n\n# Title\n\n!!! note\n\n    Mine\n"
    said = "fit, 4 min so far: epoch 8, 100 %\nmotion, 35 s\nshaker, 35 s so far: a.nc, 57 %\n0.3 N\n"
    assert hook(made + said) == "\n# Title\n\n!!! note\n\n    Mine\nmotion, 35 s\n0.3 N\n"
    assert hook('![a](./images/a.png){: .b srcset="../images/a.png"}') == "![a](./images/a.png){: .b}"


def test_formulas_are_drawn_and_options_are_whole() -> None:
    pytest.importorskip("latex2mathml", reason="the extra docs is not installed")
    hook = runpy.run_path(str(DOCS / "inline_text.py"))["on_page_content"]
    formula = hook(r'<p><span class="arithmatex">\(\frac{a}{b} &lt; 1\)</span></p>')
    assert re.search(r"<math[^>]*>.*<mfrac>.*a.*b.*</mfrac>.*&#x0003C;.*</math>", formula)
    assert 'display="block"' in hook('<div class="arithmatex">\n\\[x\\]</div>'.replace("\n", ""))
    code = "<code>shaker --no-report RUN-1.nc -o OUT</code>"
    whole = code.replace("--no-report", '<span class="option">--no-report</span>')
    assert hook(code) == whole.replace("-o OUT", '<span class="option">-o</span> OUT')
    block = "<pre><span></span><code>a --b</code></pre>"
    assert hook(block) == block


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_rows_of_a_table_have_as_many_cells_as_its_head(page: Path) -> None:
    joined = runpy.run_path(str(DOCS / "table_rows.py"))["joined_rows"](page.read_text(encoding="utf-8"))
    tables = re.findall(r"(?:^\|.*\n)+", re.sub(FENCE, "", joined), flags=re.MULTILINE)
    widths = [{len(re.split(r"(?<!\\)\|", row)) for row in table.splitlines()} for table in tables]
    assert [width for width in widths if len(width) > 1] == []


def test_make_targets_that_are_named_exist() -> None:
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):", makefile, flags=re.MULTILINE))
    named: set[str] = set()
    for page in [REPOSITORY / "README.md", REPOSITORY / "CONTRIBUTING.md", *PAGES]:
        named |= set(re.findall(r"(?:`|^)make ([a-z-]+)", page.read_text(encoding="utf-8"), flags=re.MULTILINE))
    assert {"shaker", "test", "bench", "docs"} <= named <= targets


def test_no_path_of_one_machine_is_tracked() -> None:
    roots = "|".join(("work", "root", "tmp", "home/[a-z]", "Users/[A-Za-z]", "var/folders"))
    pattern = re.compile(rf"(?<![\w.)}}\"'*-])/(?:{roots})(?![\w-])|(?<=[\"'])/(?:{roots})/")
    found = []
    for path in tracked_text_files():
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        found += [f"{path.name}:{number}" for number, line in enumerate(lines, 1) if pattern.search(line)]
    assert found == []


def test_the_page_of_experiments_says_what_the_registry_says() -> None:
    text = (DOCS / "experiments.md").read_text(encoding="utf-8")
    rows = [
        f"| `{known.name}` | {known.description} | {known.moves} | "
        f"{'itself' if known.is_recorded else f'`{known.recorded_as}`'} |"
        for known in EXPERIMENTS
    ]
    assert [row for row in text.splitlines() if row.count("|") == 5 and row.startswith("| `")] == rows
    for known in EXPERIMENTS:
        if known.pipeline:
            room = known.pipeline.rpartition(".")[0].replace(".", "/")
            [row] = [row for row in text.splitlines() if f"`{room}`" in row]
            assert f"`{known.name}`" in row


def test_every_word_of_the_glossary_stands_once_and_in_its_place() -> None:
    sections = (DOCS / "glossary.md").read_text(encoding="utf-8").split("\n## ")[1:]
    words = [re.findall(r"^- \*\*(.+?)\*\* – \S", section, flags=re.MULTILINE) for section in sections]
    assert [len(found) for found in words] == [section.count("\n- ") for section in sections]
    for found in words:
        assert found == sorted(found, key=str.lower)
    everywhere = [word for found in words for word in found]
    assert len(everywhere) == len(set(everywhere)) > 100
