"""A bag's inputs through the nodes of a configuration, recorded anew.

ros2 launch gbas_bringup replay.launch.py bag:=BAG config:=FILE.yaml [speed:=max|N] [record:=true|false] [out:=DIR]
"""

from gbas_bringup.ros_launch import describe
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    return describe(config=None, play=True)
