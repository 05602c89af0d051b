"""What the site has beside the pages of docs/, and formulas as MathML: no page fetches anything when it is read."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File, Files

import rw_ekf
from rw_ekf.cli import build_parser
from rw_ekf.man_page import verbs_of

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
_STYLE, _SHIM = "site.css", "iframe-worker.js"
_SHIM_AT = "https://unpkg.com/iframe-worker/shim"
_FENCE = re.compile(r"^```math\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_CODE = re.compile(r"(```.*?^```$|`[^`\n]+`)", re.MULTILINE | re.DOTALL)
_INLINE = re.compile(r"\$(?!\s)([^$\n]+(?:\n[^$\n]+)?)(?<!\s)\$")
_TAG = re.compile(r"\\tag\{([^}]*)\}")
_OUTSIDE = re.compile(r"\[([^\]]*)\]\((?:\.\./)+((?!README|CHANGELOG)[^)]*)\)")


def on_files(files: Files, config: Any) -> Files:
    """Add README and changelog of the project, the commands' help and the library's reference."""
    readme, changelog = ((ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "CHANGELOG.md"))
    pages = {"start.md": readme, "changelog.md": changelog, "commands.md": commands_page(), "api.md": library_page()}
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text.replace("](docs/", "](")))
    for name in (_STYLE, _SHIM):
        files.append(File.generated(config, f"assets/{name}", abs_src_path=str(HERE / name)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Formulas, and links that lead out of docs/."""
    up = "../" * page.file.src_uri.count("/")
    markdown = re.sub(r"\]\((?:\.\./)+README\.md", f"]({up}start.md", markdown)
    markdown = re.sub(r"\]\((?:\.\./)+CHANGELOG\.md", f"]({up}changelog.md", markdown)
    return with_formulas(_OUTSIDE.sub(_named, markdown))


def on_post_page(output: str, page: Any, **_: Any) -> str:
    """Search from a disk needs a script (MIT, Martin Donath) that the theme would fetch from a server."""
    return output.replace(_SHIM_AT, f"{'../' * page.file.dest_uri.count('/')}assets/{_SHIM}")


def on_post_template(output: str, **_: Any) -> str:
    """The same of the page for what is not found."""
    return output.replace(_SHIM_AT, f"assets/{_SHIM}")


def with_formulas(markdown: str) -> str:
    """LaTeX between dollars, and in blocks of `math`, as MathML; code stays code."""
    parts = _CODE.split(_FENCE.sub(lambda found: _block(found[1]), markdown))
    return "".join(part if part.startswith("`") else _INLINE.sub(_inline, part) for part in parts)


def _block(latex: str) -> str:
    number = _TAG.search(latex)
    beside = f'<span class="number">({number[1]})</span>' if number else ""
    return f'\n<div class="formula">{convert(_TAG.sub("", latex).strip(), display="block")}{beside}</div>\n'


def _inline(found: re.Match[str]) -> str:
    return f"<span>{convert(found[1].replace(chr(10), ' '))}</span>"


def _named(found: re.Match[str]) -> str:
    """A file of the repository that is no page."""
    text, path = found.groups()
    return path if path.endswith(".md") and "/" not in path else f"{text} (`{path}`)"


def commands_page() -> str:
    """`--help` of every verb."""
    verbs = verbs_of(build_parser())
    text = "# Commands\n\nEach verb's own help, as `rw-ekf help VERB` prints it.\n"
    return text + "".join(f"\n## {name}\n\n```text\n{verb.format_help()}```\n" for name, verb in verbs.items())


def library_page() -> str:
    """What `import rw_ekf` offers, by the docstrings of where it is defined."""
    names = sorted(rw_ekf.__all__, key=lambda name: (name[0].isupper(), name))
    head = "# Library\n\nWhat `import rw_ekf` offers; [how to use it](library.md). Everything else may change.\n\n"
    made = [(name, getattr(rw_ekf, name)) for name in names]
    modules = [(name, it) for name, it in made if isinstance(it, ModuleType)]
    made = [(name, it) for name, it in made if not isinstance(it, ModuleType)]
    made += [(f"{name}.{inner}", getattr(it, inner)) for name, it in modules for inner in it.__all__]
    entry = "::: {}.{}\n    options: {{heading: rw_ekf.{}, heading_level: 2}}\n"
    return head + "\n".join(entry.format(it.__module__, it.__qualname__, name) for name, it in made)
