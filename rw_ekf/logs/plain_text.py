"""Rewrites the text of a foreign table as the plain CSV that readers take, line for line, so that places stay right."""

from __future__ import annotations

from typing import NamedTuple

from rw_ekf.logs.text_layout import TextLayout, lines_of


class PlainText(NamedTuple):
    """UTF-8 text with commas, points and a row of names; what is no row of the table has become a blank line."""

    text: bytes
    left_out: tuple[int, ...]  # physical lines behind the first row that hold no row


def rewritten(text: bytes, layout: TextLayout) -> PlainText:
    """Rewrite a text. Lines behind the first row that are no data (a footer, the names again) are left out."""
    lines = lines_of(text.decode(layout.encoding, "replace"))
    while lines and not lines[-1].strip():
        lines.pop()
    out = [""] * (layout.first_line - 1)
    if layout.names and out:
        out[-1] = _row(list(layout.names))
    left_out = []
    for number in range(layout.first_line - 1, len(lines)):
        line = lines[number]
        if not line.strip():
            out.append("")
            continue
        cells = layout.cells(line)
        while len(cells) > layout.width and not cells[-1]:
            cells.pop()
        if not layout.is_data(cells):
            left_out.append(number + 1)
            out.append("")
            continue
        if number < len(lines) - 1:  # the last one may be torn, which its reader sees by its width
            cells += [""] * (layout.width - len(cells))
        out.append(_row([layout.number(cell) for cell in cells]))
    ended = "\n" if text[-4:].translate(None, b"\0").endswith((b"\n", b"\r")) else ""
    return PlainText(("\n".join(out) + ended).encode(), tuple(left_out))


def _row(cells: list[str]) -> str:
    return ",".join(f'"{cell.replace(chr(34), chr(34) * 2)}"' if "," in cell or '"' in cell else cell for cell in cells)
