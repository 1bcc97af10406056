"""Where the aircraft is: straight in, or by the equations of motion (``dynamics``)."""
