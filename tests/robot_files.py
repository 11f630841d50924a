"""MJCF files of small robots, for tests."""

BODY = '<body name="base"><freejoint/><geom size="0.1" mass="0.2"/><site name="s"/></body>'
PLANAR = (
    '<body name="base" pos="0 0 0.1"><joint name="x" type="slide" axis="1 0 0"/>'
    '<joint name="y" type="slide" axis="0 1 0"/><joint name="h" type="hinge" axis="0 0 1"/>'
    '<geom size="0.1" mass="0.2"/><site name="s"/></body>'
)
LIFT = '<actuator><motor name="lift" site="s" gear="0 0 1 0 0 0"/></actuator>'

FAR = '<sensor><framepos objtype="site" objname="w"/></sensor>'
APART = (
    '<sensor><framepos objtype="site" objname="s" reftype="site" refname="w"/>'
    '<gyro site="s"/></sensor>'
)
SENSORS = (
    '<sensor><gyro name="turns" site="s"/><rangefinder site="s" cutoff="7"/>'
    '<touch name="bumper" site="s" cutoff="3"/></sensor>'
)


def mjcf(body=BODY, actuator=LIFT, option='<option timestep="0.002"/>'):
    floor = '<geom type="plane" size="5 5 1"/>'
    return f"<mujoco>{option}<worldbody>{floor}{body}</worldbody>{actuator}</mujoco>"


def with_antenna(place):
    return BODY.replace('<site name="s"/>', f'<site name="s"/><site name="antenna" pos="{place}"/>')


def declaring(name, number):
    option = '<option timestep="0.002"/>'
    return f'{option}<custom><numeric name="{name}" data="{number}"/></custom>'


def written(folder, text):
    """Write a robot's file; return its name."""
    path = folder / "mine.xml"
    path.write_text(text)
    return str(path)
