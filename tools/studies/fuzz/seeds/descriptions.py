"""Files that people write: configurations, robots, meters."""

from __future__ import annotations

from pathlib import Path

from tools.studies.fuzz.mutate import Files

_ROOT = Path(__file__).parents[4]


def configurations() -> list[Files]:
    """The shipped file and smaller ones of other sources."""
    meters = b'[source]\nkind = "meters"\nhost = "h"\n[[source.meters]]\nname = "m"\nprofile = "em340"\nunit = 3\n'
    replay = b'[source]\nkind = "replay"\nfile = "a.csv"\nmap = "u1=A,i1=B"\nrate = 2e4\n[mqtt]\nca_file = "x.pem"\n'
    return [{"acqd.toml": (_ROOT / "config" / "acqd.toml").read_bytes()}, {"acqd.toml": meters}, {"acqd.toml": replay}]


def robots() -> list[Files]:
    """A shipped description."""
    return [{"robot.toml": (_ROOT / "acqd" / "robot" / "descriptions" / "ur10e.toml").read_bytes()}]


def urdf() -> list[Files]:
    """Two links, one joint, all elements that are read."""
    body = (
        '<inertial><origin xyz="0 0 0.1" rpy="0 0 0"/><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1"'
        ' iyz="0" izz="0.1"/></inertial><collision><geometry><cylinder radius="0.1" length="0.3"/></geometry>'
        "</collision>"
    )
    joint = (
        '<joint name="j1" type="revolute"><origin xyz="0 0 0.2" rpy="0 0 0"/><parent link="a"/><child link="b"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="10" velocity="2"/>'
        '<dynamics damping="0.1" friction="0.2"/></joint>'
    )
    links = f'<link name="a">{body}</link>\n<link name="b">{body}</link>'
    text = f'<?xml version="1.0"?>\n<robot name="r">\n{links}\n{joint}\n</robot>\n'
    return [{"robot.urdf": text.encode()}]


def profiles() -> list[Files]:
    """Two shipped meter profiles."""
    folder = _ROOT / "acqd" / "sources" / "meters" / "profiles"
    return [{"meter.toml": (folder / f"{name}.toml").read_bytes()} for name in ("em340", "sdm630")]
