"""Rate laws: what a joint resists with at a velocity. One file each."""
