"""The state of the car and of the people around it, estimated from what was measured."""
