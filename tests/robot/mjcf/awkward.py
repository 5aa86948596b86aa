"""MJCF files that are malformed or awkward, and what becomes of each."""

import struct
from dataclasses import dataclass, field
from pathlib import Path

LEG = """<body name="{0}" pos="{1} 0 -.1"><joint name="{0}_hip" axis="0 1 0" range="-40 40"/>
<geom name="{0}_geom" type="capsule" size=".03" fromto="0 0 0 0 0 -.2"/></body>"""
LEGS = LEG.format("left", ".1") + LEG.format("right", "-.1")
MOTORS = """<motor name="left_motor" joint="left_hip" ctrlrange="-1 1"/>
<motor name="right_motor" joint="right_hip" ctrlrange="-1 1"/>"""
GROUND = '<geom name="floor" type="plane" size="0 0 1"/>'
TORSO = '<geom type="box" size=".2 .1 .05"/>'


def mjcf(
    *,
    root: str = "<freejoint/>",
    torso: str = TORSO,
    legs: str = LEGS,
    motors: str = MOTORS,
    world: str = GROUND,
    more: str = "",
) -> str:
    """Returns a two-legged robot, with some of it in another way."""
    return f"""<mujoco>{more}<worldbody>{world}
    <body name="torso" pos="0 0 .35">{root}{torso}{legs}</body></worldbody>
    <actuator>{motors}</actuator></mujoco>"""


@dataclass(frozen=True)
class Awkward:
    """An MJCF and the expected result of loading it.

    Attributes:
        text: Content of the MJCF.
        sentence: Part of the error message; "" if the MJCF gives a robot.
        files: Contents of other files, by their paths from the folder of the MJCF.
    """

    text: str | bytes
    sentence: str = ""
    files: dict[str, str | bytes] = field(default_factory=dict)

    def write(self, folder: Path) -> Path:
        """Writes all files into a folder, and returns the path of the MJCF."""
        home = folder / "home"
        for name, content in {"robot.xml": self.text, **self.files}.items():
            path = home / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        return home / "robot.xml"


def _deep(levels: int) -> str:
    return "<mujoco><worldbody>" + "<body>" * levels + "</body>" * levels + "</worldbody></mujoco>"


CUBE = """v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"""
MESH = '<asset><mesh name="{0}" file="{1}"/></asset>'
MESHED = '<geom type="mesh" mesh="m"/>'
SEEN = '<geom type="mesh" mesh="m" contype="0" conaffinity="0" mass="0"/>'
INERTIAL = '<inertial pos="0 0 0" mass="2" diaginertia=".02 .02 .02"/>'
KEY = '<keyframe><key name="home" qpos="{}"/></keyframe>'
BOMB = """<!DOCTYPE lolz [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">
<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">]><mujoco model="&c;"/>"""
BALL = """<body name="ball" pos="1 0 1"><freejoint/><geom size=".1"/></body>"""

