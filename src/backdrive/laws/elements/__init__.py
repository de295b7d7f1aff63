"""Presliding elements: how the torque of a rate law builds up and relaxes at reversals, one file each."""
