"""Fewer bits a weight in the forward pass: what they cost in accuracy and in the loop, and what they earn in time."""
