"""RAPID modules of one arm and block read back: frames, speeds and the synchronous moves, as a controller would take them.

It knows what `batten.io.rapid` writes and what may stand between its lines without moving an arm, and refuses the rest: a
simulation that passed over an instruction would show another cut than the robots make.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from scipy.spatial.transform import Rotation

from batten.errors import FormatError
from batten.typing import FloatArray

UNIT = 1e-4
"""How far a quaternion's length may lie from 1: a controller normalises within this, and complains beyond."""

_TOKEN = re.compile(
    r"\s*(?:(?P<text>\"(?:[^\"]|\"\")*\")|(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<word>[A-Za-z]\w*)|(?P<sign>:=|[\[\]{}(),;\\]))"
)
_STILL = ("ConfL", "ConfJ", "WaitSyncTask", "TPWrite", "Stop", "WaitTime", "SingArea", "SetDO", "AccSet", "VelSet")
_MODULE = re.compile(r"MODULE\s+([A-Za-z]\w*)")
_BLOCK = re.compile(r"block\s+(\d+)\s*,\s*(.*)")


@dataclass(frozen=True, eq=False)
class RapidMove:
    """One synchronous MoveL.

    Attributes:
        line: in the file, from 1.
        identity: its \\ID, the same in the other arm's module.
        pose: (4, 4), the tool frame in the work object, mm.
        speed_mm_s, turn_speed_rad_s: of the tool centre point.
        seconds: how long the move takes at least, where the module says so; 0 otherwise.
        tool, work_object: (4, 4), the tool frame in the flange and the work object in the world frame, mm.
        label: the comment before it without its block, for example "leaf 12"; empty if there is none.
    """

    line: int
    identity: int
    pose: FloatArray
    speed_mm_s: float
    turn_speed_rad_s: float
    seconds: float
    tool: FloatArray
    work_object: FloatArray
    label: str


@dataclass(frozen=True, eq=False)
class RapidModule:
    """What one arm does in one block: the module's name, its block by the comments (0: not said), its synchronous moves."""

    path: Path
    name: str
    block: int
    moves: tuple[RapidMove, ...]


