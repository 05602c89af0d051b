"""Which wheel a model is of: who answered on the line, through which wire map, and whether its sign was confirmed."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rw_ekf.records import WheelIdentity

_SHOWN_DIGITS = 12  # of a hash, to a person


@dataclass(frozen=True)
class WheelTag:
    """One wheel, as far as it is known; the optional mapping `wheel` of a model file."""

    serial_number: int | None = None
    kind: int | None = None
    version: int | None = None
    protocol: str | None = None  # name or path of the wire map: for people
    wire_map: str | None = None  # sha256 of what the wire map holds: units, signs and scales come from there
    port: str | None = None  # for people
    sign_confirmed: bool = False  # sign and size of the motor gain, by a motion of this wheel through this wire map

    @classmethod
    def of_identity(cls, identity: WheelIdentity | None, **rest: Any) -> WheelTag:
        """The wheel that answers on a line; rest: the fields that the line does not give."""
        if identity is None:
            return cls(**rest)
        return cls(identity.serial_number, identity.kind, identity.version, **rest)

    def document(self) -> dict[str, Any]:
        """As a model file has it."""
        return asdict(self)

    def vouches_for(self, present: WheelTag) -> bool:
        """Whether sign and size of the gain were confirmed for the very wheel and wire map that are present now."""
        return self.sign_confirmed and all(
            own is not None and own == other
            for own, other in (
                (self.serial_number, present.serial_number),
                (self.kind, present.kind),
                (self.wire_map, present.wire_map),
            )
        )

    def difference(self, present: WheelTag, *, versions: bool = False) -> str | None:
        """Say how this wheel is another than the present one; None where nothing that both know differs.

        versions: whether another version of the wheel's own program makes it another one.
        """
        names = {"serial_number": "serial number", "kind": "kind"} | ({"version": "version"} if versions else {})
        for name, words in names.items():
            own, other = getattr(self, name), getattr(present, name)
            if own is not None and other is not None and own != other:
                return f"it is of the wheel with {words} {own}, and {words} {other} answers"
        if self.wire_map is not None and present.wire_map is not None and self.wire_map != present.wire_map:
            return (
                f"it was learned through another wire map (sha256 {self.wire_map[:_SHOWN_DIGITS]}..., now "
                f"{present.wire_map[:_SHOWN_DIGITS]}...): signs and scales may be others"
            )
        return None
