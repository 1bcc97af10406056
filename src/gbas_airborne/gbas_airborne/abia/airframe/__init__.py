"""The airframe: a mesh, the antennas on it, and the directions it hides from them.

The body frame is forward, right, down [m]. Directions in it are azimuth, from the nose clockwise seen from above (to
the right wing), and elevation, up from the plane of nose and wings.
"""
