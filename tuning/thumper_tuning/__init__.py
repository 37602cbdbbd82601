"""Know the motor, tune the loop, prove it: identification and PI design for the wheels' speed control."""
