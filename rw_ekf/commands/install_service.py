"""`rw-ekf install-service`: the systemd unit and the udev rule of one wheel, printed or written."""

from __future__ import annotations

import argparse
import os
import re
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rw_ekf.commands.inputs import add_config_option

if TYPE_CHECKING:
    from rw_ekf.service.unit import Service
    from rw_ekf.settings.schema import Configuration

HELP = "a systemd unit, and a udev rule for the adapter: printed, or written where asked"
EXAMPLE = """example:
  rw-ekf install-service --config my-wheel.yaml
  sudo rw-ekf install-service --config my-wheel.yaml --write"""

_GROUPS = ("dialout", "uucp")  # of Debian and its kin; of Arch and its kin
_UNITS, _RULES = "etc/systemd/system", "etc/udev/rules.d"
_UNKNOWN = ("ttyUSB", "ttyACM")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_config_option(parser, required=True, one_wheel=False)
    parser.add_argument("--user", metavar="NAME", help="account that the run has; default: yours, also under sudo")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--print", action="store_true", help="print both (what is done without options)")
    what.add_argument("--write", action="store_true", help="write both; a file that is there already is left alone")
    parser.add_argument("--root", metavar="DIR", default="/", help="write below this directory instead of /")


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.attach.opening import SharedLine
    from rw_ekf.attach.wire import checked_protocol
    from rw_ekf.clock import SystemClock
    from rw_ekf.json_output import print_json
    from rw_ekf.live.port_name import aliases_of, device_of, own_name
    from rw_ekf.service.udev import by_id_name, rule_text
    from rw_ekf.service.unit import unit_text
    from rw_ekf.settings.load import configuration_path, load_configurations

    path = configuration_path(args.config)
    configurations = load_configurations(path)
    protocols = [checked_protocol(configuration) for configuration in configurations]
    if len(configurations) > 1:
        SharedLine(configurations, protocols, SystemClock())  # which says why it could not be
    service = service_of(configurations, path, _user(args.user))
    name = f"rw-ekf-{_safe(service.wheel)}"
    files = {Path(args.root) / _UNITS / f"{name}.service": unit_text(service)}
    port = own_name(service.port)
    by_id = by_id_name([port, *aliases_of(device_of(port))])
    if by_id is not None:
        files[Path(args.root) / _RULES / f"99-{name}.rules"] = rule_text(by_id)
    notes = _notes(service, by_id)
    for note in notes:
        sys.stderr.write(f"rw-ekf: note: {note}\n")
    if args.write:
        _write(files)
    if args.json:
        shown = [{"path": str(path), "text": text} for path, text in files.items()]
        print_json({"schema": "rw_ekf.service/1", "files": shown, "written": args.write, "notes": notes})
    elif args.write:
        sys.stdout.write("".join(f"{path} written\n" for path in files))
        sys.stdout.write(f"now: {_next(name, rule=by_id is not None)}\n")
    else:
        sys.stdout.write("\n".join(f"# {path}\n{text}" for path, text in files.items()))
    return 0


def service_of(configurations: tuple[Configuration, ...], config: Path, user: str) -> Service:
    """What the unit has to say on this machine, run from the present directory as it would be by hand.

    A line of several wheels has one unit, by the name of its file, with what any of its wheels needs.
    """
    from rw_ekf.live.port_claim import DIRECTORIES
    from rw_ekf.live.supervisor import Patience
    from rw_ekf.service.unit import Service

    first, wheels = configurations[0], len(configurations)
    port = first.wheel.port
    outputs = [configuration.output for configuration in configurations]
    return Service(
        wheel=first.wheel.name if wheels == 1 else config.stem,
        port=port,
        program=_program(),
        config=os.path.abspath(config),
        working_directory=os.getcwd(),
        output_directories=tuple(dict.fromkeys(os.path.abspath(output.directory) for output in outputs)),
        lock_directories=DIRECTORIES,
        user=user,
        group=_group() if "://" not in port else None,
        devices=_devices(port),
        hung_after_s=Patience.of(first, wheels).turn_s,
        network=any(output.over_network for output in outputs),
        writes=any(configuration.command.writes for configuration in configurations),
    )


def _program() -> tuple[str, ...]:
    """How this program is started, whatever directory it is started from."""
    script = Path(sys.executable).parent / "rw-ekf"
    return (str(script),) if script.exists() else (sys.executable, "-P", "-m", "rw_ekf")


def _user(given: str | None) -> str:
    import pwd

    from rw_ekf.errors import BadInputError

    name = given or os.environ.get("SUDO_USER") or pwd.getpwuid(os.geteuid()).pw_name
    try:
        pwd.getpwnam(name)
    except KeyError:
        raise BadInputError(f"--user {name}: there is no such account on this machine") from None
    return name


def _group() -> str | None:
    """The group that serial ports belong to on this machine."""
    import grp

    return next((name for name in _GROUPS if any(entry.gr_name == name for entry in grp.getgrall())), None)


def _devices(port: str) -> tuple[str, ...]:
    """Kinds of device that a port may be, as /proc/devices names them; none where it is on the network."""
    from rw_ekf.live.port_name import device_of, own_name

    name = own_name(port)
    if not os.path.isabs(name):
        return ()
    device = device_of(name) or name
    if device.startswith("/dev/pts/"):
        return ("pts",)
    match = re.fullmatch(r"/dev/([A-Za-z]+)\d+", device)
    return (match[1],) if match is not None else _UNKNOWN


def _notes(service: Service, by_id: str | None) -> list[str]:
    port, found = service.port, []
    if by_id is None and service.devices:
        found.append(
            f"{port} has no name in /dev/serial/by-id: there is no udev rule, and the next plug may change its number. "
            "Plug the adapter in, and give the name that it has there as wheel.port"
        )
    missing = [shlex.quote(path) for path in service.output_directories if not os.path.isdir(path)]
    if missing:
        make = f"sudo install -d -o {shlex.quote(service.user)} {' '.join(missing)}"
        found.append(f"output.directory is not there yet, and the unit does not start without it: {make}")
    if service.user == "root":
        found.append("the run would be root's: give the account that its files shall belong to, --user NAME")
    return found


def _write(files: dict[Path, str]) -> None:
    """Write all files, or none where one is there already. Raises BadInputError."""
    from rw_ekf.errors import BadInputError

    for path in files:
        if os.path.lexists(path):
            raise BadInputError(f"{path} is there already and is left alone: remove it, or compare it with --print")
    for path, text in files.items():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
        except OSError as error:
            raise BadInputError(f"{path} cannot be written ({error.strerror}): use sudo, or --root DIR") from None


def _next(name: str, *, rule: bool) -> str:
    """Commands that a person gives then."""
    udev = "sudo udevadm control --reload && sudo udevadm trigger && " if rule else ""
    return f"{udev}sudo systemctl daemon-reload && sudo systemctl enable --now {name}"


def _safe(name: str) -> str:
    return "".join(c if c.isascii() and (c.isalnum() or c in "-_") else "-" for c in name)[:60]
