"""How good the families are, where they were not trained, and what they cost."""
