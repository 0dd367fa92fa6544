"""Hooks of mkdocs: README as home, and pages that are made from the code.

A page holds `<!-- made from the code: NAME -->` where a list of the code belongs; without the site
such a page says where the same list is printed.
"""

import inspect
import json
import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import click
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parent.parent
# Pages of the repository's root, by their address in the site.
_FROM_ROOT = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md"}
_FROM_ROOT["CHANGELOG.md"] = "changelog.md"
_MARK = re.compile(r"<!-- made from the code: (\w+) -->")
_NAMES = {"RF|[0-9]+F": "FLOOR", "theta_[0-9]+": "PARAMETER", "[0-9]+": "STORY"}
_CODE = re.compile(r"`[^`\n]+`")
# A menu whose label is but a sign, and its title.
_MENU = re.compile(
    r'aria-labelledby="__nav_([\d_]+)_label"'
    r'([^>]*>\s*<label class="md-nav__title" for="__nav_\1">\s*<span[^>]*></span>\s*([^<]+?)\s*<)'
)
_LINK = re.compile(r"(?<=\]\()([^)\s#]+)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages of the root, without a copy of them in the folder docs."""
    for name, address in _FROM_ROOT.items():
        text = (ROOT / name).read_text(encoding="utf-8")
        files.append(File.generated(config, address, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Put the lists of the code into a page, and lead its links to where pages are in the site."""
    markdown = _MARK.sub(lambda found: "\n".join(_LISTS[found[1]]()), markdown)
    # GitHub wants bars in code of tables escaped, mkdocs does not.
    markdown = _CODE.sub(lambda found: found[0].replace("\\|", "|"), markdown)
    addresses = {address: name for name, address in _FROM_ROOT.items()}
    uri = page.file.src_uri
    source = PurePosixPath(addresses.get(uri, f"docs/{uri}"))
    return _LINK.sub(lambda found: _in_site(found[1], source, uri), markdown)


def on_post_page(output: str, page: Page | None, config: MkDocsConfig) -> str:
    """Let the keyboard scroll code that is too wide, and name every menu for screen readers."""
    output = re.sub(r"(<pre><span></span>)(<code)?", _scrolled, output)
    # What screen readers are not told of takes no focus.
    output = output.replace('<input class="md-option"', '<input tabindex="-1" class="md-option"')
    # A corner without words is no heading.
    output = re.sub(r"<th( [^>]*)?></th>", r"<td\1></td>", output)
    output = output.replace('"search" role="dialog"', '"search" role="dialog" aria-label="Search"')
    return _MENU.sub(r'aria-label="\3"\2', output)


def on_post_template(output: str, template_name: str, config: MkDocsConfig) -> str:
    """The same for what stands in place of a missing page."""
    return on_post_page(output, None, config) if template_name == "404.html" else output


def _scrolled(found: re.Match[str]) -> str:
    code = ' tabindex="0"'
    return f"{found[1]}{found[2]}{code}" if found[2] else f"<pre{code}><span></span>"


def _in_site(target: str, source: PurePosixPath, uri: str) -> str:
    """A link of a page at `source` in the repository, as of the page `uri` of the site."""
    if "://" in target:
        return target
    path = (ROOT / source.parent / target).resolve()
    inside = path.relative_to(ROOT).as_posix()
    address = _FROM_ROOT.get(inside, inside.removeprefix("docs/"))
    return "../" * uri.count("/") + address


def _commands() -> Iterator[str]:
    """Every command but the benchmarks: what it does, its examples and its options."""
    from femupdate.cli.main import group

    for name in group.list_commands(click.Context(group)):
        if name == "benchmark":
            continue
        context = click.Context(group, info_name="femupdate")
        command = group.get_command(context, name)
        assert command is not None
        yield from _command(command, click.Context(command, info_name=name, parent=context))


def _command(command: click.Command, context: click.Context) -> Iterator[str]:
    text = inspect.cleandoc(command.help or "")
    words, _, examples = re.sub(r"\x08\nExamples?:\n", "\0", text).partition("\0")
    yield f"## {context.info_name}\n\n{words}\n"
    usage = " ".join(command.collect_usage_pieces(context))
    lines = [line.strip() for line in examples.splitlines() if line.strip()]
    yield "\n".join(["```text", f"{context.command_path} {usage}", "```", ""])
    yield "\n".join(["Examples:", "", "```", *lines, "```", ""]) if lines else ""
    yield "| option | meaning |\n|---|---|"
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if isinstance(parameter, click.Option) and record is not None:
            yield f"| `{_cell(record[0])}` | {_cell(record[1])} |"
    yield ""


def _effects() -> Iterator[str]:
    """Every effect of the catalogue."""
    from femupdate.effects.registry import CATALOGUE
    from femupdate.workflow.shipped import list_all

    places = {row["name"]: row["places"] for row in list_all().as_dict()["effects"]}
    for name in sorted(CATALOGUE):
        effect = CATALOGUE[name]
        yield f"### {name}\n\n{effect.sentence}\n"
        yield f"- Where: {places[name][0].lower()}{places[name][1:]}."
        for one in effect.parameters:
            unit = "" if one.unit == "1" else f" {one.unit}"
            yield (
                f"- `{one.name}`: {one.text}; prior sd {one.scale:g}{unit},"
                f" from {one.lower:g} to {one.upper:g}{unit}."
            )
        yield f"- What settles it: {effect.settled_by}.\n"


def _formats() -> Iterator[str]:
    """Every format of measured files."""
    from femupdate.measurement.reader import readers

    yield "| format | what is read |\n|---|---|"
    for name, reader in readers().items():
        yield f"| `{name}` | {_cell(reader.READS)} |"


def _python() -> Iterator[str]:
    """Every public name, with what it is."""
    import femupdate

    yield "| name | what it is |\n|---|---|"
    for name in femupdate.__all__:
        told = inspect.getdoc(getattr(femupdate, name)) or ""
        yield f"| `{name}` | {_cell(told.split(chr(10) * 2)[0])} |"


def _keys() -> Iterator[str]:
    """Keys of the JSON that commands print, as a test has recorded them."""
    for command, keys in _recorded().items():
        under: dict[str, list[str]] = {}
        for path in keys:
            parent, _, key = path.rpartition(".")
            under.setdefault(_named(parent), []).append(f"`{_named(key)}`")
        if command != "study" and "=" not in command:
            yield f"### {command}\n"
            for parent, names in under.items():
                intro = f"in `{parent}`: " if parent else ""
                yield f"- {intro}{', '.join(dict.fromkeys(names))}"
            yield ""


def _columns() -> Iterator[str]:
    """Columns of the tables of a study, as a test has recorded them."""
    yield "| table | columns |\n|---|---|"
    for entry in _recorded()["study"]:
        name, _, columns = entry.partition(": ")
        if columns:
            yield f"| `{name}` | {', '.join(columns.split(','))} |"


def _recorded() -> dict[str, list[str]]:
    path = ROOT / "tests" / "cli" / "contract.json"
    recorded: dict[str, list[str]] = json.loads(path.read_text(encoding="utf-8"))
    return recorded


def _named(key: str) -> str:
    """A key with what stands for the names of one building."""
    for pattern, word in _NAMES.items():
        key = re.sub(rf"(^|\.)({pattern})(?=$|\.)", rf"\1{word}", key)
    return key


def _records() -> Iterator[str]:
    """Every record of a decision, by its title."""
    for path in sorted((ROOT / "docs" / "adr").glob("[0-9]*.md")):
        title = path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")
        yield f"- [{title}]({path.name})"


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


_LISTS = {
    "commands": _commands,
    "effects": _effects,
    "formats": _formats,
    "python": _python,
    "keys": _keys,
    "columns": _columns,
    "records": _records,
}
