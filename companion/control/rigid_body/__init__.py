"""Control of a rigid body in six degrees of freedom: from a goal and an estimated state to pulses of on/off nozzles."""
