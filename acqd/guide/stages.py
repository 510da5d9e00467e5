"""The work in its order, and where a folder stands: each stage is done, or has the one thing to do and its command."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import count
from pathlib import Path
from shlex import quote
from typing import Any, Literal

from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.extras import LOOP, MOTION, install_command, present
from acqd.guide.found import Data, Found, Loop, Model

State = Literal["done", "now", "later"]


@dataclass(frozen=True, slots=True)
class Stage:
    """One step of the work."""

    name: str
    state: State
    """Done; the next thing to do; not yet possible, or not needed."""
    says: str
    """What there is, or what to do."""
    commands: tuple[str, ...] = ()
    """Lines to type: what does this stage, or what shows its result."""

    def as_json(self) -> dict[str, Any]:
        """For programs."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class _Work:
    """What belongs together: a model, the recordings in question, and the report on these."""

    reference: Data | None
    model: Model | None
    asked: Data | None
    """The newest dataset that the model was not trained on."""
    loop: Loop | None
    waiting: tuple[Data, ...]
    """Earlier ones that no report is about."""

    @classmethod
    def of(cls, found: Found) -> _Work:
        trained = [each for each in found.models if not each.repaired]
        model = trained[-1] if trained else None
        reference = _named(found, model.dataset) if model is not None else None
        reference = reference or (found.datasets[0] if found.datasets else None)
        further = {Path(name).name for loop in found.loops for name in loop.further}
        others = [
            each for each in found.datasets
            if reference is not None and each.robot == reference.robot and each.content != reference.content
            and each.path.name not in further
        ]  # fmt: skip
        asked = others[-1] if others else None
        about = [(each, _asked_by(each, found)) for each in found.loops]
        loops = [each for each, data in about if asked and data is asked]
        judged = [data for _, data in about]
        waiting = tuple(each for each in others[:-1] if not any(each is data for data in judged))
        return cls(reference, model, asked, loops[-1] if loops else None, waiting)


def stages(found: Found) -> list[Stage]:
    """The seven stages in the order of the work; at most one is `now`."""
    work = _Work.of(found)
    steps = [
        _robot(work), _data(work), _model(work), _told(work), _loop(work), _answer(found, work), _repaired(found, work)
    ]  # fmt: skip
    first = next((k for k, each in enumerate(steps) if each.state == "now"), len(steps))
    return [
        each if k <= first or each.state == "done" else Stage(each.name, "later", each.says, each.commands)
        for k, each in enumerate(steps)
    ]


def _robot(work: _Work) -> Stage:
    if work.reference is None:
        says = "choose the description of your robot; one that is not shipped is made from a URDF"
        return Stage("robot", "now", says, ("acqd robot list", "acqd robot check ROBOT", "acqd robot from-urdf --help"))
    check = f"acqd robot check {quote(work.reference.description)}"
    return Stage("robot", "done", work.reference.robot, _installed(check, ("scipy",), "loop"))


def _data(work: _Work) -> Stage:
    if work.reference is None:
        says = "record power and logs of the cell as it is, a dozen minutes, and align them"
        line = "acqd dataset build --power acqd.sqlite --logs logs --robot ROBOT --out ds0"
        return Stage("data", "now", says, _build(line))
    data = work.reference
    says = _amount(data)
    if data.recordings < THRESHOLDS.fewest_recordings or data.seconds < THRESHOLDS.enough_s:
        more = f"{says}: too little to tell an effect from chance; record more, or cut long logs (--cut auto)"
        return Stage("data", "now", more, ("acqd dataset build --help",))
    return Stage("data", "done", says, (f"acqd dataset show {_path(data.path)}",))


def _model(work: _Work) -> Stage:
    if work.model is not None:
        return Stage("model", "done", f"{work.model.name}, trained on {work.model.dataset}", ())
    dataset = _path(work.reference.path) if work.reference else "ds0"
    line = f"acqd train {dataset} --network grey-box"
    lines = _installed(line, ("safetensors", "scipy"), "data,predict")
    return Stage("model", "now", "train a model of the cell as it was", lines)


def _told(work: _Work) -> Stage:
    bundle = _path(work.model.path) if work.model else "BUNDLE"
    ability = f"acqd robot ability {bundle}"
    lines = (*_installed(ability, LOOP, "loop"), f"{ability} --minutes 20")
    if work.loop is not None:
        says = f"the smallest sizes of {work.loop.smallest} effects that these recordings tell are in the report"
        return Stage("can it be told?", "done", says, lines)
    if work.asked is not None:
        return Stage("can it be told?", "done", "recordings exist; the report will say what they can tell", lines)
    says = "ask before you record: how small an effect would show, in how many minutes"
    return Stage("can it be told?", "now" if work.model else "later", says, lines)


