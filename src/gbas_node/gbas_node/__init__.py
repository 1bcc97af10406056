"""What every node runs on: parameters, ports, start and end, diagnostics, flow control of drivers."""
