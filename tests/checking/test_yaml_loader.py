"""The strict YAML loader."""

from __future__ import annotations

from pathlib import Path

import pytest

from rw_ekf.checking import yaml_loader
from rw_ekf.checking.yaml_loader import load_what_can_be_read, load_yaml, parse_yaml
from rw_ekf.errors import BadInputError, ConfigError


def test_numbers_that_plain_yaml_takes_for_text_are_numbers() -> None:
    """Proves that 1e-5 and its relatives are floats, and whole numbers stay integers."""
    data = parse_yaml("a: 1e-5\nb: -1.0E+3\nc: .5\nd: 3.\ne: 7\nf: +2\ng: 010\n", "f.yaml").data
    assert data == {"a": 1e-5, "b": -1000.0, "c": 0.5, "d": 3.0, "e": 7, "f": 2, "g": 10}
    assert isinstance(data["e"], int)


def test_only_true_and_false_are_booleans() -> None:
    """Proves that on, no, yes, True and dates stay text, and that quotes make text of anything."""
    data = parse_yaml('a: on\nb: no\nc: yes\nd: True\ne: 2024-01-01\nf: "1"\ng: true\nh: null\non: x\n', "f.yaml").data
    assert data == {
        "a": "on", "b": "no", "c": "yes", "d": "True", "e": "2024-01-01", "f": "1", "g": True, "h": None, "on": "x"
    }  # fmt: skip


def test_anchors_work() -> None:
    """Proves that a value can be written once and used twice."""
    assert parse_yaml("a: &x {v: 1}\nb: *x\n", "f.yaml").data == {"a": {"v": 1}, "b": {"v": 1}}


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("a: 1\nb: 2\na: 3\n", "3:1", "key 'a' is repeated"),
        ("a: {b: 1, b: 2}\n", "1:11", "key 'b' is repeated"),
        ("a: .nan\n", "1:4", "not a finite number"),
        ("a: [1, -.inf]\n", "1:8", "not a finite number"),
        ("a: 1e999\n", "1:4", "too large"),
        ("a: [1\n", "2:1", "not valid YAML"),
        ("\ta: 1\n", "1:1", "not valid YAML"),
        ("a: &x [*x]\n", "1:4", "contains itself"),
        ("a: *nowhere\n", "1:4", "undefined alias"),
        ("a: !!python/object:os.system {}\n", "1:4", "not supported"),
        ("<<: {a: 1}\n", "1:1", "merge keys"),
        ("? [1]\n: 2\n", "1:3", "a key must be plain text"),
        ("a: 1\n---\nb: 1\n", "2:1", "another document"),
        ("# only a comment\n", "1:1", "empty"),
        ("a: 1\nb: x\x01\n", "2:5", "does not allow"),
        ("[" * 3000, "1:1", "too deeply"),
        ("a: " + "9" * 5000, "1:4", "too many digits"),
        ("a: 0x" + "f" * 5000, "1:4", "too many digits"),
    ],
)
def test_mistakes_name_file_line_and_column(text: str, place: str, words: str) -> None:
    """Proves that each kind of mistake is a ConfigError that begins with file:line:column."""
    with pytest.raises(ConfigError) as caught:
        parse_yaml(text, "f.yaml")
    assert str(caught.value).startswith(f"f.yaml:{place}: ")
    assert words in str(caught.value)
    assert caught.value.exit_status == 2


def test_aliases_of_aliases_do_not_fill_the_memory() -> None:
    """Proves that the billion-laughs file is refused."""
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 9)]
    with pytest.raises(ConfigError, match="too many"):
        parse_yaml("\n".join(lines), "f.yaml")


@pytest.mark.parametrize("leaf", ["{}", "[]", "{a: {}}", "[[]]"])
@pytest.mark.parametrize("wrap", ["[{}]", "{{{}}}"])
def test_aliases_of_nothing_come_to_an_end(leaf: str, wrap: str) -> None:
    """Proves that tables and lists count too: 36 lines that stand for 9**36 empty ones are refused."""
    lines = [f"a0: &a0 {leaf}"]
    for n in range(1, 37):
        items = [f"*a{n - 1}" if wrap[0] == "[" else f"k{i}: *a{n - 1}" for i in range(9)]
        lines.append(f"a{n}: &a{n} {wrap.format(', '.join(items))}")
    with pytest.raises(ConfigError, match="too many"):
        parse_yaml("\n".join(lines), "f.yaml")


