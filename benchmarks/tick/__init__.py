"""The tick measured: its order, its error in time, its chatter, its cost, and where explicit hosts stay stable.

``python -P`` keeps a script's own folder off ``sys.path``, so that the study is a package beside its entry script
``tick_study.py``, which names the repository's root.
"""