def read_rapid_module(path: str | Path) -> RapidModule:
    """Read the module of one arm and block.

    Parameters:
        path: a .mod file.

    Returns:
        Its synchronous moves, in order.

    Raises:
        FormatError: no such file, or a line that is not RAPID as batten writes it: an unknown instruction, an undeclared
            tool, work object or speed, a frame that is none, a move without \\ID while the arms move together, \\ID twice.
            The message names file and line.

    Accuracy: the numbers of the file; quaternions are normalised.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(f"{path}: cannot be read ({error}); cut the job again") from error
    reader = _Reader(path)
    for number, line in enumerate(text.split("\n"), start=1):
        reader.line(number, line.strip())
    return reader.module()


@dataclass
class _Reader:
    """The state between two lines."""

    path: Path
    name: str = ""
    number: int = 0
    label: str = ""
    block: int = 0
    synchronous: bool = False
    inside: bool = False
    frames: dict[str, dict[str, FloatArray]] = field(default_factory=lambda: {"tooldata": {}, "wobjdata": {}})
    speeds: dict[str, FloatArray] = field(default_factory=dict)
    moves: list[RapidMove] = field(default_factory=list)

    def line(self, number: int, text: str) -> None:
        self.number = number
        if text.startswith("!"):
            found = _BLOCK.match(text[1:].strip())
            if found and self.inside:
                self._of_block(int(found[1]))
                self.label = found[2]
        elif text.startswith("MODULE"):
            name = _MODULE.match(text)
            self.name = name[1] if name and not self.name else self._refuse("another MODULE, or one without a name")
        elif text.startswith("PROC"):
            self.inside = True
        elif text and text not in ("ENDPROC", "ENDMODULE"):
            if not text.endswith(";"):
                self._refuse(f"{text!r}: an instruction ends with ; on its own line")
            words = _Statement(text, self._refuse)
            (self._instruction if self.inside else self._declaration)(words)

    def module(self) -> RapidModule:
        if not self.name or not self.moves:
            self._refuse("the module has no name, or no synchronous move")
        if self.synchronous:
            self._refuse("no SyncMoveOff")
        return RapidModule(self.path, self.name, self.block, tuple(self.moves))

    def _refuse(self, what: str) -> NoReturn:
        raise FormatError(f"{self.path}, line {self.number}: {what}; cut the job again, or mend the line")

    def _of_block(self, block: int) -> None:
        if self.block not in (0, block):
            self._refuse(f"block {block} in a module of block {self.block}")
        self.block = block

    def _declaration(self, words: _Statement) -> None:
        words.word("PERS", "VAR", "CONST", "LOCAL", "TASK")
        kind, name = words.word(), words.word()
        if kind in self.frames:
            words.sign(":=")
            value = words.value()
            place = [1] if kind == "tooldata" else [3, 4]
            if not isinstance(value, list) or len(value) <= place[-1] or not _is_held_right(kind, value):
                self._refuse(f"{name}: a {kind} of another kind than batten writes")
            frame = np.eye(4)
            for part in place:
                frame = frame @ self._frame(name, value[part])
            self.frames[kind][name] = frame
        elif kind == "speeddata":
            words.sign(":=")
            speeds = _row(words.value(), 4)
            if speeds is None or not (speeds > 0.0).all():
                self._refuse(f"{name}: a speed has four numbers above 0")
            self.speeds[name] = speeds

    def _instruction(self, words: _Statement) -> None:
        name = words.word()
        if name in ("SyncMoveOn", "SyncMoveOff"):
            if self.synchronous == (name == "SyncMoveOn"):
                self._refuse(f"{name} twice")
            self.synchronous = name == "SyncMoveOn"
        elif name == "MoveL" and self.synchronous:
            self._move(words)
        elif name == "MoveAbsJ" and not self.synchronous:
            pass  # to the approach pose, or back from the block, with an empty gripper
        elif name not in _STILL:
            self._refuse(f"{name} is not simulated")

    def _move(self, words: _Statement) -> None:
        target = words.value()
        if not isinstance(target, list) or len(target) != 4:
            self._refuse("a robtarget has four parts")
        pose = self._frame("robtarget", target[:2])
        options = words.options(self.frames["wobjdata"])
        words.sign(",")
        speed = words.word()
        options |= words.options(self.frames["wobjdata"])
        words.sign(",")
        words.word()  # the zone: corners are taken as points
        words.sign(",")
        tool = words.word()
        options |= words.options(self.frames["wobjdata"])
        words.sign(";")
        seconds, identity = options.get("T", 0.0), options.get("ID", 0.0)
        if speed not in self.speeds or tool not in self.frames["tooldata"] or "WObj" not in options:
            self._refuse(f"speed {speed}, tool {tool} or the work object is not declared above")
        if identity != int(identity) or identity < 1 or not seconds >= 0.0:
            self._refuse("a synchronous move has \\ID, a whole number from 1, and its time is not below 0")
        if any(move.identity == identity for move in self.moves):
            self._refuse(f"\\ID:={identity:g} twice")
        pace = self.speeds[speed]
        self.moves.append(
            RapidMove(
                line=self.number,
                identity=int(identity),
                pose=pose,
                speed_mm_s=float(options.get("V", pace[0])),
                turn_speed_rad_s=float(np.radians(pace[1])),
                seconds=float(seconds),
                tool=self.frames["tooldata"][tool],
                work_object=self.frames["wobjdata"][options["WObj"]],
                label=self.label,
            )
        )
        self.label = ""

    def _frame(self, name: str, value: Any) -> FloatArray:
        position, turn = (_row(v, n) for v, n in zip(value, (3, 4))) if _is_pair(value) else (None, None)
        if position is None or turn is None or not abs(float(np.linalg.norm(turn)) - 1.0) <= UNIT:
            self._refuse(f"{name}: a frame is [[x,y,z],[q1,q2,q3,q4]] with a quaternion of length 1; got {value}")
        frame = np.eye(4)
        frame[:3, :3] = Rotation.from_quat(turn, scalar_first=True).as_matrix()
        frame[:3, 3] = position
        return frame


class _Statement:
    """The tokens of one statement, taken from the left."""

    def __init__(self, text: str, refuse: Callable[[str], NoReturn]) -> None:
        self.text, self.refuse, at = text, refuse, 0
        self.tokens: list[tuple[str, str]] = []
        while at < len(text):
            match = _TOKEN.match(text, at)
            if match is None or match.lastgroup is None:
                refuse(f"{text[at:]!r} is not RAPID")
            self.tokens.append((match.lastgroup, match[match.lastgroup]))
            at = match.end()
        self.tokens.reverse()

    def next(self) -> tuple[str, str]:
        return self.tokens[-1] if self.tokens else ("end", "")

    def word(self, *allowed: str) -> str:
        kind, text = self.next()
        if kind != "word" or (allowed and text not in allowed):
            self.refuse(f"{self.text!r}: {' or '.join(allowed) or 'a name'} was expected before {text!r}")
        self.tokens.pop()
        return text

    def sign(self, sign: str) -> None:
        if self.next() != ("sign", sign):
            self.refuse(f"{self.text!r}: {sign} was expected before {self.next()[1]!r}")
        self.tokens.pop()

    def value(self) -> Any:
        """A number, text, a word, or a list of these in brackets."""
        kind, text = self.next()
        if kind in ("end", "sign") and text != "[":
            self.refuse(f"{self.text!r}: a value was expected before {text!r}")
        self.tokens.pop()
        if kind != "sign":
            return float(text) if kind == "number" else text
        values = [self.value()]
        while self.next() == ("sign", ","):
            self.tokens.pop()
            values.append(self.value())
        self.sign("]")
        return values

    def options(self, work_objects: dict[str, FloatArray]) -> dict[str, Any]:
        """The arguments that begin with a backslash here."""
        found: dict[str, Any] = {}
        while self.next() == ("sign", "\\"):
            self.tokens.pop()
            name = self.word("ID", "T", "V", "WObj")
            self.sign(":=")
            value = self.value()
            if isinstance(value, float) == (name == "WObj") or (name == "WObj" and value not in work_objects):
                self.refuse(f"\\{name}:={value} is not declared above, or no number")
            found[name] = value
        return found


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2


def _is_held_right(kind: str, value: list[Any]) -> bool:
    """A tool that the robot holds, a work object that stands in the room."""
    return value[0] == "TRUE" if kind == "tooldata" else value[:2] == ["FALSE", "TRUE"]


def _row(value: Any, count: int) -> FloatArray | None:
    if not isinstance(value, list) or len(value) != count or not all(isinstance(v, float) for v in value):
        return None
    row = np.array(value)
    return row if bool(np.isfinite(row).all()) else None
