"""The monitor on the vehicle's bus: intake, faults, states, decision and commands, turn by turn."""
