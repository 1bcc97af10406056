"""What every node runs on: parameters, ports, start and end, diagnostics, flow control of drivers.

:mod:`node` is the base of all nodes, with :mod:`start_gate` (work that waits for its readers), :mod:`inputs` (when
something was heard) and :mod:`publishers`; :mod:`serving` is the program around them, :mod:`driver` drives time.
"""