def test_aliases_cannot_nest_without_end() -> None:
    """Proves that a chain of aliases, flat to the parser, is refused before it exhausts the stack."""
    lines = ["a0: &a0 {}", *(f"a{n}: &a{n} [*a{n - 1}]" for n in range(1, 3000))]
    with pytest.raises(ConfigError, match="nested more than"):
        parse_yaml("\n".join(lines), "f.yaml")


def test_a_file_without_end_is_refused(tmp_path: Path) -> None:
    """Proves that neither /dev/zero nor a log given by mistake is read whole."""
    long = tmp_path / "long.yaml"
    long.write_bytes(b"# nothing\n" * 200_000)
    for path, why in (("/dev/zero", "a device, no plain file"), (long, "longer than")):
        with pytest.raises(ConfigError, match=why):
            load_yaml(path)


@pytest.mark.parametrize(
    ("text", "data", "repeated"),
    [
        ("a: {b: 1}\nc: [\nd: {e: 2}\n", {"a": {"b": 1}}, set()),
        ("a: {b: 1, b: 2}\n", {"a": {"b": 1}}, {("a", "b")}),
        ("a: 1\nx: {\na: 2\n", {"a": 1}, set()),
        ("a: 1\nb: }\na: 2\n", {"a": 1}, {("a",)}),
        ("[", {}, set()),
    ],
)
def test_what_can_be_read_of_a_file_with_mistakes(
    tmp_path: Path, text: str, data: dict[str, object], repeated: set[tuple[str, ...]]
) -> None:
    """Proves that sound sections come back beside the findings, and that a key that stands twice is told."""
    path = tmp_path / "f.yaml"
    path.write_text(text)
    document, findings, twice = load_what_can_be_read(path)
    assert findings
    assert {key: document.data[key] for key in data} == data
    assert twice >= repeated


def test_all_mistakes_come_at_once() -> None:
    """Proves that a user need not mend a file one run at a time."""
    with pytest.raises(ConfigError) as caught:
        parse_yaml("a: 1\na: 2\nb: .nan\n", "f.yaml")
    assert len(caught.value.findings) == 2


def test_positions_of_values_keys_and_missing_things() -> None:
    """Proves that `where` gives the value's place, and the nearest parent's for what is not there."""
    document = parse_yaml("a:\n  b: [10, 20]\n", "f.yaml")
    assert document.where(("a", "b", 1)) == "f.yaml:2:11"
    assert document.where_key(("a", "b")) == "f.yaml:2:3"
    assert document.where(("a", "missing", "deeper")) == "f.yaml:1:1"
    assert document.where() == "f.yaml:1:1"


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    """Proves that a missing, foreign or empty file, or a directory, is one sentence with its name."""
    not_text = tmp_path / "latin.yaml"
    not_text.write_bytes(b"a: 1\nb: \xb0\n")
    empty = tmp_path / "empty.yaml"
    empty.write_bytes(b"")
    cases = {tmp_path / "none.yaml": "no such file", tmp_path: "directory", not_text: ":2:4: not UTF-8", empty: "empty"}
    for path, words in cases.items():
        with pytest.raises(BadInputError) as caught:
            load_yaml(path)
        assert str(path) in str(caught.value)
        assert words in str(caught.value)


def test_a_byte_order_mark_and_windows_line_ends_are_no_trouble(tmp_path: Path) -> None:
    """Proves that a file saved by a Windows editor reads."""
    path = tmp_path / "w.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\r\nb: 2\r\n")
    assert load_yaml(path).data == {"a": 1, "b": 2}


def test_hexadecimal_numbers_of_a_wire_map_are_integers() -> None:
    """YAML 1.2 writes bytes as 0x1F; they arrive as the integer, quoted ones as text."""
    data = parse_yaml("{escape: 0x1F, text: '0x1F'}", "map.yaml").data
    assert data == {"escape": 31, "text": "0x1F"}


SHIPPED = sorted((Path(__file__).parents[2] / "config").glob("*.yaml"))
ODD = (
    "a: {b: 'x', c: \"y\\n\", d: [1, ~, .5]}\n",
    "k: |\n  two\n  lines\nl: >-\n  one\n  line\n",
    "é: 1 # ü\n'0x1F': ö\n",
)


@pytest.mark.parametrize("text", [*(path.read_text(encoding="utf-8") for path in SHIPPED), *ODD])
def test_both_parsers_make_the_same_of_a_file(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """libyaml and PyYAML's own: the same values at the same places; the second is there where the first is not."""
    quick = parse_yaml(text, "f.yaml")
    monkeypatch.setattr(yaml_loader, "_QuickComposer", yaml_loader._Composer)
    own = parse_yaml(text, "f.yaml")
    assert own == quick
