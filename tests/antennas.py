"""A robot whose model declares an antenna: 0.5 m up, 6 dBi, and 3 dB less power."""

HEIGHT_M = 0.5
GAIN_DBI = 6.0
POWER_DB = -3.0

ROVER = f"""
<mujoco>
  <custom>
    <numeric name="antenna_gain_dbi" data="{GAIN_DBI}"/>
    <numeric name="power_class_db" data="{POWER_DB}"/>
  </custom>
  <option timestep="0.01"/>
  <worldbody>
    <body name="base" pos="0 0 0.1">
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="y" type="slide" axis="0 1 0"/>
      <joint name="heading" type="hinge" axis="0 0 1"/>
      <geom type="box" size="0.2 0.2 0.1" mass="1"/>
      <site name="middle"/>
      <site name="antenna" pos="0 0 {HEIGHT_M}"/>
    </body>
  </worldbody>
  <actuator>
    <general name="drive" site="middle" gear="1 0 0 0 0 0" ctrlrange="-10 10"/>
    <general name="steer" site="middle" gear="0 0 0 0 0 1" ctrlrange="-1 1"/>
  </actuator>
</mujoco>
"""


def write_rover(folder):
    """Write the robot's file; return its name, for a mission's `robot`."""
    path = folder / "antenna_rover.xml"
    path.write_text(ROVER)
    return str(path)


def links_db(position_m, is_rover):
    """The link budget of each pair beyond free space over one metre [dB], by a plain loop."""
    found = {}
    for i, sends in enumerate(is_rover):
        for j, receives in enumerate(is_rover):
            if i != j:
                budget_db = GAIN_DBI * (int(sends) + int(receives)) + POWER_DB * int(sends)
                climb_m = HEIGHT_M * (int(receives) - int(sends))
                x, y, z = (position_m[j] - position_m[i]).tolist()
                found[i, j] = budget_db, (x**2 + y**2 + (z + climb_m) ** 2) ** 0.5
    return found
