"""A small strict reader of the RAPID that two arms under MultiMove need. It shares nothing with the writer.

It knows a subset of the language: one module, declarations of tooldata, wobjdata, tasks, syncident and speeddata, one
procedure `main`, the instructions below. Whatever else it meets is an error, and so is every rule of the language that is
broken: names, lengths, scopes, undeclared data, moves without \\ID between SyncMoveOn and SyncMoveOff.

Sources of the rules: ABB, technical reference manual "RAPID Instructions, Functions and Data types", and "RAPID Overview"
(identifiers of at most 32 characters, strings of at most 80, persistent tool and work object, quadrants of confdata).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

RESERVED = {
    *(
        "ALIAS",
        "AND",
        "BACKWARD",
        "CASE",
        "CONNECT",
        "CONST",
        "DEFAULT",
        "DIV",
        "DO",
        "ELSE",
        "ELSEIF",
        "ENDFOR",
        "ENDFUNC",
    ),
    *("ENDIF", "ENDMODULE", "ENDPROC", "ENDRECORD", "ENDTEST", "ENDTRAP", "ENDWHILE", "ERROR", "EXIT", "FALSE", "FOR"),
    *(
        "FROM",
        "FUNC",
        "GOTO",
        "IF",
        "INOUT",
        "LOCAL",
        "MOD",
        "MODULE",
        "NOSTEPIN",
        "NOT",
        "NOVIEW",
        "OR",
        "PERS",
        "PROC",
    ),
    *(
        "RAISE",
        "READONLY",
        "RECORD",
        "RETRY",
        "RETURN",
        "STEP",
        "SYSMODULE",
        "TEST",
        "THEN",
        "TO",
        "TRAP",
        "TRUE",
        "TRYNEXT",
    ),
    *("UNDO", "VAR", "VIEWONLY", "WHILE", "WITH", "XOR"),
}
ZONES = {"fine", "z0", "z1", "z5", "z10", "z15", "z20", "z30", "z40", "z50", "z60", "z80", "z100", "z150", "z200"}
TOKEN = re.compile(
    r"""\s*(?:(?P<string>"(?:[^"\\]|""|\\\\)*")
    |(?P<number>[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?)
    |(?P<name>[A-Za-z][A-Za-z0-9_]*)
    |(?P<sign>:=|[\[\]{}(),;\\]))""",
    re.VERBOSE,
)


class RapidError(ValueError):
    """The text is not the RAPID that this reader knows."""


@dataclass
class Move:
    """One move. `pose` is (4, 4) for MoveL and None for MoveAbsJ, whose joints are in degrees."""

    kind: str
    identity: int | None
    speed: str
    zone: str
    tool: str
    wobj: str | None
    text: str
    seconds: float | None = None
    pose: np.ndarray | None = None
    quaternion: np.ndarray | None = None
    configuration: tuple[int, ...] | None = None
    joints_deg: np.ndarray | None = None


@dataclass
class Module:
    """What a module declares and does."""

    name: str
    tools: dict[str, np.ndarray] = field(default_factory=dict)
    loads: dict[str, list] = field(default_factory=dict)
    wobjs: dict[str, np.ndarray] = field(default_factory=dict)
    speeds: dict[str, list] = field(default_factory=dict)
    tasks: dict[str, list[str]] = field(default_factory=dict)
    syncs: set[str] = field(default_factory=set)
    steps: list[str] = field(default_factory=list)  # names of the instructions, in order
    synchronous: list[Move] = field(default_factory=list)
    alone: list[Move] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)

    @property
    def leaves(self) -> list[Move]:
        """The synchronous moves without approach and leave."""
        return self.synchronous[1:-1]


def rotation(q):
    """The matrix of a quaternion w, x, y, z."""
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def numbers(value, count, where):
    if not (isinstance(value, list) and len(value) == count and all(isinstance(v, float) for v in value)):
        raise RapidError(f"{where}: {count} numbers expected, got {value}")
    return np.array(value)


def frame(value, where):
    """A RAPID pose as a matrix and its quaternion, which must be normalised."""
    if not (isinstance(value, list) and len(value) == 2):
        raise RapidError(f"{where}: a pose expected, got {value}")
    position, q = numbers(value[0], 3, where), numbers(value[1], 4, where)
    if abs(np.linalg.norm(q) - 1.0) > 1e-6:
        raise RapidError(f"{where}: quaternion of length {np.linalg.norm(q)!r}")
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation(q), position
    return pose, q


class Statement:
    """The tokens of one statement, taken from the left."""

    def __init__(self, text):
        self.text, self.tokens, at = text, [], 0
        while text[at:].strip():
            match = TOKEN.match(text, at)
            if match is None:
                raise RapidError(f"cannot be read: {text[at:]!r}")
            self.tokens.append((match.lastgroup, match.group(match.lastgroup)))
            at = match.end()

    def peek(self):
        return self.tokens[0][1] if self.tokens else None

    def take(self, *expected):
        if not self.tokens or (expected and self.tokens[0][1] not in expected):
            raise RapidError(f"{self.text!r}: expected {expected or 'more'}, got {self.peek()!r}")
        return self.tokens.pop(0)[1]

    def name(self):
        kind, text = self.tokens.pop(0) if self.tokens else (None, None)
        if kind != "name" or text.upper() in RESERVED or len(text) > 32:
            raise RapidError(f"{self.text!r}: {text!r} is not a name")
        return text

    def value(self):
        """A number, a string, a truth value or an aggregate of values."""
        kind, text = self.tokens.pop(0) if self.tokens else (None, None)
        if kind == "number":
            return float(text)
        if kind == "string":
            inside = text[1:-1].replace('""', '"').replace("\\\\", "\\")
            if len(inside) > 80:
                raise RapidError(f"string of {len(inside)} characters: {inside!r}")
            return inside
        if text in ("TRUE", "FALSE"):
            return text == "TRUE"
        if text != "[":
            raise RapidError(f"{self.text!r}: a value expected, got {text!r}")
        out = [self.value()]
        while self.take(",", "]") == ",":
            out.append(self.value())
        return out

    def end(self):
        self.take(";")
        if self.tokens:
            raise RapidError(f"{self.text!r}: something after the semicolon")


def read_module(text):
    """The module in `text`; RapidError with the line where it is not what this reader knows."""
    if not text.isascii() or not text.endswith("\n"):
        raise RapidError("a module is ASCII and ends with a newline")
    module, section, synchronous, closed = None, "before", False, False
    for number, line in enumerate(text.split("\n")[:-1], start=1):
        bare = line.strip()
        try:
            if len(line) > 200 or "\t" in line:
                raise RapidError(f"line of {len(line)} characters")
            if not bare:
                continue
            if closed:
                raise RapidError("something after ENDMODULE")
            if bare.startswith("!"):
                (module.comments if module else []).append(bare)
                continue
            if section == "before":
                statement = Statement(bare)
                statement.take("MODULE")
                module, section = Module(statement.name()), "declarations"
            elif section == "declarations":
                if bare == "PROC main()":
                    section = "main"
                else:
                    declare(module, Statement(bare))
            elif bare == "ENDPROC":
                if section != "main" or synchronous:
                    raise RapidError("ENDPROC in the wrong place")
                section = "after"
            elif bare == "ENDMODULE":
                if section != "after":
                    raise RapidError("ENDMODULE in the wrong place")
                closed = True
            elif section == "main":
                synchronous = perform(module, Statement(bare), synchronous)
            else:
                raise RapidError("a statement outside of a procedure")
        except RapidError as error:
            raise RapidError(f"line {number}: {error}") from None
    if not closed:
        raise RapidError("no ENDMODULE")
    return module


def declare(module, statement):
    storage, kind, name = statement.take("PERS", "VAR", "CONST"), statement.name(), statement.name()
    known = {*module.tools, *module.wobjs, *module.speeds, *module.tasks, *module.syncs, module.name}
    if name.lower() in {k.lower() for k in known}:
        raise RapidError(f"{name} is declared twice")
    if kind == "syncident":
        if storage != "VAR":
            raise RapidError("a syncident is a VAR")
        module.syncs.add(name)
        statement.end()
        return
    size = None
    if statement.peek() == "{":
        statement.take("{")
        size = statement.value()
        statement.take("}")
    statement.take(":=")
    value = statement.value()
    statement.end()
    if kind == "tasks":
        if storage != "PERS" or size != len(value) or not all(len(v) == 1 and isinstance(v[0], str) for v in value):
            raise RapidError("tasks are PERS, an array of one name each")
        module.tasks[name] = [v[0] for v in value]
    elif kind == "tooldata":
        if storage != "PERS" or len(value) != 3 or value[0] is not True:
            raise RapidError("a tool is PERS and held by the robot")
        module.tools[name] = frame(value[1], name)[0]
        mass, centre, axes, *inertia = value[2]
        if not mass > 0 or abs(np.linalg.norm(numbers(axes, 4, name)) - 1) > 1e-6 or len(inertia) != 3:
            raise RapidError(f"{name}: no load data")
        module.loads[name] = [mass, numbers(centre, 3, name)]
    elif kind == "wobjdata":
        if storage != "PERS" or len(value) != 5 or value[:3] != [False, True, ""]:
            raise RapidError("a fixed work object is PERS, not held, fixed, with no mechanical unit")
        module.wobjs[name] = frame(value[3], name)[0] @ frame(value[4], name)[0]
    elif kind == "speeddata":
        module.speeds[name] = numbers(value, 4, name).tolist()
        if min(module.speeds[name]) <= 0:
            raise RapidError(f"{name}: speeds must be positive")
    else:
        raise RapidError(f"unknown type {kind}")


def perform(module, statement, synchronous):
    """One instruction; whether the arms move synchronously after it."""
    name = statement.name()
    module.steps.append(name)
    if name in ("MoveL", "MoveAbsJ"):
        move = read_move(module, name, statement)
        if synchronous != (move.identity is not None):
            raise RapidError("a move has an \\ID if and only if the arms move synchronously")
        if synchronous and move.identity in {m.identity for m in module.synchronous}:
            raise RapidError(f"\\ID:={move.identity} twice")
        (module.synchronous if synchronous else module.alone).append(move)
    elif name == "ConfL":
        statement.take("\\")
        statement.take("Off")
    elif name in ("SyncMoveOn", "WaitSyncTask", "SyncMoveOff"):
        sync = statement.name()
        used = [s for s in module.steps if s.endswith(f":{sync}")]
        if sync not in module.syncs or used:
            raise RapidError(f"{sync} is not declared or is used twice")
        module.steps[-1] = f"{name}:{sync}"
        if name != "SyncMoveOff":
            statement.take(",")
            if statement.name() not in module.tasks:
                raise RapidError("undeclared task list")
        if (name == "SyncMoveOff") != synchronous:
            raise RapidError(f"{name} in the wrong place")
        synchronous = name == "SyncMoveOn" or (synchronous and name != "SyncMoveOff")
    elif name == "TPWrite":
        module.messages.append(statement.value())
    elif name != "Stop":
        raise RapidError(f"unknown instruction {name}")
    statement.end()
    return synchronous


def read_move(module, kind, statement):
    text = statement.text
    target = statement.value()
    options = {}
    while statement.peek() == "\\":
        statement.take("\\")
        option = statement.name()
        if option == "ID":
            statement.take(":=")
            options["ID"] = statement.value()
        elif option == "NoEOffs" and kind == "MoveAbsJ":
            options["NoEOffs"] = True
        else:
            raise RapidError(f"unknown option {option}")
    words, seconds = [], None
    for _ in range(3):
        statement.take(",")
        words.append(statement.name())
        if len(words) == 1 and statement.peek() == "\\":  # the time of the move in place of its speed
            statement.take("\\")
            statement.take("T")
            statement.take(":=")
            seconds = statement.value()
            if not (isinstance(seconds, float) and seconds > 0.0):
                raise RapidError(f"\\T:={seconds} is no time")
    speed, zone, tool = words
    wobj = None
    if statement.peek() == "\\":
        statement.take("\\")
        statement.take("WObj")
        statement.take(":=")
        wobj = statement.name()
    if speed not in module.speeds or zone not in ZONES or tool not in module.tools:
        raise RapidError(f"undeclared speed, zone or tool: {words}")
    if wobj is not None and wobj not in module.wobjs:
        raise RapidError(f"undeclared work object {wobj}")
    identity = options.get("ID")
    if identity is not None and (identity != int(identity) or identity < 1):
        raise RapidError(f"\\ID:={identity}")
    move = Move(kind, None if identity is None else int(identity), speed, zone, tool, wobj, text, seconds)
    axes = numbers(target[-1], 6, "external axes") if isinstance(target, list) else None
    if axes is None or not (axes == 9e9).all():
        raise RapidError("external axes must be 9E9")
    if kind == "MoveL":
        if len(target) != 4:
            raise RapidError("a robtarget has four parts")
        move.pose, move.quaternion = frame(target[:2], "robtarget")
        configuration = numbers(target[2], 4, "confdata")
        if not ((configuration == np.round(configuration)).all() and 0 <= configuration[3] <= 7):
            raise RapidError(f"confdata {configuration}")
        move.configuration = tuple(int(v) for v in configuration)
    else:
        if len(target) != 2:
            raise RapidError("a jointtarget has two parts")
        move.joints_deg = numbers(target[0], 6, "joints")
    return move


def rods(left, right):
    """Both end points and both unit tangents (from the left end to the right one) of every leaf, from two modules.

    Returns (start, end, start tangent, end tangent), each (n, 3), in the work object's frame, mm. The tool's z axis points
    from the gripper into the rod.
    """
    if [m.identity for m in left.synchronous] != [m.identity for m in right.synchronous]:
        raise RapidError("the two modules' \\ID differ")
    a = np.stack([m.pose for m in left.leaves])
    b = np.stack([m.pose for m in right.leaves])
    return a[:, :3, 3], b[:, :3, 3], a[:, :3, 2], -b[:, :3, 2]
