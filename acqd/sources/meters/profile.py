"""Profiles: where a model of meter keeps its quantities, as data files that users can add to."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from acqd.errors import InputError, UserError
from acqd.toml_file import tables_of

FOLDER = Path(__file__).parent / "profiles"
RegisterType = Literal["u16", "i16", "u32", "i32", "u64", "i64", "float32", "float64"]
WIDTH: dict[RegisterType, int] = {
    "u16": 1, "i16": 1, "u32": 2, "i32": 2, "float32": 2, "u64": 4, "i64": 4, "float64": 4,
}  # fmt: skip
"""Registers of each type."""
WordOrder = Literal["high", "low"]
_PER_CHANNEL = ("Vrms", "Irms", "P", "S", "PF", "W", "W_export")
NAMES = ("f", *(f"{channel}.{name}" for channel in ("L1", "L2", "L3", "total") for name in _PER_CHANNEL))
"""Quantities a profile may have; W is imported and W_export exported energy [kWh]."""


@dataclass(frozen=True, slots=True)
class Register:
    """Where one quantity is."""

    address: int
    """Zero-based, as on the wire."""
    type: RegisterType
    function: int
    word_order: WordOrder
    scale: float = 1.0
    """Register value x scale is in V, A, W, VA, 1, Hz or kWh."""
    unavailable: tuple[int, ...] = ()
    """Raw values of this register that mean "not available"."""

    @property
    def width(self) -> int:
        """Registers."""
        return WIDTH[self.type]


@dataclass(frozen=True, slots=True)
class Identity:
    """Registers that identify the model; older firmware may lack them."""

    register: Register
    values: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Profile:
    """One model of meter."""

    name: str
    title: str
    source: str
    verified: str
    phases: int
    transports: tuple[str, ...]
    most_registers: int
    """Most registers of one read."""
    quantities: dict[str, Register]
    unit: int = 1
    """Factory setting of the Modbus unit id."""
    update_s: float = 1.0
    """How often the meter refreshes its registers [s]."""
    pause_s: float = 0.0
    """Silence that the meter asks for before each request [s]."""
    serial: dict[str, Any] = field(default_factory=dict)
    """Factory setting of the serial line: baudrate, parity, stopbits."""
    unavailable: tuple[int, ...] = ()
    """Raw values that mean "not available"; they count for 32 and 64 bit registers."""
    identity: Identity | None = None


def known_profiles() -> list[str]:
    """Names of the profiles that come with acqd."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load_profile(name: str) -> Profile:
    """A profile by its name, or by the path of a file of one's own. Raises UserError."""
    path = FOLDER / f"{name}.toml"
    if name.endswith(".toml"):
        path = Path(name)
    elif not path.exists():
        raise UserError(
            f"source.meters: there is no profile {name!r}; known are {', '.join(known_profiles())}, "
            "or give the path of a .toml file of your own"
        )
    try:
        data = tables_of(path)
    except OSError as error:
        raise InputError(path, f"the profile cannot be read ({error.strerror})") from None
    return _Reader(path, data).profile()


class _Reader:
    """Checks every key of one file."""

    def __init__(self, path: Path, data: dict[str, Any]) -> None:
        self._path = path
        self._data = data

    def profile(self) -> Profile:
        data = dict(self._data)
        quantities, identify = data.pop("quantities", {}), data.pop("identify", None)
        function, order = data.pop("function", None), data.pop("word_order", None)
        self._one_of("function", function, (3, 4))
        self._one_of("word_order", order, ("high", "low"))
        if not quantities:
            self._refuse("has no [quantities]")
        registers = {}
        for name, place in quantities.items():
            self._one_of(f"quantities.{name}", name, NAMES)
            registers[name] = self._register(name, place, function, order)
        for key in ("transports", "unavailable"):
            if key in data:
                data[key] = tuple(data[key])
        try:
            profile = Profile(quantities=registers, identity=self._identity(identify, function, order), **data)
        except TypeError as error:
            self._refuse(str(error).replace("Profile.__init__() got an unexpected keyword argument", "unknown key"))
        self._one_of("phases", profile.phases, (1, 2, 3))
        if not isinstance(profile.update_s, int | float) or not 0.05 <= profile.update_s <= 3600:
            self._refuse(f"update_s is {profile.update_s!r}, expected 0.05 to 3600 s")
        if not isinstance(profile.most_registers, int) or not 1 <= profile.most_registers <= 125:
            self._refuse(f"most_registers is {profile.most_registers!r}, expected 1 to 125")
        return profile

    def _identity(self, place: Any, function: int, order: WordOrder) -> Identity | None:
        if place is None:
            return None
        values = tuple(place.pop("values", ()))
        if not values:
            self._refuse("identify.values lists no value")
        return Identity(self._register("identify", place, function, order), values)

    def _register(self, name: str, place: dict[str, Any], function: int, order: WordOrder) -> Register:
        if not isinstance(place, dict) or not isinstance(place.get("address"), int):
            self._refuse(f"{name}: expected {{ address = NUMBER, type = ... }}")
        try:
            unavailable = tuple(place.get("unavailable", ()))
            register = Register(**({"function": function, "word_order": order} | place | {"unavailable": unavailable}))
        except TypeError as error:
            text = str(error).replace("Register.__init__() got an unexpected keyword argument", "unknown key")
            self._refuse(f"{name}: {text}")
        self._one_of(f"{name}: type", register.type, tuple(WIDTH))
        self._one_of(f"{name}: function", register.function, (3, 4))
        self._one_of(f"{name}: word_order", register.word_order, ("high", "low"))
        if not 0 <= register.address <= 0xFFFF - register.width + 1:
            self._refuse(f"{name}: address {register.address} is outside 0 .. 65535")
        return register

    def _one_of(self, key: str, value: Any, allowed: tuple[Any, ...]) -> None:
        if value not in allowed:
            self._refuse(f"{key} is {value!r}, expected one of {', '.join(map(str, allowed))}")

    def _refuse(self, problem: str) -> Any:
        raise InputError(self._path, problem)
