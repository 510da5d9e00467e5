"""Small URDF files of our own: an arm of two links on a rail, with a tool and a gripper."""


def link(name, mass=None, xyz="0 0 0", rpy="0 0 0", inertia=(0.02, 0.03, 0.01, 0.001, 0.002, 0.003), collision=""):
    if mass is None:
        return f'<link name="{name}">{collision}</link>'
    keys = zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), inertia, strict=True)
    tensor = " ".join(f'{key}="{value}"' for key, value in keys)
    body = f'<origin xyz="{xyz}" rpy="{rpy}"/><mass value="{mass}"/><inertia {tensor}/>'
    return f'<link name="{name}"><inertial>{body}</inertial>{collision}</link>'


def joint(name, kind, parent, child, xyz="0 0 0", rpy="0 0 0", axis="0 0 1", limit=True, more=""):
    if limit is True:
        limit = 'lower="-1.5" upper="2" velocity="2" effort="40"'
    shown = f"<limit {limit}/>" if limit and kind in ("revolute", "prismatic") else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{shown}{more}</joint>'
    )


CYLINDER = '<collision><origin xyz="0 0 0.2"/><geometry><cylinder radius="0.05" length="0.4"/></geometry></collision>'
MESH = '<collision><geometry><mesh filename="package://x/y.stl"/></geometry></collision>'


def arm(*more, swap=()):
    """Rail, shoulder and elbow, a sensor bolted to the forearm, a tool frame. `swap`: pairs of elements."""
    parts = [
        link("base", 10),
        joint("rail", "prismatic", "base", "cart", "0 0 0.1", "0.1 0 0.2", axis="1 0 0"),
        link("cart", 8, "0 0.1 0.05"),
        joint("shoulder", "revolute", "cart", "upper", "0 0 0.3", "0.2 0 0.3", axis="0 1 0"),
        link("upper", 5, "0 0 0.2", "0.3 0.2 0.1", collision=CYLINDER),
        joint("elbow", "continuous", "upper", "lower", "0 0 0.4", axis="0 1 1"),
        link("lower", 3, "0.1 0 0.1", collision=MESH),
        joint("bolted", "fixed", "lower", "sensor", "0.1 0.2 0.3", "0.4 0.5 0.6"),
        link("sensor", 0.7, "0.01 0.02 0.03"),
        joint("mount", "fixed", "sensor", "tool0", "0 0 0.05", "0 1 0"),
        link("tool0"),
        *more,
    ]
    for old, new in swap:
        assert old in parts
        parts[parts.index(old)] = new
    return '<?xml version="1.0"?><robot name="Little Arm">' + "\n".join(parts) + "</robot>"


GRIPPER = (
    joint("finger", "prismatic", "tool0", "left", "0 0.02 0", axis="0 1 0"),
    link("left", 0.1, inertia=(1e-5, 1e-5, 1e-5, 0, 0, 0)),
    joint("other", "prismatic", "tool0", "right", "0 -0.02 0", axis="0 -1 0", more='<mimic joint="finger"/>'),
    link("right", 0.1, inertia=(1e-5, 1e-5, 1e-5, 0, 0, 0)),
)
