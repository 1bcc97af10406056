"""A simulated approach: constellation, reference receivers, station, aircraft, recorder.

ros2 launch gbas_bringup approach.launch.py [config:=braunschweig] [speed:=1|N|max] [record:=true|false] [out:=DIR]
"""

from gbas_bringup.ros_launch import describe
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    return describe(config="braunschweig")
