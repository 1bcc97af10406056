"""The whole chain without ROS: the steps the nodes run, over recorded files, and what comes out."""
