"""Any configuration: a site with recorded receivers, a second aircraft, a station alone.

ros2 launch gbas_bringup site.launch.py config:=FILE.yaml [speed:=1|N|max] [record:=true|false] [out:=DIR]
"""

from gbas_bringup.ros_launch import describe
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    return describe(config=None)
