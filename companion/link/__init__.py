"""MAVLink without I/O, and the transports that carry it."""
