"""The geometry file of a flyby: strict YAML, every mistake with file:line:column."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field

from rw_ekf.checking.findings import validated_sections
from rw_ekf.checking.section import Section
from rw_ekf.checking.wording import shown
from rw_ekf.checking.yaml_loader import PathTuple, YamlDocument, load_yaml
from rw_ekf.errors import ConfigError
from rw_ekf.flyby.geometry import Flyby, Wheels
from rw_ekf.settings.resources import config_resource

DEFAULT = "flyby-titan"
_UNIT = 1.0e-3  # a unit vector written with three digits is one
_FLAT = 1.0e-3  # smallest singular value of the axes: below, no torque about one direction to speak of


def _listed(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


def _rows(value: Any) -> Any:
    return value if isinstance(value, list) and any(isinstance(item, list) for item in value) else [value]


Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Inertias = Annotated[list[Annotated[float, Field(gt=0, le=1e12)]], BeforeValidator(_listed)]  # one for all, or all
Matrix = Annotated[list[Vector], BeforeValidator(_rows)]  # its diagonal, or three rows


class WheelsSection(Section):
    """The wheels."""

    axes: list[Vector] = Field(
        min_length=3, max_length=64, description="spin axis of each wheel in the body frame, unit vectors"
    )
    inertia_kg_m2: Inertias = Field(description="rotor inertia, of each or a list of all [kg m^2]")
    names: list[str] | None = Field(None, description="what the wheels are called; null: 1, 2, ...")


class SpacecraftSection(Section):
    """The body that they turn."""

    inertia_kg_m2: Matrix = Field(description="inertia about X, Y, Z, or three rows of three, wheels included [kg m^2]")
    slew_axis: Vector = Field([0.0, 1.0, 0.0], description="axis in the body frame that the slew turns about")


class FlybySection(Section):
    """The track."""

    body_radius_km: float = Field(ge=0, le=1e9, description="radius of the body that is passed [km]")
    altitude_km: float = Field(gt=0, le=1e9, description="altitude at closest approach [km]")
    speed_km_s: float = Field(gt=0, le=1e5, description="speed along the straight track [km/s]")
    start_angle_deg: float | None = Field(
        None, gt=0, lt=180, description="angle between track and nadir at the start, 90 at closest approach [deg]"
    )
    start_distance_km: float | None = Field(
        None, ge=-1e12, le=1e12, description="distance along the track before closest approach at the start [km]"
    )
    end_angle_deg: float | None = Field(
        None, gt=0, lt=180, description="the same angle at the end; null: 180 less the start's [deg]"
    )


SECTIONS: dict[str, type[Section]] = {"wheels": WheelsSection, "spacecraft": SpacecraftSection, "flyby": FlybySection}


def read_flyby(path: str | Path | None = None) -> Flyby:
    """Read a geometry file; None: the shipped one of [L17]. Raises ConfigError with one finding for each mistake."""
    document = load_yaml(config_resource(DEFAULT) if path is None else path)
    if not isinstance(document.data, dict):
        found = shown(document.data)
        raise ConfigError(f"{document.where()}: a geometry is a table of {', '.join(SECTIONS)}, found {found}")
    sections, findings = validated_sections(document, document.data, SECTIONS)
    wheels, spacecraft, track = (sections.get(name) for name in SECTIONS)
    if isinstance(wheels, WheelsSection):
        findings += _wheel_findings(document, wheels)
    if isinstance(spacecraft, SpacecraftSection):
        findings += _spacecraft_findings(document, spacecraft)
    if isinstance(track, FlybySection):
        findings += _track_findings(document, track)
    if findings:
        raise ConfigError(list(dict.fromkeys(findings)))
    assert isinstance(wheels, WheelsSection)
    assert isinstance(spacecraft, SpacecraftSection)
    assert isinstance(track, FlybySection)
    return _flyby(wheels, spacecraft, track)


def _flyby(wheels: WheelsSection, spacecraft: SpacecraftSection, track: FlybySection) -> Flyby:
    axes = np.array(wheels.axes, dtype=np.float64).T
    count = axes.shape[1]
    start, end = _window_rad(track)
    return Flyby(
        wheels=Wheels(
            names=tuple(wheels.names or (str(number + 1) for number in range(count))),
            axes=axes / np.linalg.norm(axes, axis=0),
            inertia_kg_m2=np.broadcast_to(np.array(wheels.inertia_kg_m2, dtype=np.float64), (count,)),
        ),
        inertia_kg_m2=_matrix(spacecraft),
        slew_axis=np.array(spacecraft.slew_axis) / np.linalg.norm(spacecraft.slew_axis),
        miss_distance_m=1.0e3 * (track.altitude_km + track.body_radius_km),
        speed_m_s=1.0e3 * track.speed_km_s,
        start_rad=start,
        end_rad=end,
    )


def _matrix(spacecraft: SpacecraftSection) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    inertia = np.array(spacecraft.inertia_kg_m2, dtype=np.float64)
    return np.diag(inertia[0]) if len(inertia) == 1 else inertia


def _window_rad(track: FlybySection) -> tuple[float, float]:
    """Angles alpha at the start and the end."""
    if track.start_angle_deg is not None:
        start = math.radians(track.start_angle_deg)
    else:
        assert track.start_distance_km is not None
        start = math.atan2(track.altitude_km + track.body_radius_km, track.start_distance_km)
    end = math.pi - start if track.end_angle_deg is None else math.radians(track.end_angle_deg)
    return start, end


def _unit_finding(document: YamlDocument, path: PathTuple, vector: list[float]) -> list[str]:
    length = math.hypot(*vector)
    if abs(length - 1.0) <= _UNIT:
        return []
    advice = "divide each component by that" if length > 0.0 else "it points nowhere"
    key = ".".join(map(str, path))
    return [f"{document.where(path)}: {key} is no unit vector, its length is {length:.4g}: {advice}"]


def _wheel_findings(document: YamlDocument, wheels: WheelsSection) -> list[str]:
    count = len(wheels.axes)
    findings = []
    for number, axis in enumerate(wheels.axes):
        findings += _unit_finding(document, ("wheels", "axes", number), axis)
    inertias = wheels.inertia_kg_m2 if len(wheels.inertia_kg_m2) > 1 else None
    for key, value in (("inertia_kg_m2", inertias), ("names", wheels.names)):
        if value is not None and len(value) != count:
            place = document.where(("wheels", key))
            findings.append(f"{place}: wheels.{key} has {len(value)} entries for {count} axes: give one for each wheel")
    if not findings and np.linalg.svd(np.array(wheels.axes), compute_uv=False)[-1] < _FLAT:
        findings.append(
            f"{document.where(('wheels', 'axes'))}: wheels.axes all lie in one plane (rank below 3), and take up no "
            "momentum across it: turn an axis out of the plane or add a wheel"
        )
    return findings


def _spacecraft_findings(document: YamlDocument, spacecraft: SpacecraftSection) -> list[str]:
    findings = _unit_finding(document, ("spacecraft", "slew_axis"), spacecraft.slew_axis)
    place = document.where(("spacecraft", "inertia_kg_m2"))
    if len(spacecraft.inertia_kg_m2) not in {1, 3}:
        return [*findings, f"{place}: spacecraft.inertia_kg_m2 must be three numbers or three rows of three"]
    matrix = _matrix(spacecraft)
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0):
        findings.append(f"{place}: spacecraft.inertia_kg_m2 is not symmetric: an inertia matrix is")
    elif np.linalg.eigvalsh(matrix)[0] <= 0.0:
        findings.append(f"{place}: spacecraft.inertia_kg_m2 is not positive: no body has such moments of inertia")
    return findings


def _track_findings(document: YamlDocument, track: FlybySection) -> list[str]:
    given = [key for key in ("start_angle_deg", "start_distance_km") if getattr(track, key) is not None]
    if len(given) != 1:
        found = "both" if given else "neither"
        where = document.where_key(("flyby", given[0]) if given else ("flyby",))
        return [f"{where}: give one of flyby.start_angle_deg and flyby.start_distance_km, found {found}"]
    start, end = _window_rad(track)
    if end > start:
        return []
    degrees = f"{math.degrees(start):.4g} deg to {math.degrees(end):.4g} deg"
    return [
        f"{document.where(('flyby', 'end_angle_deg'))}: the window goes from {degrees}: the angle only grows; start "
        "before closest approach, or give a flyby.end_angle_deg beyond the start"
    ]
