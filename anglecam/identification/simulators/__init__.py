"""An identified mechanism for simulators: one joint with its actuator, in their file formats."""
