"""Presliding elements: how the torque of a rate law builds up and lets go. One file each."""
