"""The example of docs/wire-protocol.md: its map, and its Arduino's program, compiled, at the two ends of a line."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from rw_ekf.drivers.line.ascii_protocol import AsciiMap
from rw_ekf.drivers.line.registers import decode_register, encode_register
from tests.drivers.test_ascii_link import Rig
from tests.live.bench import ROOT, wire_map_of

SECTION = (ROOT / "docs" / "wire-protocol.md").read_text(encoding="utf-8").partition("## Lines of text")[2]
# As much of an Arduino as the example uses: Serial is standard input and output, a loop without input is the end.
ARDUINO = """
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <string>
typedef unsigned char byte;
static const int HEX = 16;
static unsigned long now = 1234;
unsigned long millis() { return now += 7; }
struct String : std::string {
  using std::string::string;
  String(const std::string& s) : std::string(s) {}
  void trim() { while (!empty() && isspace(back())) pop_back(); }
  bool startsWith(const char* s) const { return rfind(s, 0) == 0; }
  String substring(int from) const { return String(substr(from)); }
  float toFloat() const { return strtof(c_str(), nullptr); }
};
struct Port {
  void begin(long) {}
  void setTimeout(long) {}
  bool available() { return std::cin.peek() != EOF; }
  String readStringUntil(char end) { std::string s; std::getline(std::cin, s, end); return s; }
  void print(const std::string& s) { std::cout << s; }
  void print(double x, int digits) { printf("%.*f", digits, x); fflush(stdout); }
  void println(const std::string& s) { std::cout << s << "\\r\\n" << std::flush; }
  void println(unsigned long x) { std::cout << x << "\\r\\n" << std::flush; }
  void println(int x, int) { printf("%X\\r\\n", x); fflush(stdout); }
} Serial;
float speedRpm() { return -1234.56f; }
void drive(float) {}
"""
MAIN = "\nint main() { std::cout << std::unitbuf; setup(); while (Serial.available()) loop(); }\n"


def block(kind: str, index: int = 0) -> str:
    """A block of code of the section."""
    found: list[str] = re.findall(rf"^ *```{kind}\n(.*?)```", SECTION, re.DOTALL | re.MULTILINE)
    return found[index]


@pytest.fixture
def example(tmp_path: Path) -> AsciiMap:
    """The map of the example."""
    (tmp_path / "my-wheel.yaml").write_text(block("yaml"), encoding="utf-8")
    made = wire_map_of(str(tmp_path / "my-wheel.yaml"))
    assert isinstance(made, AsciiMap)
    return made


def test_the_example_s_map_attaches_a_wheel(example: AsciiMap, tmp_path: Path) -> None:
    """Simulated from the map alone: readings, a current, a restart that is told, zero."""
    rig = Rig(str(tmp_path / "my-wheel.yaml"))
    wheel = rig.open()
    sample = wheel.read(1.0)
    assert sample is not None
    assert sample.speed_rad_s == pytest.approx(50.0, abs=0.5)
    assert wheel.command_current(0.25).acknowledged
    rig.clock.sleep(1.0)
    rig.server.restart()
    again = wheel.read(1.0)
    assert again is not None
    assert (again.segment, again.current_command_A) == (1, 0.0)
    assert wheel.stop_current().acknowledged


def compiled(directory: Path, program: str) -> Path:
    """A program for this machine."""
    compiler = shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        pytest.skip("no C++ compiler")
    (directory / "wheel.cpp").write_text(program, encoding="utf-8")
    subprocess.run([compiler, "-o", directory / "wheel", directory / "wheel.cpp"], check=True)
    return directory / "wheel"


@pytest.mark.slow
def test_the_example_s_arduino_answers_what_its_map_asks(example: AsciiMap, tmp_path: Path) -> None:
    """Requests as the driver writes them into the program; its replies as the driver reads them."""
    wheel = compiled(tmp_path, ARDUINO + block("cpp") + MAIN)
    codec, command = example.codec(), example.current_command
    wanted = [
        codec.request(0, example.speed_register.id, b""),
        codec.request(0, command.id, encode_register(command, {"current_command": -0.125})),
        codec.request(0, example.speed_register.id, b""),
        b"CUR=0.501\n",
    ]
    stated = subprocess.run([wheel], input=b"".join(wanted), capture_output=True, check=True).stdout.splitlines(True)
    assert stated[0] == b"READY\r\n"
    reported = []
    for line in (stated[1], stated[3]):
        codec.request(7, example.speed_register.id, b"")
        (frame,) = codec.replies(line).frames
        reported.append(decode_register(example.speed_register, frame.data))
    assert reported[0]["speed"] == pytest.approx(-129.282, abs=0.01)
    assert [values["current_command"] for values in reported] == [0.0, -0.125]
    assert reported[1]["uptime"] > reported[0]["uptime"] > 1.0
    codec.request(8, command.id, encode_register(command, {"current_command": -0.125}))
    assert [codec.replies(line).frames[0].data for line in (stated[2], stated[4])] == [b"\0", b"\3"]


@pytest.mark.slow
def test_the_example_s_checksum_is_the_driver_s(tmp_path: Path) -> None:
    """Four lines of C++ against the codec: of what it says a line is read, and with a letter changed it is not."""
    main = '\nint main() { say("RPM=1234.5 CUR=0.100 MS=7"); say("A"); say("@@"); }\n'
    wheel = compiled(tmp_path, ARDUINO + block("cpp", 1) + main)
    stated = subprocess.run([wheel], capture_output=True, check=True).stdout
    text = block("yaml").replace("name: my-wheel", "name: my-wheel\nframing: {checksum: xor}\nignored: [A, '@@']")
    (tmp_path / "checked.yaml").write_text(text, encoding="utf-8")
    codec = wire_map_of(str(tmp_path / "checked.yaml")).codec()
    codec.request(0, 128, b"")
    decoded = codec.replies(stated)
    assert (len(decoded.frames), decoded.damaged) == (1, 0)
    assert codec.replies(stated.replace(b"1234", b"1334")).damaged == 1