def _loop(work: _Work) -> Stage:
    bundle = _path(work.model.path) if work.model else "BUNDLE"
    if work.asked is None:
        says = "record the cell as it is now, in the same way, and close the loop on these recordings"
        robot = quote(work.reference.description) if work.reference else "ROBOT"
        build = f"acqd dataset build --power acqd.sqlite --logs logs --robot {robot} --out ds1"
        return Stage("loop", "now", says, (*_build(build), *_close(f"acqd close-loop ds1 --model {bundle}")))
    line = f"acqd close-loop {_path(work.asked.path)} --model {bundle}"
    if work.loop is None:
        return Stage("loop", "now", f"{work.asked.path.name} ({_amount(work.asked)}) has no report yet", _close(line))
    verdict = work.loop.verdict.replace("_", " ")
    names = f": {', '.join(work.loop.names)}" if work.loop.names else ""
    waiting = ", ".join(str(each.path) for each in work.waiting)
    return Stage("loop", "done", f"{verdict}{names}{'; no report yet on ' + waiting if waiting else ''}", (line,))


def _answer(found: Found, work: _Work) -> Stage:
    name = "answer, or the next motion"
    if work.loop is None or work.asked is None:
        return Stage(name, "later", "follows from the report")
    if not work.loop.open:
        says = "the name is not in doubt" if work.loop.names else "the model explains the power as far as this shows"
        return Stage(name, "done", says)
    says = work.loop.causes or "the report leaves a question"
    report = _path(work.loop.path)
    program = next((each for each in reversed(found.programs) if Path(each.report).name == work.loop.path.name), None)
    if program is None and work.loop.designable:
        line = _installed(f"acqd next {report}", (*LOOP, *MOTION), "loop,motion")
        return Stage(name, "now", f"{says}; let acqd design the motion that decides", line)
    taken = {each.path.name for each in found.datasets}
    name_of_next = next(f"ds{number}" for number in count(2) if f"ds{number}" not in taken)
    sessions = "".join(f" --with {_path(Path(each))}" for each in [*work.loop.further, name_of_next])
    again = f"acqd close-loop {_path(work.asked.path)} --model {_path(Path(work.loop.model))}{sessions}"
    worked = f" --worked {program.worked_min:g}" if program is not None and program.worked_min else ""
    recorded = f"--power acqd.sqlite --logs logs --robot {quote(work.asked.description)}{worked}"
    build = f"acqd dataset build {recorded} --out {name_of_next}"
    if program is None:
        do = work.loop.advice or "record another session with other motions"
        do = f"{do}; record that session, and close the loop on both"
    else:
        do = (
            f"check and run the program of {program.minutes:.1f} min in {_path(program.path)}, and close the loop again"
        )
    return Stage(name, "now", f"{says}; {do}", (*_build(build), *_close(again)))


def _repaired(found: Found, work: _Work) -> Stage:
    if work.loop is None:
        return Stage("repaired model", "later", "follows from the report")
    bundle = work.loop.path / "model"
    model, sliding = _path(bundle), any(each.sliding for each in found.models if each.path == bundle)
    if not work.loop.added:
        return Stage("repaired model", "later", "nothing was added: the model stays as it is")
    lines = (f"acqd predict {model} LOG", *([] if sliding else [f"acqd export-fmu {model}"]))
    return Stage("repaired model", "done", f"{model} has what was found", lines)


def _installed(line: str, modules: tuple[str, ...], extra: str) -> tuple[str, ...]:
    """A line to type, behind the one that installs what it needs and this environment lacks."""
    return (line,) if present(modules) else (install_command(extra), line)


def _build(line: str) -> tuple[str, ...]:
    return _installed(line, ("jinja2", "matplotlib", "scipy"), "data")


def _close(line: str) -> tuple[str, ...]:
    return _installed(line, LOOP, "loop")


def _asked_by(loop: Loop, found: Found) -> Data | None:
    """The dataset of a report; of several with its name the one whose folders agree most, or that lies beside it."""
    told = Path(loop.dataset).parts[::-1]

    def agreement(each: Data) -> tuple[int, bool]:
        own = each.path.absolute().parts[::-1]
        same = next((k for k, (a, b) in enumerate(zip(told, own, strict=False)) if a != b), min(len(told), len(own)))
        return same, each.path.parent == loop.path.parent

    named = [each for each in found.datasets if each.path.name == Path(loop.dataset).name]
    return max(named, key=agreement, default=None)


def _named(found: Found, told: str) -> Data | None:
    """A dataset by the folder that a command was given, wherever the command was run."""
    return next((each for each in found.datasets if each.path.name == Path(told).name), None)


def _amount(data: Data) -> str:
    label = "" if data.measured == "mains" else f", {data.measured} power"
    return f"{data.path.name}: {data.recordings} recordings, {data.seconds / 60:.1f} min{label}"


def _path(path: Path) -> str:
    return quote(str(path))