AWKWARD: dict[str, Awkward] = {
    # What is no MJCF.
    "an empty file": Awkward("", "no XML"),
    "binary junk": Awkward(bytes(range(256)) * 40, "no XML"),
    "cut off": Awkward(mjcf()[:200], "no XML"),
    "a URDF of one link": Awkward(
        '<robot name="r"><link name="l"/></robot>', "no link has a <collision>"
    ),
    "other XML": Awkward("<html><body/></html>", "got <html>"),
    "an entity bomb": Awkward(BOMB, "<!DOCTYPE>"),
    "deep nesting": Awkward(_deep(5000), "200 elements within each other"),
    "an element that MJCF has not": Awkward(mjcf(more="<leg/>"), "MuJoCo cannot load the model"),
    "UTF-16": Awkward(f'<?xml version="1.0" encoding="utf-16"?>{mjcf()}'.encode("utf-16")),
    "an encoding that is none": Awkward(
        '<?xml version="1.0" encoding="rot13"?>' + mjcf(), "no XML"
    ),
    "a name of 100,000 characters": Awkward(
        mjcf().replace("left_hip", "h" * 100_000), "at most 1000 characters"
    ),
    "a body's name of 100,000 characters": Awkward(
        mjcf().replace("torso", "h" * 100_000), "at most 1000 characters"
    ),
    # Files.
    "a missing mesh": Awkward(mjcf(more=MESH.format("m", "m.obj"), torso=MESHED), "'m.obj'"),
    "a missing mesh that is not used": Awkward(mjcf(more=MESH.format("m", "m.obj"))),
    "a missing mesh that is only seen": Awkward(
        mjcf(more=MESH.format("m", "m.obj"), torso=INERTIAL + SEEN)
    ),
    "a missing mesh that is only seen and has the mass": Awkward(
        mjcf(more=MESH.format("m", "m.obj"), torso=SEEN.replace('mass="0"', "")), "'m.obj'"
    ),
    "a missing mesh with a contact pair": Awkward(
        mjcf(
            more=MESH.format("m", "m.obj")
            + '<contact><pair geom1="floor" geom2="belly"/></contact>',
            torso=INERTIAL + SEEN.replace("<geom", '<geom name="belly"'),
        ),
        "'m.obj'",
    ),
    "a missing mesh to which a box is fitted": Awkward(
        mjcf(
            more=MESH.format("m", "m.obj"),
            torso=INERTIAL + '<geom type="box" mesh="m" contype="0" conaffinity="0"/>',
        ),
        "'m.obj'",
    ),
    "a mesh outside the folder": Awkward(
        mjcf(more=MESH.format("m", "../m.obj"), torso=MESHED),
        "outside its own folder",
        {"../m.obj": CUBE},
    ),
    "a mesh below the folder": Awkward(
        mjcf(more=MESH.format("m", "parts/m.obj"), torso=MESHED), "", {"parts/m.obj": CUBE}
    ),
    "a mesh that is junk": Awkward(
        mjcf(more=MESH.format("m", "m.stl"), torso=MESHED),
        "MuJoCo cannot load the model",
        {"m.stl": "x"},
    ),
    "an include": Awkward(
        mjcf(motors="", more='<include file="motors.xml"/>'),
        "",
        {"motors.xml": f"<mujocoinclude><actuator>{MOTORS}</actuator></mujocoinclude>"},
    ),
    "a height field in the folder of the meshes": Awkward(
        mjcf(
            more='<compiler meshdir="parts"/>'
            '<asset><hfield name="h" file="h.bin" size="2 2 .1 .1"/></asset>',
            world='<geom type="hfield" hfield="h"/>',
        ),
        "",
        {"parts/h.bin": struct.pack("<2i4f", 2, 2, 0, 0, 0, 0)},
    ),
    "a missing include": Awkward(mjcf(more='<include file="no.xml"/>'), "'no.xml'"),
    "an include outside the folder": Awkward(
        mjcf(more='<include file="../o.xml"/>'), "outside its own folder", {"../o.xml": "<mujoco/>"}
    ),
    "an include of itself": Awkward(mjcf(more='<include file="robot.xml"/>'), "twice"),
    "a device as mesh": Awkward(
        mjcf(more=MESH.format("m", "/dev/zero"), torso=MESHED), "outside its own folder"
    ),
    # The root.
    "no free joint": Awkward(mjcf(root="")),
    "limbs on the world": Awkward(
        f"<mujoco><worldbody>{GROUND}{LEGS}</worldbody><actuator>{MOTORS}</actuator></mujoco>"
    ),
    "a root on a hinge": Awkward(mjcf(root='<joint name="pole"/>')),
    "a fixed base beside a ball": Awkward(mjcf(root="", world=GROUND + BALL), "one tree"),
    "two floating bases": Awkward(mjcf(world=GROUND + BALL), "ball, torso"),
    "a planar root": Awkward(
        mjcf(root='<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>')
    ),
    "a motor on the root": Awkward(
        mjcf(
            root='<joint name="x" type="slide" axis="1 0 0"/>',
            motors=MOTORS + '<motor joint="x" ctrlrange="-1 1"/>',
        ),
        "no motor moves",
    ),
    "a mocap body": Awkward(
        mjcf(world=GROUND + '<body name="hand" mocap="true"><geom size=".05"/></body>')
    ),
    # Joints.
    "no actuator": Awkward(mjcf(motors=""), "no actuators"),
    "unnamed joints and bodies": Awkward(
        mjcf(motors='<motor joint="left_hip" ctrlrange="-1 1"/>').replace('name="right_hip"', "")
    ),
    "an unlimited joint": Awkward(mjcf(legs=LEGS.replace('range="-40 40"', ""))),
    "duplicate names": Awkward(mjcf(legs=LEGS + LEG.format("left", "0")), "repeated name"),
    # Actuators.
    "an actuator on a tendon": Awkward(
        mjcf(
            motors='<motor name="both" tendon="t" ctrlrange="-1 1"/>',
            more='<tendon><fixed name="t"><joint joint="left_hip" coef="1"/>'
            '<joint joint="right_hip" coef="1"/></fixed></tendon>',
        )
    ),
    "an actuator on a site": Awkward(
        mjcf(
            torso=TORSO + '<site name="s"/>', motors=MOTORS + '<general site="s" ctrlrange="0 1"/>'
        )
    ),
    "an actuator on a site alone": Awkward(
        mjcf(torso=TORSO + '<site name="s"/>', motors='<general site="s" ctrlrange="0 1"/>'),
        "drive no joint",
    ),
    "an actuator of nothing": Awkward(mjcf(motors='<motor joint="tail"/>'), "tail"),
    "a motor without a range": Awkward(
        mjcf(motors='<motor name="m" joint="left_hip"/>'), "ctrlrange=[-1, 1]"
    ),
    # Other parts of MuJoCo.
    "an equality constraint": Awkward(
        mjcf(more='<equality><joint joint1="left_hip" joint2="right_hip"/></equality>')
    ),
    "a plugin": Awkward(
        mjcf(more='<extension><plugin plugin="mujoco.elasticity.cable"/></extension>'),
        "<extension>",
    ),
    "a flex": Awkward(
        mjcf(torso=TORSO + '<flexcomp name="f" type="grid" count="3 3 1" spacing=".1 .1 .1"/>'),
        "slide joint",
    ),
    "a composite": Awkward(
        mjcf(
            legs=LEGS + '<composite type="cable" curve="s" count="9 1 1" size="1">'
            '<joint kind="main"/><geom type="capsule" size=".01"/></composite>'
        ),
        "ball",
    ),
    "an attached model": Awkward(
        mjcf(more='<asset><model name="o" file="o.xml"/></asset>'), "<model>", {"o.xml": mjcf()}
    ),
    "a height field as ground": Awkward(
        mjcf(
            more='<asset><hfield name="h" nrow="4" ncol="4" size="2 2 .1 .1"/></asset>',
            world='<geom type="hfield" hfield="h"/>',
        )
    ),
    "frames and copies": Awkward(
        mjcf(legs=f'<frame pos="0 0 .01" euler="0 0 5">{LEGS}</frame>', more="")
    ),
    "static bodies that MuJoCo fuses": Awkward(
        mjcf(
            torso=TORSO + '<body><geom size=".02"/></body>',
            more='<compiler fusestatic="true" settotalmass="7"/>',
        )
    ),
    "what is only seen and MuJoCo discards, with files too large for a log": Awkward(
        mjcf(
            torso=f'<geom size=".02" contype="0" conaffinity="0" mass="0"/>{TORSO}{SEEN}',
            more=MESH.format("m", "m.obj") + '<compiler discardvisual="true"/>',
        ),
        "",
        {"m.obj": CUBE + "# only seen\n" * 2**19},
    ),
    # Bodies and numbers.
    "no geoms": Awkward(
        mjcf(torso="", legs=LEGS.replace("<geom", "<site").replace("_geom", "_site")), "mass"
    ),
    "nothing that can touch": Awkward(
        mjcf(more='<default><geom contype="0" conaffinity="0"/></default>'), "touch"
    ),
    "no ground": Awkward(mjcf(world="")),
    "three hundred joints": Awkward(
        mjcf(legs="".join(LEG.format(f"leg{k}", f"{k / 100}") for k in range(300))), "left_hip"
    ),
    "NaN inertia": Awkward(
        mjcf(torso='<inertial pos="0 0 0" mass="1" diaginertia="nan 1 1"/>' + TORSO),
        "MuJoCo cannot load the model",
    ),
    "NaN position": Awkward(mjcf().replace('pos="0 0 .35"', 'pos="0 nan .35"'), "finite"),
    "zero mass": Awkward(mjcf(torso='<geom size=".1" mass="0"/>', legs=LEGS), "mass"),
    "huge numbers": Awkward(mjcf(torso='<geom size="1e200"/>'), "finite"),
    "a negative time step": Awkward(mjcf(more='<option timestep="-0.01"/>'), "timestep"),
    "a time step of years": Awkward(
        mjcf(more='<option timestep="1e10"/>'), "time step of at most 10 s, got 1e+10 s"
    ),
    "a time step of nothing": Awkward(mjcf(more='<option timestep="1e-9"/>'), "time"),
    "a model that blows up": Awkward(
        mjcf(
            more='<option timestep="0.05" integrator="Euler"/>'
            '<default><joint stiffness="1e7" springref="30"/></default>'
        ),
        "the simulation diverges",
    ),
    "a huge memory": Awkward(mjcf(more='<size memory="900G"/>'), "memory"),
    # Keyframes and names.
    "a keyframe that is too long": Awkward(mjcf(more=KEY.format("1 " * 30)), "qpos"),
    "a keyframe that MuJoCo fills up": Awkward(mjcf(more=KEY.format("0 0 1"))),
    "a keyframe": Awkward(mjcf(more=KEY.format("0 0 .4 1 0 0 0 .2 -.2"))),
    "names of notation": Awkward(mjcf().replace("left", "le+ft = a:b")),
    "names that are alike once plain": Awkward(
        mjcf().replace("left", "leg+").replace("right", "leg=")
    ),
    "unicode names": Awkward(mjcf().replace("left", "linkes_Bein_β")),
    "two touch sensors": Awkward(
        mjcf(
            legs=LEGS.replace("</body>", '<site name="a"/><site name="b"/></body>', 1),
            more='<sensor><touch name="heel" site="a"/><touch name="toe" site="b"/></sensor>',
        )
    ),
    "a sensor of another kind": Awkward(mjcf(more='<sensor><clock name="time"/></sensor>')),
    "settotalmass": Awkward(mjcf(more='<compiler settotalmass="7" inertiafromgeom="true"/>')),
}
"""Cases by the awkward part of the MJCF."""
