"""Rate laws: the friction torque of a joint at a velocity, one file each."""
